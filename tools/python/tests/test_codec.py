"""Chunks of Zarr arrays are stored by the codec, and keep its bound."""

import json
import pickle

import dask.array as da
import numpy as np
import pytest
import xarray as xr
from conftest import smooth

import wavesplat

zarr = pytest.importorskip("zarr")  # for Python 3.11 or later

from zarr.storage import MemoryStore  # noqa: E402

from wavesplat.zarr import WavesplatCodec  # noqa: E402


def stored(samples, chunks, codec, store=None, **options):
    """The samples, written by the codec and read again."""
    store = MemoryStore() if store is None else store
    settings = {"shape": samples.shape, "dtype": samples.dtype, "chunks": chunks, "compressors": None} | options
    zarr.create_array(store, serializer=codec, **settings)[...] = samples
    return zarr.open_array(store, mode="r")[...]


def error(a, b):
    return np.abs(a.astype("f8") - b.astype("f8")).max()


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", "u1", "i1", "u2", "i2", "u4", "i4", ">f4", "i8", "u8"])
def test_samples_of_all_types_keep_the_bound(dtype):
    samples = smooth((13, 6, 9, 10), "f8").clip(-3, 3)
    samples = (samples * 40 if dtype[-2] == "i" else (samples + 3) * 40).astype(dtype)
    for allowed in (0.0, 0.25, 1.0):
        found = stored(samples, (7, 6, 5, 10), WavesplatCodec(max_error=allowed))
        assert found.dtype == samples.dtype.newbyteorder("=")
        assert error(found, samples) <= allowed
        assert allowed == 0 or dtype[-2:] not in ("f4", "f8") or error(found, samples) > 0


def test_booleans_come_back():
    samples = smooth((9, 6, 9, 10)) > 0
    np.testing.assert_array_equal(stored(samples, (4, 6, 9, 10), WavesplatCodec(tolerance=0.01)), samples)


@pytest.mark.parametrize(
    ("axes", "shape", "chunks"),
    [
        (None, (40,), (25,)),
        (None, (20, 30), (20, 7)),
        (None, (9, 20, 30), (4, 20, 30)),
        (None, (2, 3, 9, 4, 6, 8), (1, 2, 5, 4, 6, 8)),
        ("xyzt", (6, 5, 4, 12), (6, 5, 4, 7)),
        ("ztc", (6, 12, 3), (4, 12, 2)),
        ("yc", (6, 4), (6, 4)),
        ("cc", (3, 2), (3, 2)),
        (None, (), ()),
    ],
)
def test_axes_may_be_in_any_order(axes, shape, chunks):
    samples = np.random.default_rng(3).normal(size=shape)
    samples = np.asarray(samples.cumsum(axis=0) if shape else samples, "f4")
    found = stored(samples, chunks, WavesplatCodec(max_error=0.01, axes=axes))
    assert error(found, samples) <= 0.01
    assert error(found, samples) > 0 or "c" in (axes or "") or len(shape) < 2


def test_a_tolerance_refers_to_each_chunk_or_to_a_range():
    samples = smooth((16, 8, 8, 8))
    samples[:, :, :, 4:] *= 100
    found = stored(samples, (16, 8, 8, 4), WavesplatCodec(tolerance=0.01))
    for part in (np.s_[..., :4], np.s_[..., 4:]):
        assert error(found[part], samples[part]) <= 0.01 * np.ptp(samples[part])
    found = stored(samples, (16, 8, 8, 4), WavesplatCodec(tolerance=0.01, range=(-400, 400)))
    assert 0.5 < error(found, samples) <= 8


def test_missing_samples_stay(tmp_path):
    samples = smooth((16, 8, 8, 8))
    samples[3:, 2:4, :, 1] = np.nan
    samples[0, 0, 0, 0] = np.inf
    found = stored(samples, (16, 8, 8, 8), WavesplatCodec(tolerance=0.01, range=(-4, 4)), fill_value=np.nan)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(samples))
    assert found[0, 0, 0, 0] == np.inf
    finite = np.isfinite(samples)
    assert error(found[finite], samples[finite]) <= 0.08
    with pytest.raises(wavesplat.InputError, match="missing"):
        stored(samples, (16, 8, 8, 8), WavesplatCodec(tolerance=0.01, missing="error"))


