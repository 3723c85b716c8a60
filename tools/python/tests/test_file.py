"""What a file knows, and what becomes of damaged ones."""

import concurrent.futures
import pickle
import shutil

import numpy as np
import pytest
import xarray as xr
from conftest import SHAPE, run, smooth

import wavesplat


def test_facts(file, samples):
    assert (file.shape, file.dtype, file.ndim, len(file)) == (SHAPE, np.float32, 4, SHAPE[0])
    assert file.nbytes == samples.nbytes
    assert file.chunks == ((16, 16, 8), (12, 8), (12, 6), (12, 10))
    assert file.dims == ("time", "z", "y", "x")
    assert file.coords == {}
    assert file.promise["tolerance"] == 1e-3
    assert abs(file[...] - samples).max() <= file.bound <= 1e-3 * np.ptp(samples)
    assert file.range == pytest.approx((samples.min(), samples.max()), abs=file.bound)
    assert "error <= " in repr(file)
    file.check()


def test_places_and_times(tmp_path):
    times = np.array(["2001-02-03T04:00", "2001-02-03T05:00", "2001-02-03T07:00"], "datetime64[m]")
    place = {"spacing": (1.0, 2.0, 0.5), "origin": (10.0, 0.0, -1.0)}
    wavesplat.convert(smooth((3, 4, 5, 6)), tmp_path / "a.wspl", times=times, **place)
    file = wavesplat.open(tmp_path / "a.wspl")
    assert file.time_unit == "seconds since 2001-02-03 04:00:00"
    assert file.coords["time"].tolist() == [0.0, 3600.0, 10800.0]
    assert file.coords["x"].tolist() == [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]
    assert file.coords["z"].tolist() == [-1.0, -0.5, 0.0, 0.5]


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i4", "f2", "f4", "f8"])
def test_every_type_comes_back_exactly(tmp_path, dtype):
    samples = smooth((5, 4, 6, 7), np.dtype(dtype))
    wavesplat.convert(samples, tmp_path / "a.wspl", tolerance=0)
    back = wavesplat.open(tmp_path / "a.wspl")[...]
    assert back.dtype == samples.dtype
    np.testing.assert_array_equal(back, samples)


def test_out(file, decoded):
    out = np.empty((2, *SHAPE[1:]), file.dtype)
    assert file.read(slice(30, 32), out=out) is out
    np.testing.assert_array_equal(out, decoded[30:32])
    strided = np.empty((2, 1, SHAPE[2], SHAPE[3]), file.dtype)[..., ::2]
    file.read([3, 1], 4, slice(None), slice(0, None, 2), out=strided)
    np.testing.assert_array_equal(strided, decoded[[3, 1], 4:5, :, ::2])
    for wrong in (np.empty((1, *SHAPE[1:]), file.dtype), np.empty((2, *SHAPE[1:]), np.float64)):
        with pytest.raises(ValueError, match="out: takes float32 of shape"):
            file.read(slice(30, 32), out=wrong)


def test_out_that_cannot_be_written(file):
    out = np.empty((2, *SHAPE[1:]), file.dtype)
    out.flags.writeable = False
    with pytest.raises(ValueError, match="out: cannot be written"):
        file.read(slice(30, 32), out=out)


def test_single_samples_are_numbers(file, decoded):
    assert type(file[1, 2, 3, 4]) is type(decoded[1, 2, 3, 4]) is np.float32
    assert file.size == decoded.size


def test_small_memory_gives_the_same(file, decoded):
    np.testing.assert_array_equal(file.read(slice(None, None, -3), memory=10 << 20), decoded[::-3])


def test_levels_of_detail(path, decoded):
    coarse = wavesplat.open(path, lod=1)
    np.testing.assert_array_equal(coarse[...], decoded[:, ::2, ::2, ::2])
    with pytest.raises(ValueError, match="lod|level|detail"):
        wavesplat.open(path, lod=30)


def test_several_threads(file, decoded):
    def read(n):
        return np.array_equal(file[n % 40, ..., n % 22], decoded[n % 40, ..., n % 22])

    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        assert all(pool.map(read, range(200)))


def test_pickled_files_are_opened_again(path, tmp_path):
    file = wavesplat.open(path)
    again = pickle.loads(pickle.dumps(file))
    assert (again.id, again.shape) == (file.id, file.shape)
    moved = tmp_path / "a.wspl"
    shutil.copy(path, moved)
    packed = pickle.dumps(wavesplat.open(moved))
    wavesplat.convert(smooth(seed=2), moved, overwrite=True)
    with pytest.raises(wavesplat.ChangedError, match="another file"):
        pickle.loads(packed)


def test_no_such_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="none.wspl"):
        wavesplat.open(tmp_path / "none.wspl")
    (tmp_path / "text.wspl").write_text("no coefficients" * 100)
    with pytest.raises(wavesplat.DamagedError, match="not a wavesplat coefficient file"):
        wavesplat.open(tmp_path / "text.wspl")


