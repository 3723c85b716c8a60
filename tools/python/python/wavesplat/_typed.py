"""The keyword arguments of pictures, for types and for help."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, TypedDict

_Slice = slice
_Pair = tuple[float, float]
_Texts = str | Sequence[str]
_Place = str | dict[str, float | str]
_Path = str | os.PathLike[str]


class LookOptions(TypedDict, total=False):
    """The keyword arguments of `File.view`: options of ``wavesplat-render`` with underscores, for all pictures.

    ``wavesplat-render --help`` says more of each.

    Which pictures: ``view``, azimuth and elevation in degrees, or "top" and so on, or a list; ``orbit``, so many views
    around; ``roll``, degrees; ``over_time``, one view for each frame; ``key_frames``, a file of views; ``frames``, numbers, a
    slice or a mask; ``region``, "0:32,:,50%:"; ``slice``, {"z": 0.5} or "z=50%"; ``convention``, sides of a patient.

    What they show: ``mode``, such as "mip" or "composite"; ``quantity``; ``iso``, values of surfaces; ``shade`` and
    ``light``; ``opacity``, "0:0,1:0.5"; ``opacity_unit``; ``transfer_function``; ``slices``, steps along a ray; ``probe`` and
    ``probe_region``, series at points and boxes; ``exaggerate``, of heights; ``tau`` and ``sigma``, of the kernel.

    Colours and texts: ``colormap``, names and objects of matplotlib work; ``range``; ``norm``; ``clear`` and ``beyond``,
    missing values and others; ``background``; ``annotate``, True or parts such as "axes,bar"; ``title``; ``bar_title``;
    ``theme``.

    Size, speed and errors: ``size``, (width, height); ``scale``, pixels of a unit; ``center``; ``lod``; ``fast``;
    ``splat_error``; ``tolerance``, which ``error`` it limits, and ``error_image``; ``missing_value``; ``skip_damaged``;
    ``method``; ``depth``, bits; ``fps`` and ``speed`` of movies; ``sidecar``, a file of facts.
    """

    view: Any
    orbit: int
    roll: float
    over_time: bool
    key_frames: _Path
    frames: int | _Slice | str | Sequence[int] | Any
    region: str
    slice: _Place
    convention: str
    mode: str
    quantity: str
    iso: float | str | Sequence[float]
    shade: bool
    light: str | _Pair
    opacity: str | Any
    opacity_unit: float
    transfer_function: Any
    slices: int
    probe: Any
    probe_region: _Texts
    exaggerate: float | str
    tau: float
    sigma: float
    colormap: Any
    range: str | _Pair
    norm: str
    clear: str | float
    beyond: str
    background: str
    annotate: bool | str
    title: str
    bar_title: str
    theme: str
    size: str | tuple[int, int]
    scale: float
    center: str | tuple[float, float, float]
    lod: int | str
    fast: bool
    splat_error: float
    tolerance: float
    error: str
    error_image: _Path
    missing_value: float
    skip_damaged: bool
    method: str
    depth: int | str
    fps: float
    speed: float
    sidecar: _Path


class PictureOptions(LookOptions, total=False):
    """The keyword arguments of `File.render`, `File.figure` and `wavesplat.dask.render`: those of `LookOptions`, and
    ``memory``, such as "1GiB".
    """

    memory: str | int
