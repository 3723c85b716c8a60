"""What the axes of arrays count: letters of "tzyx", slowest first, and "c" for other axes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

AXES = "tzyx"


def checked(letters: str, axes: int) -> str:
    """The letters, if there is one for each axis."""
    repeated = any(letters.count(letter) > 1 for letter in AXES)
    if len(letters) != axes or set(letters) - set(AXES + "c") or repeated:
        raise ValueError(
            f'axes: takes a letter of "tzyxc" for each axis of the array, which has {axes}, not {letters!r}'
        )
    return letters


def others(letters: str) -> list[int]:
    """The axes that count neither frames nor voxels."""
    return [axis for axis, letter in enumerate(letters) if letter == "c"]


def volumes(array: Any, letters: str) -> Iterator[Any]:
    """Views (time, z, y, x) of an array, one for each place along the other axes."""
    own = [letters.index(letter) for letter in AXES if letter in letters]
    turned = np.transpose(array, others(letters) + own)
    all_of_own = tuple(slice(None) if letter in letters else None for letter in AXES)
    for place in np.ndindex(*turned.shape[: len(others(letters))]):
        yield turned[(*place, *all_of_own)]  # a view, of a single sample too
