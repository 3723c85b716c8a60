"""Conversions by the workers of Dask: each converts shards, and the shards are merged."""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ._convert import convert as _convert
from ._convert import merge

CHAIN = 256
"""Frames of a chain by default: 8 windows of 32 frames."""


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
    chain = settings.setdefault("chain", 8) * settings.get("window", 32)
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
