"""Datasets go into files and come back, lazily and with all that they say."""

import io
import pickle
import warnings

import numpy as np
import pytest
import xarray as xr
from conftest import run, smooth

import wavesplat
import wavesplat.xarray  # noqa: F401

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def ocean(dtype="f4"):
    """A dataset with dates, a descending latitude, depths, a field beside the axes, texts, and missing samples."""
    samples = smooth((10, 5, 12, 16), np.dtype(dtype))
    lat, lon = np.linspace(60, 5, 12), np.arange(16) * 2.5
    coords = {
        "time": ("time", np.datetime64("2001-03-01", "ns") + np.arange(10) * np.timedelta64(6, "h")),
        "depth": ("depth", [0.0, 10.0, 30.0, 70.0, 150.0], {"units": "m", "positive": "down"}),
        "lat": ("lat", lat, {"units": "degrees_north", "standard_name": "latitude"}),
        "lon": ("lon", lon, {"units": "degrees_east"}),
        "area": (("lat", "lon"), np.cos(np.radians(lat))[:, None] * np.ones(16), {"units": "m2"}),
        "run": ((), 7),
    }
    attrs = {"units": "degC", "long_name": "sea temperature", "levels": np.array([1, 2, 3], "i4")}
    dims = ("time", "depth", "lat", "lon")
    return xr.Dataset({"thetao": (dims, samples, attrs)}, coords, {"title": "an ocean", "version": 3})


def test_a_dataset_comes_back(tmp_path):
    ds = ocean()
    report = ds.to_wavesplat(tmp_path / "a.wspl", tolerance={"thetao": 1e-3})
    back = xr.open_dataset(tmp_path / "a.wspl")
    assert list(back.data_vars) == ["thetao"]
    xr.testing.assert_identical(back.drop_vars("thetao"), ds.drop_vars("thetao"))
    assert back.thetao.dims == ds.thetao.dims
    assert back.thetao.dtype == np.float32
    np.testing.assert_equal(dict(back.thetao.attrs), dict(ds.thetao.attrs))
    assert abs(back.thetao - ds.thetao).max() <= report["reached"] <= 1e-3 * np.ptp(ds.thetao.values)
    assert back.sel(lat=5, method="nearest").lat == 5


def test_the_bytes_of_the_program(tmp_path):
    """The program makes the same file of the dataset's NetCDF file."""
    ds = ocean()
    ds.to_netcdf(tmp_path / "a.nc")
    run("convert", tmp_path / "a.nc", "-o", tmp_path / "a.wspl", "-q")
    ds.to_wavesplat(tmp_path / "b.wspl")
    assert (tmp_path / "a.wspl").read_bytes() == (tmp_path / "b.wspl").read_bytes()
    ds.chunk({"time": 3, "lat": 5}).to_wavesplat(tmp_path / "c.wspl")
    assert (tmp_path / "a.wspl").read_bytes() == (tmp_path / "c.wspl").read_bytes()


def test_coordinates_over_any_axes_are_kept(tmp_path):
    ds = xr.Dataset({"v": (("time", "z", "y", "x"), smooth((8, 5, 6, 7)))})
    hours = np.datetime64("2001-01-01", "ns") + np.arange(8)[:, None] * np.timedelta64(24, "h")
    ds = ds.assign_coords(
        valid_time=(("time", "z"), hours + np.arange(5) * np.timedelta64(1, "h")),
        z_rho=(("z", "y", "x"), smooth((1, 5, 6, 7))[0]),
        zeta=(("time", "y", "x"), smooth((8, 1, 6, 7))[:, 0]),
    )
    ds.to_wavesplat(tmp_path / "a.wspl")
    back = xr.open_dataset(tmp_path / "a.wspl")
    xr.testing.assert_identical(back.drop_vars("v"), ds.drop_vars("v"))
    run("extract", tmp_path / "a.wspl", "-o", tmp_path / "a.nc")
    assert {"valid_time", "z_rho", "zeta"} <= set(xr.open_dataset(tmp_path / "a.nc").coords)


def test_samples_named_as_an_axis_leave_its_coordinates(tmp_path):
    z = xr.DataArray(smooth((8, 5, 6, 7)), dims=("t", "z", "y", "x"), coords={"t": np.arange(8.0)}, name="z")
    z.to_wavesplat(tmp_path / "a.wspl")
    back = xr.open_dataset(tmp_path / "a.wspl")
    assert list(back.data_vars) == ["values_z"]
    assert back.values_z.dims == z.dims
    assert (back.t == z.t).all()


@pytest.fixture
def opened(tmp_path):
    ocean().to_wavesplat(tmp_path / "a.wspl", tolerance=0, window=4, block=8)
    return xr.open_dataset(tmp_path / "a.wspl"), ocean()


