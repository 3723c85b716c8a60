"""Files are Zarr groups that say what xarray says of them."""

import asyncio
import pickle

import dask.array as da
import numpy as np
import pytest
import xarray as xr
from conftest import run, smooth
from test_xarray import ocean

import wavesplat

zarr = pytest.importorskip("zarr")  # for Python 3.11 or later

from zarr.abc.store import OffsetByteRequest, RangeByteRequest, SuffixByteRequest  # noqa: E402
from zarr.core.buffer import default_buffer_prototype  # noqa: E402
from zarr.storage import MemoryStore  # noqa: E402

import wavesplat.zarr  # noqa: E402
from wavesplat.zarr import CoefficientStore  # noqa: E402


def test_samples_are_those_of_the_file(path, decoded):
    group = wavesplat.zarr.open(path)
    samples = group["data"]
    assert samples.shape == decoded.shape
    assert samples.dtype == decoded.dtype
    assert samples.chunks == (16, 12, 12, 12)
    np.testing.assert_array_equal(samples[...], decoded)
    np.testing.assert_array_equal(samples[15:18, ::3, -2, 5], decoded[15:18, ::3, -2, 5])
    np.testing.assert_array_equal(samples.oindex[[0, 39], :, [1, 17], 2], decoded[[0, 39]][:, :, [1, 17], 2])
    lazy = da.from_zarr(samples)
    np.testing.assert_array_equal(lazy[:, 3].max(axis=0).compute(), decoded[:, 3].max(axis=0))


@pytest.mark.parametrize("dtype", ["f4", "f8", "i2", "u1"])
def test_xarray_opens_the_same_dataset(tmp_path, dtype):
    ds = ocean(dtype)
    if dtype == "f4":
        ds["thetao"][2:5, 1, 3:7, 2:9] = np.nan
        ds["thetao"].encoding["_FillValue"] = np.float32(1e20)
    if dtype == "i2":
        ds["thetao"].attrs["_FillValue"] = np.int16(-999)
    ds.to_wavesplat(tmp_path / "a.wspl", block=8, window=4)
    for lod in 0, 1:
        expected = xr.open_dataset(tmp_path / "a.wspl", engine="wavesplat", lod=lod)
        store = CoefficientStore(wavesplat.open(tmp_path / "a.wspl", lod=lod))
        found = xr.open_zarr(store, consolidated=False)
        assert found.thetao.chunks
        xr.testing.assert_identical(found.load(), expected.load())


@pytest.mark.filterwarnings("ignore:The data type")
def test_all_that_stands_beside_the_samples(tmp_path):
    samples = smooth((6, 5, 7, 8))
    beside = {
        "text": ("z", np.array(["a", "bc", "", "déf", "g"], object)),
        "letters": (("z", "width"), np.array([list("ab")] * 5, "S1"), {"_FillValue": b" "}),
        "one": ((), 3.5),
        "yes": ("x", np.arange(8) % 2 == 0),
        "kept": ("y", np.arange(7.0, dtype="f4"), {"_FillValue": np.float32(3)}),
        "whole": ("y", np.arange(7, dtype="i4"), {"_FillValue": np.int32(-1)}),
    }
    ds = xr.Dataset({"v": (("t", "z", "y", "x"), samples)}).assign_coords(beside)
    ds.attrs = {"_FillValue": 3.0, "list": [1.5, 2.5], "text": "a text"}
    ds.to_netcdf(tmp_path / "a.nc")
    run("convert", tmp_path / "a.nc", "-o", tmp_path / "a.wspl", "-q")
    expected = xr.open_dataset(tmp_path / "a.wspl", engine="wavesplat").load()
    found = xr.open_zarr(CoefficientStore(wavesplat.open(tmp_path / "a.wspl")), consolidated=False).load()
    assert set(found.variables) == set(expected.variables)
    for name in expected.variables:
        np.testing.assert_array_equal(found[name].values, expected[name].values, err_msg=name)
        assert found[name].dims == expected[name].dims
    assert found.attrs["list"] == [1.5, 2.5]


@pytest.mark.parametrize("fill", [np.nan, np.inf, 0.5])
def test_a_fill_value_that_no_integer_has_is_left_out(fill):
    assert wavesplat.zarr._plain({"_FillValue": fill, "units": "m"}, np.dtype("i4")) == {"units": "m"}


