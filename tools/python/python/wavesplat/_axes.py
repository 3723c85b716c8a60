"""What the axes of arrays count: letters of "tzyx", slowest first, and "c" for other axes."""

from __future__ import annotations

from collections.abc import Sequence
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


def arranged(array: Any, letters: str) -> Any:
    """A view with the other axes first, and then those of t, z, y and x that there are."""
    own = [letters.index(letter) for letter in AXES if letter in letters]
    return np.transpose(array, others(letters) + own)


def with_all(letters: str, place: Sequence[int]) -> tuple[Any, ...]:
    """The index for an array that was arranged: a place along the other axes, and all of t, z, y and x."""
    return (*place, *(slice(None) if letter in letters else None for letter in AXES))
