"""Archives that the tests share."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import wavesplat

SHAPE = (40, 20, 18, 22)


def smooth(shape=SHAPE, dtype=np.float32, seed=1):
    """Waves that move: frames, z, y, x."""
    rng = np.random.default_rng(seed)
    t, z, y, x = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    waves = sum(np.sin(2 * np.pi * (a * x + b * y + c * z + d * t) + p) for a, b, c, d, p in rng.uniform(0, 3, (4, 5)))
    if np.issubdtype(dtype, np.floating):
        return waves.astype(dtype)
    info = np.iinfo(dtype)
    return np.interp(waves, (-4, 4), (info.min / 2, info.max / 2)).astype(dtype)


@pytest.fixture(scope="session")
def samples():
    return smooth()


@pytest.fixture(scope="session")
def path(tmp_path_factory, samples):
    """A file of several windows and blocks."""
    path = tmp_path_factory.mktemp("files") / "run.wspl"
    wavesplat.convert(samples, path, tolerance=1e-3, window=16, block=12)
    return path


@pytest.fixture
def file(path):
    return wavesplat.open(path)


@pytest.fixture(scope="session")
def decoded(path):
    return wavesplat.open(path)[...]


def program(name="wavesplat"):
    """A program of wavesplat: of WAVESPLAT_PROGRAMS, or on the path."""
    folder = os.environ.get("WAVESPLAT_PROGRAMS")
    found = Path(folder, name) if folder else shutil.which(name)
    if not found:
        pytest.skip(f"{name} is not there: name its folder as WAVESPLAT_PROGRAMS")
    return str(found)


def run(*words, name="wavesplat"):
    done = subprocess.run([program(name), *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