@pytest.mark.parametrize("name", ["a\\b", "zarr.json", "..", "c", "__x", "é t"])
def test_any_name_of_samples_has_an_array(tmp_path, name):
    array = xr.DataArray(smooth((4, 5, 6, 7)), dims=("t", "z", "y", "x"), name=name)
    wavesplat.convert(array, tmp_path / "a.wspl")
    ((_, samples),) = wavesplat.zarr.open(tmp_path / "a.wspl").arrays()
    np.testing.assert_array_equal(samples[...], wavesplat.open(tmp_path / "a.wspl")[...])


def test_colours_are_three_arrays(tmp_path, samples):
    np.save(tmp_path / "a.npy", samples[:4])
    run("convert", tmp_path / "a.npy", "-o", tmp_path / "a.wspl", "--transfer-function", "viridis", "-q")
    file, group = wavesplat.open(tmp_path / "a.wspl"), wavesplat.zarr.open(tmp_path / "a.wspl")
    assert file.channels == 3
    for channel, name in enumerate(("red", "green", "blue")):
        np.testing.assert_array_equal(group[name][...], file.read(channel=channel))


def test_a_store_holds_what_it_lists(file, decoded):
    """Copying the listed keys makes a store that needs no wavesplat."""
    store, copy = CoefficientStore(file), MemoryStore()
    prototype = default_buffer_prototype()

    async def keys():
        found = [key async for key in store.list()]
        for key in found:
            assert await store.exists(key)
            await copy.set(key, await store.get(key, prototype))
        assert sorted([key async for key in store.list_dir("")]) == ["data", "zarr.json"]
        assert sorted([key async for key in store.list_dir("data")]) == ["c", "zarr.json"]
        assert [key async for key in store.list_dir("data/c/")] == ["0", "1", "2"]
        assert [key async for key in store.list_dir("data/c/0/0/0/")] == ["0", "1"]
        assert not [key for folder in ("data/c/3", "data/c/0/0/0/0", "data/d") async for key in store.list_dir(folder)]
        return found

    found = asyncio.run(keys())
    assert len(found) == len(set(found)) == 2 + 3 * 2 * 2 * 2
    np.testing.assert_array_equal(zarr.open_group(copy, mode="r")["data"][...], decoded)


def test_parts_of_chunks_and_keys_that_are_not_there(file):
    store, prototype = CoefficientStore(file), default_buffer_prototype()

    def get(key, part=None):
        found = asyncio.run(store.get(key, prototype, part))
        return None if found is None else found.to_bytes()

    whole = get("data/c/2/1/1/1")
    assert len(whole) == 16 * 12**3 * 4
    assert get("data/c/2/1/1/1", RangeByteRequest(100, 164)) == whole[100:164]
    assert get("data/c/2/1/1/1", OffsetByteRequest(1000)) == whole[1000:]
    assert get("data/c/2/1/1/1", SuffixByteRequest(8)) == whole[-8:]
    for key in (
        "data/c/3/0/0/0",
        "data/c/-1/0/0/0",
        "data/c/01/0/0/0",
        "data/c/+1/0/0/0",
        "data/c/²/0/0/0",
        "data/c/0/0/0",
        "data/c/0/0/0/a",
        "other/c/0",
        "data/c/",
        "c/0",
    ):
        assert get(key) is None, key
        assert not asyncio.run(store.exists(key)), key


def test_nothing_is_written(file):
    group = zarr.open_group(CoefficientStore(file), mode="r")
    with pytest.raises(ValueError, match="not written by Zarr"):
        group["data"][0] = 1
    with pytest.raises(ValueError, match="not written by Zarr"):
        asyncio.run(CoefficientStore(file).delete("data/zarr.json"))


def test_stores_travel_to_other_processes(file, decoded):
    store = pickle.loads(pickle.dumps(CoefficientStore(file)))
    assert store == CoefficientStore(file)
    assert store != CoefficientStore(wavesplat.open(file.path, lod=1))
    np.testing.assert_array_equal(zarr.open_group(store, mode="r")["data"][7], decoded[7])


def test_a_closed_store_is_a_closed_file(path):
    group = wavesplat.zarr.open(path)
    group.store.close()
    with pytest.raises(ValueError, match="is closed"):
        group["data"][0]


def test_damage_is_named(tmp_path, path):
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 0xFF
    (tmp_path / "a.wspl").write_bytes(whole)
    with pytest.raises(wavesplat.DamagedError, match=r"a\.wspl"):
        wavesplat.zarr.open(tmp_path / "a.wspl")["data"][...]
