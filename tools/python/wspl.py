"""Reader of coefficient files (.wspl), versions 1.0 to 1.2, written from format/FORMAT.md alone.

    python wspl.py info FILE              metadata as JSON
    python wspl.py check FILE             everything in the file is as the format says
    python wspl.py extract FILE OUT       samples, little-endian, channel by channel, frame by frame, x fastest
    python wspl.py extract-many LISTFILE  lines FILE<TAB>OUT: check and extract each

Exit codes: 0 fine, 2 usage, 3 damaged, lost or not supported.
"Section n" in this file is a section of FORMAT.md.
"""

from __future__ import annotations

import json
import math
import mmap
import os
import struct
import sys
from collections import namedtuple
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import product

import numpy as np
import xxhash
import zstandard

# Section 9.
ALIGN = 64
BLOCKS_PER_LEAF = 512
MAX_BLOCK_SAMPLES = 8388608
MAX_PART_RAW = 100663296
MAX_LISTED = 65536
MAX_SIDES = 16
MAX_LEVELS = 32
MAX_PARTS = 36
MAX_WINDOW_FRAMES = 1025
MAX_COEFFICIENTS = 4100
MAX_DIM = 2147483648
MAX_CHANNELS = 256
MAX_TIERS = 24
MAX_FRAMES = 9007199254740992
MAX_METADATA = 16777216
MAX_ROOT_RAW = 1073741824
MAX_DESCRIPTION = 16777216
MAX_DESCRIPTION_ITEMS = 65536

MAGIC = bytes.fromhex("89 57 53 50 0D 0A 1A 0A")
END_MAGIC = bytes.fromhex("89 57 53 50 45 4E 44 0A")
KEPT_LEAVES = 16  # read leaves that an archive keeps
LOST = "lost, or below a lost block: data were missing when the file was recovered"

class Layout:
    """A structure of fixed length: the names and `struct` codes of its fields, without padding."""

    def __init__(self, name: str, text: str):
        words = text.split()
        self.type = namedtuple(name, words[::2])
        self.struct = struct.Struct("<" + "".join(words[1::2]))
        self.size = self.struct.size

    def read(self, data: bytes, at: int = 0):
        return self.type(*self.struct.unpack_from(data, at))


# Sections 3 to 5.
HEADER = Layout("Header", "magic 8s major H minor H reserved I required Q optional Q id 16s needs 72s checksum Q")
FOOTER = Layout(
    "Footer",
    "id 16s total Q metadata_offset Q metadata_stored I metadata_raw I metadata_checksum Q root_offset Q"
    " root_stored I root_raw I root_checksum Q blocks Q leaves Q description_offset Q description_stored I"
    " description_raw I description_checksum Q checksum Q magic 8s",
)
FRAME = Layout("Frame", "tag 4s stored I raw I reserved I checksum Q")
BLOCK = Layout(
    "BlockEntry",
    "window I block I channel B tier B count H lost I step d min d max d reached d squared_error d dropped d",
)
PART = Layout(
    "Part",
    "kind B level B reserved H stored I raw I reserved_too I offset Q checksum Q count Q energy d largest d",
)
LEAF = Layout(
    "Leaf",
    "window I first_block I channel B tier B count H stored I raw I exact I data_offset Q offset Q checksum Q min d"
    " max d reached d squared_error d energy d dropped d coded Q outliers Q missing Q lost Q",
)

# Kinds of parts and sections (section 4).
LEVEL, OUTLIERS, MISSING, EXACT, SIDES, SUMS = 0, 1, 2, 3, 4, 5
KIND = {b"BLCK": 16, b"LEAF": 17, b"META": 18, b"ROOT": 19, b"STRT": 20, b"WNDW": 21, b"WEND": 22, b"DESC": 23}

# The totals of no blocks: reached, share, squared_error, min, max, then counts.
NO_BLOCKS = struct.pack("<ddddd", 0, 0, 0, math.inf, -math.inf) + bytes(24)

# Variants, in the order of section 6.
SAMPLES = ["u8", "i8", "u16", "i16", "u32", "i32", "f16", "f32", "f64"]
BOUNDS = ["pointwise", "rms", "relative", "sampled"]
BASES = ["haar", "multi", "samples", "learned"]
AXES = ["x", "y", "z", "t"]
STENCILS = ["linear", "cubic"]


class Damaged(Exception):
    """The file does not follow the format, or the requested samples are lost."""

    def __init__(self, place: str, reason: str, offset: int | None = None):
        super().__init__(f"{place}{'' if offset is None else f' at byte {offset}'}: {reason}")


class Unsupported(Damaged):
    """The file needs a reader of another version or with more features."""


def need(true, place: str, reason: str, offset: int | None = None) -> None:
    if not true:
        raise Damaged(place, reason, offset)


