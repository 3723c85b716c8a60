"""The native half of the package. Triples are in the order x, y, z."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

__version__: str

class WavesplatError(Exception): ...
class InputError(WavesplatError): ...
class DamagedError(WavesplatError): ...
class UnsupportedError(WavesplatError): ...
class ChangedError(WavesplatError): ...
class BoundMissedError(WavesplatError): ...

_Report = Callable[[int, int], object]
_Bytes = npt.NDArray[np.uint8]

class File:
    def __init__(
        self, path: str | PathLike[str], lod: int = 0, cache_dir: str | PathLike[str] | None = None, cache: int = ...
    ) -> None: ...
    @staticmethod
    def of_object(
        name: str, read: Callable[[list[int], list[int]], list[bytes]], length: int, lod: int, cache: int
    ) -> File: ...
    path: str
    id: str
    dims: list[int]
    frames: int
    sample: str
    channels: int
    block: list[int]
    windows: list[int]
    times: list[float]
    spacing: list[float]
    origin: list[float]
    variable: str | None
    missing_value: float | None
    value_range: tuple[float, float]
    coarsest: int
    bytes: int
    bytes_read: int
    reached: float
    def setting(self, name: str) -> str | None: ...
    def promise(self) -> str: ...
    def description(self) -> dict[str, Any] | None: ...
    def check(self, report: _Report | None = None) -> None: ...
    def read(
        self,
        frames: Sequence[int],
        region: tuple[Sequence[int], Sequence[int]],
        channel: int,
        memory: int,
        out: _Bytes,
    ) -> None: ...
    def extract(
        self,
        output: str,
        frames: Sequence[int],
        region: tuple[Sequence[int], Sequence[int]],
        channel: int,
        memory: int,
        overwrite: bool,
        report: _Report | None = None,
    ) -> tuple[str, list[str]]: ...
    def render(self, request: str, output: str, memory: str, report: _Report | None = None) -> None: ...
    def page(self, request: str, output: str, memory: str) -> None: ...
    def view(self, request: str, port: int, memory: str) -> Viewer: ...

class Viewer:
    address: str
    def open_browser(self) -> None: ...
    def close(self) -> None: ...

def after_fork() -> None: ...
def before_end() -> None: ...
def render(inputs: Sequence[str], request: str, output: str, memory: str, report: _Report | None = None) -> None: ...
def convert_frames(
    iterator: Iterator[_Bytes],
    layout: Mapping[str, Any],
    settings: Mapping[str, Any],
    report: _Report | None = None,
) -> tuple[str | None, list[str]]: ...
def append_frames(
    iterator: Iterator[_Bytes],
    layout: Mapping[str, Any],
    appended: Mapping[str, Any],
    report: _Report | None = None,
) -> tuple[str | None, list[str]]: ...
def convert_arrays(
    arrays: Sequence[Mapping[str, Any]],
    attributes: Sequence[tuple[str, Any]],
    read: Callable[[str, Sequence[tuple[int, int]]], _Bytes],
    chosen: Mapping[str, Any],
    settings: Mapping[str, Any],
    report: _Report | None = None,
) -> tuple[str | None, list[str]]: ...
def append_arrays(
    arrays: Sequence[Mapping[str, Any]],
    attributes: Sequence[tuple[str, Any]],
    read: Callable[[str, Sequence[tuple[int, int]]], _Bytes],
    chosen: Mapping[str, Any],
    appended: Mapping[str, Any],
    report: _Report | None = None,
) -> tuple[str | None, list[str]]: ...
def encode(samples: _Bytes, dims: Sequence[int], sample: str, request: str) -> bytes: ...
def decode(bytes: bytes, at: int, most: Sequence[int], sample: str) -> tuple[_Bytes, list[int], int]: ...
def check(request: str) -> None: ...
def merge(shards: Sequence[str], path: str, resume: bool, overwrite: bool, report: _Report | None = None) -> str: ...
