"""Pictures that the library writes to files, as arrays."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _wavesplat
from ._arguments import MEMORY
from ._options import request
from ._progress import Progress, reporting


def pictures(options: dict[str, Any], make: Callable[[str], object]) -> npt.NDArray[Any]:
    """The arrays that ``make`` writes to a file, or to one for each view; several views add an axis."""
    is_several = isinstance(options.get("view"), list) or options.get("orbit", 1) != 1
    is_several = is_several and not (options.get("over_time") or options.get("key_frames"))
    with tempfile.TemporaryDirectory(prefix="wavesplat-") as folder:
        make(os.path.join(folder, "%05v.npy" if is_several else "pictures.npy"))
        views = [np.load(path) for path in sorted(Path(folder).glob("*.npy"))]
    together: npt.NDArray[Any] = np.stack(views) if is_several else views[0]
    return together


def run(options: dict[str, Any], output: str, inputs: Sequence[str], progress: Progress = False) -> None:
    """Does what options of ``wavesplat-render`` ask for; errors have the names of Python."""
    options = dict(options)
    memory = str(options.pop("memory", MEMORY))
    with reporting(progress, "render") as report:
        _wavesplat.render(inputs, request(options), output, memory, report)
