"""Reports of conversions and extractions, and warnings of what is worth knowing."""

from __future__ import annotations

import json
import os
import sys
import warnings
from typing import Any


def told(report: str | None, notes: list[str]) -> dict[str, Any]:
    """A report. Warns of what is worth knowing."""
    for note in notes:
        warnings.warn(note, stacklevel=_caller())
    return json.loads(report) if report is not None else {}


def _caller() -> int:
    """How far up the caller of this package is, for warnings."""
    folder = os.path.dirname(__file__)
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and os.path.dirname(frame.f_code.co_filename) == folder:
        frame, level = frame.f_back, level + 1
    return level
