#!/usr/bin/env python3
"""A score card of coders with a bound on the error of every sample, wavesplat among them, for climate data and snapshots.

    pip install "./tools/python[xarray]" numcodecs -r tools/peers/requirements.txt
    python3 tools/peers/scorecard.py                             imitated climate fields
    python3 tools/peers/scorecard.py era5.zarr tas pr            variables of a dataset that xarray opens
    python3 tools/peers/scorecard.py --raw CLDHGH.f32 3600x1800  a file of SDRBench: 32-bit floats, x fastest

ClimateBenchPress asks a coder for a codec of numcodecs with an absolute bound, or one relative to each sample. wavesplat's are

    numcodecs.get_codec({"id": "wavesplat", "max_error": bound})
    numcodecs.get_codec({"id": "wavesplat", "bound": "relative", "tolerance": bound})

All coders are used like that: an array with up to five axes (realization, time, vertical, latitude, longitude) in, bytes out.
The bound is a share of the range of values. The error is the largest of any sample, as a share of the bound: above 1, the bound
is broken. Seconds are of one processor. Coders that know no missing samples get the mean instead, and are not judged there.
"""

import argparse
import os
import time

for library in ("OMP", "OPENBLAS", "MKL", "RAYON"):
    os.environ[library + "_NUM_THREADS"] = "1"  # before any of them is loaded

import numcodecs
import numpy as np
from coders import CODERS
from peers import in_child

SHARES = (1e-2, 1e-3, 1e-4)
OURS = "wavesplat"


def waves(rng, shape, count=40):
    """Waves of all lengths that move, about -1 to 1: the longer, the stronger."""
    axes = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij", sparse=True)
    sum_of_all = np.zeros(shape)
    for n in range(1, count + 1):
        direction = rng.normal(size=len(shape)) * [1.5, 1, n, n][-len(shape) :]
        phase = rng.uniform(0, 2 * np.pi) + sum(2 * k * along for k, along in zip(direction, axes))
        sum_of_all += np.sin(phase) / n**1.2
    return sum_of_all / np.abs(sum_of_all).max()


def imitated():
    """Fields with the layout and the difficulties of climate data: smooth, mostly 0, with land, with noise."""
    rng = np.random.default_rng(11)
    yield "ta", 250 + 30 * waves(rng, (12, 8, 96, 192)) + 0.05 * rng.normal(size=(12, 8, 96, 192))
    rain = np.exp(6 * waves(rng, (24, 1, 96, 192)) - 8)
    yield "pr", np.where(rain < 1e-3, 0, rain)
    ocean = 290 + 10 * waves(rng, (24, 1, 96, 192))
    ocean[:, :, waves(rng, (96, 192)) > 0.4] = np.nan
    yield "tos", ocean
    yield "agb", np.maximum(0, 80 * waves(rng, (1, 1, 400, 400)) + 20 * rng.normal(size=(1, 1, 400, 400)))


def of_dataset(path, names):
    import xarray as xr

    opened = xr.open_zarr(path) if os.path.isdir(path) else xr.open_dataset(path)
    return ((name, opened[name].values) for name in names)


def filled(samples):
    """The samples without missing ones, for coders that know none."""
    return np.where(np.isfinite(samples), samples, np.nanmean(samples)).astype(samples.dtype)


def coded_by_us(samples, bound):
    codec = numcodecs.get_codec({"id": OURS, "max_error": bound})
    stored, encoding = timed(lambda: codec.encode(samples))
    decoded, decoding = timed(lambda: codec.decode(stored))
    assert np.array_equal(np.isnan(decoded), np.isnan(samples))
    return len(stored), decoded, encoding, decoding


def coded_by(peer, samples, bound):
    levels = samples.shape[-3:] if samples.shape[-3] > 1 else samples.shape[-2:]
    series = filled(samples).reshape((-1,) + levels)  # others take (time, z, y, x), or (time, y, x)
    coder = CODERS[peer]
    blobs, encoding = timed(lambda: coder.encode(series, bound))
    decoded, decoding = timed(lambda: coder.decode(blobs, series.shape, series.dtype))
    return sum(memoryview(blob).nbytes for blob in blobs), decoded.reshape(samples.shape), encoding, decoding


def timed(work):
    started = time.process_time()
    return work(), time.process_time() - started


def judged(name, samples, share):
    """Bits of a sample, the largest error as a share of the bound, and seconds; None where a coder fails."""
    present = np.isfinite(samples)
    bound = share * float(np.ptp(samples[present]))
    size, decoded, encoding, decoding = coded_by_us(samples, bound) if name == OURS else coded_by(name, samples, bound)
    errors = np.abs(decoded[present].astype("f8") - samples[present].astype("f8"))
    return 8 * size / samples.size, float(errors.max() / bound), encoding, decoding


def table(fields):
    """Prints the score card, and how often each coder is the smallest of those that keep the bound."""
    print("| field | bound | coder | bits | ratio | error | encode s | decode s |\n|---|---|---|---|---|---|---|---|")
    best = {}
    for field, samples in fields:
        samples = np.ascontiguousarray(samples if samples.dtype.kind in "iu" else samples.astype("f4"))
        samples = samples.reshape((1,) * (4 - samples.ndim) + samples.shape)
        for share in SHARES:
            kept = []
            for name in (OURS, *CODERS):
                found = in_child(lambda: judged(name, samples, share))  # some coders abort
                if found is None:
                    print(f"| {field} | {share:g} | {name} | fails | | | | |", flush=True)
                    continue
                bits, error, encoding, decoding = found
                facts = f"{bits:.3f} | {8 * samples.itemsize / bits:.1f} | {error:.3f} | {encoding:.2f} | {decoding:.2f}"
                print(f"| {field} | {share:g} | {name} | {facts} |", flush=True)
                kept += [(bits, name)] if error <= 1 else []
            smallest = min(kept, default=(0, "none"))[1]
            best[smallest] = best.get(smallest, 0) + 1
    print("\nSmallest, of those that keep the bound: " + ", ".join(f"{name} {count}" for name, count in best.items()))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="*", help="a dataset and its variables, or a raw file and its size")
    parser.add_argument("--raw", action="store_true", help="32-bit floats, and a size such as 512x512x512")
    given = parser.parse_args()
    if given.raw:
        path, size = given.data
        table([(os.path.basename(path), np.fromfile(path, "<f4").reshape([int(n) for n in size.split("x")][::-1]))])
    elif given.data:
        table(of_dataset(given.data[0], given.data[1:]))
    else:
        table((name, field[None]) for name, field in imitated())


if __name__ == "__main__":
    main()