def test_damaged_files_raise(path, tmp_path, decoded):
    """Cut and flipped files raise an exception of wavesplat, or give the right samples."""
    whole = path.read_bytes()
    rng = np.random.default_rng(3)
    damaged = tmp_path / "damaged.wspl"
    raised = 0
    for n in range(120):
        bytes_ = bytearray(whole)
        at = int(rng.integers(len(whole)))
        if n % 3:
            bytes_[at] ^= 1 << int(rng.integers(8))
        else:
            del bytes_[at:]
        damaged.write_bytes(bytes_)
        try:
            samples = wavesplat.open(damaged)[...]
        except (wavesplat.WavesplatError, ValueError) as error:
            assert "damaged.wspl" in str(error)
            raised += 1
        else:
            np.testing.assert_array_equal(samples, decoded)
    assert raised > 100
    with pytest.raises(wavesplat.DamagedError):
        wavesplat.open(damaged).check()


def test_an_array_by_numpys_protocol(file, decoded):
    np.testing.assert_array_equal(np.asarray(file), decoded)
    assert np.asarray(file, dtype="f8").dtype == np.float64
    with pytest.raises(ValueError, match="decoded"):
        file.__array__(copy=False)


def test_closing(path, decoded):
    with wavesplat.open(path) as file:
        np.testing.assert_array_equal(file[3], decoded[3])
        assert not file.closed
    assert file.closed
    assert "closed" in repr(file)
    file.close()
    for use in (lambda: file[3], lambda: file.render(size=(8, 8)), lambda: file.times, lambda: pickle.dumps(file)):
        with pytest.raises(ValueError, match="run.wspl: is closed"):
            use()


def test_addresses_of_files(path, decoded, tmp_path):
    spaced = tmp_path / "a b#1?.wspl"
    shutil.copy(path, spaced)
    quoted = str(spaced).replace(" ", "%20").replace("#", "%23").replace("?", "%3F")
    for address in (f"file://{path}", f"file://localhost{path}", f"FILE://{path}", f"file://{quoted}"):
        np.testing.assert_array_equal(wavesplat.open(address)[1], decoded[1])
    with pytest.raises(ValueError, match="another machine, elsewhere"):
        wavesplat.open(f"file://elsewhere{path}")
    with pytest.raises(FileNotFoundError):
        wavesplat.open("file:///none/none.wspl")
    wavesplat.convert(decoded, f"file://{tmp_path}/c.wspl")
    assert (tmp_path / "c.wspl").exists()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda file: wavesplat.open(7), "path: takes a path, an address or a file object, not 7"),
        (lambda file: wavesplat.open(file.path, lod="1"), "lod: takes a whole number, not '1'"),
        (lambda file: file.read(memory="1GiB"), "memory: takes a whole number"),
        (lambda file: file.read(channel=0.5), "channel: takes a whole number"),
        (lambda file: file.read(out=[0.0]), "out: takes an array of numpy, not list"),
        (lambda file: wavesplat.merge(file.path, "a.wspl"), "shards: takes a list of files"),
    ],
)
def test_wrong_types_say_what_is_wanted(file, call, words):
    with pytest.raises(TypeError, match=words):
        call(file)


def test_extracting_writes_what_the_program_does(path, decoded, tmp_path):
    file = wavesplat.open(path)
    report = file.extract(tmp_path / "part.npy", slice(3, 30, 2), y=slice(4, 9), x=5)
    assert report["frames"] == 14
    assert np.array_equal(np.load(tmp_path / "part.npy"), decoded[3:30:2, :, 4:9, 5:6])
    run("extract", path, "-o", tmp_path / "whole.nc")
    file.extract(tmp_path / "own.nc")
    assert (tmp_path / "own.nc").read_bytes() == (tmp_path / "whole.nc").read_bytes()
    wavesplat.open(path, lod=1).extract(tmp_path / "coarse_%02d.vti", [7, 8])
    assert sorted(found.name for found in tmp_path.glob("*.vti")) == ["coarse_07.vti", "coarse_08.vti"]
    for output, key, words in (
        ("own.nc", {}, "exists"),
        ("own.foo", {}, "the extension is none of"),
        ("a.npy", {"y": slice(0, 9, 2)}, "y: takes voxels that follow each other"),
        ("a.npy", {"z": slice(5, 5)}, "z: takes voxels"),
        ("a.npy", {"t": [5, 3]}, "t: takes frames that ascend"),
        ("a.npy", {"t": [3, 3]}, "t: takes frames that ascend"),
        ("a.npy", {"t": []}, "t: takes frames that ascend, at least one"),
        ("a.npy", {"channel": 1}, "channel"),
    ):
        with pytest.raises(ValueError, match=words):
            file.extract(tmp_path / output, **key)
    file.extract(tmp_path / "some.npy", 0, z=None, y=slice(0, 4))
    assert np.array_equal(np.load(tmp_path / "some.npy"), decoded[:1, :, :4])
    assert np.array_equal(file.read(0, None, slice(0, 4)), decoded[0, :, :4])
    shutil.copy(path, tmp_path / "self.npy")
    with pytest.raises(ValueError, match="would replace the input"):
        wavesplat.open(tmp_path / "self.npy").extract(tmp_path / "self.npy", overwrite=True)
    file.extract(tmp_path / "own.nc", 3, overwrite=True)
    assert len(xr.open_dataset(tmp_path / "own.nc").time) == 1