@pytest.mark.parametrize("options", [{"fill_value": -9999}, {}])
def test_fill_values_stay_and_do_not_count(options):
    samples = smooth((16, 8, 8, 8), "i2")
    samples[:, :, 2:5, 3:] = -9999
    land = samples == -9999
    missing = "mask" if options else -9999
    found = stored(samples, (16, 8, 8, 8), WavesplatCodec(tolerance=0.01, missing=missing), **options)
    np.testing.assert_array_equal(found == -9999, land)
    assert error(found[~land], samples[~land]) <= 0.01 * np.ptp(samples[~land].astype("f8"))


@pytest.mark.parametrize("fill", [0.0, -0.0, 1.5, np.nan])
def test_what_lies_beyond_the_array_takes_no_bytes(fill):
    samples = smooth((35, 8, 8, 8)) + 100
    whole, parts = MemoryStore(), MemoryStore()
    codec = WavesplatCodec(max_error=0.01)
    stored(samples, (35, 8, 8, 8), codec, whole)
    found = stored(samples, (64, 16, 9, 12), codec, parts, fill_value=fill)
    assert error(found, samples) <= 0.01
    sizes = [
        sum(len(value) for key, value in store._store_dict.items() if key != "zarr.json") for store in (whole, parts)
    ]
    assert sizes[1] <= sizes[0] + 16  # the fill value is named
    whole = zarr.open_array(parts, mode="r+")
    whole.resize((64, 16, 9, 12))
    assert np.signbit(whole[-1, -1, -1, -1]) == np.signbit(fill)
    np.testing.assert_array_equal(whole[40], np.full((16, 9, 12), fill, "f4"))


def test_one_value_is_kept_besides_nan():
    samples = smooth((16, 8, 8, 8)) + 100
    samples[:, :, 2:5, 3:] = 7
    found = stored(samples, samples.shape, WavesplatCodec(tolerance=0.01), fill_value=7)
    np.testing.assert_array_equal(found == 7, samples == 7)
    wide = samples.copy()
    wide[wide == 7] = 1e20
    found = stored(wide, wide.shape, WavesplatCodec(max_error=0.01, missing=1e20), fill_value=1e20)
    np.testing.assert_array_equal(found == wide.max(), wide == wide.max())
    with pytest.raises(ValueError, match="missing: is -1.0, but the fill value of the array is 255"):
        stored(np.ones((4, 4), "u1"), (4, 4), WavesplatCodec(max_error=1, missing=-1), fill_value=255)
    with pytest.raises(ValueError, match="missing: is -9999.0, but the fill value of the array is 7"):
        stored(samples, samples.shape, WavesplatCodec(tolerance=0.01, missing=-9999), fill_value=7)


def test_filters_may_flatten_a_chunk():
    from zarr.codecs.numcodecs import Delta

    samples = smooth((16, 8, 9, 10))
    found = stored(samples, (16, 8, 9, 7), WavesplatCodec(tolerance=0), filters=[Delta(dtype="f4")])
    np.testing.assert_allclose(found, samples, rtol=1e-4, atol=1e-4)


def test_settings_are_those_of_json():
    codec = WavesplatCodec(max_error=np.float32(0.5), range=None, missing=np.int16(-9), axes="tzyx")
    again = WavesplatCodec.from_dict(json.loads(json.dumps(codec.to_dict())))
    assert (again, hash(again)) == (codec, hash(codec))
    ranged = WavesplatCodec(tolerance=0.01, range=np.array([0, 2]))
    assert WavesplatCodec.from_dict(json.loads(json.dumps(ranged.to_dict()))) == ranged
    assert WavesplatCodec(tolerance=0, missing=np.inf, keep=None) == WavesplatCodec(tolerance=0)
    assert WavesplatCodec(tolerance=0, missing=np.nan) == WavesplatCodec(tolerance=0)
    with pytest.raises(ValueError, match="a codec named 'zstd'"):
        WavesplatCodec.from_dict({"name": "zstd"})


