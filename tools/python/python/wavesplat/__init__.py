"""Time-varying volumes in small files with a guaranteed error for every sample, and pictures from them.

>>> import wavesplat
>>> report = wavesplat.convert(array, "run.wspl", tolerance=1e-3)  # array: (time, z, y, x)
>>> f = wavesplat.open("run.wspl")
>>> f[10, :, 5]  # samples as numpy arrays, from the blocks that they are in alone
>>> f.figure(mode="composite")  # an interactive picture in a notebook

With xarray, ``xr.open_dataset("run.wspl")`` opens a file lazily, and ``ds.to_wavesplat("run.wspl")`` writes one after
``import wavesplat.xarray``.
"""

import atexit as _atexit
import os as _os
import sys as _sys

from ._convert import append, convert, merge
from ._figure import Figure
from ._file import File, open
from ._typed import LookOptions, PictureOptions
from ._viewer import Viewer
from ._wavesplat import (
    BoundMissedError,
    ChangedError,
    DamagedError,
    InputError,
    UnsupportedError,
    WavesplatError,
    __version__,
)
from ._wavesplat import after_fork as _after_fork
from ._wavesplat import before_end as _before_end

_atexit.register(_before_end)  # threads that read objects then end before the interpreter
_os.register_at_fork(after_in_child=_after_fork)  # threads do not follow a fork

if "xarray" in _sys.modules:  # its users expect Dataset.to_wavesplat; others do not wait for its import
    from . import xarray as _xarray  # noqa: F401

__all__ = [
    "BoundMissedError",
    "ChangedError",
    "DamagedError",
    "Figure",
    "File",
    "InputError",
    "LookOptions",
    "PictureOptions",
    "UnsupportedError",
    "Viewer",
    "WavesplatError",
    "__version__",
    "append",
    "convert",
    "merge",
    "open",
]
