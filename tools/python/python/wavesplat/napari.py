"""A reader for napari: Dask arrays of all levels of detail, with scale, place and units."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Layer = tuple[Any, dict[str, Any], str]


def get_reader(path: str | list[str]) -> Callable[[str | list[str]], list[Layer]] | None:
    """The reader of a coefficient file; None for other files."""
    first = path[0] if isinstance(path, list) else path
    return read if str(first).endswith(".wspl") else None


def read(path: str | list[str]) -> list[Layer]:
    """The layers of one file, or of several."""
    return [_layer(one) for one in (path if isinstance(path, list) else [path])]


def _layer(path: str) -> Layer:
    import dask.array as da

    from ._file import open
    from ._volumes import corner, distances, places

    file = open(path)
    levels = [file, *(open(path, lod=lod) for lod in range(1, file.coarsest + 1))]
    samples = [
        da.from_array(level, chunks=level.chunks, name=f"wavesplat-{file.id}-{level.lod}", asarray=False)  # type: ignore[no-untyped-call]
        for level in levels
    ]
    times = file.times
    step = float(times[1] - times[0]) if len(times) > 1 and times[1] > times[0] else 1.0
    where = places(file)
    settings: dict[str, Any] = {
        "name": file.variable or "samples",
        "scale": (step, *distances(file, where)[::-1]),
        "translate": (float(times[0]) if len(times) else 0.0, *corner(where)[::-1]),
        "contrast_limits": file.range,
        "axis_labels": file.dims,
        "metadata": {"path": file.path, "unit": file.unit, "time_unit": file.time_unit},
    }
    is_one = len(levels) == 1
    return samples[0] if is_one else samples, settings | {"multiscale": not is_one}, "image"