@pytest.mark.parametrize(
    "key",
    [
        {"time": 3},
        {"lat": slice(None, None, -1)},
        {"lat": slice(9, 2, -3), "time": [5, 0, 5]},
        {"lon": [3, 1, 15], "depth": -1},
        {"lat": np.array([True, False] * 6)},
        {"time": slice(0, 0)},
        {"time": xr.DataArray([1, 2, 3], dims="p"), "lat": xr.DataArray([4, 0, 11], dims="p")},
        {"time": 1, "depth": 2, "lat": 3, "lon": 4},
    ],
)
def test_lazy_indexing(opened, key):
    back, ds = opened
    assert not back.thetao.variable._in_memory
    xr.testing.assert_equal(back.thetao.isel(key), ds.thetao.isel(key))
    assert not back.thetao.variable._in_memory
    twice = back.thetao.isel(lat=slice(None, None, -2))[..., 2:9]
    xr.testing.assert_equal(twice, ds.thetao.isel(lat=slice(None, None, -2))[..., 2:9])


def test_chunks_are_windows_and_blocks(tmp_path, opened):
    chunked = xr.open_dataset(tmp_path / "a.wspl", chunks={})
    assert chunked.thetao.chunks == ((4, 4, 2), (5,), (4, 8), (8, 8))  # the latitude descends
    xr.testing.assert_allclose(chunked.thetao.mean("time").compute(), ocean().thetao.mean("time"), atol=1e-5)
    again = pickle.loads(pickle.dumps(chunked))
    xr.testing.assert_equal(again.thetao.compute(), ocean().thetao)
    assert pickle.loads(pickle.dumps(opened[0])).thetao.isel(time=0).shape == (5, 12, 16)


def test_missing_samples_and_packed_types(tmp_path):
    ds = ocean()
    ds["thetao"] = ds.thetao.where(ds.lat < 50)
    ds.to_wavesplat(tmp_path / "a.wspl")
    back = xr.open_dataset(tmp_path / "a.wspl")
    np.testing.assert_array_equal(back.thetao.isnull(), ds.thetao.isnull())
    counts = ocean("i2")
    counts.thetao[:, 0, 0] = -5
    counts.to_wavesplat(tmp_path / "b.wspl", missing=-5, tolerance=0)
    raw = xr.open_dataset(tmp_path / "b.wspl", mask_and_scale=False).thetao
    assert raw.dtype == np.int16
    assert raw.attrs["_FillValue"] == -5
    assert xr.open_dataset(tmp_path / "b.wspl").thetao.isnull().sum() >= 10 * 16


def test_several_variables(tmp_path):
    ds = ocean()
    ds["so"] = ds.thetao * 2
    ds["ice"] = ds.thetao.isel(depth=0, drop=True).mean("time")
    with pytest.raises(ValueError, match="thetao, so.*%n"):
        ds.to_wavesplat(tmp_path / "a.wspl")
    reports = ds.to_wavesplat(tmp_path / "a_%n.wspl", tolerance={"thetao": 1e-2, "so": 1e-4})
    assert set(reports) == {"thetao", "so"}
    both = xr.open_mfdataset([tmp_path / "a_thetao.wspl", tmp_path / "a_so.wspl"], engine="wavesplat")
    assert {"thetao", "so", "ice"} >= set(both.data_vars) >= {"thetao", "so"}
    ds.to_wavesplat(tmp_path / "one.wspl", variable="so")
    assert wavesplat.open(tmp_path / "one.wspl").variable == "so"
    with pytest.raises(ValueError, match="no 'sea'"):
        ds.to_wavesplat(tmp_path / "one.wspl", variable="sea", overwrite=True)


def test_bounds_and_other_small_variables_are_kept(tmp_path):
    ds = ocean()
    ds["depth_bnds"] = (("depth", "bnds"), np.arange(10.0).reshape(5, 2))
    ds.depth.attrs["bounds"] = "depth_bnds"
    ds["crs"] = ((), np.int32(7), {"grid_mapping_name": "latitude_longitude"})
    ds.to_wavesplat(tmp_path / "a.wspl")
    back = xr.open_dataset(tmp_path / "a.wspl")
    xr.testing.assert_identical(back.drop_vars("thetao"), ds.drop_vars("thetao"))
    ds.to_netcdf(tmp_path / "a.nc")
    run("convert", tmp_path / "a.nc", "-o", tmp_path / "b.wspl", "-q")
    assert (tmp_path / "a.wspl").read_bytes() == (tmp_path / "b.wspl").read_bytes()


