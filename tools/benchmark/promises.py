#!/usr/bin/env python3
"""What `--keep` costs, beside SZ3 with the same promise by compression-safeguards.

    pip install -r tools/peers/requirements.txt compression-safeguards==1.0.0rc5 zstandard
    python tools/benchmark/promises.py BIN ARCHIVE.npy ...

BIN is the folder of wavesplat's programs. Prints a row of tools/benchmark/promises.md for each archive (t, z, y, x), tolerance and promise.
With `--computed`, prints the errors of what is computed from the samples instead, without a promise and with several, and compares no peer.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time

os.environ["OMP_NUM_THREADS"] = "1"  # before any coder is loaded

import numpy as np
import zstandard
from compression_safeguards import Safeguards

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "peers"))

from coders import CODERS


def least_seconds(rounds, work):
    best = float("inf")
    for _ in range(rounds):
        started = time.time()
        work()
        best = min(best, time.time() - started)
    return best


class Programs:
    """Converts and extracts an archive on one thread."""

    def __init__(self, folder, archive, work, rounds):
        self.program, self.archive, self.rounds = os.path.join(folder, "wavesplat"), archive, rounds
        self.file, self.back = os.path.join(work, "a.wspl"), os.path.join(work, "a.npy")

    def run(self, *words):
        command = [self.program, *words, "--quiet", "--threads", "1"]
        subprocess.run(command, check=True, capture_output=True)

    def measured(self, tolerance, keep):
        """Bytes, and seconds of converting and of extracting."""
        words = ["convert", self.archive, "-o", self.file, "--force", "--tolerance", tolerance, *(["--keep", keep] if keep else [])]
        convert = least_seconds(self.rounds, lambda: self.run(*words))
        extract = least_seconds(self.rounds, lambda: self.run("extract", self.file, "-o", self.back, "--force"))
        if keep:
            self.run("verify", self.file, "--against", self.archive)
        return os.path.getsize(self.file), convert, extract


def safeguarded(series, bound, offset):
    """Bytes and seconds of SZ3 over space and time, corrected so that samples keep their sides of `offset`."""
    started = time.time()
    coder = CODERS["sz3-4d"]
    blobs = coder.encode(series, bound)
    decoded = coder.decode(blobs, series.shape, series.dtype)
    kinds = [{"kind": "eb", "type": "abs", "eb": bound}, {"kind": "sign", "offset": offset}]
    correction = Safeguards(safeguards=kinds).compute_correction(series, decoded)
    rows = correction.reshape(-1).view(np.uint8).reshape(-1, correction.itemsize)
    packed = zstandard.ZstdCompressor(level=9).compress(np.ascontiguousarray(rows.T).tobytes())
    return sum(memoryview(blob).nbytes for blob in blobs) + len(packed), time.time() - started


def rows_of(archive, args):
    series = np.load(archive)
    low, high = float(series.min()), float(series.max())
    some = series[::2, ::4, ::4, ::4]
    values = {"range": None, "sum": None, "sign": 0.0, "side, middle of the range": 0.5 * (low + high), "side, 90 % are below": np.quantile(some, 0.9)}
    name = os.path.splitext(os.path.basename(archive))[0]
    with tempfile.TemporaryDirectory(dir=args.work) as work:
        programs = Programs(args.bin, archive, work, args.rounds)
        for tolerance in args.tolerances.split(","):
            plain, convert, extract = programs.measured(tolerance, None)
            for what, value in values.items():
                value = None if value is None else float(series.dtype.type(value))
                keep = what if what in ("range", "sum", "sign") else f"side={value!r}"
                kept, slower, read = programs.measured(tolerance, keep)
                cells = [name, tolerance, what, str(plain), f"{100 * (kept / plain - 1):.2f} %"]
                cells += [f"{slower / convert:.2f}", f"{read / extract:.2f}"]
                if value is None or args.alone:
                    cells += ["", ""]
                else:
                    peer, seconds = safeguarded(series, float(tolerance) * (high - low), value)
                    cells += [f"{peer / kept:.2f}", f"{seconds / slower:.1f}"]
                yield cells


def rms(numbers):
    return float(np.sqrt(np.mean(np.square(numbers))))


def laplacian(series):
    inside = series[:, 1:-1, 1:-1, 1:-1]
    around = sum(np.roll(series, by, axis)[:, 1:-1, 1:-1, 1:-1] for axis in (1, 2, 3) for by in (-1, 1))
    return around - 6 * inside


def computed_errors(series, decoded, value):
    """Errors of differences between frames, gradients and Laplacians as shares of these; the largest of the mean of a frame as a share of the
    range; the edges between neighbours along x that cross a value in only one of both, as a share."""
    both = [series, decoded]
    results = {"difference": [np.diff(a, axis=0) for a in both], "gradient": [np.gradient(a, axis=3) for a in both]}
    results["laplacian"] = [laplacian(a) for a in both]
    shares = [rms(b - a) / rms(a) for a, b in results.values()]
    mean = np.abs(np.mean(decoded - series, axis=(1, 2, 3))).max() / (series.max() - series.min())
    crossed = [np.diff(a > value, axis=3) for a in both]
    return [f"{100 * share:.2f} %" for share in shares] + [f"{mean:.1e}", f"{100 * np.sum(crossed[0] != crossed[1]) / np.sum(crossed[0]):.2f} %"]


def computed_rows(archive, args):
    stored = np.load(archive)
    series = stored.astype(np.float64)
    low, high = series.min(), series.max()
    value = float(stored.dtype.type(np.quantile(series[::2, ::2, ::2, ::2], 0.9)))
    name = os.path.splitext(os.path.basename(archive))[0]
    with tempfile.TemporaryDirectory(dir=args.work) as work:
        programs = Programs(args.bin, archive, work, 1)
        for tolerance in args.tolerances.split(","):
            bound = float(tolerance) * (high - low)
            gradient = f"difference={bound / 2},gradient={bound / 4}"
            for what, keep in {"nothing": None, "sum, side": f"sum side={value!r}", "difference, gradient": gradient.replace(",", " ")}.items():
                size, _, _ = programs.measured(tolerance, keep)
                yield [name, tolerance, what, str(size), *computed_errors(series, np.load(programs.back).astype(np.float64), value)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bin", metavar="BIN", help="the folder of wavesplat's programs")
    parser.add_argument("archives", metavar="ARCHIVE", nargs="+", help="a .npy file (t, z, y, x)")
    parser.add_argument("--tolerances", default="1e-2,1e-3")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--alone", action="store_true", help="without SZ3")
    parser.add_argument("--computed", action="store_true", help="errors of what is computed from the samples")
    parser.add_argument("--work", help="a folder for files, such as one in memory")
    args = parser.parse_args()
    heads = ["data", "tolerance", "kept"]
    if args.computed:
        heads += ["bytes", "difference", "gradient", "laplacian", "mean of a frame", "edges at the value"]
    else:
        heads += ["bytes without", "more bytes", "convert, times", "extract, times"]
        heads += ["safeguarded SZ3 / kept, bytes", "its time / convert"]
    print("| " + " | ".join(heads) + " |\n|---|---|---|" + "--:|" * 6)
    for archive in args.archives:
        for cells in (computed_rows if args.computed else rows_of)(archive, args):
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
