"""Keyword arguments of pictures as the fields of a request."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ._arguments import pair, whole

REPEATED = ("view", "slice", "probe", "probe_region")
"""Options that have several values."""

USUAL_PARTS = "box,axes,bar,time"
"""What ``annotate=True`` draws."""


def request(options: dict[str, Any]) -> str:
    """The fields of a request as JSON; None and False leave an option out."""
    given = {name.rstrip("_"): value for name, value in options.items() if value is not None and value is not False}
    return json.dumps({name: _field(name, value) for name, value in given.items()})


def _field(name: str, value: Any) -> Any:
    if value is True:
        return USUAL_PARTS if name == "annotate" else True
    if name in REPEATED:
        texts = [_text(name, one) for one in (value if isinstance(value, list) else [value])]
        return [one for text in texts for one in text.split(",")] if name == "slice" else texts
    if isinstance(value, (int, float, np.number)) and name not in ("frames", "size"):
        return value.item() if isinstance(value, np.generic) else value
    return _text(name, value)


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
        return "x".join(str(whole("size", side)) for side in pair("size", "(WIDTH, HEIGHT)", value))
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