def test_data_arrays_and_plain_files(tmp_path, path, decoded):
    wavesplat.convert(ocean().thetao.rename("so"), tmp_path / "a.wspl")
    assert list(xr.open_dataset(tmp_path / "a.wspl").data_vars) == ["so"]
    xr.DataArray(smooth((4, 5, 6, 7)), dims=("t", "k", "j", "i")).to_wavesplat(tmp_path / "b.wspl", tolerance=0)
    back = xr.open_dataset(tmp_path / "b.wspl")
    assert back.data.dims == ("t", "k", "j", "i")
    np.testing.assert_array_equal(back.data, smooth((4, 5, 6, 7)))
    plain = xr.open_dataset(path, engine="wavesplat")
    assert plain.data.dims == ("time", "z", "y", "x")
    np.testing.assert_array_equal(plain.data, decoded)
    assert xr.open_dataset(path, drop_variables="data").data_vars == {}


def test_levels_of_detail(tmp_path):
    ds = ocean()
    ds.to_wavesplat(tmp_path / "a.wspl", tolerance=0)
    coarse = xr.open_dataset(tmp_path / "a.wspl", lod=1)
    expected = ds.isel(depth=slice(0, None, 2), lat=slice(1, None, 2), lon=slice(0, None, 2))
    xr.testing.assert_equal(coarse, expected)


def test_cftime(tmp_path):
    ds = ocean()
    ds["time"] = xr.date_range("0100-02-28", periods=10, freq="12h", calendar="360_day", use_cftime=True)
    ds.to_wavesplat(tmp_path / "a.wspl", tolerance=0)
    xr.testing.assert_identical(xr.open_dataset(tmp_path / "a.wspl").time, ds.time)


def test_only_coefficient_files_are_guessed(tmp_path):
    ocean().to_netcdf(tmp_path / "a.nc")
    assert xr.open_dataset(tmp_path / "a.nc").thetao.shape == (10, 5, 12, 16)
    (tmp_path / "text.wspl").write_text("nothing")
    with pytest.raises(wavesplat.DamagedError, match="text.wspl"):
        xr.open_dataset(tmp_path / "text.wspl")


@pytest.mark.parametrize(
    "attrs",
    [
        {"valid_range": np.array([-1, 1], "f4")},
        {"valid_min": np.float32(0)},
        {"valid_max": np.float32(0.5), "valid_min": np.float32(-0.5)},
    ],
)
def test_valid_ranges_of_decoded_datasets_exclude_no_samples(tmp_path, attrs):
    ds = ocean()
    ds.thetao.attrs.update(attrs)
    ds.to_wavesplat(tmp_path / "a.wspl", tolerance=0)
    back = xr.open_dataset(tmp_path / "a.wspl")
    xr.testing.assert_equal(back.thetao, ds.thetao)
    np.testing.assert_equal(dict(back.thetao.attrs), dict(ds.thetao.attrs))


def packed(tmp_path):
    """A dataset of int16 with a valid range of stored numbers, as another program wrote it."""
    ds = ocean()
    ds.thetao.attrs["valid_range"] = np.array([-100, 100], "i2")
    ds.thetao.encoding = {"dtype": "i2", "scale_factor": 0.01, "add_offset": 280.0, "_FillValue": np.int16(-32768)}
    ds["thetao"] = (ds.thetao + 280.0).assign_attrs(ds.thetao.attrs)
    ds.thetao.encoding = {"dtype": "i2", "scale_factor": 0.01, "add_offset": 280.0, "_FillValue": np.int16(-32768)}
    ds.to_netcdf(tmp_path / "packed.nc")
    return tmp_path / "packed.nc"


def test_valid_ranges_of_packed_datasets_count_stored_numbers(tmp_path):
    source = packed(tmp_path)
    decoded = xr.open_dataset(source)
    decoded.to_wavesplat(tmp_path / "decoded.wspl", tolerance=0)
    back = xr.open_dataset(tmp_path / "decoded.wspl").thetao
    xr.testing.assert_equal(back, decoded.thetao)
    assert "valid_range" not in back.attrs
    xr.open_dataset(source, mask_and_scale=False).to_wavesplat(tmp_path / "raw.wspl", tolerance=0)
    run("convert", source, "-o", tmp_path / "program.wspl", "--tolerance", "0", "-q")
    raw, program = (xr.open_dataset(tmp_path / f"{name}.wspl").thetao for name in ("raw", "program"))
    xr.testing.assert_identical(raw, program)
    assert raw.isnull().sum() > decoded.thetao.isnull().sum()


def test_booleans_and_wide_integers(tmp_path):
    samples = smooth((6, 5, 7, 8))
    dims = ("time", "z", "y", "x")
    ds = xr.Dataset({"ice": (dims, samples > 0), "count": (dims, (1000 * samples).astype("i8"))})
    ds.to_wavesplat(tmp_path / "%n.wspl", tolerance=0)
    for name in ("ice", "count"):
        back = xr.open_dataset(tmp_path / f"{name}.wspl")[name]
        np.testing.assert_array_equal(back, ds[name])
    assert xr.open_dataset(tmp_path / "ice.wspl").ice.dtype == bool


