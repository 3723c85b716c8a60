"""Arguments of functions: what they take, said in an exception where they have something else."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterable
from numbers import Number
from typing import Any

MEMORY = 512 << 20
"""Bytes that reading, converting and rendering may take beside their results."""


def number(name: str, given: Any) -> float:
    """A number."""
    try:
        return float(given)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: takes a number, not {given!r}") from None


def whole(name: str, given: Any) -> int:
    """A whole number."""
    try:
        return operator.index(given)
    except TypeError:
        raise TypeError(f"{name}: takes a whole number, not {given!r}") from None


def text(name: str, given: Any) -> str | None:
    """A text, or None."""
    if given is not None and not isinstance(given, str):
        raise TypeError(f"{name}: takes a text, not {given!r}")
    return given


def pair(name: str, form: str, given: Any) -> tuple[Any, Any]:
    """Two values, such as ``form``."""
    values = _several(given)
    if values is None or len(values) != 2:
        raise _wrong_count(given)(f"{name}: takes {form}, not {given!r}")
    return values[0], values[1]


def three(name: str, given: Any) -> list[float] | None:
    """A number for each of x, y and z, or None."""
    if given is None:
        return None
    values = _several(given)
    if values is None or len(values) != 3:
        raise _wrong_count(given)(f"{name}: takes three numbers, along x, y and z, not {given!r}")
    return [number(name, value) for value in values]


def _wrong_count(given: Any) -> type[Exception]:
    """The exception where there are too few or too many values, such as one number, or something else than values."""
    return ValueError if _several(given) is not None or isinstance(given, Number) else TypeError


def _several(given: Any) -> list[Any] | None:
    """The items of a list, tuple or array; None for others."""
    is_one = isinstance(given, (str, bytes, dict)) or not isinstance(given, Iterable) or getattr(given, "ndim", 1) == 0
    return None if is_one else list(given)


def located(path: str | os.PathLike[str]) -> str:
    """A path, or an address of a server. An address that begins with ``file://`` is that of a path."""
    from urllib.parse import unquote

    name = os.fsdecode(path)
    if not name.lower().startswith("file://"):
        return name
    host, _, rest = name[len("file://") :].partition("/")
    if host.lower() not in ("", "localhost"):
        raise ValueError(f"{name}: is a file of another machine, {host}; give a path")
    return "/" + unquote(rest)
