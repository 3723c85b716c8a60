"""Conversions give the bytes of the program, in bounded memory, and can be interrupted."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time

import dask.array as da
import numpy as np
import pytest
from conftest import run, smooth

import wavesplat

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def test_the_bytes_of_the_program(tmp_path, samples):
    np.save(tmp_path / "a.npy", samples)
    run("convert", tmp_path / "a.npy", "-o", tmp_path / "a.wspl", "--tolerance", "0.003", "-q")
    expected = (tmp_path / "a.wspl").read_bytes()
    chunked = da.from_array(samples, chunks=(7, 5, 9, 22))
    for n, source in enumerate([samples, samples.astype(">f4"), samples[::-1][::-1], chunked, Sliced(samples)]):
        report = wavesplat.convert(source, tmp_path / f"{n}.wspl", tolerance=0.003)
        assert (tmp_path / f"{n}.wspl").read_bytes() == expected, type(source)
    assert report["frames"] == len(samples)
    assert report["output_bytes"] == len(expected)
    wavesplat.convert(iter(samples), tmp_path / "stream.wspl", tolerance=0.003)
    np.testing.assert_array_equal(
        wavesplat.open(tmp_path / "stream.wspl")[...], wavesplat.open(tmp_path / "a.wspl")[...]
    )


def test_best_for(tmp_path, samples):
    np.save(tmp_path / "a.npy", samples)
    run("convert", tmp_path / "a.npy", "-o", tmp_path / "a.wspl", "--best-for", "series", "-q")
    wavesplat.convert(samples, tmp_path / "b.wspl", best_for="series")
    assert (tmp_path / "b.wspl").read_bytes() == (tmp_path / "a.wspl").read_bytes()


class Sliced:
    """An array that can only be sliced, such as Zarr's or h5py's."""

    def __init__(self, array):
        self._array, self.shape, self.dtype, self.chunks = array, array.shape, array.dtype, (3, 20, 18, 22)

    def __getitem__(self, key):
        return self._array[key]


def test_pictures_are_volumes_of_one_layer(tmp_path):
    samples = smooth((6, 1, 18, 22))[:, 0]
    for n, source in enumerate([samples, list(samples)]):
        wavesplat.convert(source, tmp_path / f"{n}.wspl", tolerance=0)
        np.testing.assert_array_equal(wavesplat.open(tmp_path / f"{n}.wspl")[:, 0], samples)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tolerance": 2.0}, "tolerance"),
        ({"tolerance": 0.1, "max_error": 0.1}, "give one"),
        ({"bound": "best"}, "bound: 'pointwise'"),
        ({"missing": "ignore"}, "missing: 'error' or 'mask'"),
        ({"tolerance": {"u": 0.1}}, "no entry for"),
        ({"variable": "u"}, "Dataset"),
        ({"times": [0.0, 1.0]}, "times"),
        ({"window": 0}, "window"),
        ({"best_for": "speed"}, "best_for"),
        ({"memory": 1000}, "memory"),
        ({"range": (1, 0)}, "range"),
    ],
)
def test_wrong_settings(tmp_path, samples, options, words):
    with pytest.raises(ValueError, match=words):
        wavesplat.convert(samples, tmp_path / "a.wspl", **options)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "source", [np.zeros((3, 4)), np.zeros((0, 4, 4, 4)), np.zeros((3, 4, 4, 4), complex), 7, "text"]
)
def test_wrong_sources(tmp_path, source):
    with pytest.raises((ValueError, wavesplat.InputError), match="source"):
        wavesplat.convert(source, tmp_path / "a.wspl")


def test_existing_files_are_kept(tmp_path, samples):
    path = tmp_path / "a.wspl"
    path.write_text("mine")
    with pytest.raises(ValueError, match="exists already"):
        wavesplat.convert(samples, path)
    assert path.read_text() == "mine"
    wavesplat.convert(samples, path, overwrite=True)
    assert wavesplat.open(path).shape == samples.shape


def test_errors_in_the_samples_unit(tmp_path, samples):
    report = wavesplat.convert(samples, tmp_path / "a.wspl", max_error=0.02)
    assert abs(wavesplat.open(tmp_path / "a.wspl")[...] - samples).max() <= 0.02
    assert report["reached"] <= 0.02
    wavesplat.convert(np.abs(samples) + 1, tmp_path / "b.wspl", bound="relative", tolerance=0.01)
    back = wavesplat.open(tmp_path / "b.wspl")[...].astype(float)
    original = (np.abs(samples) + 1).astype(float)
    assert (abs(back - original) <= 0.01 * original).all()


def test_missing_samples(tmp_path, samples):
    holes = samples.copy()
    holes[:, 3, 4, 5:9] = np.nan
    with pytest.raises(wavesplat.InputError, match="missing value"):
        wavesplat.convert(holes, tmp_path / "a.wspl")
    wavesplat.convert(holes, tmp_path / "a.wspl", missing="mask")
    np.testing.assert_array_equal(np.isnan(wavesplat.open(tmp_path / "a.wspl")[...]), np.isnan(holes))
    filled = np.where(np.isnan(holes), -999, holes).astype("f4")
    wavesplat.convert(filled, tmp_path / "b.wspl", missing=-999)
    file = wavesplat.open(tmp_path / "b.wspl")
    assert file.missing_value == -999
    np.testing.assert_array_equal(file[...] == -999, filled == -999)


def test_masks_are_not_lost(tmp_path, samples):
    with pytest.raises(ValueError, match="filled"):
        wavesplat.convert(np.ma.masked_less(samples, 0), tmp_path / "a.wspl")


def test_exceptions_of_frames_come_through(tmp_path, samples):
    def frames():
        yield samples[0]
        raise LookupError("the simulation ended")

    with pytest.raises(LookupError, match="the simulation ended"):
        wavesplat.convert(frames(), tmp_path / "a.wspl")
    with pytest.raises(wavesplat.InputError, match="of shape"):
        wavesplat.convert([samples[0], samples[0, 1:]], tmp_path / "a.wspl")
    with pytest.raises(wavesplat.InputError, match="is empty"):
        wavesplat.convert([], tmp_path / "a.wspl")
    assert not (tmp_path / "a.wspl").exists()


def test_progress(tmp_path, samples, capsys):
    seen = []
    wavesplat.convert(samples, tmp_path / "a.wspl", progress=lambda done, steps: seen.append((done, steps)))
    assert seen[-1][0] == seen[-1][1] > 0
    wavesplat.convert(samples, tmp_path / "b.wspl", progress=True)
    assert "convert" in capsys.readouterr().err

    def stop(done, steps):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        wavesplat.convert(slow(samples), tmp_path / "c.wspl", progress=stop)


def slow(samples):
    for frame in samples:
        time.sleep(0.02)
        yield frame


INTERRUPTED = """
    import signal, sys, time
    import numpy as np
    import wavesplat
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it
    samples = np.load("a.npy")
    class Slow:
        shape, dtype = samples.shape, samples.dtype
        chunks = (16, 1, 1, 1)
        def __getitem__(self, key):
            if key.start >= 16 and len(sys.argv) > 1:
                print("waiting", flush=True)
                time.sleep(60)
            return samples[key]
    wavesplat.convert(Slow(), "b.wspl", tolerance=0.003, window=16, block=16, memory=32 << 20, resume=len(sys.argv) == 1)