def align(offset: int) -> int:
    return -(-offset // ALIGN) * ALIGN


def finite(*values: float) -> bool:
    return all(math.isfinite(v) for v in values)


def is_range(low: float, high: float) -> bool:
    """Section 9: finite and in order, or (+inf, -inf)."""
    return (finite(low, high) and low <= high) or (low == math.inf and high == -math.inf)


def decompress(stored: bytes, raw: int, place: str, offset: int) -> bytes:
    """Exactly one zstd frame with content size and content checksum (the page's first lines)."""
    try:
        frame = zstandard.get_frame_parameters(stored)
        need(stored[:4] == b"\x28\xb5\x2f\xfd", place, "not a zstd frame", offset)
        need(frame.content_size == raw, place, "the zstd frame declares another length", offset)
        need(frame.has_checksum, place, "the zstd frame has no checksum", offset)
        out = zstandard.ZstdDecompressor().decompress(stored, allow_extra_data=False)
    except zstandard.ZstdError as e:
        raise Damaged(place, f"does not decompress: {e}", offset) from None
    need(len(out) == raw, place, "decompresses to another length", offset)
    return out


# ---------------------------------------------------------------- records (section 6)


class Record:
    """Reads the fields of a record in order, never beyond its end."""

    def __init__(self, data: bytes, place: str, at: int = 0):
        self.data, self.place, self.at = data, place, at

    def take(self, size: int) -> bytes:
        need(size <= len(self.data) - self.at, self.place, "ends too early", self.at)
        self.at += size
        return self.data[self.at - size : self.at]

    def get(self, code: str):
        values = struct.unpack("<" + code, self.take(struct.calcsize("<" + code)))
        return values[0] if len(values) == 1 else values

    def string(self) -> str:
        try:
            return self.take(self.get("Q")).decode("utf-8")
        except UnicodeDecodeError:
            raise Damaged(self.place, "a string is not UTF-8", self.at) from None

    def numbers(self, dtype: str) -> np.ndarray:
        size = np.dtype(dtype).itemsize
        return np.frombuffer(self.take(size * self.get("Q")), dtype)

    def list(self, item) -> list:
        return [item() for _ in range(self.get("Q"))]  # an item takes bytes: it ends with the data

    def option(self, value):
        flag = self.get("B")
        need(flag <= 1, self.place, "an option is neither 0 nor 1", self.at - 1)
        return value() if flag else None

    def variant(self, names: list[str]) -> str:
        number = self.get("I")
        need(number < len(names), self.place, f"there is no variant {number}", self.at - 4)
        return names[number]

    def end(self) -> None:
        need(self.at == len(self.data), self.place, "bytes follow the record", self.at)


@dataclass(frozen=True)
class Pyramid:
    order: tuple[str, ...]
    stencil: str
    growth: float
    most: float
    flags: int  # bits 0 to 2
    tiers: int  # bits 3 to 7: tiers above the blocks

    @staticmethod
    def read(r: Record) -> "Pyramid":
        order = tuple(r.list(lambda: r.variant(AXES)))
        stencil, growth, most, bits = r.variant(STENCILS), *r.get("ddB")
        p = Pyramid(order, stencil, growth, most, bits & 7, bits >> 3)
        need(len(set(order)) == len(order), r.place, "an axis is refined twice")
        need(1 <= p.growth <= 1e6 and 1 <= p.most <= 1e6, r.place, "growth or most is not in 1 .. 10^6")
        need(p.nested or not (p.flags & 4 or p.tiers), r.place, "ghost nodes or tiers without nested parts")
        need(p.tiers <= MAX_TIERS, r.place, "too many tiers")
        need(not p.tiers or {"x", "y", "z"} <= set(order), r.place, "tiers, but an axis of space is not refined")
        return p

    @property
    def single(self) -> bool:
        return bool(self.flags & 1)

    @property
    def nested(self) -> bool:
        return bool(self.flags & 2)

    def ghosts(self, extents: tuple[int, ...]) -> tuple[int, ...]:
        """1 along axes with ghost nodes."""
        axes = [a for a in range(3) if self.flags & 4 and AXES[a] in self.order and extents[a] % 2 == 0]
        return tuple(int(a in axes) for a in range(4))

    def lattice(self, extents: tuple[int, ...], tier: int) -> tuple[int, ...]:
        """Nodes of a block along x, y, z, t, ghost nodes included; its box has `extents` in voxels and coefficients."""
        units = (1 << tier, 1 << tier, 1 << tier, 1)
        return tuple(-(-(n + g) // u) for n, g, u in zip(extents, self.ghosts(extents), units))


@dataclass(frozen=True, eq=False)  # eq=False: hashed by identity, for the caches below
class Window:
    first_frame: int
    frames: int
    basis: str
    coefficients: int
    levels: list[int]
    functions: np.ndarray
    pyramid: Pyramid | None
    coarseness: float
    range: tuple[float, float]
    digest: int
    delta: float
    reached: float
    share: float
    squared_error: float
    min: float
    max: float
    missing: int
    coded: int
    outliers: int
    bytes: bytes  # the record itself: window section and end repeat it

    @staticmethod
    def read(r: Record) -> "Window":
        begin = r.at
        head = [*r.get("QI"), r.variant(BASES), r.get("I"), r.numbers("<u4").tolist(), r.numbers("<i2")]
        head += [r.option(lambda: Pyramid.read(r)), r.get("d"), r.get("dd"), r.get("Q")]
        w = Window(*head, *r.get("ddddddQQQ"), r.data[begin : r.at])
        w.check(r.place + f", window from frame {w.first_frame}")
        return w

    def check(self, place: str) -> None:
        need(1 <= self.frames <= MAX_WINDOW_FRAMES, place, "too few or too many frames")
        need(self.coefficients == coefficients_of(self.basis, self.frames), place, "coefficients do not fit the basis")
        need(self.coefficients <= MAX_COEFFICIENTS, place, "too many coefficients")
        if self.pyramid is None:
            need(len(self.levels) <= MAX_LEVELS and min(self.levels, default=0) >= 1, place, "bad list of levels")
            need(sum(self.levels) == self.coefficients, place, "levels do not sum up to the coefficients")
        else:
            need(not self.levels, place, "levels and a pyramid")
            need("t" not in self.pyramid.order or self.basis == "samples", place, "t is refined without samples")
        count = len(self.functions)
        need(count == 0 or self.basis == "learned", place, "functions without a learned basis")
        need(count % self.frames == 0 and count <= self.frames**2, place, "bad count of functions")
        need(finite(self.coarseness) and self.coarseness >= 0, place, "bad coarseness")
        need(is_range(*self.range) and is_range(self.min, self.max), place, "bad range")
        need(finite(self.delta, self.reached, self.share), place, "an error is not finite")
        need(self.squared_error >= 0, place, "bad squared error")

    @property
    def level_parts(self) -> int:
        return 4 if self.pyramid else len(self.levels)

    @property
    def tiers(self) -> int:
        """Above the blocks."""
        return self.pyramid.tiers if self.pyramid else 0


@dataclass
class Metadata:
    dims: tuple[int, int, int]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]
    sample: str
    block_edge: int
    channels: int
    frames: int
    times: np.ndarray
    variable: str | None
    bound: dict
    tolerance: float
    missing_value: float | None
    windows: list[Window]
    settings: list[tuple[str, str]]
    program: str
    start: bytes  # the record of the start: this one without frames, times and windows

    @property
    def kept(self) -> list[str]:
        """The words of the setting `keep`."""
        return [word for name, words in self.settings if name == "keep" for word in words.split()]

    @property
    def keeps_range(self) -> bool:
        return "range" in self.kept or ("clip", "true") in self.settings

    @property
    def sides(self) -> list[float]:
        """The kept values, ascending: samples stay below, at or above each."""
        named = [float(value) for word in self.kept if word.startswith("side=") for value in word[5:].split(",")]
        return sorted({value + 0.0 for value in named} | ({0.0} if "sign" in self.kept else set()))

    @staticmethod
    def read(data: bytes) -> "Metadata":
        r = Record(data, "metadata")
        head = [r.get("QQQ"), r.get("ddd"), r.get("ddd"), r.variant(SAMPLES), *r.get("IH")]
        a = r.at
        head += [r.get("Q"), r.numbers("<f8")]
        b = r.at
        head += [r.option(r.string), read_bound(r), r.get("d"), r.option(lambda: r.get("d"))]
        c = r.at
        windows = r.list(lambda: Window.read(r))
        d = r.at
        tail = [r.list(lambda: (r.string(), r.string())), r.string()]
        r.end()
        m = Metadata(*head, windows, *tail, data[:a] + bytes(16) + data[b:c] + bytes(8) + data[d:])
        m.check()
        return m

    def check(self) -> None:
        place = "metadata"
        need(all(1 <= n <= MAX_DIM for n in self.dims), place, "an extent is 0 or too large")
        need(finite(*self.spacing, *self.origin), place, "the grid is not finite")
        need(self.block_edge >= 1, place, "no block edge")
        need(1 <= self.channels <= MAX_CHANNELS, place, "no channel or too many")
        need(self.frames <= MAX_FRAMES, place, "too many frames")
        need(len(self.times) in (0, self.frames), place, "times do not fit the frames")
        need(np.isfinite(self.times).all(), place, "a time is not finite")
        need(self.blocks(0) < 1 << 32, place, "too many blocks")
        largest = math.prod(min(self.block_edge, n) for n in self.dims)
        frame = 0
        for w in self.windows:
            need(w.first_frame == frame, place, f"no window begins with frame {frame}")
            need(largest * max(w.frames, w.coefficients) <= MAX_BLOCK_SAMPLES, place, "blocks are too large")
            need(w.tiers == 0 or self.block_edge % 2 == 0, place, "tiers, but an odd block edge")
            frame += w.frames
        need(frame == self.frames, place, "windows do not cover the frames")

    @property
    def dtype(self) -> np.dtype:
        return np.dtype("<" + self.sample[0] + str(int(self.sample[1:]) // 8))

    def grid(self, tier: int) -> tuple[int, ...]:
        return tuple(-(-n // (self.block_edge << tier)) for n in self.dims)

    def blocks(self, tier: int) -> int:
        """Of one window and channel."""
        return math.prod(self.grid(tier))

    def position(self, block: int, tier: int) -> tuple[int, int, int]:
        """bx, by, bz of a block (section 1)."""
        nx, ny, _ = self.grid(tier)
        return (block % nx, block // nx % ny, block // (nx * ny))

    def number(self, position: tuple[int, int, int], tier: int) -> int:
        """Of the block at bx, by, bz."""
        nx, ny, _ = self.grid(tier)
        return position[0] + nx * (position[1] + ny * position[2])

    def above(self, block: int, tier: int) -> int:
        """The number of the block above."""
        return self.number(tuple(b // 2 for b in self.position(block, tier)), tier + 1)

    def box(self, block: int, tier: int) -> tuple[slice, slice, slice]:
        """The voxels of a block along x, y, z (section 1)."""
        edge = self.block_edge << tier
        return tuple(slice(b * edge, min((b + 1) * edge, n)) for b, n in zip(self.position(block, tier), self.dims))

    def runs(self, window: int):
        """Tier, channel and first block of a window's leaves, in their order."""
        for tier in range(self.windows[window].tiers, -1, -1):
            for channel in range(self.channels):
                for first in range(0, self.blocks(tier), BLOCKS_PER_LEAF):
                    yield tier, channel, first

    def descent(self, window: int):
        """Tier and number of a channel's blocks, each right before those below it: few decoded ones have to be kept."""

        def from_block(tier: int, position: tuple[int, int, int]):
            yield tier, self.number(position, tier)
            if tier:
                below = [range(2 * b, min(2 * b + 2, n)) for b, n in zip(position, self.grid(tier - 1))]
                for z, y, x in product(*below[::-1]):
                    yield from from_block(tier - 1, (x, y, z))

        top = self.windows[window].tiers
        for z, y, x in product(*map(range, self.grid(top)[::-1])):
            yield from from_block(top, (x, y, z))

    def window_section(self, number: int) -> bytes:
        """The record of a window section: number, the window with the totals of no blocks, then its times."""
        w = self.windows[number]
        times = self.times[w.first_frame : w.first_frame + w.frames]
        window = w.bytes[: -len(NO_BLOCKS)] + NO_BLOCKS
        return struct.pack("<I", number) + window + struct.pack("<Q", len(times)) + times.tobytes()

    def window_end(self, number: int) -> bytes:
        """The record of a window's end: the window's number, and the totals of its blocks."""
        return struct.pack("<I", number) + self.windows[number].bytes[-len(NO_BLOCKS) :]


def read_bound(r: Record) -> dict:
    name = r.variant(BOUNDS)
    if name == "relative":
        return {"name": name, "floor": r.get("d")}
    if name == "sampled":
        return {"name": name, **dict(zip(("samples", "seed"), r.get("IQ")))}
    return {"name": name}


# ---------------------------------------------------------------- directory (section 5)


class Block(namedtuple("Block", BLOCK.type._fields + ("parts", "bytes"))):
    """A block's entry, its parts and its bytes. The block's header repeats the bytes."""

    @staticmethod
    def read(r: Record) -> "Block":
        begin = r.at
        head = BLOCK.read(r.take(BLOCK.size))
        need(head.count <= MAX_PARTS, r.place, "too many parts in a block")
        parts = [PART.read(r.take(PART.size)) for _ in range(head.count)]
        return Block(*head, parts, r.data[begin : r.at])

    @property
    def place(self) -> str:
        return f"window {self.window}, tier {self.tier}, channel {self.channel}, block {self.block}"

    @property
    def where(self) -> tuple[int, int, int, int]:
        """What its checksums depend on."""
        return (self.window, self.block, self.channel, self.tier)

    @property
    def exact(self) -> bool:
        return any(p.kind == EXACT for p in self.parts)

    def end(self, offset: int) -> int:
        """Where the block ends if it begins at `offset`."""
        return offset + FRAME.size + len(self.bytes) + sum(p.stored for p in self.parts)

    def count_of(self, kind: int) -> int:
        return sum(p.count for p in self.parts if p.kind == kind)


def name_of(leaf) -> str:
    return f"leaf of window {leaf.window}, tier {leaf.tier}, channel {leaf.channel}, block {leaf.first_block}"


def sums(blocks: list[Block]) -> dict:
    """Recomputes the statistics in a leaf's entry; float sums run in order, from 0."""
    energies = [p.energy for b in blocks for p in b.parts if p.kind == LEVEL]
    return {
        "exact": sum(b.exact for b in blocks),
        "min": min((b.min for b in blocks), key=ascending),
        "max": max((b.max for b in blocks), key=ascending),
        "reached": max([0.0, *[b.reached for b in blocks]], key=ascending),
        "squared_error": plain_sum(b.squared_error for b in blocks),
        "energy": plain_sum(energies),
        "dropped": plain_sum(b.dropped for b in blocks),
        "coded": sum(b.count_of(LEVEL) for b in blocks),
        "outliers": sum(b.count_of(OUTLIERS) for b in blocks),
        "missing": sum(b.count_of(MISSING) for b in blocks),
        "lost": sum(b.lost for b in blocks),
    }


def ascending(value: float) -> tuple[float, float]:
    """-0 is smaller than 0."""
    return (value, math.copysign(1, value))


def same(a, b) -> bool:
    """To the bit: -0 is not 0."""
    return ascending(a) == ascending(b)


def plain_sum(values) -> float:
    """One rounding after each term: sum() compensates from Python 3.12 on."""
    total = 0.0
    for v in values:
        total += v
    return total


def check_block(b: Block, w: Window, size: tuple[int, ...], sample_bytes: int, announced: set) -> None:
    """Sections 5 and 9: an entry by itself and with the block's geometry. `announced`: the (kind, level) pairs whose feature the header has."""
    place = b.place
    need(b.lost <= 1, place, "lost is neither 0 nor 1")
    need(finite(b.step, b.reached) and b.reached >= 0, place, "step or error is not finite")
    need(is_range(b.min, b.max), place, "bad range")
    need(b.squared_error >= 0 and b.dropped >= 0, place, "bad squared error or dropped energy")
    if b.lost:
        empty = not b.parts and b.min == math.inf
        need(empty and b.step == b.reached == b.squared_error == b.dropped == 0, place, "not empty, but lost")
    if b.tier:
        empty = b.min == math.inf and b.reached == b.squared_error == b.dropped == 0
        need(empty, place, "range or errors, but no samples of its own")
        need(all(p.kind == LEVEL for p in b.parts), place, "parts that are no levels in a tier above 0")
    if not b.tier and w.tiers and not b.step:
        need(all(p.kind != LEVEL for p in b.parts), place, "levels without a step")
    keys = [(p.kind, p.level) for p in b.parts]
    need(all(k < l for k, l in zip(keys, keys[1:])), place, "parts do not ascend")
    need(not b.exact or all(p.kind in (MISSING, EXACT) for p in b.parts), place, "exact beside levels or outliers")
    need(sum(p.kind == EXACT for p in b.parts) <= 1, place, "two exact parts")
    for key in ((EXACT, 1), (SIDES, 0), (SUMS, 0)):
        need(key in announced or key not in keys, place, f"parts of kind {key[0]}, level {key[1]} are not announced")
    for p in b.parts:
        check_part(p, w, b.tier, size, sample_bytes, f"{place}, part of kind {p.kind}, level {p.level}")


def check_part(p, w: Window, tier: int, size: tuple[int, ...], s: int, place: str) -> None:
    need(p.reserved == p.reserved_too == 0, place, "reserved bytes are not zero")
    need(p.kind <= SUMS, place, "there is no such kind")
    need(p.level < {LEVEL: w.level_parts, EXACT: 2}.get(p.kind, 1), place, "there is no such level")
    need(p.count >= 1, place, "count is 0")
    need(p.energy >= 0 and finite(p.largest) and p.largest >= 0, place, "bad energy or largest amount")
    need(p.kind == LEVEL or p.energy == p.largest == 0, place, "energy, but not of a level")
    voxels = math.prod(size)
    samples = voxels * w.frames
    most = samples
    if p.kind == LEVEL and w.pyramid:
        mine = [b.counts for b in boxes((*size, w.coefficients), w.pyramid, tier) if b.part == p.level]
        most = sum(map(math.prod, mine))
        fits = p.raw <= lattice_most(sum(math.prod(cells_of(b)) for b in mine), most)
    elif p.kind == LEVEL:
        most = w.levels[p.level] * voxels
        fits = p.raw in [1 + -(-most // 8) + width * p.count for width in (1, 2, 3, 4)]
    elif p.kind == OUTLIERS:
        fits = p.raw == (4 + s) * p.count
    elif p.kind == MISSING:
        fits = p.raw == -(-samples // 8) + s * p.count
    elif p.kind == SIDES:
        most = MAX_SIDES * samples
        fits = p.raw <= MAX_SIDES * (13 + 3 * samples + 8)
    elif p.kind == SUMS:
        most = w.frames
        fits = p.raw <= 8 + 8 * w.frames + 5 * (samples // 4)
    elif p.level == 1:
        cells = math.prod(cells_of((*size, w.frames)))
        longest = 8 + s * min(MAX_LISTED, samples) + lattice_most(cells, samples)
        fits = p.count == samples and p.raw <= longest
    else:
        fits = p.count == samples and p.raw == s * samples
    need(p.count <= most, place, "count is too large")
    need(fits and p.raw <= MAX_PART_RAW, place, "length does not fit count and geometry")


# ---------------------------------------------------------------- payloads (section 7)


def planes(data: bytes, dtype, count: int) -> np.ndarray:
    """Byte planes: all lowest bytes of the values, then all second ones, and so on."""
    dtype = np.dtype(dtype)
    rows = np.frombuffer(data, np.uint8).reshape(-1, count)
    rows = np.concatenate([rows, np.zeros((dtype.itemsize - len(rows), count), np.uint8)])
    return np.ascontiguousarray(rows.T).reshape(-1).view(dtype)


def bitmap(data: bytes, bits: int, place: str) -> np.ndarray:
    """`bits` bits, the first in the lowest bit of the first byte; padding bits are zero."""
    out = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
    need(not out[bits:].any(), place, "padding bits are not zero")
    return out[:bits].astype(bool)


def codes_of(values: np.ndarray) -> np.ndarray:
    """Codes of `zigzag(code) - 1`: 0, 1, 2, 3, ... is -1, 1, -2, 2, ..."""
    z = values.astype(np.int64) + 1
    return np.where(z % 2 == 0, z // 2, -((z + 1) // 2))


def read_level(data: bytes, n: int, count: int, place: str) -> np.ndarray:
    """A level without a pyramid: width, bitmap, byte planes."""
    width, split = data[0], 1 + -(-n // 8)
    need(1 <= width <= 4, place, "width is not 1 to 4")
    need(len(data) == split + width * count, place, "length does not fit width and count")
    nonzero = bitmap(data[1:split], n, place)
    need(nonzero.sum() == count, place, "the bitmap does not fit the count")
    values = planes(data[split:], "<u4", count)
    need(width == 1 or values.max() >> (8 * width - 8), place, "width is not the least")
    need(values.max() < 0xFFFFFFFF, place, "a code is too large")
    out = np.zeros(n, np.int64)
    out[nonzero] = codes_of(values)
    return out


def read_outliers(data: bytes, dtype, count: int, samples: int, place: str):
    """Sample numbers and samples."""
    gaps = planes(data[: 4 * count], "<u4", count).astype(np.uint64)
    numbers = np.cumsum(gaps + np.uint64(1)) - np.uint64(1)
    need(numbers[-1] < samples, place, "an outlier is beyond the last sample")
    return numbers.astype(np.int64), planes(data[4 * count :], dtype, count)


def read_missing(data: bytes, dtype, count: int, samples: int, place: str):
    """The mask of missing samples, and their values."""
    split = -(-samples // 8)
    mask = bitmap(data[:split], samples, place)
    need(mask.sum() == count, place, "the bitmap does not fit the count")
    return mask, planes(data[split:], dtype, count)


def read_listed(data: bytes, dtype: np.dtype, extents: tuple[int, ...], place: str) -> np.ndarray:
    """Exact samples: a list of values, and for each sample its place in the list. `extents` are along x, y, z, t."""
    r = Record(data, place)
    n, base, predictor = r.get("IHH")
    need(1 <= n <= MAX_LISTED, place, "too few or too many values in the list")
    need(base < n, place, "the base is not in the list")
    need(predictor <= 2, place, "there is no such predictor")
    values = planes(r.take(dtype.itemsize * n), f"<u{dtype.itemsize}", n)
    need((values[:-1] < values[1:]).all(), place, "the values do not ascend")
    (places,) = read_lattice(r, [extents], True, None)
    if predictor:
        places = np.cumsum(places, axis=3 if predictor == 1 else 0)  # [t, z, y, x]
    places = places + base
    need(places.min() >= 0 and places.max() < n, place, "a place is not in the list")
    return values.view(dtype)[places].reshape(-1)


def read_sides(data: bytes, samples: int, place: str) -> list[tuple[int, float, bytes]]:
    """For each value: the sides of the source's samples, the reach, and the bits."""
    r, found = Record(data, place), []
    while r.at < len(data):
        need(len(found) < MAX_SIDES, place, "too many values")
        sides = r.get("B")
        need(sides < 8, place, "there is no such side")
        if sides:
            reach, n = r.get("dI")
            need(finite(reach) and reach >= 0, place, "bad reach")
            need(n <= 3 * samples + 8, place, "too many bits")
            found.append((sides, reach, r.take(n)))
        else:
            found.append((0, 0.0, b""))
    need(found, place, "no values")
    return found


def add_to_sums(out: np.ndarray, data: bytes, p, frames: int, place: str) -> np.ndarray:
    """Shifts the samples [frame * voxels + voxel] of each frame so that their sum is kept."""
    need(len(data) >= 8 + 8 * frames, place, "ends within the codes")
    unit, n = struct.unpack("<d", data[:8])[0], len(out) // frames
    need(finite(unit) and unit > 0, place, "bad unit")
    unsigned = [int(code) for code in planes(data[8 : 8 + 8 * frames], "<u8", frames)]
    codes = [code >> 1 ^ -(code & 1) for code in unsigned]
    need(all(abs(code) <= 2**53 for code in codes), place, "a code is too large")
    need(sum(code != 0 for code in codes) == p.count, place, "wrong count")
    r, unshifted, before = Record(data, place), [], 0
    r.at = 8 + 8 * frames
    while r.at < len(data):
        unshifted.append(before + take_number(r))
        before = unshifted[-1] + 1
    need(before <= len(out) and len(unshifted) <= len(out) // 4, place, "a sample is not in the block, or too many")
    old, out = out, out.reshape(frames, n).copy()
    stride = next(m for m in range(n * 618 // 1000 + 1, 2 * n + 2) if math.gcd(m, n) == 1)
    rank = np.arange(n) * stride % n
    for frame, code in enumerate(codes):
        if code and out.dtype.kind == "f":
            out[frame] = to_samples(out[frame].astype(np.float64) + code * unit, out.dtype, place)
        elif code:
            out[frame] = to_samples(out[frame].astype(np.float64) + (code // n + (rank < code % n)), out.dtype, place)
    out = out.reshape(-1)
    out[unshifted] = old[unshifted]
    return out


class Coder:
    """Reads bits that were coded arithmetically, each of a kind."""

    def __init__(self, data: bytes):
        self.data, self.at, self.range, self.code, self.chances = data, 4, 2**32 - 1, 0, {}
        self.code = int.from_bytes(data[:4].ljust(4, b"\0"), "big")

    def take(self, kind) -> int:
        chance, shift = self.chances.get(kind, (32768, 1))
        bound = (self.range >> 16) * chance
        if bit := int(self.code >= bound):
            self.code, self.range = self.code - bound, self.range - bound
            chance -= chance >> shift
        else:
            self.range = bound
            chance += (65536 - chance) >> shift
        self.chances[kind] = chance, min(shift + 1, 6)
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.range, self.code, self.at = self.range << 8, (self.code << 8 | byte) & 0xFFFFFFFF, self.at + 1
        return bit


def nearest_samples(dtype: np.dtype, value: float, missing: float | None) -> list:
    """The samples below, at and above a value that are nearest to it; None where there are none."""

    def step(sample, up: bool):
        if dtype.kind == "f":
            return np.nextafter(sample, dtype.type(math.inf if up else -math.inf))
        limits, one = np.iinfo(dtype), 1 if up else -1
        return sample + one if limits.min <= sample + one <= limits.max else None

    def beside(up: bool):
        if dtype.kind == "f":
            with np.errstate(all="ignore"):
                sample = dtype.type(value)
            first = sample if (float(sample) > value if up else float(sample) < value) else step(sample, up)
        else:
            limits = np.iinfo(dtype)
            first = max(math.floor(value) + 1, limits.min) if up else min(math.ceil(value) - 1, limits.max)
            first = first if limits.min <= first <= limits.max else None
        if first is not None and missing is not None and float(first) == missing:
            first = step(first, up)
        return first

    with np.errstate(all="ignore"):
        is_sample = float(dtype.type(value)) == value if dtype.kind == "f" else value == int(value)
    return [beside(False), value if is_sample else None, beside(True)]


def put_on_sides(out: np.ndarray, value: float, code, size: tuple[int, ...], fixed: np.ndarray, missing) -> np.ndarray:
    """Moves samples to their sides of a value. `out` and `fixed` are [frame * voxels + voxel]."""
    sides, reach, bits = code
    if not sides:
        return out
    out, coder, nearest = out.copy(), Coder(bits), nearest_samples(out.dtype, value, missing)
    (nx, ny, nz), voxels = size, math.prod(size)
    with np.errstate(all="ignore"):
        numbers = out.astype(np.float64)
        distances = np.abs(numbers - value)
        relative = np.nan_to_num(distances / np.float64(reach), nan=0.0, posinf=0.0)
    for i in np.flatnonzero((distances <= reach) & ~fixed):
        side = 0 if numbers[i] < value else 2 if numbers[i] > value else 1
        others = [other for other in range(3) if other != side and sides >> other & 1]
        if not others:
            continue
        steps = (1, i % nx), (nx, i // nx % ny), (nx * ny, i // (nx * ny) % nz), (voxels, i // voxels)
        above = sum(bool(at and numbers[i - step] > value) for step, at in steps)
        kind = side, min(15, math.floor(16 * math.sqrt(relative[i]))), above
        if sides >> side & 1 and not coder.take(kind):
            continue
        to = others[1] if len(others) == 2 and coder.take(side) else others[0]
        if nearest[to] is not None:
            out[i] = nearest[to]
            numbers[i] = out[i]
    return out


# ---------------------------------------------------------------- lattice codes (section 7)

STREAM_OF_ACTIVITY = [0] + [1] * 2 + [2] * 5 + [3] * 8 + [4] * 17  # a is 0 .. 32
ONES = [bin(i).count("1") for i in range(256)]


class Bits:
    """Bits of a byte string from `at` on, the lowest first."""

    def __init__(self, data: bytes, at: int, place: str):
        self.data, self.at, self.place, self.bit = data, at, place, 0

    def take(self, count: int) -> int:
        value = 0
        for i in range(count):
            need(self.at < len(self.data), self.place, "ends within a table of frequencies")
            value |= (self.data[self.at] >> self.bit & 1) << i
            self.bit += 1
            if self.bit == 8:
                self.bit, self.at = 0, self.at + 1
        return value

    def end(self) -> int:
        """The next whole byte; the rest of the last is zero."""
        if self.bit:
            need(self.data[self.at] >> self.bit == 0, self.place, "padding bits are not zero")
            self.at += 1
        return self.at


def take_number(r: Record) -> int:
    """A number of 1 to 5 bytes with 7 bits each, the lowest first, in as few bytes as possible."""
    value = 0
    for i in range(5):
        byte = r.take(1)[0]
        value |= (byte & 127) << 7 * i
        if byte < 128:
            need(byte or i == 0, r.place, "a number is longer than it has to be")
            return value
    raise Damaged(r.place, "a number is longer than 5 bytes")


def cells_of(counts) -> tuple[int, int, int, int]:
    x, y, z, t = counts
    return (-(-x // 2), -(-y // 2), -(-z // 2), t)


def lattice_most(cells: int, codes: int) -> int:
    """The largest raw length that is allowed."""
    s = cells + codes
    return 45 + s + 5 * (9 + s // 4096) + -(-29 * codes // 8)


def read_lattice(r: Record, boxes: list, nested: bool, count: int | None) -> list[np.ndarray]:
    """The codes of boxes with these extents, as arrays [t, z, y, x]. The record ends with them.

    `count` is the number of nonzero codes. None: the part does not say.
    """
    place = r.place
    lengths = [take_number(r) for _ in range(9)]
    cells = [math.prod(cells_of(b)) for b in boxes]
    need(sum(lengths[:5]) == sum(cells), place, "significance streams do not fit the cells")
    need(count is None or sum(lengths[5:]) == count, place, "value streams do not fit the count")
    need(sum(lengths[5:]) <= sum(map(math.prod, boxes)), place, "value streams do not fit the codes")
    symbols = read_segments(r, nested, sum(lengths))
    ends = np.cumsum([0] + lengths)
    streams = [symbols[a:b] for a, b in zip(ends, ends[1:])]
    significance, activity = read_significance(streams[:5], boxes, place)
    nonzero = np.unpackbits(significance[:, None], axis=1, bitorder="little").astype(bool)
    values = read_values(r, streams[5:], nonzero.sum(axis=1), activity, place)
    codes = np.zeros(nonzero.shape, np.int64)
    codes[nonzero] = codes_of(values)
    ends = np.cumsum([0] + cells)
    return [uncell(codes[a:b], box, place) for a, b, box in zip(ends, ends[1:], boxes)]


def read_significance(streams: list[bytes], boxes: list, place: str):
    """Significance byte and activity of every cell of all boxes, in order."""
    bytes_, activities = bytearray(), bytearray()
    next_of_stream = [iter(s).__next__ for s in streams]
    next_of_activity = [next_of_stream[s] for s in STREAM_OF_ACTIVITY]
    used = [0] * 5
    for box in boxes:
        x, y, z, t = cells_of(box)
        sy, sz, st = x + 1, (x + 1) * (y + 1), (x + 1) * (y + 1) * (z + 1)
        counts = bytearray(st * (t + 1))  # one cell of zeros before the first along each axis
        inner = np.arange(len(counts)).reshape(t + 1, z + 1, y + 1, x + 1)[1:, 1:, 1:, 1:]
        begin = len(activities)
        try:
            for i in inner.ravel().tolist():
                a = counts[i - 1] + counts[i - sy] + counts[i - sz] + counts[i - st]
                byte = next_of_activity[a]()
                counts[i] = ONES[byte]
                bytes_.append(byte)
                activities.append(a)
        except StopIteration:
            raise Damaged(place, "a significance stream ends too early") from None
        for a, n in enumerate(np.bincount(np.frombuffer(activities[begin:], np.uint8), minlength=33)):
            used[STREAM_OF_ACTIVITY[a]] += n
    need(used == [len(s) for s in streams], place, "a significance stream ends too late")
    return np.frombuffer(bytes_, np.uint8), np.frombuffer(activities, np.uint8)


def read_values(r: Record, streams: list[bytes], c: np.ndarray, a: np.ndarray, place: str) -> np.ndarray:
    """`zigzag(code) - 1` of all nonzero codes, in order; the low bits end the payload."""
    of_cell = np.searchsorted([4, 10, 20], 2 * c.astype(np.int64) + a // 2, side="right")
    of_value = np.repeat(of_cell, c)
    symbols = np.zeros(len(of_value), np.int64)
    for i, stream in enumerate(streams):
        mask = of_value == i
        need(mask.sum() == len(stream), place, "a value stream ends too early or too late")
        symbols[mask] = np.frombuffer(stream, np.uint8)
    need(not (symbols > 227).any(), place, "a symbol is above 227")
    large = symbols >= 128
    bits, top = np.divmod(symbols[large] - 128, 4)
    low = bits + 8 - 3  # a value of n bits has n - 3 low ones
    begins = np.cumsum(low) - low
    rest = r.take(-(-int(low.sum()) // 8))
    r.end()
    pool = np.append(bitmap(rest, int(low.sum()), place), np.zeros(32, bool)).astype(np.int64)
    values = (4 + top) << low
    for i in range(29):
        values |= np.where(i < low, pool[begins + np.minimum(i, low)] << i, 0)
    symbols[large] = values
    need(not (symbols >= 0xFFFFFFFF).any(), place, "a code is too large")
    return symbols


def uncell(codes: np.ndarray, box, place: str) -> np.ndarray:
    """Arranges cells of 8 codes, bit dx + 2 dy + 4 dz, in a box [t, z, y, x]; cuts off codes beyond its far faces."""
    x, y, z, t = cells_of(box)
    full = codes.reshape(t, z, y, x, 2, 2, 2).transpose(0, 1, 4, 2, 5, 3, 6).reshape(t, 2 * z, 2 * y, 2 * x)
    inside = full[:, : box[2], : box[1], : box[0]]
    need(np.count_nonzero(inside) == np.count_nonzero(full), place, "a code beyond the far faces")
    return inside


def read_segments(r: Record, nested: bool, total: int) -> bytes:
    """One string of `total` symbols."""
    out = bytearray()
    while len(out) < total:
        length, kind = divmod(take_number(r), 8 if nested else 4)
        need(kind <= 5, r.place, "there is no such kind of segment")
        need(1 <= length <= total - len(out), r.place, "a segment is empty or ends after the string")
        if kind == 0:
            out += r.take(length)
        elif kind == 1:
            out += r.take(1) * length
        else:
            usual = 4 if length >= 1024 else 1
            out += read_coded(r, length, 14 if kind % 2 else 12, 32 if kind >= 4 else usual)
    return bytes(out)


def read_frequencies(r: Record, b: int) -> np.ndarray:
    """Frequencies of all byte values; they add up to 2^b."""
    bits = Bits(r.data, r.at, r.place)
    frequencies = np.zeros(256, np.int64)
    length, left = b, 1 << b
    for value in range(256):
        if bits.take(1):
            if bits.take(1):
                length = bits.take(4)
            else:
                length += -1 if bits.take(1) else 1
        need(0 <= length <= b, r.place, "a frequency is too long")
        if length:
            frequencies[value] = 1 << (length - 1) | bits.take(length - 1)
        left -= int(frequencies[value])
        if left <= 0:
            break
    need(left == 0, r.place, "frequencies do not add up")
    r.at = bits.end()
    return frequencies


def read_coded(r: Record, length: int, b: int, lanes: int) -> bytearray:
    """A segment of kind 2 to 5, after its number."""
    frequencies = read_frequencies(r, b)
    symbol = np.repeat(np.arange(256), frequencies)  # of every slot
    begin = np.cumsum(frequencies) - frequencies
    rest = (np.arange(1 << b) - begin[symbol]).tolist()
    frequency = frequencies[symbol].tolist()
    symbol = symbol.tolist()
    words = take_number(r)
    states = list(struct.unpack(f"<{lanes}I", r.take(4 * lanes)))
    need(min(states) >= 65536, r.place, "a state is below 65536")
    next_word = iter(np.frombuffer(r.take(2 * words), "<u2").tolist())
    out, mask, lane = bytearray(length), (1 << b) - 1, lanes - 1
    try:
        for i in range(length):
            state = states[i & lane]
            slot = state & mask
            out[i] = symbol[slot]
            state = frequency[slot] * (state >> b) + rest[slot]
            if state < 65536:
                state = state << 16 | next(next_word)
            states[i & lane] = state
    except StopIteration:
        raise Damaged(r.place, "words end too early") from None
    need(all(s == 65536 for s in states), r.place, "a state does not end at 65536")
    need(next(next_word, None) is None, r.place, "words are left")
    return out


# ---------------------------------------------------------------- pyramids (section 8)


@dataclass(frozen=True)
class Pass:
    part: int
    level: int
    axis: int | None  # None: the first pass
    first: tuple[int, ...]  # f and d along x, y, z, t, on the lattice of the tier
    stride: tuple[int, ...]
    counts: tuple[int, ...]  # nodes along x, y, z, t


@lru_cache(256)
def passes(extents: tuple[int, ...], p: Pyramid, tier: int) -> list[Pass]:
    """The passes of a block in their order, each with the part that its codes are in without nested parts.

    `extents` are the voxels of its box and its coefficients.
    """
    axes = [AXES.index(a) for a in p.order]
    outer = tuple(n + g for n, g in zip(extents, p.ghosts(extents)))
    top = max(p.tiers, max([(outer[a] - 1).bit_length() for a in axes], default=0))
    unit = 1 << tier
    units = (unit, unit, unit, 1)

    def one(part: int, level: int, axis: int | None, along: dict) -> Pass:
        first, stride = zip(*[along.get(a, (0, 1)) for a in range(4)])
        stride = [max(d, u) for d, u in zip(stride, units)]
        apart = [d // 2 if a == axis else d for a, d in enumerate(stride)]  # the distance of all nodes so far
        ends = [o if d > 1 else n for n, o, d in zip(extents, outer, apart)]
        counts = tuple(-(-(n - f) // d) for n, f, d in zip(ends, first, stride))
        on_lattice = [tuple(n // u for n, u in zip(numbers, units)) for numbers in (first, stride)]
        return Pass(part, level, axis, *on_lattice, counts)

    out = [one(0, top, None, {a: (0, 1 << top) for a in axes})] if tier == p.tiers else []
    for level in range(top - 1, -1, -1):
        near, far = 1 << level, 2 << level
        for at, axis in enumerate(axes):
            if outer[axis] <= near or not in_tier(level, axis, tier, p):
                continue
            along = {a: (0, near if i < at else far) for i, a in enumerate(axes)}
            along[axis] = (near, far)
            last_t = axis == 3 and at == len(axes) - 1
            part = 3 if last_t and level == 0 else max(0, min(2, p.tiers + 2 - level))
            out.append(one(part, level, axis, along))
    return out


def in_tier(level: int, axis: int, tier: int, p: Pyramid) -> bool:
    """Whether the blocks of a tier have this pass."""
    if tier == p.tiers:
        return axis == 3 or level >= tier
    if axis == 3:
        return level < tier or (level == tier and p.order[0] != "t")  # then t comes after an axis of space
    return level == tier


@dataclass(frozen=True)
class Box:
    part: int
    number: int  # of its pass
    steps: tuple[int, int, int]  # s along x, y, z
    counts: tuple[int, ...]  # codes along x, y, z, t
    others: tuple[int, ...]  # nodes at even numbers along all of these axes have no code in this box; empty: no such nodes


@lru_cache(256)
def boxes(extents: tuple[int, ...], p: Pyramid, tier: int) -> list[Box]:
    """The boxes of a block's codes, in the order of their passes."""
    out = []
    for number, q in enumerate(passes(extents, p, tier)):
        if not (p.nested and q.axis == 3):
            out.append(Box(q.part, number, (1, 1, 1), q.counts, ()))
            continue
        if tier < p.tiers:
            out.append(Box(q.part, number, (1, 1, 1), q.counts, tuple(a for a in range(3) if q.stride[a] == 1)))
            continue

        def steps(n: int) -> tuple[int, ...]:
            return tuple(max(1, (1 << n) // q.stride[a]) if AXES[a] in p.order else 1 for a in range(3))

        for n in (2, 1, 0):
            s, coarser = steps(n), steps(n + 1)
            others = tuple(a for a in range(3) if s[a] != coarser[a]) if n < 2 else ()
            if n == 2 or others:
                part = 0 if n == 2 else 1 if n == 1 else q.part
                counts = (*(-(-c // e) for c, e in zip(q.counts, s)), q.counts[3])
                out.append(Box(part, number, s, counts, others))
    return out


def predict(e: np.ndarray, count: int, stencil: str) -> np.ndarray:
    """Predicts the `count` nodes between e[0] .. e[n-1] (first axis) by the table of stencils, its last rows first."""
    n = len(e)
    c = e.dtype.type
    p = np.empty((count, *e.shape[1:]), e.dtype)
    if n == 1:
        p[:] = e[0]
        return p
    p[: n - 1] = c(1 / 2) * e[:-1] + c(1 / 2) * e[1:]
    if stencil == "cubic" and n > 2:
        near, far = c(9 / 16), c(-1 / 16)
        p[1 : n - 2] = far * e[: n - 3] + near * e[1 : n - 2] + near * e[2 : n - 1] + far * e[3:]
        p[n - 2] = c(-1 / 8) * e[n - 3] + c(3 / 4) * e[n - 2] + c(3 / 8) * e[n - 1]
        p[0] = c(3 / 8) * e[0] + c(3 / 4) * e[1] - c(1 / 8) * e[2]
    if count == n:
        p[n - 1] = c(-1 / 2) * e[n - 2] + c(3 / 2) * e[n - 1]
    return p


def level_step(step: float, level: int, p: Pyramid) -> float:
    """The step of a level, in 64-bit floats."""
    g = 1.0
    for _ in range(level):
        g = min(g * p.growth, p.most)
    return step / g


def rebuild(codes: dict, step: float, extents: tuple[int, ...], p: Pyramid, tier: int, known) -> np.ndarray:
    """The nodes [k, z, y, x], ghost nodes included, from the codes of the passes; a pass without codes has zeros.

    `known` are the nodes at even numbers along x, y, z: those of the block above. None: there is none above.
    """
    precision = np.float32 if p.single else np.float64
    nodes = np.zeros(p.lattice(extents, tier)[::-1], precision)
    even = nodes[:, ::2, ::2, ::2]
    if known is not None:
        even[:] = known
    for number, q in enumerate(passes(extents, p, tier)):
        s = precision(level_step(step, q.level, p))
        part = [slice(f, f + n * d, d) for f, n, d in zip(q.first, q.counts, q.stride)][::-1]
        base = precision(0)
        if q.axis is not None:
            lines = list(part)
            lines[3 - q.axis] = slice(0, None, q.stride[q.axis])
            e = np.moveaxis(nodes[tuple(lines)], 3 - q.axis, 0)
            base = np.moveaxis(predict(e, q.counts[q.axis], p.stencil), 0, 3 - q.axis)
        amount = codes[number].astype(precision) * s if number in codes else precision(0)
        nodes[tuple(part)] = base + amount
        if known is not None and q.axis == 3:
            even[:] = known
    return nodes


# ---------------------------------------------------------------- along time (section 8)


def coefficients_of(basis: str, frames: int) -> int:
    """K."""
    if basis != "multi":
        return frames
    n = 1
    while 2 * n + 1 < frames:
        n *= 2
    return 2 * n + 1


def inverse_haar(c: np.ndarray) -> np.ndarray:
    """From the coarsest step: x1 = a s + b d, x2 = b s - a d."""
    weights = [[1] * len(c)]  # of the sums before each step
    while len(weights[-1]) > 1:
        m = weights[-1]
        weights.append([sum(m[i : i + 2]) for i in range(0, len(m), 2)])
    sums_, used = [c[0]], 1
    for m in weights[-2::-1]:
        fine = []
        for i in range(len(m) // 2):
            m1, m2 = m[2 * i], m[2 * i + 1]
            a, b = math.sqrt(m1 / (m1 + m2)), math.sqrt(m2 / (m1 + m2))
            s, d = sums_[i], c[used + i]
            fine += [a * s + b * d, b * s - a * d]
        if len(m) % 2:
            fine.append(sums_[-1])
        sums_, used = fine, used + len(m) // 2
    return np.array(sums_)


# The numbers of the multi transform, as the page gives them.
T1, T9, T10, T3Q, T6, T8Q = 0.07071067811865475, 0.6363961030678927, 0.7071067811865475, 0.3, 0.4242640687119285, 0.8
I1, I9, I3Q, I10Q = 0.05, 0.45, 0.21213203435596428, 0.7071067811865476
NODE, END_NODE, MID = 0.816496580927726, 0.5773502691896258, 0.7216878364870322
END_TAPS = np.array([T10, T9, -T3Q, -T1])[:, None]
END_WAVELET = np.array([-T10, T9, -T3Q, -T1])[:, None]
NODE_TAPS = np.array([-I1, -I3Q, I9, I10Q, I9, -I3Q, -I1])[:, None]
EVEN_WAVELET = np.array([-I1, -I3Q, I9, -I10Q, I9, -I3Q, -I1])[:, None]
ODD_WAVELET = np.array([-T1, -T3Q, T9, 0, -T9, T3Q, T1])[:, None]


def inverse_multi(c: np.ndarray, frames: int) -> np.ndarray:
    """Level by level to fine coefficients, then to samples; mids take the samples of their nodes."""
    f, used = c[:3], 3
    while used < len(c):
        n = len(f) - 1  # intervals of the finer level
        f = inverse_multi_level(f, c[used : used + n], n)
        used += n
    x = np.empty_like(f)
    x[::2] = f[::2] / NODE
    x[0], x[-1] = f[0] / END_NODE, f[-1] / END_NODE
    x[1::2] = f[1::2] / MID - 0.3 * (x[:-2:2] + x[2::2])
    return x[:frames]


def inverse_multi_level(s: np.ndarray, w: np.ndarray, n: int) -> np.ndarray:
    """Each fine coefficient is summed up from 0, in the page's order of scaling coefficients and wavelets."""
    fine = np.zeros((2 * n + 1, s.shape[1]))
    fine[:4] += END_TAPS * s[0]
    fine[:4] += END_WAVELET * w[0]
    for c in range(1, n // 2):
        at = fine[4 * c - 3 : 4 * c + 4]
        at += NODE_TAPS * s[2 * c]
        at += EVEN_WAVELET * w[2 * c - 1]
        at += ODD_WAVELET * w[2 * c]
    for i, tap in enumerate((T6, T8Q, T6)):
        fine[1 + i :: 4] += tap * s[1::2]
    fine[-4:] += END_TAPS[::-1] * s[-1]
    fine[-4:] += END_WAVELET[::-1] * w[-1]
    return fine


def dot(a: np.ndarray, b: np.ndarray) -> float:
    return np.add.accumulate(a * b)[-1]  # from left to right: np.dot and np.sum are not


@lru_cache(16)
def learned_functions(w: Window) -> np.ndarray:
    """The orthonormal functions [k, t]."""
    identity = np.eye(w.frames)
    candidates = [w.functions.reshape(-1, w.frames) / 32768.0, inverse_haar(identity).T, identity]
    out: list[np.ndarray] = []
    for f in np.concatenate(candidates):
        if len(out) == w.frames:
            break
        before = dot(f, f)
        for u in out + out:
            f = f - dot(f, u) * u
        s = dot(f, f)
        if s > 1e-10 * max(before, 1e-10):
            out.append(f / np.sqrt(s))
    need(len(out) == w.frames, f"window from frame {w.first_frame}", "too few functions")
    return np.array(out)


def inverse(c: np.ndarray, w: Window) -> np.ndarray:
    """x [frame, voxel] from c [k, voxel]."""
    if w.basis == "samples":
        return c
    if w.basis == "haar":
        return inverse_haar(c)
    if w.basis == "multi":
        return inverse_multi(c, w.frames)
    x = np.zeros_like(c)
    for u, row in zip(learned_functions(w), c):
        if row.any():
            x += u[:, None] * row
    return x


def to_samples(x: np.ndarray, dtype: np.dtype, place: str) -> np.ndarray:
    """Rounded to the sample type: section 8."""
    if dtype.kind == "f":
        return x.astype(dtype)
    need(not np.isnan(x).any(), place, "a sample is not a number")
    whole = np.trunc(x)
    whole += np.where(np.abs(x - whole) >= 0.5, np.sign(x), 0)  # the difference is exact
    limits = np.iinfo(dtype)
    return np.clip(whole, limits.min, limits.max).astype(dtype)


# ---------------------------------------------------------------- the file


# ---------------------------------------------------------------- section 6, description


NUMBERS = ["u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f4", "<f8", "S1"]
ROLES = ["frames", "x", "y", "z", "single"]


def described_numbers(r: Record) -> np.ndarray:
    dtype = np.dtype(r.variant(NUMBERS))
    size, packed = dtype.itemsize, r.take(r.get("Q"))
    need(len(packed) % size == 0, r.place, "a number is cut short", r.at)
    planes = np.frombuffer(packed, "u1").reshape(size, -1)
    differences = np.ascontiguousarray(planes.T).reshape(-1).view(f"<u{size}")
    return np.cumsum(differences, dtype=f"<u{size}").view(dtype)


def described_values(r: Record, frames: int):
    """Values, and how many they are."""
    kind = r.variant(["texts", "numbers", "times"])
    if kind == "texts":
        texts = r.list(r.string)
        return texts, len(texts)
    if kind == "numbers":
        numbers = described_numbers(r)
        return numbers, len(numbers)
    return {"times": r.variant(NUMBERS)}, frames


def read_description(r: Record, m) -> dict:
    """The record of a description, checked against itself and the metadata."""
    items = 0

    def flag() -> bool:
        value = r.get("B")
        need(value <= 1, r.place, "a flag is neither 0 nor 1", r.at - 1)
        return bool(value)

    def attributes() -> dict:
        nonlocal items
        found = {}
        for _ in range(r.get("Q")):
            items += 1
            name = r.string()
            values, _ = described_values(r, m.frames)
            need(not isinstance(values, dict), r.place, f"attribute {name} is times", r.at)
            found[name] = values
        return found

    source = r.string()
    dimensions = r.list(lambda: {"name": r.string(), "length": r.get("Q"), "unlimited": flag()})
    axes = r.list(lambda: {"dimension": r.get("I"), "role": r.variant(ROLES), "reversed": flag()})
    items += len(dimensions) + len(axes)
    lengths = {"frames": m.frames, "single": 1, **dict(zip("xyz", m.dims))}
    for i, axis in enumerate(axes):
        need(axis["dimension"] < len(dimensions), r.place, "there is no such dimension")
        need(dimensions[axis["dimension"]]["length"] == lengths[axis["role"]], r.place, "an axis of another length")
        for other in axes[:i]:
            same = other["role"] == axis["role"] != "single" or other["dimension"] == axis["dimension"]
            need(not same, r.place, "an axis repeats another")
    described = {"source": source, "dimensions": dimensions, "axes": axes}
    described["attributes"], described["global"] = attributes(), attributes()
    variables = described["variables"] = []
    for _ in range(r.get("Q")):
        items += 1
        name, of = r.string(), r.list(lambda: r.get("I"))
        need(all(number < len(dimensions) for number in of), r.place, "there is no such dimension")
        values, count = described_values(r, m.frames)
        expected = math.prod(dimensions[number]["length"] for number in of)
        need(count == expected, r.place, f"variable {name} has {count} values, not {expected}")
        along = [axis["dimension"] for axis in axes if axis["role"] == "frames"]
        need(not isinstance(values, dict) or of in ([], along), r.place, "times along another axis")
        variables.append({"name": name, "dimensions": of, "values": values, "attributes": attributes()})
    places = ["first", "directions", "spacing"]
    orientation = r.option(lambda: {"space": r.string(), **dict(zip(places, (r.get("3d"), r.get("9d"), r.get("3d"))))})
    finite = orientation is None or all(math.isfinite(n) for place in places for n in orientation[place])
    need(finite, r.place, "an orientation that is not finite")
    described["orientation"] = orientation
    need(items <= MAX_DESCRIPTION_ITEMS, r.place, f"{items} items")
    r.end()
    return described


class Archive:
    """An open file. Opening it does the checks of section 2 up to the root; leaves and blocks are read on demand."""

    def __init__(self, path: str):
        with open(path, "rb") as f:
            f.seek(0, 2)
            self.length = f.tell()
            need(self.length >= 256 and self.length % ALIGN == 0, "file", f"cannot be {self.length} bytes long")
            self.data = mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ)
        self._leaves: dict[int, list[Block]] = {}  # the latest KEPT_LEAVES that were read
        self._nodes: dict[int, tuple] = {}  # tier: the latest block above 0 that was decoded
        self._first: dict[tuple, int] = {}  # window, tier, channel: number of the first leaf
        self._header()
        self._footer()
        f = self.footer
        place = (f.metadata_offset, f.metadata_stored, f.metadata_raw, f.metadata_checksum)
        self.metadata = Metadata.read(self._section(b"META", *place, place="metadata", cap=MAX_METADATA))
        for w in self.metadata.windows:
            need(self.nested or not (w.pyramid and w.pyramid.nested), "metadata", "nested parts are not announced")
            need(self.tiered or not w.tiers, "metadata", "tiers are not announced")
        place = (f.root_offset, f.root_stored, f.root_raw, f.root_checksum)
        root = self._section(b"ROOT", *place, place="root", cap=MAX_ROOT_RAW)
        root = decompress(root, f.root_raw, "root", f.root_offset)
        self.leaves = [LEAF.read(root, i) for i in range(0, len(root), LEAF.size)]
        self._places()
        self._totals()

    # ---- sections 3 and 4

    def _header(self) -> None:
        data = self.data[:128]
        head = HEADER.read(data)
        need(head.magic == MAGIC, "header", "wrong magic", 0)
        need(xxhash.xxh3_64_intdigest(data[:120]) == head.checksum, "header", "wrong checksum", 120)
        if head.major != 1:
            raise Unsupported("header", f"version {head.major}", 8)
        if head.required > 63:
            words = head.needs.rstrip(b"\0").decode("utf-8", "replace")
            raise Unsupported("header", f"the file needs: {words}", 16)
        need(head.reserved == 0, "header", "reserved bytes are not zero", 12)
        self.id = head.id
        self.nested, self.described, self.tiered = [bool(head.required & bit) for bit in (1, 2, 4)]
        parts = (8, (EXACT, 1)), (16, (SIDES, 0)), (32, (SUMS, 0))
        self.announced = {key for bit, key in parts if head.required & bit}

    def _footer(self) -> None:
        """Checks the footer and the places of metadata and root."""
        at = self.length - 128
        data = self.data[at:]
        f = self.footer = FOOTER.read(data)
        need(f.magic == END_MAGIC, "footer", "wrong end magic", at + 120)
        need(xxhash.xxh3_64_intdigest(data[:112]) == f.checksum, "footer", "wrong checksum", at + 112)
        need(f.id == self.id, "footer", "another file id than the header's", at)
        need(f.total == self.length, "footer", "another length than the file's", at + 16)
        need(f.metadata_offset % ALIGN == 0 and f.metadata_offset >= 128, "footer", "bad place of metadata", at + 24)
        end = align(f.metadata_offset + FRAME.size + f.metadata_stored)
        need(end == f.root_offset, "footer", "the root does not follow the metadata", at + 48)
        end = align(f.root_offset + FRAME.size + f.root_stored)
        described = any([f.description_offset, f.description_stored, f.description_raw, f.description_checksum])
        need(described == self.described, "footer", "the header says otherwise of a description", at + 88)
        if described:
            need(end == f.description_offset, "footer", "the description does not follow the root", at + 88)
            end = align(f.description_offset + FRAME.size + f.description_stored)
        need(end == at, "footer", "does not follow what is before it", at)
        need(f.blocks <= self.length // 128, "footer", "too many blocks", at + 72)
        need(f.leaves <= f.blocks and f.root_raw == LEAF.size * f.leaves, "footer", "bad count of leaves", at + 80)

    def _seed(self, kind: int, where: tuple[int, int, int, int], level: int = 0) -> int:
        """`where`: window, block, channel, tier."""
        return xxhash.xxh3_64_intdigest(self.id + struct.pack("<IIBBBB", *where, kind, level))

    def _bytes(self, offset: int, size: int, checksum: int, seed: int, place: str) -> bytes:
        need(offset + size <= self.length - 128, place, "is not within the file", offset)
        stored = self.data[offset : offset + size]
        need(xxhash.xxh3_64_intdigest(stored, seed) == checksum, place, "wrong checksum", offset)
        return stored

    def _section(self, tag, offset, stored, raw, checksum, where=(0, 0, 0, 0), place="", cap=None) -> bytes:
        """The stored bytes of a section. `checksum` None: only its frame has it."""
        need(offset + FRAME.size <= self.length - 128, place, "is not within the file", offset)
        need(tag in (b"LEAF", b"ROOT", b"DESC") or stored == raw, place, "stored and raw differ", offset)
        need(cap is None or raw <= cap, place, "is too long", offset)
        frame = FRAME.read(self.data[offset : offset + FRAME.size])
        expected = (tag, stored, raw, 0, frame.checksum if checksum is None else checksum)
        need(frame == expected, place, "its frame is not the one that is expected", offset)
        return self._bytes(offset + FRAME.size, stored, frame.checksum, self._seed(KIND[tag], where), place)

    # ---- section 6

    def description(self) -> dict | None:
        """What the source says beside its samples."""
        if not self.described:
            return None
        f = self.footer
        place = (f.description_offset, f.description_stored, f.description_raw, f.description_checksum)
        stored = self._section(b"DESC", *place, place="description", cap=MAX_DESCRIPTION)
        raw = decompress(stored, f.description_raw, "description", f.description_offset)
        return read_description(Record(raw, "description"), self.metadata)

    # ---- section 5

    def _places(self) -> None:
        """Checks that only padding separates window sections, blocks, leaves, window's ends and metadata."""
        m = self.metadata
        blocks = [m.blocks(tier) for w in m.windows for tier in range(w.tiers + 1)]
        leaves = [-(-n // BLOCKS_PER_LEAF) for n in blocks]
        need(self.footer.blocks == m.channels * sum(blocks), "footer", "count of blocks does not fit the metadata")
        need(len(self.leaves) == m.channels * sum(leaves), "footer", "count of leaves does not fit the metadata")
        at = align(128 + FRAME.size + len(m.start))
        numbers = iter(range(len(self.leaves)))
        for window in range(len(m.windows)):
            at = align(at + FRAME.size + len(m.window_section(window)))
            for tier, channel, first in m.runs(window):
                number = next(numbers)
                self._first.setdefault((window, tier, channel), number)
                at = self._place(self.leaves[number], (window, tier, channel, first), at)
            at = align(at + FRAME.size + len(m.window_end(window)))
        end = self.footer.metadata_offset
        need(at == end, "metadata", f"is not at byte {at}, where what is before ends", end)

    def _place(self, leaf, key: tuple, at: int) -> int:
        """Checks a leaf's entry, and returns the offset of the next section."""
        place = f"root, {name_of(leaf)}"
        need((leaf.window, leaf.tier, leaf.channel, leaf.first_block) == key, place, "leaves are not in order")
        count = min(BLOCKS_PER_LEAF, self.metadata.blocks(leaf.tier) - leaf.first_block)
        need(leaf.count == count, place, "bad count of blocks")
        need(leaf.data_offset == at, place, f"its blocks do not begin at byte {at}", leaf.data_offset)
        need(leaf.offset % ALIGN == 0 and leaf.offset >= at + 128 * leaf.count, place, "bad place", leaf.offset)
        least = BLOCK.size * leaf.count
        need(least <= leaf.raw <= least + PART.size * MAX_PARTS * leaf.count, place, "bad length")
        return align(leaf.offset + FRAME.size + leaf.stored)

    def _totals(self) -> None:
        """Checks that the metadata of a window matches its leaves."""
        of_window: list[list] = [[] for _ in self.metadata.windows]
        for leaf in self.leaves:
            of_window[leaf.window].append(leaf)
        for number, (w, leaves) in enumerate(zip(self.metadata.windows, of_window)):
            place = f"metadata, window {number}"
            need(sum(l.coded for l in leaves) == w.coded, place, "another count of codes than the directory's")
            need(sum(l.outliers for l in leaves) == w.outliers, place, "another count of outliers than the directory's")
            need(sum(l.missing for l in leaves) <= w.missing, place, "fewer missing samples than in the directory")
            need(all(l.reached <= w.reached for l in leaves), place, "smaller error than in the directory")

    def leaf(self, number: int) -> list[Block]:
        """The entries of a leaf's blocks."""
        blocks = self._leaves.pop(number, None) or self._read_leaf(self.leaves[number])
        self._leaves[number] = blocks  # the last of the dictionary is the latest
        if len(self._leaves) > KEPT_LEAVES:
            del self._leaves[next(iter(self._leaves))]
        return blocks

    def _read_leaf(self, leaf) -> list[Block]:
        where, place = (leaf.window, leaf.first_block, leaf.channel, leaf.tier), name_of(leaf)
        stored = self._section(b"LEAF", leaf.offset, leaf.stored, leaf.raw, leaf.checksum, where, place)
        r = Record(decompress(stored, leaf.raw, place, leaf.offset), place)
        blocks = [Block.read(r) for _ in range(leaf.count)]
        r.end()
        at = leaf.data_offset
        for i, b in enumerate(blocks):
            key = (leaf.window, leaf.first_block + i, leaf.channel, leaf.tier)
            need(b.where == key, place, "blocks are not in order")
            check_block(b, self.metadata.windows[b.window], self._size(b), self.metadata.dtype.itemsize, self.announced)
            part_at = at + FRAME.size + len(b.bytes)
            for p in b.parts:
                need(p.offset == part_at, b.place, f"a part does not begin at byte {part_at}", p.offset)
                part_at += p.stored
            at = align(b.end(at))
        need(at == leaf.offset, place, "does not follow its blocks", leaf.offset)
        for name, value in sums(blocks).items():
            need(same(getattr(leaf, name), value), f"root, {place}", f"wrong {name}")
        return blocks

    def _size(self, b: Block) -> tuple[int, ...]:
        return tuple(s.stop - s.start for s in self.metadata.box(b.block, b.tier))

    # ---- samples

    def block(self, window: int, tier: int, channel: int, number: int) -> Block:
        leaf = self._first[window, tier, channel] + number // BLOCKS_PER_LEAF
        return self.leaf(leaf)[number % BLOCKS_PER_LEAF]

    def above(self, b: Block) -> Block | None:
        """The block above, if there is one."""
        if b.tier == self.metadata.windows[b.window].tiers:
            return None
        return self.block(b.window, b.tier + 1, b.channel, self.metadata.above(b.block, b.tier))

    def lost(self, b: Block | None) -> bool:
        """Whether a block is lost, or begins with the nodes of one that is."""
        if b is None or b.lost:
            return b is not None
        return (b.tier > 0 or b.step > 0 and not b.exact) and self.lost(self.above(b))

    def payload(self, b: Block, p) -> bytes:
        """The content of a part after decompression."""
        place = f"{b.place}, part of kind {p.kind}, level {p.level}"
        seed = self._seed(p.kind, b.where, p.level)
        return decompress(self._bytes(p.offset, p.stored, p.checksum, seed, place), p.raw, place, p.offset)

    def samples(self, b: Block) -> np.ndarray:
        """The samples of a block of tier 0, [frame, z, y, x] (section 7)."""
        need(not self.lost(b), b.place, LOST)
        w, size, dtype = self.metadata.windows[b.window], self._size(b), self.metadata.dtype
        count = math.prod(size) * w.frames
        payloads = {(p.kind, p.level): (p, self.payload(b, p)) for p in b.parts}
        if (EXACT, 0) in payloads:
            out = planes(payloads[EXACT, 0][1], dtype, count)
        elif (EXACT, 1) in payloads:
            place = f"{b.place}, part of kind {EXACT}, level 1"
            out = read_listed(payloads[EXACT, 1][1], dtype, (*size, w.frames), place)
        else:
            with np.errstate(all="ignore"):
                c = self._coefficients(b, w, size, payloads)
                need(np.isfinite(c).all(), b.place, "a coefficient is not finite")
                out = to_samples(inverse(c, w), dtype, b.place).reshape(-1)
                if (SUMS, 0) in payloads:
                    p, data = payloads[SUMS, 0]
                    out = add_to_sums(out, data, p, w.frames, f"{b.place}, part of kind {SUMS}")
                if self.metadata.keeps_range and w.min <= w.max:
                    out = np.clip(out, dtype.type(w.min), dtype.type(w.max))
        fixed = np.zeros(count, bool)
        for kind, read in ((OUTLIERS, read_outliers), (MISSING, read_missing)):
            if (kind, 0) in payloads:
                p, data = payloads[kind, 0]
                which, values = read(data, dtype, p.count, count, f"{b.place}, part of kind {kind}")
                out = out.copy()
                out[which] = values
                fixed[which] = True
        if (SIDES, 0) in payloads:
            place = f"{b.place}, part of kind {SIDES}"
            codes = read_sides(payloads[SIDES, 0][1], count, place)
            need(len(codes) == len(self.metadata.sides), place, "other values than the file keeps")
            for value, code in zip(self.metadata.sides, codes):
                out = put_on_sides(out, value, code, size, fixed, self.metadata.missing_value)
        return out.reshape(w.frames, *size[::-1])

    def _coefficients(self, b: Block, w: Window, size: tuple[int, ...], payloads: dict) -> np.ndarray:
        """c [k, voxel] as 64-bit floats (section 8)."""
        levels = {p.level: (p, data) for (kind, _), (p, data) in payloads.items() if kind == LEVEL}
        if w.pyramid:
            own = self._lattice(b, w, levels)[(slice(None), *(slice(0, n) for n in size[::-1]))]
            return own.reshape(w.coefficients, -1).astype(np.float64)
        voxels = math.prod(size)
        rows = []
        for level, count in enumerate(w.levels):
            if level in levels:
                p, data = levels[level]
                rows.append(read_level(data, count * voxels, p.count, f"{b.place}, level {level}"))
            else:
                rows.append(np.zeros(count * voxels, np.int64))
        return np.concatenate(rows).astype(np.float64).reshape(-1, voxels) * b.step

    def _lattice(self, b: Block, w: Window, levels: dict) -> np.ndarray:
        """The nodes of a block [k, z, y, x], ghost nodes included."""
        p, extents, codes = w.pyramid, (*self._size(b), w.coefficients), {}
        if not b.tier and p.tiers and not b.step:
            return np.zeros(p.lattice(extents, 0)[::-1])
        for level, (part, data) in levels.items():
            mine = [box for box in boxes(extents, p, b.tier) if box.part == level]
            place = f"{b.place}, level {level}"
            read = read_lattice(Record(data, place), [box.counts for box in mine], p.nested, part.count)
            for box, found in zip(mine, read):
                even = tuple(slice(None, None, 2 if a in box.others else 1) for a in (2, 1, 0))
                need(not box.others or not found[(slice(None), *even)].any(), place, "a code that is not of this box")
                whole = passes(extents, p, b.tier)[box.number].counts[::-1]
                of_pass = codes.setdefault(box.number, np.zeros(whole, np.int64))
                of_pass[(slice(None), *(slice(None, None, e) for e in box.steps[::-1]))] += found
        return rebuild(codes, b.step, extents, p, b.tier, self._known(b, p.lattice(extents, b.tier)))

    def _known(self, b: Block, lattice: tuple[int, ...]) -> np.ndarray | None:
        """The nodes of a block that are also those of the block above: those at even numbers."""
        above = self.above(b)
        if above is None:
            return None
        half = self.metadata.block_edge // 2  # of a block, on the lattice above
        firsts = [n % 2 * half for n in self.metadata.position(b.block, b.tier)]
        inside = [slice(f, f - (-n // 2)) for f, n in zip(firsts, lattice)]
        return self.nodes(above)[(slice(None), *inside[::-1])]

    def nodes(self, b: Block) -> np.ndarray:
        """The nodes of a block of a tier above 0. The latest of each tier is kept for the blocks below it."""
        key, nodes = self._nodes.get(b.tier, (None, None))
        if key != b.where:
            need(not b.lost, b.place, LOST)
            levels = {p.level: (p, self.payload(b, p)) for p in b.parts}
            with np.errstate(all="ignore"):
                nodes = self._lattice(b, self.metadata.windows[b.window], levels)
            self._nodes[b.tier] = (b.where, nodes)
        return nodes

    def window(self, number: int, channel: int) -> np.ndarray:
        """All samples of a window and channel, [frame, z, y, x]."""
        m = self.metadata
        out = np.empty((m.windows[number].frames, *m.dims[::-1]), m.dtype)
        for tier, i in m.descent(number):
            if tier == 0:
                out[(slice(None), *m.box(i, 0)[::-1])] = self.samples(self.block(number, 0, channel, i))
        return out

    def extract(self, path: str) -> None:
        """Writes the samples of all frames, of one channel after another."""
        try:
            with open(path, "wb") as f:
                for channel in range(self.metadata.channels):
                    for number in range(len(self.metadata.windows)):
                        f.write(self.window(number, channel))
        except Damaged:
            if os.path.isfile(path):
                os.remove(path)  # half a series could be taken for a whole one
            raise

    # ---- check

    def check(self, decode: bool = True) -> int:
        """Reads everything in the order of the file, then decodes; returns how many blocks are lost."""
        m, f = self.metadata, self.footer
        at = self._padding(self._repeats(b"STRT", 128, m.start, (0, 0, 0, 0), "start"))
        lost, leaves = 0, iter(range(len(self.leaves)))
        for number in range(len(m.windows)):
            where = (number, 0, 0, 0)
            place = f"window section {number}"
            at = self._padding(self._repeats(b"WNDW", at, m.window_section(number), where, place))
            for _ in m.runs(number):
                i = next(leaves)
                for b in self.leaf(i):
                    at = self._check_block(b, at)
                    lost += b.lost
                at = self._padding(at + FRAME.size + self.leaves[i].stored)
            place = f"end of window {number}"
            at = self._padding(self._repeats(b"WEND", at, m.window_end(number), where, place))
            if decode:
                self._decode(number)
        self._padding(f.metadata_offset + FRAME.size + f.metadata_stored)
        if self.description() is not None:
            self._padding(f.description_offset + FRAME.size + f.description_stored)
        self._padding(f.root_offset + FRAME.size + f.root_stored)
        return lost

    def _padding(self, end: int) -> int:
        """Checks for zeros up to the next multiple of 64, and returns it."""
        need(not any(self.data[end : align(end)]), "padding", "is not zero", end)
        return align(end)

    def _repeats(self, tag: bytes, at: int, expected: bytes, where: tuple, place: str) -> int:
        """Checks a section that repeats leaf or metadata; returns its end."""
        found = self._section(tag, at, len(expected), len(expected), None, where, place)
        need(found == expected, place, "is not what leaf or metadata say", at)
        return at + FRAME.size + len(expected)

    def _check_block(self, b: Block, at: int) -> int:
        self._repeats(b"BLCK", at, b.bytes, b.where, f"header of {b.place}")
        for p in b.parts:
            self.payload(b, p)
        return self._padding(b.end(at))

    def _decode(self, window: int) -> None:
        """Decodes the blocks of a window, except lost ones and those below them."""
        for channel in range(self.metadata.channels):
            for tier, number in self.metadata.descent(window):
                b = self.block(window, tier, channel, number)
                if not self.lost(b):
                    (self.nodes if tier else self.samples)(b)


# ---------------------------------------------------------------- command line


def plain(value):
    """A value as JSON has it: infinities and NaN as words, records as objects."""
    if isinstance(value, (Metadata, Window, Pyramid)):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value) if f.type != "bytes"}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, dict):
        return {key: plain(v) for key, v in value.items()}
    if isinstance(value, bytes):
        return value.decode("latin-1")
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def info(path: str) -> None:
    archive = Archive(path)
    file = {"id": archive.id.hex(), "bytes": archive.length, "blocks": archive.footer.blocks, "leaves": len(archive.leaves)}
    described = {"description": plain(archive.description())} if archive.described else {}
    print(json.dumps({"file": file, **plain(archive.metadata), **described}, indent=2, ensure_ascii=False))


def check(path: str) -> None:
    lost = Archive(path).check()
    print(f"ok {path}" + (f" ({lost} blocks lost)" if lost else ""))


def extract(path: str, out: str) -> None:
    Archive(path).extract(out)


def extract_many(path: str) -> None:
    bad = 0
    with open(path, encoding="utf-8") as f:
        jobs = [line.rstrip("\n").split("\t") for line in f if line.strip()]
    for source, out in jobs:
        try:
            archive = Archive(source)
            archive.check(decode=False)
            archive.extract(out)
            print(f"ok {source}", flush=True)
        except (Damaged, OSError) as e:
            print(f"damaged {source}: {e}", flush=True)
            bad += 1
    if bad:
        raise Damaged(path, f"{bad} of {len(jobs)} files")


def main(arguments: list[str]) -> int:
    commands = {"info": (info, 1), "check": (check, 1), "extract": (extract, 2), "extract-many": (extract_many, 1)}
    command, count = commands.get(arguments[0] if arguments else "", (None, 0))
    if command is None or len(arguments) != 1 + count:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        command(*arguments[1:])
    except Damaged as e:
        print(f"{arguments[0]}: {e}", file=sys.stderr)
        return 3
    except OSError as e:
        print(f"{arguments[0]}: {e}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
