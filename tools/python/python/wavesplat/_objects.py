"""Coefficient files in file objects: those of fsspec, and others that read and seek."""

from __future__ import annotations

import io
import os
import threading
from os import PathLike
from typing import Any, Protocol
from weakref import WeakKeyDictionary

from ._arguments import located


class FileObject(Protocol):
    """What reads bytes, and moves to another place."""

    def read(self, count: int, /) -> bytes:
        """The next bytes."""
        ...

    def seek(self, offset: int, whence: int, /) -> Any:
        """Moves."""
        ...


Place = str | PathLike[str] | FileObject
"""A path, an address or a file object."""


class ByteRanges:
    """Reads ranges of bytes of a file object, from any thread."""

    def __init__(self, given: Any) -> None:
        """Of an object that is open for bytes, or a file of fsspec that is not open yet."""
        self.given = given
        self.file = _opened(given)
        self.name = _name(given)
        self._lock = _lock_of(self.file)
        self._process = os.getpid()
        if not hasattr(self.file, "seek") or (hasattr(self.file, "seekable") and not self.file.seekable()):
            raise ValueError(f"{self.name}: cannot seek, and files are read by parts")
        if isinstance(self.file.read(0), str):
            raise TypeError(f"{self.name}: is open for texts; open it with mode 'rb'")
        self.file.seek(0, os.SEEK_END)
        self.length: int = self.file.tell()

    def __call__(self, starts: list[int], ends: list[int]) -> list[bytes]:
        """The bytes of each range. Servers are asked for all of them side by side."""
        self.check_process()
        fs: Any = getattr(self.given, "fs", None)
        if getattr(fs, "async_impl", False) and getattr(self.given, "compression", None) is None:
            return [_read(part) for part in fs.cat_ranges([self.given.path] * len(starts), starts, ends)]
        with self._lock:
            return [self._range(start, end - start) for start, end in zip(starts, ends, strict=True)]

    def check_process(self) -> None:
        """An exception in a forked process: both would move the place in the same file."""
        if self._process != os.getpid():
            raise RuntimeError(f"{self.name}: was opened by another process; open it again in this one")

    def close(self) -> None:
        """Closes the file if it was opened here."""
        if self.file is not self.given:
            self.file.close()

    def _range(self, start: int, count: int) -> bytes:
        self.file.seek(start, os.SEEK_SET)
        parts = []
        while count > 0 and (part := self.file.read(count)):
            parts.append(part)
            count -= len(part)
        return b"".join(parts)


def place_of(path: Place) -> str | ByteRanges:
    """A path or an address, also that of a local file which is open; or the bytes of another file object."""
    if isinstance(path, (str, bytes, PathLike)):
        name = located(path)
        if "://" in name and not name.lower().startswith(("https://", "http://", "s3://")):
            what = "only https://, http:// and s3:// are read directly; for others, give fsspec.open(address)"
            raise ValueError(f"{name}: {what}")
        return name
    local = _local_path(path) or _local_name(path)
    return ByteRanges(path) if local is None else located(local)


def _local_path(file: Any) -> str | None:
    """The path of a file of fsspec, if it is one of this machine."""
    protocol = getattr(getattr(file, "fs", None), "protocol", None)
    is_plain = not hasattr(file, "read") and getattr(file, "compression", None) is None
    return str(file.path) if is_plain and protocol in ("file", ("file", "local")) else None


def _local_name(file: Any) -> str | None:
    """The name of an open file, if it still leads to it."""
    if not isinstance(file, io.BufferedReader) or type(file.raw) is not io.FileIO or not isinstance(file.name, str):
        return None
    try:
        return file.name if os.path.samestat(os.fstat(file.fileno()), os.stat(file.name)) else None
    except (OSError, ValueError):
        return None


def _opened(given: Any) -> Any:
    """An open file: the one that is given, or that of a file of fsspec or a path of another filesystem."""
    if hasattr(given, "read"):
        return given
    if hasattr(given, "full_name"):  # fsspec.open, which knows about compression
        return given.open()
    if hasattr(given, "fs") and hasattr(given, "path"):
        return given.fs.open(given.path, "rb")
    raise TypeError(f"path: takes a path, an address or a file object, not {given!r}")


def _read(part: Any) -> bytes:
    """The bytes of a range; fsspec may give an exception instead."""
    if isinstance(part, BaseException):
        raise part
    return bytes(part)


_LOCKS: WeakKeyDictionary[Any, threading.Lock] = WeakKeyDictionary()


def _lock_of(file: Any) -> threading.Lock:
    """The lock of an object, which several open files may share."""
    try:
        return _LOCKS.setdefault(file, threading.Lock())
    except TypeError:  # it cannot be a key
        return threading.Lock()


def _name(given: Any) -> str:
    """What messages call a file."""
    known = (getattr(given, name, None) for name in ("full_name", "path", "name"))
    return next((name for name in known if isinstance(name, str)), repr(given))