"""


def test_an_interrupted_conversion_goes_on(tmp_path):
    """Ctrl-C raises KeyboardInterrupt, keeps the finished windows, and resume gives the bytes of an undisturbed run."""
    samples = smooth((40, 40, 40, 40))
    np.save(tmp_path / "a.npy", samples)
    (tmp_path / "work.py").write_text(textwrap.dedent(INTERRUPTED))
    words = [sys.executable, "work.py", "slowly"]
    process = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    part = tmp_path / "b.wspl.part"
    assert process.stdout.readline() == "waiting\n"
    wait_for(lambda: part.exists() and part.stat().st_size > 1000)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert "KeyboardInterrupt" in errors
    assert part.exists()
    assert not (tmp_path / "b.wspl").exists()
    subprocess.run(words[:2], cwd=tmp_path, check=True)
    wavesplat.convert(samples, tmp_path / "c.wspl", tolerance=0.003, window=16, block=16, memory=32 << 20)
    assert (tmp_path / "b.wspl").read_bytes() == (tmp_path / "c.wspl").read_bytes()
    assert wavesplat.convert(samples, tmp_path / "c.wspl", tolerance=0.003, window=16, block=16, resume=True) == {}
    with pytest.raises(ValueError, match="other settings"):
        wavesplat.convert(samples, tmp_path / "c.wspl", tolerance=0.1, window=16, block=16, resume=True)


def wait_for(condition):
    for _ in range(200):
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError("never")


BOUNDED = """
    import json, resource
    import dask, dask.array as da
    import numpy as np
    import wavesplat
    dask.config.set(scheduler="single-threaded")
    budget = 32 << 20
    def frames(block_info=None):
        (t0, t1), *_ = block_info[None]["array-location"]
        t, z, y, x = np.ogrid[t0:t1, 0:64, 0:64, 0:64]
        return np.sin(0.05 * (t + x) + 0.02 * y * z / 64).astype("f4")
    array = da.map_blocks(frames, chunks=((8,) * 80, 64, 64, 64), dtype="f4")
    assert array.nbytes >= 20 * budget, array.nbytes
    settings = dict(memory=budget, window=16, block=16)
    wavesplat.convert(array[:32], "warm.wspl", **settings)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    wavesplat.convert(array, "a.wspl", **settings)
    print(json.dumps([before, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss]))
"""


def test_memory_is_bounded(tmp_path):
    """A Dask array twenty times as large as the budget takes hardly more memory than its first window."""
    (tmp_path / "work.py").write_text(textwrap.dedent(BOUNDED))
    done = subprocess.run([sys.executable, "work.py"], cwd=tmp_path, check=True, capture_output=True, text=True)
    before, after = json.loads(done.stdout)
    assert after - before < 16 << 10, f"{before} -> {after} KiB"
    assert wavesplat.open(tmp_path / "a.wspl").shape == (640, 64, 64, 64)


def test_warnings_are_of_the_callers_line(tmp_path):
    with pytest.warns(UserWarning, match="keep='range'") as warned:
        wavesplat.convert(np.abs(smooth()), tmp_path / "a.wspl", tolerance=0.05)
    assert {warning.filename for warning in warned} == {__file__}