def test_chunks_of_the_fill_value_alone_are_written_if_they_must_be():
    samples = np.full((8, 4, 4, 4), 7.0, "f4")
    options = {"fill_value": 7.0, "config": {"write_empty_chunks": True}}
    np.testing.assert_array_equal(stored(samples, (8, 4, 4, 4), WavesplatCodec(tolerance=0.1), **options), samples)


def test_shards_and_appends(tmp_path):
    samples = smooth((40, 16, 16, 16))
    codec = WavesplatCodec(max_error=0.01)
    assert error(stored(samples, (8, 8, 8, 16), codec, shards=(16, 16, 16, 16)), samples) <= 0.01
    array = zarr.create_array(
        tmp_path / "a", shape=(0, 16, 16, 16), chunks=(16, 16, 16, 16), dtype="f4", serializer=codec
    )
    array.append(samples[:20])
    before = array[:16].copy()
    array.append(samples[20:])
    np.testing.assert_array_equal(array[:16], before)
    assert error(array[...], samples) <= 0.02  # frames 16 to 19 are coded twice: their chunk was not full


def test_xarray_and_dask_write_and_read(tmp_path):
    samples = smooth((24, 2, 12, 16))
    ds = xr.Dataset({"t": (("time", "z", "y", "x"), samples)}, {"time": np.arange(24) * 3.5})
    encoding = {"t": {"serializer": WavesplatCodec(max_error=0.01), "compressors": None, "chunks": (8, 2, 12, 16)}}
    ds.chunk(time=8).to_zarr(tmp_path / "run.zarr", encoding=encoding, zarr_format=3)
    found = xr.open_zarr(tmp_path / "run.zarr")
    assert 0 < error(found.t.values, samples) <= 0.01
    np.testing.assert_array_equal(found.time, ds.time)
    facts = json.loads((tmp_path / "run.zarr/t/zarr.json").read_text())
    assert facts["codecs"] == [{"name": "wavesplat", "configuration": {"max_error": 0.01}}]
    array = da.from_array(samples, chunks=(8, 2, 12, 16))
    target = zarr.create_array(
        MemoryStore(), shape=array.shape, chunks=array.chunksize, dtype="f4", serializer=WavesplatCodec(tolerance=0)
    )
    array.store(target)
    np.testing.assert_array_equal(target[...], samples)


def test_bytes_do_not_depend_on_who_writes():
    samples, codec = smooth((16, 12, 12, 12)), WavesplatCodec(max_error=0.001, keep="range")
    stores = [MemoryStore(), MemoryStore()]
    for store in stores:
        stored(samples, (16, 12, 12, 12), codec, store)
    assert stores[0]._store_dict["c/0/0/0/0"].to_bytes() == stores[1]._store_dict["c/0/0/0/0"].to_bytes()
    assert pickle.loads(pickle.dumps(codec)) == codec == WavesplatCodec.from_dict(codec.to_dict())


def test_wrong_settings_are_refused():
    samples = smooth((8, 4, 4, 4))
    for wrong, words in [
        ({}, "tolerance: give this or max_error"),
        ({"max_error": 1, "level": 20}, "level: takes 1 to 19"),
        ({"max_error": 1, "range": ()}, "range: takes"),
        ({"max_error": 1, "missing": "often"}, "missing: 'error' or 'mask'"),
        ({"tolerance": 2}, "tolerance: takes 0 to 1"),
        ({"tolerance": 1, "max_error": 1}, "give one"),
        ({"tolerance": 1, "bound": "best"}, "bound: 'pointwise'"),
        ({"max_error": 1, "axes": "tzy"}, "axes: takes a letter"),
        ({"max_error": 1, "axes": "tzyy"}, "axes: takes a letter"),
        ({"max_error": 1, "keep": "peace"}, "peace"),
        ({"max_error": -1}, "max_error"),
    ]:
        with pytest.raises((ValueError, wavesplat.WavesplatError), match=words):
            stored(samples, samples.shape, WavesplatCodec(**wrong))
    with pytest.raises(ValueError, match="complex128"):
        stored(samples.astype("c16"), samples.shape, WavesplatCodec(tolerance=0))
    with pytest.raises(ValueError, match="unknown in the codec's configuration: speed"):
        WavesplatCodec.from_dict({"name": "wavesplat", "configuration": {"tolerance": 1, "speed": 2}})
    with pytest.raises(wavesplat.InputError, match="does not fit into int32"):
        stored(samples.astype("i8") + 2**40, samples.shape, WavesplatCodec(tolerance=0))


