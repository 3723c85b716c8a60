"""Progress of long work: a bar of tqdm if it is there, a line of text otherwise, or a function of the caller."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = bool | Callable[[int, int], object]
"""Whether to show progress, or a function of the steps that are done and of all (0 if their number is not known)."""

_Report = Callable[[int, int], object]


@contextmanager
def reporting(progress: Progress, what: str) -> Iterator[_Report | None]:
    """The function that long work calls."""
    if not progress:
        yield None
    elif callable(progress):
        yield progress
    else:
        yield from _shown(what)


def _shown(what: str) -> Iterator[_Report]:
    if importlib.util.find_spec("tqdm") is None:
        yield _line(what)
        sys.stderr.write("\n")
        return
    from tqdm.auto import tqdm

    with tqdm(desc=what, leave=True) as bar:
        yield lambda done, steps: _advance(bar, done, steps)


def _advance(bar: Any, done: int, steps: int) -> None:
    bar.total = steps or None
    bar.n = done
    bar.refresh()


def _line(what: str) -> _Report:
    def show(done: int, steps: int) -> None:
        share = f"{done / steps:4.0%}" if steps else str(done)
        sys.stderr.write(f"\r{what}: {share}")
        sys.stderr.flush()

    return show
