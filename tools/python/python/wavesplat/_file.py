"""Coefficient files: samples, what is known of them, and pictures."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _wavesplat
from ._arguments import MEMORY, located, whole
from ._description import Axes, coordinates
from ._figure import Figure
from ._index import Selection, box_of, read_into, select
from ._objects import ByteRanges, Place, place_of
from ._options import request
from ._pictures import pictures
from ._progress import Progress, reporting
from ._reports import told
from ._viewer import Viewer

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._typed import LookOptions, PictureOptions

CACHE = 512 << 20
"""Bytes of decoded blocks that an open file keeps."""


def open(path: Place, *, lod: int = 0, cache_dir: str | PathLike[str] | None = None, cache: int = CACHE) -> File:
    """Opens a coefficient file, until `File.close` or the end of a ``with``. Samples are read when they are asked for. Blocks
    that were decoded stay in memory for the next reads and pictures, until the file is closed or gone.

    Args:
        path: A ``.wspl`` file, or the address of one: ``https://host/run.wspl`` or ``s3://bucket/run.wspl``, as a string.
            ``file:///folder/run.wspl`` is a path, too. Or a file object that reads bytes and seeks, such as
            ``fsspec.open("gs://bucket/run.wspl")``; it must stay open.
        lod: Level of detail: every 2**lod-th voxel along each axis, read from the coarse levels alone.
        cache_dir: A folder that keeps what was read of remote files, up to 4 GiB. Several processes may share it.
        cache: Bytes of decoded blocks that stay in memory. A loop over frames is fast if all samples of a window fit.

    Raises:
        FileNotFoundError: There is no such file.
        DamagedError: It is damaged, or no coefficient file.
        ValueError: It has no such level of detail, or cannot seek.

    """
    return File(path, lod=lod, cache_dir=cache_dir, cache=cache)


class File:
    """An open coefficient file. It acts as a read-only array of shape (time, z, y, x); several threads may read it.

    ``f[10, :, ::2, 5]`` gives samples as numpy does for basic indices and one list or mask, and ``f.oindex`` takes one along
    each axis. Only the blocks that an index touches are read, and the interpreter's lock is released meanwhile. Voxels are in
    the file's own order: along each axis, coordinates ascend. ``xarray.open_dataset`` gives the order of the source.

    A process that was forked reads and draws with threads of its own, one call at a time. It cannot convert if its parent
    used wavesplat before, and nothing at all if other threads used it at that moment: then there is a RuntimeError.
    """

    def __init__(
        self,
        path: Place,
        *,
        lod: int = 0,
        cache_dir: str | PathLike[str] | None = None,
        cache: int = CACHE,
    ) -> None:
        """As `wavesplat.open`."""
        for name, value in ("lod", lod), ("cache", cache):
            if whole(name, value) < 0:
                raise ValueError(f"{name}: takes 0 or more, not {value}")
        self._options: dict[str, Any] = {"lod": lod, "cache_dir": cache_dir, "cache": cache}
        place = place_of(path)
        self._object = place if isinstance(place, ByteRanges) else None
        self._path = place.name if isinstance(place, ByteRanges) else place
        try:
            self._native: _wavesplat.File | None = self._opened()
        except BaseException:
            self.close()
            raise
        self._process = os.getpid()

    def _opened(self) -> _wavesplat.File:
        if self._object is None:
            return _wavesplat.File(self._path, **self._options)
        if self._options["cache_dir"] is not None:
            raise ValueError("cache_dir: is for addresses; a file object may have a cache of its own")
        read, lod, cache = self._object, self._options["lod"], self._options["cache"]
        return _wavesplat.File.of_object(self._path, read, read.length, lod, cache)

    @property
    def _file(self) -> _wavesplat.File:
        """The open file. A forked process connects to a server by itself: its parent uses the connection."""
        if self._native is None:
            raise ValueError(f"{self._path}: is closed")
        if self._object is not None:
            self._object.check_process()
        elif self._process != os.getpid() and "://" in self._path:
            self._native = _same(self._path, self._native.id, self._options)._file
            self._process = os.getpid()
        return self._native

    def close(self) -> None:
        """Closes the file and frees what is kept of it. Its samples cannot be read any more."""
        self._native = None
        if self._object is not None:
            self._object.close()
            self._object = None

    @property
    def closed(self) -> bool:
        """Whether it is closed."""
        return self._native is None

    def __enter__(self) -> File:  # noqa: D105
        return self

    def __exit__(self, *raised: object) -> None:  # noqa: D105
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:  # noqa: D105
        place = anywhere(self._path) if self._object is None else self._object.given
        return _same, (place, self.id, self._options)

    def __repr__(self) -> str:  # noqa: D105
        if self.closed:
            return f"<wavesplat.File {self._path!r}: closed>"
        sizes = ", ".join(f"{name}: {length}" for name, length in zip(self.dims, self.shape, strict=True))
        name = self.variable or "samples"
        return f"<wavesplat.File {self._file.path!r}: {name} ({sizes}) {self.dtype}, error <= {self.bound:.4g}>"

    def __len__(self) -> int:  # noqa: D105
        return self.shape[0]

    @property
    def path(self) -> str:
        """Its path, or the name of its file object."""
        return self._path

    @property
    def lod(self) -> int:
        """The level of detail: every 2**lod-th voxel along each axis is there."""
        lod: int = self._options["lod"]
        return lod

    @property
    def id(self) -> str:
        """Its identity, which the same frames and settings share."""
        return self._file.id

    @cached_property
    def shape(self) -> tuple[int, int, int, int]:
        """Frames, and voxels along z, y and x."""
        x, y, z = self._file.dims
        return self._file.frames, z, y, x

    @property
    def ndim(self) -> int:
        """Four: time, z, y and x."""
        return 4

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """The type of the samples."""
        sample = self._file.sample
        return np.dtype(f"<{sample[0]}{int(sample[1:]) // 8}")

    @property
    def channels(self) -> int:
        """1, or 3 for red, green and blue."""
        return self._file.channels

    @property
    def size(self) -> int:
        """Samples of a channel."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def nbytes(self) -> int:
        """Bytes of all samples of a channel."""
        return self.size * self.dtype.itemsize

    @cached_property
    def chunks(self) -> tuple[tuple[int, ...], ...]:
        """Lengths of the windows, and of the blocks along z, y and x: what is decoded together."""
        edges = reversed(self._file.block)
        spatial = zip(self.shape[1:], edges, strict=True)
        blocks = (tuple(min(edge, n - at) for at in range(0, n, edge)) for n, edge in spatial)
        return (tuple(self._file.windows), *blocks)

    @property
    def variable(self) -> str | None:
        """The name of the variable, if the source had one."""
        return self._file.variable

    @property
    def unit(self) -> str | None:
        """The unit of the samples, if the source had one."""
        return self._file.setting("units")

    @cached_property
    def description(self) -> dict[str, Any] | None:
        """Dimensions, coordinates and attributes of the source, as far as they are kept."""
        return self._file.description()

    @cached_property
    def _axes(self) -> Axes:
        return Axes.of(self)

    @property
    def dims(self) -> tuple[str, str, str, str]:
        """The names of the four axes."""
        return self._axes.names

    @cached_property
    def coords(self) -> dict[str, npt.NDArray[Any]]:
        """The coordinates of each axis that has some: of its frames or voxels, in the file's order."""
        return coordinates(self)

    @cached_property
    def attrs(self) -> dict[str, Any]:
        """The attributes of the samples in the source."""
        return self._axes.attributes

    @property
    def spacing(self) -> tuple[float, float, float]:
        """The distance of voxels along x, y and z."""
        x, y, z = self._file.spacing
        return x, y, z

    @property
    def origin(self) -> tuple[float, float, float]:
        """The place of the first voxel along x, y and z."""
        x, y, z = self._file.origin
        return x, y, z

    @property
    def coarsest(self) -> int:
        """The coarsest level of detail that `wavesplat.open` takes."""
        return self._file.coarsest

    @cached_property
    def times(self) -> npt.NDArray[np.float64]:
        """The time of each frame, in `time_unit`; empty if there are none."""
        return np.asarray(self._file.times)

    @property
    def time_unit(self) -> str | None:
        """The unit of times, perhaps since a date: "hours since 2000-01-01"."""
        return self._file.setting("time-units")

    @property
    def calendar(self) -> str | None:
        """The calendar of times, if it is not the usual one."""
        return self._file.setting("calendar")

    @property
    def missing_value(self) -> float | None:
        """The value that stands for missing samples, besides NaN and infinities."""
        return self._file.missing_value

    @property
    def range(self) -> tuple[float, float]:
        """The least and the largest sample."""
        return self._file.value_range

    @property
    def bound(self) -> float:
        """The largest error of any sample, in its unit. It was measured in the conversion, and is guaranteed."""
        return self._file.reached

    @cached_property
    def promise(self) -> dict[str, Any]:
        """What was promised: kind of bound, tolerance and so on, as ``wavesplat verify --json`` reports it."""
        promise: dict[str, Any] = json.loads(self._file.promise())
        return promise

    @property
    def file_bytes(self) -> int:
        """Bytes of the file."""
        return self._file.bytes

    @property
    def bytes_read(self) -> int:
        """Bytes of the file that were read so far."""
        return self._file.bytes_read

    def __getitem__(self, key: Any) -> Any:
        """Samples by an index of numpy's: numbers, slices, ``...``, ``None``, and one list or mask."""
        selection = select(key, self.shape)
        return selection.finish(self._read(selection.items))

    @property
    def oindex(self) -> Outer:
        """Samples by a number, slice, list or mask along each axis: every combination of them."""
        return Outer(self)

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        """All samples."""
        if copy is False:
            raise ValueError("samples are decoded: there is no array without a copy")
        samples: npt.NDArray[Any] = self[...]
        return samples.astype(dtype or self.dtype, copy=False)

    def read(
        self,
        t: Any = slice(None),
        z: Any = slice(None),
        y: Any = slice(None),
        x: Any = slice(None),
        *,
        out: npt.NDArray[Any] | None = None,
        channel: int = 0,
        memory: int = MEMORY,
    ) -> Any:
        """Samples by a number, slice, list or mask along each axis.

        Args:
            t: Which frames.
            z: Which voxels along z.
            y: Which voxels along y.
            x: Which voxels along x.
            out: An array for the samples, of their shape and type. All axes are kept then, with length 1 for a number.
            channel: Which channel, from 0.
            memory: Bytes that decoding may take beside the result.

        Raises:
            IndexError: There are no such frames or voxels.
            DamagedError: A block is damaged.

        """
        memory, channel = whole("memory", memory), whole("channel", channel)
        selection = _along_all((t, z, y, x), self.shape)
        if out is None:
            return selection.finish(self._read(selection.items, channel=channel, memory=memory))
        if not isinstance(out, np.ndarray):
            raise TypeError(f"out: takes an array of numpy, not {type(out).__name__}")
        if not out.flags.writeable:
            raise ValueError("out: cannot be written")
        if out.shape != selection.shape or out.dtype != self.dtype:
            raise ValueError(
                f"out: takes {self.dtype} of shape {selection.shape}, not {out.dtype} of shape {out.shape}"
            )
        self._fill(out, selection.items, channel, memory)
        return out

    def _read(self, items: Sequence[Any], *, channel: int = 0, memory: int = MEMORY) -> npt.NDArray[Any]:
        out = np.empty(tuple(len(along) for along in items), self.dtype)
        self._fill(out, items, channel, memory)
        return out

    def _fill(self, out: npt.NDArray[Any], items: Sequence[Any], channel: int, memory: int) -> None:
        def read(frames: list[int], box: tuple[list[int], list[int]], part: npt.NDArray[Any]) -> None:
            region = (box[0][::-1], box[1][::-1])
            self._file.read(frames, region, channel, memory, part.reshape(-1).view(np.uint8))

        blocks = self._file.block[::-1]
        read_into(out, items, read, blocks=blocks, windows=self._file.windows, memory=memory)

    def extract(
        self,
        path: str | PathLike[str],
        t: Any = slice(None),
        z: Any = slice(None),
        y: Any = slice(None),
        x: Any = slice(None),
        *,
        channel: int = 0,
        overwrite: bool = False,
        memory: int = MEMORY,
        progress: Progress = False,
    ) -> dict[str, Any]:
        """Writes samples in the format of other programs, a piece at a time: memory stays bounded.

        Args:
            path: The file, whose ending says the format: ``.npy``, ``.raw``, ``.nrrd``, ``.nhdr``, ``.vti``, ``.vtr``,
                ``.pvd``, ``.nc``, ``.nii``, ``.nii.gz``, ``.mha`` or ``.zarr``. ``out_%04d.vti`` is one file for each frame.
            t: Which frames, ascending.
            z: Which voxels along z, as a number or a slice without a step; all by default.
            y: Which voxels along y.
            x: Which voxels along x.
            channel: Which channel, from 0.
            overwrite: Whether to replace existing files.
            memory: Bytes that the extraction may take.
            progress: Whether to show progress, or a function of (done, all).

        Returns:
            The report, as ``wavesplat extract --json`` prints it, without the names of files.

        Raises:
            ValueError: The ending is another one, or the file exists already.
            DamagedError: A block is damaged.

        """
        frames, *voxels = _along_all((t, z, y, x), self.shape).items
        if len(frames) == 0 or np.any(np.diff(frames) <= 0):
            raise ValueError("t: takes frames that ascend, at least one")
        region, output = box_of(voxels), located(path)
        memory, channel = whole("memory", memory), whole("channel", channel)
        with reporting(progress, "extract") as report:
            return told(*self._file.extract(output, list(frames), region, channel, memory, bool(overwrite), report))

    def check(self, progress: Progress = False) -> None:
        """Compares the checksums of every byte of the file.

        Raises:
            DamagedError: It names the place of the first damage.

        """
        with reporting(progress, "check") as report:
            self._file.check(report)

    def render(self, *, progress: Progress = False, **options: Unpack[PictureOptions]) -> npt.NDArray[Any]:
        """Pictures as numbers.

        Args:
            progress: Whether to show progress, or a function of (done, all).
            options: `wavesplat.PictureOptions`, as in ``wavesplat-render``: ``view=(30, 30)``, ``mode="composite"``,
                ``frames=slice(0, 8)``, ``size=(640, 480)``, ``range=(0, 1)``, ``iso="50%"``,
                ``slice={"z": "50%"}`` (numbers are coordinates), ``colormap="RdBu"`` (names and objects of matplotlib work),
                ``memory="1GiB"`` and so on.

        Returns:
            Means and largest values: float32 (pictures, height, width) in the unit of the samples, NaN for background.
            With a ``colormap``: uint8 colours (pictures, height, width, 3). Composites and isosurfaces: float32 red, green,
            blue and what shines through (pictures, height, width, 4), each 0 to 1.

            Several views, by a list or ``orbit``, add an axis before these.

        Raises:
            ValueError: An option is wrong.

        """
        given: dict[str, Any] = {**options}
        return pictures(given, lambda output: self._render(output, given, progress))

    def figure(
        self,
        format: str = "html",
        *,
        interactive: bool = False,
        height: int = 700,
        progress: Progress = False,
        **options: Unpack[PictureOptions],
    ) -> Figure:
        """A picture that a notebook shows.

        Args:
            format: "html" for an interactive page with all frames, "png" for one picture or a sheet of several, "apng" or
                "gif" for a movie.
            interactive: Whether a page holds the whole file and the program instead of finished pictures: it turns, cuts
                and plays the volume as `view` does, without a server. `options` are then those of `view`.
            height: Pixels of height that a page takes in a notebook.
            progress: Whether to show progress, or a function of (done, all).
            options: As for `render`. ``annotate`` is True by default.

        """
        given: dict[str, Any] = {**options}
        if interactive and format == "html":
            return self._page(height, given)
        if interactive:
            raise ValueError(f"interactive: takes the format 'html', not {format!r}")
        if format not in ("html", "png", "apng", "gif"):
            raise ValueError(f"format: 'html', 'png', 'apng' or 'gif', not {format!r}")
        given = {"annotate": True, **given}
        if format == "png":
            given.setdefault("frames", self.shape[0] // 2)
            several = (not isinstance(given["frames"], (int, np.integer)), isinstance(given.get("view"), list))
            if all(several):
                raise ValueError("png: shows several frames or several views, not both; take 'html'")
            if any(several):
                given["format"] = "sheet"  # all pictures in one
        with tempfile.TemporaryDirectory(prefix="wavesplat-") as folder:
            path = Path(folder, f"figure.{format}")
            self._render(str(path), given, progress)
            return Figure(path.read_bytes(), format, height)

    def _page(self, height: int, options: dict[str, Any]) -> Figure:
        memory = str(options.pop("memory", MEMORY))
        with tempfile.TemporaryDirectory(prefix="wavesplat-") as folder:
            path = Path(folder, "page.html")
            self._file.page(request(options), str(path), memory)
            return Figure(path.read_bytes(), "html", height)

    def _render(self, output: str, options: dict[str, Any], progress: Progress) -> None:
        options = {"lod": self.lod or None, **options}
        memory = str(options.pop("memory", MEMORY))
        with reporting(progress, "render") as report:
            self._file.render(request(options), output, memory, report)

    def view(
        self, *, browser: bool = True, port: int = 0, memory: int = MEMORY, **options: Unpack[LookOptions]
    ) -> Viewer:
        """Opens the interactive viewer in the browser.

        Args:
            browser: Whether to open the browser; otherwise open `Viewer.address` yourself.
            port: Port of the server on 127.0.0.1; any free one by default.
            memory: Bytes that pictures may take.
            options: As for `render`, for all pictures.

        """
        if not 0 <= whole("port", port) < 1 << 16:
            raise ValueError(f"port: takes 0 to 65535, not {port}")
        return Viewer(self._file.view(request({**options}), port, str(memory)), browser=browser)

    def to_pyvista(self, frame: int = 0, z: Any = slice(None), y: Any = slice(None), x: Any = slice(None)) -> Any:
        """A frame, or a box of it, as a data set of PyVista: an ImageData, or a RectilinearGrid where distances differ.

        Args:
            frame: Which frame.
            z: Which voxels along z, as a slice without a step.
            y: Which voxels along y.
            x: Which voxels along x.

        """
        from ._volumes import to_pyvista

        return to_pyvista(self, frame, (z, y, x))


def _along_all(parts: Sequence[Any], shape: Sequence[int]) -> Selection:
    """What arguments for each axis ask for; None asks for all."""
    return select(tuple(slice(None) if part is None else part for part in parts), shape, outer=True)


class Outer:
    """Samples by a list along each axis; see `File.oindex`."""

    def __init__(self, file: File) -> None:
        """Of a file."""
        self._of = file

    def __getitem__(self, key: Any) -> Any:  # noqa: D105
        selection = select(key, self._of.shape, outer=True)
        return selection.finish(self._of._read(selection.items))


def anywhere(path: str) -> str:
    """A path that other processes understand: absolute, unless it is an address."""
    path = located(path)
    return path if "://" in path else os.path.abspath(path)


def _same(path: Place, id: str, options: dict[str, Any]) -> File:
    """A file that is opened again with its options, if it is still the same."""
    file = File(path, **options)
    if file.id != id:
        raise _wavesplat.ChangedError(f"{file.path}: is another file than the one that was pickled or opened before")
    return file
