#!/usr/bin/env python3
"""Peers of wavesplat: test archives, and what other coders make of them under the same bound.

`wavesplat-tools bench size --peers python3` runs this script.

    pip install -r requirements.txt
    python3 peers.py generate plate vortex --out data/
    python3 peers.py measure data/plate.npy --tolerances 1e-2,1e-3 --repeats 3

generate writes archives (t, z, y, x) of float32, or of integers, as KIND.npy:

    plate     |J| of eddy currents that decay in a plate, 75x75x20 voxels, 32 frames
    plate_fe  the same, every voxel off by 0.2 %, always alike: rough in space, smooth in time
    vortex    Gaussians in decaying turbulence, no empty space, 64x64x64 voxels, 64 frames
    cloud     turbulent blobs in nothing (exactly 0), 96x96x96 voxels, 64 frames

and those of small solvers and imitated scans in solvers.py, from reaction to grains.

measure prints a line of JSON for every file, tolerance and peer:

    data            the file, as it was given
    tolerance       the share of the value range (highest less lowest sample of the file)
    peer            sz3-3d, sz3-4d, zfp-4d or sperr-3d: frame by frame (3d), or the whole series as one array (4d)
    bytes           of all that the peer made
    bound           what no sample may be off, in the units of the samples: tolerance x range
    largest_error   what some sample is off, after decoding, in the units of the samples; null where a value is lost
    encode_seconds, decode_seconds   array to bytes and back, in memory

Seconds are those of the processor, on one thread and one core, the least of so many repeats after one that is not
counted. Where a peer misses its bound or cannot code an archive, a line on standard error says so.
"""

import argparse
import json
import os
import sys
import time

for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[library + "_NUM_THREADS"] = "1"  # before any of them is loaded

import numpy as np

import fields
import solvers

KINDS = fields.KINDS | solvers.KINDS
PEERS = ["sz3-3d", "sz3-4d", "zfp-4d", "sperr-3d"]


def least_seconds(repeats, work):
    """What `work` returns, and the least processor time that it took."""
    result, seconds = work(), []
    for _ in range(repeats):
        result = None  # so that memory is as free as it was
        started = time.process_time()
        result = work()
        seconds.append(time.process_time() - started)
    return result, min(seconds)


def largest_error(series, decoded):
    """Of any sample; None where a value is lost."""
    errors = [np.abs(a.astype(np.float64) - b.astype(np.float64)).max() for a, b in zip(series, decoded)]
    largest = float(max(errors))
    return largest if np.isfinite(largest) else None


def measure(path, tolerances, peers, repeats):
    """Yields what is measured of each tolerance and peer."""
    series = np.ascontiguousarray(np.load(path))
    if series.dtype.kind in "iu" and series.dtype.itemsize <= 2:
        series = series.astype(np.float32)  # exact; not all peers take integers
    if series.ndim != 4 or series.dtype not in (np.float32, np.float64):
        taken = "float32, float64 or integers of at most 16 bits"
        sys.exit(f"{path}: peers take arrays (t, z, y, x) of {taken}, this is {series.shape} {series.dtype}")
    value_range = float(series.max()) - float(series.min())
    for tolerance in tolerances:
        for peer in peers:
            bound = tolerance * value_range
            row = in_child(lambda: {"data": path, "tolerance": tolerance, **measured(peer, series, bound, repeats)})
            if row is None:
                print(f"{path}, {tolerance:g}, {peer}: cannot code this archive", file=sys.stderr)
            else:
                yield row


def measured(peer, series, bound, repeats):
    """What is measured of a peer under a bound."""
    from coders import CODERS

    coder = CODERS[peer]
    blobs, encode_seconds = least_seconds(repeats, lambda: coder.encode(series, bound))
    decode = lambda: coder.decode(blobs, series.shape, series.dtype)
    decoded, decode_seconds = least_seconds(repeats, decode)
    return {
        "peer": peer,
        "bytes": sum(memoryview(blob).nbytes for blob in blobs),
        "bound": bound,
        "largest_error": largest_error(series, decoded),
        "encode_seconds": encode_seconds,
        "decode_seconds": decode_seconds,
    }


def in_child(work):
    """What `work` returns in a process of its own, as JSON holds it; None if that fails: some coders abort."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            with os.fdopen(write, "w") as out:
                json.dump(work(), out)
        except Exception as why:  # coders raise what they like
            print(why, file=sys.stderr, flush=True)
            os._exit(1)
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as result:
        text = result.read()
    _, status = os.waitpid(child, 0)
    return json.loads(text) if status == 0 else None


def complain_unless_held(row):
    error, bound = row["largest_error"], row["bound"]
    if error is None or error > bound:
        place = f"{row['data']}, {row['tolerance']:g}, {row['peer']}"
        print(f"{place}: a sample is off by {error}, allowed are {bound}", file=sys.stderr)


def stay_on_one_core():
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def run_generate(args):
    os.makedirs(args.out, exist_ok=True)
    for kind in args.kinds:
        fields.write(KINDS[kind], os.path.join(args.out, kind + ".npy"), args.frames, args.edge)


def run_measure(args):
    stay_on_one_core()
    for path in args.files:
        for row in measure(path, args.tolerances, args.peers, args.repeats):
            print(json.dumps(row), flush=True)
            complain_unless_held(row)


def listed(read, names=None):
    """Reads values with commas between them."""

    def parse(text):
        values = [read(word) for word in text.split(",")]
        if names and not set(values) <= set(names):
            raise argparse.ArgumentTypeError(f"{text!r}: known are {', '.join(names)}")
        return values

    return parse


def count(text):
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not 1 or more")
    return number


def arguments():
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    commands = parser.add_subparsers(required=True)
    generate = commands.add_parser("generate", help="write test archives")
    generate.add_argument("kinds", nargs="+", choices=KINDS, metavar="KIND", help=", ".join(KINDS))
    generate.add_argument("--out", required=True, metavar="DIR", help="the folder to write to")
    generate.add_argument("--frames", type=count, metavar="N", help="frames of each")
    generate.add_argument("--edge", type=count, metavar="N", help="voxels along x")
    generate.set_defaults(run=run_generate)
    measured = commands.add_parser("measure", help="sizes, times and errors of peers")
    measured.add_argument("files", nargs="+", metavar="FILE.npy", help="archives (t, z, y, x)")
    measured.add_argument("--tolerances", type=listed(float), default=[1e-2, 1e-3, 1e-4], metavar="E,...")
    measured.add_argument("--peers", type=listed(str, PEERS), default=PEERS, metavar="NAME,...")
    measured.add_argument("--repeats", type=count, default=3, metavar="N", help="how often every time is taken [3]")
    measured.set_defaults(run=run_measure)
    return parser.parse_args()


if __name__ == "__main__":
    options = arguments()
    options.run(options)