def test_names_that_files_cannot_have(tmp_path):
    samples = smooth((6, 5, 7, 8))
    with pytest.raises(ValueError, match="'speed/10m' has a slash"):
        xr.DataArray(samples, dims=list("tzyx"), name="speed/10m").to_wavesplat(tmp_path / "a.wspl")
    with pytest.raises(ValueError, match="'level/m' has a slash"):
        xr.DataArray(samples, dims=["t", "level/m", "y", "x"], name="speed").to_wavesplat(tmp_path / "a.wspl")
    with pytest.raises(ValueError, match="names are texts, not 7"):
        xr.Dataset({7: (tuple("tzyx"), samples)}).to_wavesplat(tmp_path / "a.wspl")
    xr.DataArray(samples, dims=list("tzyx"), name=7).to_wavesplat(tmp_path / "a.wspl")
    assert list(xr.open_dataset(tmp_path / "a.wspl")) == ["7"]
    dates = xr.Dataset({"when": (tuple("tzyx"), samples.astype("i8").astype("M8[ns]"))})
    with pytest.raises(ValueError, match="'when' has values of type datetime64.*no samples"):
        dates.to_wavesplat(tmp_path / "b.wspl", variable="when")


def test_ways_to_open(tmp_path):
    ds = ocean()
    ds.to_wavesplat(tmp_path / "a.wspl", tolerance=0)
    path = tmp_path / "a.wspl"
    with open(path, "rb") as opened:
        xr.testing.assert_equal(xr.open_dataset(opened, engine="wavesplat").thetao, ds.thetao)
    xr.testing.assert_equal(xr.open_dataset(f"file://{path}", engine="wavesplat").thetao, ds.thetao)
    in_memory = xr.open_dataset(io.BytesIO(path.read_bytes()), engine="wavesplat")
    xr.testing.assert_equal(in_memory.thetao, ds.thetao)
    xr.testing.assert_equal(xr.open_dataset(path, concat_characters=False).thetao, ds.thetao)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # newer versions prefer decode_times
        assert xr.open_dataset(path, use_cftime=True).time.dtype == object


def test_axes_without_coordinates_get_none(tmp_path):
    """Pictures put these voxels as far apart as others, but that is no coordinate."""
    ds = xr.Dataset(
        {"u": (("t", "z", "y", "x"), smooth((4, 5, 6, 7)))}, {"x": np.arange(7.0) ** 2, "z": [5.0, 4, 3, 2, 1]}
    )
    ds.to_wavesplat(tmp_path / "a.wspl", tolerance=0)
    back = xr.open_dataset(tmp_path / "a.wspl")
    xr.testing.assert_equal(back, ds)
    assert set(wavesplat.open(tmp_path / "a.wspl").coords) == {"z", "x"}
    wavesplat.convert(smooth((4, 5, 6, 7)), tmp_path / "b.wspl", spacing=(1, 2, 3))
    assert set(xr.open_dataset(tmp_path / "b.wspl").coords) == {"z", "y"}


def test_coordinates_may_be_stored_as_integers(tmp_path):
    ds = xr.Dataset({"u": (("t", "lat", "lon"), smooth((4, 5, 6, 7))[:, 0])}, {"lat": 60 - 0.5 * np.arange(6)})
    ds["lon"] = "lon", 10 + 0.25 * np.arange(7)
    ds["t"] = "t", 100 + 0.5 * np.arange(4)
    packing = {"dtype": "i2", "scale_factor": 0.01, "add_offset": 5.0}
    ds.to_netcdf(tmp_path / "a.nc", encoding={"lon": packing, "lat": packing, "t": packing})
    run("convert", tmp_path / "a.nc", "-o", tmp_path / "a.wspl", "--tolerance", "0")
    file = wavesplat.open(tmp_path / "a.wspl")
    np.testing.assert_allclose(file.spacing[:2], (0.25, 0.5))
    np.testing.assert_allclose(file.origin[:2], (10, 57.5))
    np.testing.assert_allclose(file.coords["lat"], ds.lat[::-1])
    np.testing.assert_allclose(file.times, ds.t)
    run("extract", tmp_path / "a.wspl", "-o", tmp_path / "b.nc")
    xr.testing.assert_allclose(xr.open_dataset(tmp_path / "b.nc"), ds)
    xr.testing.assert_allclose(xr.open_dataset(tmp_path / "a.wspl"), ds)
    assert "10 to 11.5" in run("info", tmp_path / "a.wspl")


def test_trees_have_one_node(tmp_path):
    pytest.importorskip("xarray", minversion="2024.10")
    ds = ocean()
    ds.to_wavesplat(tmp_path / "a.wspl", tolerance=0)
    tree = xr.open_datatree(tmp_path / "a.wspl")
    xr.testing.assert_equal(tree.to_dataset().thetao, ds.thetao)
