"""The peers: other programs' coders under a hard bound on the error of every sample.

A coder is a pair: encode(array, bound) -> list of bytes-like blobs, decode(blobs, shape, dtype) -> array. Arrays are
(t, z, y, x) in C order; the bound is in the units of the samples. "3d" coders code every frame by itself and decode
into one array, "4d" coders code the whole series at once.
"""

from dataclasses import dataclass
from typing import Callable

import imagecodecs
import numpy as np
import zfpy
from pysz import sz, szConfig, szErrorBoundMode


@dataclass
class Coder:
    encode: Callable
    decode: Callable


def per_frame(encode, decode):
    """A coder of series from one of frames: encode(frame, bound) -> blob, decode(blob, shape, dtype) -> frame."""

    def all_frames(blobs, shape, dtype):
        series = np.empty(shape, dtype)
        for frame, blob in zip(series, blobs):
            frame[...] = decode(blob, shape[1:], dtype)
        return series

    return Coder(lambda series, bound: [encode(frame, bound) for frame in series], all_frames)


def sz3_series(series, bound):
    config = szConfig(series.shape)
    config.errorBoundMode = szErrorBoundMode.ABS
    config.absErrorBound = bound
    return [sz.compress(series, config)[0]]


CODERS = {
    "sz3-3d": per_frame(
        lambda frame, bound: imagecodecs.sz3_encode(frame, mode="abs", abs=bound),
        lambda blob, shape, dtype: imagecodecs.sz3_decode(blob, shape=shape, dtype=dtype),
    ),
    "sz3-4d": Coder(sz3_series, lambda blobs, shape, dtype: sz.decompress(blobs[0], dtype, shape)[0]),
    "zfp-4d": Coder(
        lambda series, bound: [zfpy.compress_numpy(series, tolerance=bound)],
        lambda blobs, shape, dtype: zfpy.decompress_numpy(blobs[0]),
    ),
    "sperr-3d": per_frame(
        lambda frame, bound: imagecodecs.sperr_encode(frame, level=bound, mode="pwe"),
        lambda blob, shape, dtype: imagecodecs.sperr_decode(blob),
    ),
}
