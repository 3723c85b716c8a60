"""Coefficient files in file objects: those of fsspec, and others that read and seek."""

from __future__ import annotations

import os
import threading
from io import BufferedReader
from os import PathLike
from typing import Any, Protocol

from ._arguments import located


class FileObject(Protocol):
    """What reads bytes, and moves to another place."""

    def read(self, count: int, /) -> bytes:
        """The next bytes."""
        ...

    def seek(self, offset: int, whence: int, /) -> int:
        """Moves."""
        ...


Place = str | PathLike[str] | FileObject
"""A path, an address or a file object."""


class ByteRanges:
    """Reads ranges of bytes of a file object, from any thread."""

    def __init__(self, of: Any) -> None:
        """Of an object that is open for bytes, or a file of fsspec that is not open yet."""
        is_closed = not hasattr(of, "read") and hasattr(of, "fs") and hasattr(of, "path")
        self.file = of.fs.open(of.path, "rb") if is_closed else of
        if not hasattr(self.file, "read"):
            raise TypeError(f"path: takes a path, an address or a file object, not {of!r}")
        self.name = _name(self.file)
        self._lock = threading.Lock()
        self._process = os.getpid()
        if not hasattr(self.file, "seek") or (hasattr(self.file, "seekable") and not self.file.seekable()):
            raise ValueError(f"{self.name}: cannot seek, and files are read by parts")
        if not isinstance(self.file.read(0), bytes):
            raise TypeError(f"{self.name}: is open for texts; open it with mode 'rb'")
        self.length: int = self.file.seek(0, os.SEEK_END)

    def __call__(self, starts: list[int], ends: list[int]) -> list[bytes]:
        """The bytes of each range. fsspec asks for all of them at once."""
        self.check_process()
        together = getattr(getattr(self.file, "fs", None), "cat_ranges", None)
        if together is not None:
            found: list[bytes] = together([self.file.path] * len(starts), starts, ends, on_error="raise")
            return found
        with self._lock:
            return [self._read(start, end - start) for start, end in zip(starts, ends, strict=True)]

    def check_process(self) -> None:
        """An exception in a forked process: both would move the place in the same file."""
        if self._process != os.getpid():
            raise RuntimeError(f"{self.name}: was opened by another process; open it again in this one")

    def _read(self, start: int, count: int) -> bytes:
        self.file.seek(start)
        parts = []
        while count > 0 and (part := self.file.read(count)):
            parts.append(part)
            count -= len(part)
        return b"".join(parts)


def place_of(path: Place) -> str | ByteRanges:
    """A path or an address, also that of a local file which is open; or the bytes of another file object."""
    if isinstance(path, BufferedReader) and isinstance(path.name, str):
        return located(path.name)
    return located(path) if isinstance(path, (str, bytes, PathLike)) else ByteRanges(path)


def _name(file: Any) -> str:
    """What messages call a file."""
    known = (getattr(file, name, None) for name in ("full_name", "path", "name"))
    return next((name for name in known if isinstance(name, str)), repr(file))
