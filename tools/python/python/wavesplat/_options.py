"""Keyword arguments of pictures as words after ``wavesplat-render``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

REPEATED = ("view", "slice", "probe")
"""Options that a list repeats. Of others it gives several values."""


def words(options: dict[str, Any]) -> list[str]:
    """The words of options; None and False leave an option out, True has no value."""
    return [word for name, value in options.items() for word in _option(name, value)]


def _option(name: str, value: Any) -> Iterable[str]:
    option = "--" + name.rstrip("_").replace("_", "-")
    if value is None or value is False:
        return []
    if value is True:
        return [option]
    if isinstance(value, list) and name in REPEATED:
        return [word for one in value for word in _option(name, one)]
    return [f"{option}={_text(name, value)}"]


def _text(name: str, value: Any) -> str:
    if name in ("colormap", "transfer_function"):
        return colours(value)
    if name == "frames" and isinstance(value, slice):
        return ":".join("" if part is None else str(part) for part in (value.start, value.stop, value.step or 1))
    if name == "frames" and not isinstance(value, str):
        frames = np.atleast_1d(np.asarray(value))
        frames = np.flatnonzero(frames) if frames.dtype == bool else frames
        if len(frames) == 0:
            raise ValueError("frames: none are chosen")
        return ",".join(str(int(frame)) for frame in frames)
    if name == "size" and not isinstance(value, str):
        return "x".join(str(int(side)) for side in value)
    if isinstance(value, dict):  # numbers are coordinates, texts such as "50%" and "#12" are what the program takes
        return ",".join(f"{key}={one if isinstance(one, str) else '@' + _number(one)}" for key, one in value.items())
    if isinstance(value, (tuple, list, np.ndarray)):
        return ",".join(_number(one) for one in value)
    return _number(value)


def _number(value: Any) -> str:
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


NAMED = ("viridis", "plasma", "inferno", "magma", "cividis", "turbo", "coolwarm", "grey", "gray", "rainbow")
STEPS = 256


def colours(given: Any) -> str:
    """A name of wavesplat's or a file as it is; another name, or an object, of matplotlib as a list of colours."""
    if isinstance(given, str) and (given in NAMED or "." in given or given.startswith("#")):
        return given
    if isinstance(given, str):
        try:
            import matplotlib
        except ImportError:
            return given  # the renderer says which names it knows
        if given not in matplotlib.colormaps:
            return given
        given = matplotlib.colormaps[given]
    shares = np.linspace(0.0, 1.0, STEPS)
    levels = np.round(np.asarray(given(shares))[:, :3] * 255).astype(int)
    return ",".join(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in levels)


def in_python(message: str) -> str:
    """An error with options by their names in Python: ``--splat-error`` is ``splat_error``."""
    return re.sub(r"--([a-z][a-z-]*)", lambda option: option[1].replace("-", "_"), message)