def test_damaged_chunks_are_named():
    samples, store = smooth((16, 8, 8, 8)), MemoryStore()
    stored(samples, samples.shape, WavesplatCodec(max_error=0.001), store)
    whole = store._store_dict["c/0/0/0/0"].to_bytes()
    prototype = type(store._store_dict["c/0/0/0/0"])
    rng = np.random.default_rng(5)
    cases = [whole[:cut] for cut in (0, 7, 23, 100, len(whole) - 1)] + [whole + b"x", whole + whole]
    for at in rng.integers(0, len(whole), 60):
        cases.append(whole[:at] + bytes([whole[at] ^ (1 << rng.integers(8))]) + whole[at + 1 :])
    for case in cases:
        store._store_dict["c/0/0/0/0"] = prototype.from_bytes(case)
        with pytest.raises(wavesplat.DamagedError, match="a chunk: ") as raised:
            zarr.open_array(store, mode="r")[...]
        assert "recover" not in str(raised.value)


def test_chunks_of_another_array_are_refused():
    samples = smooth((16, 8, 8, 8))
    for other in (samples[:, :, :, :7].copy(), samples.astype("f8"), samples[:15].copy()):
        one, another = MemoryStore(), MemoryStore()
        stored(samples, samples.shape, WavesplatCodec(max_error=0.001), one)
        stored(other, other.shape, WavesplatCodec(max_error=0.001), another)
        another._store_dict["c/0/0/0/0"] = one._store_dict["c/0/0/0/0"]
        with pytest.raises(wavesplat.InputError, match="a chunk.*the array has"):
            zarr.open_array(another, mode="r")[...]


def test_numcodecs_has_a_codec_too():
    numcodecs = pytest.importorskip("numcodecs")
    samples = smooth((2, 16, 5, 8, 9)[1:]).reshape(2, 8, 5, 8, 9)
    config = {"id": "wavesplat", "max_error": 0.01}
    codec = numcodecs.get_codec(config)
    assert codec.get_config() == config
    stored = codec.encode(samples)
    assert 0 < error(codec.decode(stored), samples) <= 0.01
    out = np.empty_like(samples)
    codec.decode(stored, out)
    assert error(out, codec.decode(stored)) == 0
    relative = numcodecs.get_codec({"id": "wavesplat", "bound": "relative", "tolerance": 0.01})
    found = relative.decode(relative.encode(samples))
    assert (np.abs(found - samples) <= 0.01 * np.abs(samples)).all()
    streams = stored[4 + int.from_bytes(stored[:4], "little") :]
    empty = np.empty((0, 4), "f4")
    assert codec.decode(codec.encode(empty)).shape == (0, 4)
    huge = b'{"shape": [1048576, 1048576], "dtype": "<f4"}'
    nested = b"[" * 100_000
    other = [
        json.dumps({"shape": shape, "dtype": dtype}).encode()
        for shape, dtype in [((2, 9, 5, 8, 9), "<f4"), ((2, 8, 5, 8, 9), "<f8")]
    ]
    lying = [
        len(text).to_bytes(4, "little") + text + streams for text in (huge, nested, *other, huge.replace(b"<f4", b"O"))
    ]
    for damaged in (*lying, b"", stored[:20], stored[:-1], stored + b"x", stored[:4] + b"x" + stored[5:]):
        with pytest.raises(wavesplat.DamagedError):
            codec.decode(damaged)
