"""Conversions and pictures by the workers of Dask.

Each worker converts shards, and the shards are merged. Each renders some of the pictures, or parts of all, which are added.
"""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from ._convert import convert as _convert
from ._convert import merge
from ._file import anywhere
from ._file import open as _open
from ._pictures import pictures, run

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._typed import PictureOptions

CHAIN = 256
"""Frames of a chain by default: 8 windows of 32 frames."""

WINDOWS = {"series": 128, "pictures": 8}
"""Frames in a window by what a file is made best for."""


def convert(
    source: xr.DataArray | xr.Dataset,
    path: str | PathLike[str],
    *,
    client: Any = None,
    variable: str | None = None,
    shards: int | None = None,
    folder: str | PathLike[str] | None = None,
    overwrite: bool = False,
    **settings: Any,
) -> dict[str, Any]:
    """Converts a dataset of Dask arrays by many workers, to the bytes of one conversion with the same range.

    Each worker computes and writes shards: runs of whole windows. The range of values, which the tolerance refers to, is
    computed first unless ``range`` or ``max_error`` is given. Finished shards are kept if something fails: run this again.

    Args:
        source: A DataArray, or a Dataset with one variable or the named one. All workers must be able to read it.
        path: The ``.wspl`` file to write, where all workers can reach it.
        client: A client of dask.distributed; the current one by default.
        variable: Which variable of a Dataset.
        shards: How many shards; by default as many as there are chains of 8 windows, at most four for each worker.
        folder: A folder for the shards, ``path`` + ".shards" by default. They are removed in the end.
        overwrite: Whether to replace a file of this name, and shards that an earlier run left.
        settings: Those of `wavesplat.convert`.

    Returns:
        The report of the merge.

    """
    import distributed

    if os.path.exists(path) and not overwrite:
        raise ValueError(f"{os.fspath(path)}: exists already; overwrite=True replaces it")
    if not any(chunks for chunks in source.chunksizes.values()):
        raise ValueError("source: takes Dask arrays, as xr.open_dataset(..., chunks={}) gives them, or .chunk()")
    client = client or distributed.get_client()
    array = source if isinstance(source, xr.DataArray) else _variable(source, variable)
    if settings.get("range") is None and settings.get("max_error") is None:
        settings["range"] = _range(client, array, settings.get("missing"))
    frames = array.sizes[array.dims[0]]
    if settings.get("window") is None:
        settings["window"] = WINDOWS.get(str(settings.get("best_for")), 32)  # shards are runs of windows
    chain = settings.setdefault("chain", 8) * settings["window"]
    workers = max(len(client.scheduler_info()["workers"]), 1)
    shards = shards or max(min(-(-frames // chain), 4 * workers), 1)
    place = Path(folder) if folder is not None else Path(os.fspath(path) + ".shards")
    place.mkdir(parents=True, exist_ok=True)
    parts = [place / f"part-{n}-of-{shards}.wspl" for n in range(1, shards + 1)]
    if overwrite:
        for part in place.glob("part-*.wspl*"):
            part.unlink()  # they may be of other frames
    dataset = source if isinstance(source, xr.DataArray) else source[[array.name]]
    numbers = [(n, shards) for n in range(1, shards + 1)]
    wait = client.map(_shard, numbers, [str(part) for part in parts], source=dataset, settings=settings, pure=False)
    client.gather(wait)
    report = merge(parts, path, overwrite=overwrite, resume=not overwrite)
    for part in parts:
        part.unlink()
    if folder is None and not any(place.iterdir()):
        place.rmdir()
    return report


def _variable(dataset: xr.Dataset, name: str | None) -> xr.DataArray:
    names = [str(key) for key, array in dataset.data_vars.items() if array.ndim >= 3]
    if name is None and len(names) != 1:
        raise ValueError(f"variable: choose one of {', '.join(names) or 'none'}")
    return dataset[names[0] if name is None else name]


def _range(client: Any, array: xr.DataArray, missing: Any) -> tuple[float, float]:
    """The least and the largest value that is finite and does not mean "missing"."""
    known = array.where(np.isfinite(array))
    if isinstance(missing, (int, float)):
        known = known.where(array != missing)
    least, most = (float(found) for found in client.gather(client.compute([known.min().data, known.max().data])))
    return (least, most) if least <= most else (0.0, 0.0)


def _shard(shard: tuple[int, int], path: str, *, source: Any, settings: dict[str, Any]) -> None:
    """Converts a shard on a worker, which computes its frames itself. What is complete is not made anew."""
    import dask

    with dask.config.set(scheduler="threads"):
        _convert(source, path, shard=shard, resume=True, **settings)


TOGETHER = 8
"""Parts that one task adds."""

OF_SUMS = ("colormap", "range", "norm", "clear", "beyond", "background", "bar_title", "theme")
"""Options of colours: parts of pictures have none."""

OF_BOTH = ("annotate", "title", "memory")
"""Options that parts of pictures and their sums have. Those of colours are for sums, and all others for parts."""


def render(
    source: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    client: Any = None,
    regions: int | Sequence[str] | None = None,
    folder: str | PathLike[str] | None = None,
    **options: Unpack[PictureOptions],
) -> npt.NDArray[Any]:
    """Pictures as numbers by many workers, as `wavesplat.File.render` gives them.

    Each task renders the frames of a window from one view, or from all views if the colours depend on all. Those are the
    numbers of one call of ``render``.

    Shards of an archive, or ``regions`` of a volume that is too large for one machine, are rendered in parts: each task
    writes what its voxels or frames add to the pictures, and a tree of tasks adds these files. Sums over regions differ from
    one rendering by the rounding of 32-bit sums, far less than the splat error; sums over shards are the same numbers. With a
    ``colormap``, give a ``range``: without, it is that of the sums. Only means and emissions are sums.

    Args:
        source: A ``.wspl`` file, or the shards of an archive, in any order. All workers must reach them.
        client: A client of dask.distributed; the current one by default.
        regions: Into how many slabs to cut the volume, or the regions themselves, like ``"0:32,:,:"``.
        folder: A folder for parts that all workers can reach; beside the first file by default. What is written there is
            removed in the end.
        options: Those of `wavesplat.File.render`.

    Raises:
        ValueError: An option is wrong, or pictures of this kind are no sums.

    """
    import distributed

    client = client or distributed.get_client()
    given: dict[str, Any] = {**options}
    paths = [source] if isinstance(source, (str, PathLike)) else list(source)
    files = [anywhere(os.fspath(path)) for path in paths]
    if not files:
        raise ValueError("source: takes a file, or several")
    if regions is None and len(files) == 1:
        return _divided(client, files[0], given)
    if given.get("region") is not None and regions is not None:
        raise ValueError("region: cannot be given with regions")
    boxes = [given.pop("region", None)] if regions is None else _boxes(files[0], regions)
    place = Path(folder) if folder is not None else Path(files[0] + ".parts")
    own = place / uuid.uuid4().hex
    own.mkdir(parents=True)
    try:
        of_part = {name: value for name, value in given.items() if name not in OF_SUMS}
        of_sum = {name: value for name, value in given.items() if name in OF_SUMS + OF_BOTH}
        jobs = [(file, {**of_part, "region": box}) for file in files for box in boxes]
        names = [str(own / f"part-{n}.wpart") for n in range(len(jobs))]
        parts = client.map(_part, jobs, names, pure=False)
        level = 0
        while len(parts) > TOGETHER:
            groups = [parts[n : n + TOGETHER] for n in range(0, len(parts), TOGETHER)]
            names = [str(own / f"sum-{level}-{n}.wpart") for n in range(len(groups))]
            limits = {name: value for name, value in of_sum.items() if name == "memory"}
            pairs = zip(groups, names, strict=True)
            parts = [client.submit(_joined, group, name, limits, pure=False) for group, name in pairs]
            level += 1
        total: npt.NDArray[Any] = client.submit(_total, parts, of_sum, given, pure=False).result()
        return total
    finally:
        shutil.rmtree(own, ignore_errors=True)
        if folder is None and place.is_dir() and not any(place.iterdir()):
            place.rmdir()


def _boxes(file: str, regions: int | Sequence[str]) -> list[str]:
    """Regions: as given, or slabs of whole blocks across the axis with most blocks."""
    if not isinstance(regions, int):
        return list(regions)
    opened = _open(file)._file
    counts = [-(-n // edge) for n, edge in zip(opened.dims, opened.block, strict=True)]
    axis = counts.index(max(counts))
    if not 1 <= regions <= counts[axis]:
        raise ValueError(f"regions: takes 1 to {counts[axis]}, as many as there are blocks across the volume")
    ends = [counts[axis] * n // regions * opened.block[axis] for n in range(regions)] + [opened.dims[axis]]
    sides = [f"{first}:{last}" for first, last in zip(ends, ends[1:], strict=False)]
    return [",".join(side if along == axis else ":" for along in range(3)) for side in sides]


def _divided(client: Any, file: str, options: dict[str, Any]) -> npt.NDArray[Any]:
    """Pictures of one file: a task for each window, and for each view if its colours are its own."""
    if options.get("over_time") or options.get("key_frames"):
        whole: npt.NDArray[Any] = client.submit(_pictures, file, options, pure=False).result()
        return whole
    view = options.get("view")
    has_numbers = options.get("colormap") is None and options.get("mode", "projection") in ("projection", "mip")
    has_numbers = has_numbers and options.get("iso") is None and options.get("slice") is None
    apart = isinstance(view, list) and options.get("orbit", 1) == 1 and has_numbers
    views = [[one] for one in view] if apart and isinstance(view, list) else [view]
    jobs = [{**options, "view": one, **frames} for one in views for frames in _windows(file, options.get("frames"))]
    done = client.gather(client.map(_pictures, [file] * len(jobs), jobs, pure=False))
    is_several = isinstance(view, list) or options.get("orbit", 1) != 1
    runs = len(jobs) // len(views)
    rows = [np.concatenate(done[n : n + runs], axis=int(is_several)) for n in range(0, len(done), runs)]
    return np.concatenate(rows) if apart else rows[0]


def _windows(file: str, frames: Any) -> list[dict[str, Any]]:
    """The frames that are asked for, window by window."""
    if isinstance(frames, str):
        return [{"frames": frames}]
    opened = _open(file)
    numbers = np.arange(opened.shape[0])
    chosen = np.unique(numbers if frames is None else numbers[frames])
    if len(chosen) == 0:
        raise ValueError("frames: none are chosen")
    window = np.searchsorted(opened._file.windows, chosen, side="right")
    runs = np.split(chosen, np.flatnonzero(np.diff(window)) + 1)
    return [{"frames": [int(frame) for frame in one]} for one in runs]


def _pictures(file: str, options: dict[str, Any]) -> npt.NDArray[Any]:
    return _open(file).render(**options)


def _part(job: tuple[str, dict[str, Any]], name: str) -> str:
    """Writes what a file and a region add to the pictures. A task that is done again replaces it."""
    file, options = job
    run({**options, "partial": True, "force": True}, name, [file])
    return name


def _joined(parts: list[str], name: str, limits: dict[str, Any]) -> str:
    run({**limits, "sum": True, "partial": True, "force": True}, name, parts)
    return name


def _total(parts: list[str], of_sum: dict[str, Any], options: dict[str, Any]) -> npt.NDArray[Any]:
    return pictures(options, lambda output: run({**of_sum, "sum": True}, output, parts))
