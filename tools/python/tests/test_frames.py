"""Arrays of other libraries and types, times, and arguments that are wrong."""

import datetime
import re

import cftime
import dask.array as da
import netCDF4
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from conftest import smooth

import wavesplat

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


@pytest.fixture
def small():
    return smooth((6, 5, 7, 8))


def back(path):
    with wavesplat.open(path) as file:
        return file[...]


def variables(folder):
    """Variables of netCDF4: plain, packed, and packed with a valid range that excludes samples."""
    packed = np.arange(6 * 5 * 7 * 8, dtype="i2").reshape(6, 5, 7, 8)
    with netCDF4.Dataset(folder / "a.nc", "w") as file:
        for name, length in zip("tzyx", packed.shape, strict=True):
            file.createDimension(name, length)
        for name in ("packed", "ranged"):
            variable = file.createVariable(name, "i2", tuple("tzyx"))
            variable.set_auto_scale(False)
            variable.scale_factor, variable.add_offset = 0.5, 280.0
            variable[...] = packed
        file["ranged"].valid_range = np.array([0, 1599], "i2")
        file.createVariable("plain", "f4", tuple("tzyx"))[...] = packed
    return netCDF4.Dataset(folder / "a.nc"), packed


def test_variables_of_netcdf4(tmp_path):
    file, packed = variables(tmp_path)
    wavesplat.convert(file["plain"], tmp_path / "plain.wspl", tolerance=0)
    np.testing.assert_array_equal(back(tmp_path / "plain.wspl"), packed.astype("f4"))
    wavesplat.convert(file["packed"], tmp_path / "packed.wspl", tolerance=0)
    np.testing.assert_array_equal(back(tmp_path / "packed.wspl"), 0.5 * packed + 280.0)
    with pytest.raises(ValueError, match="frame 5 has masked samples; missing='mask'"):
        wavesplat.convert(file["ranged"], tmp_path / "ranged.wspl")
    wavesplat.convert(file["ranged"], tmp_path / "ranged.wspl", missing="mask", tolerance=0, overwrite=True)
    np.testing.assert_array_equal(np.isnan(back(tmp_path / "ranged.wspl")), packed > 1599)


def test_masked_arrays(tmp_path, small):
    for n, plain in enumerate([np.ma.array(small), np.ma.masked_less(small, -99), list(np.ma.array(small))]):
        wavesplat.convert(plain, tmp_path / f"{n}.wspl", tolerance=0)
        np.testing.assert_array_equal(back(tmp_path / f"{n}.wspl"), small)
    masked = np.ma.masked_less(small, 0.5)
    for n, source in enumerate([masked, list(masked), da.from_array(masked, chunks=(2, 5, 7, 8))]):
        with pytest.raises(ValueError, match="frame 0 has masked samples"):
            wavesplat.convert(source, tmp_path / "refused.wspl")
        for path in tmp_path.glob("refused*"):
            path.unlink()
        wavesplat.convert(source, tmp_path / f"masked{n}.wspl", missing="mask")
        np.testing.assert_array_equal(np.isnan(back(tmp_path / f"masked{n}.wspl")), masked.mask)
    counts = np.ma.masked_equal((10 * small).astype("i2"), 3)
    wavesplat.convert(counts, tmp_path / "counts.wspl", missing=-32768, tolerance=0)
    np.testing.assert_array_equal(back(tmp_path / "counts.wspl") == -32768, counts.mask)


@pytest.mark.parametrize(("dtype", "stored"), [("i8", "i4"), ("u8", "u4"), ("?", "u1"), (">i8", "i4")])
def test_other_types_that_fit(tmp_path, small, dtype, stored):
    samples = np.abs(1000 * small) > 500 if dtype == "?" else np.abs(1000 * small).astype(dtype)
    for n, source in enumerate([samples, list(samples)]):
        wavesplat.convert(source, tmp_path / f"{n}.wspl", tolerance=0)
        found = back(tmp_path / f"{n}.wspl")
        assert found.dtype == np.dtype(stored)
        np.testing.assert_array_equal(found, samples)


def test_integers_that_do_not_fit_are_named(tmp_path):
    samples = np.zeros((6, 5, 7, 8), "i8")
    samples[4, 1, 2, 3] = 3_000_000_000
    for source in (samples, list(samples)):
        with pytest.raises(
            wavesplat.InputError, match="frame 4 has 3000000000, which does not fit into int32.*float64"
        ):
            wavesplat.convert(source, tmp_path / "a.wspl", overwrite=True)
    with pytest.raises(wavesplat.InputError, match="frame 0 has 5000000000, which does not fit into uint32"):
        wavesplat.convert(np.full((2, 3, 4, 5), 5_000_000_000, "u8"), tmp_path / "b.wspl")


def test_missing_samples_are_found_in_the_array(tmp_path, small):
    small[3, 2, 1, 0] = np.nan
    for source, name in ((small, "the array"), (iter(small), "the frames")):
        with pytest.raises(wavesplat.InputError, match=f"source, {name}, frame 3: .* x 0, y 1, z 2") as raised:
            wavesplat.convert(source, tmp_path / "a.wspl", overwrite=True)
        assert "standard input" not in str(raised.value)


def test_fill_values_name_the_arguments(tmp_path, small):
    small += 280
    small[:, 0, :3] = -9999
    with pytest.raises(wavesplat.InputError, match="missing=-9999; if not, allow an error by max_error=") as raised:
        wavesplat.convert(small, tmp_path / "a.wspl")
    assert "the array, frame 0" in str(raised.value)


HOURS = np.arange(6) * np.timedelta64(1, "h")
STAMPS = np.datetime64("2001-02-03T04:00") + HOURS
SECONDS = [3600.0 * n for n in range(6)]


@pytest.mark.parametrize(
    ("times", "unit", "numbers"),
    [
        (STAMPS, "seconds since 2001-02-03 04:00:00", SECONDS),
        (list(STAMPS.astype("M8[us]").astype(object)), "seconds since 2001-02-03 04:00:00", SECONDS),
        (pd.DatetimeIndex(STAMPS), "seconds since 2001-02-03 04:00:00", SECONDS),
        (pd.DatetimeIndex(STAMPS).tz_localize("Asia/Tokyo"), "seconds since 2001-02-02 19:00:00", SECONDS),
        (xr.DataArray(STAMPS, dims="time"), "seconds since 2001-02-03 04:00:00", SECONDS),
        (HOURS, "s", SECONDS),
        (pd.TimedeltaIndex(HOURS), "s", SECONDS),
        ([datetime.timedelta(hours=n) for n in range(6)], "s", SECONDS),
        (range(6), None, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
    ],
)
def test_times(tmp_path, small, times, unit, numbers):
    wavesplat.convert(small, tmp_path / "a.wspl", times=times)
    file = wavesplat.open(tmp_path / "a.wspl")
    assert (file.time_unit, file.times.tolist(), file.calendar) == (unit, numbers, None)


def test_lengths_of_time_in_other_units(tmp_path, small):
    for n, (unit, last) in enumerate([("h", 5.0), ("days", 5 / 24), ("hours since 2000-01-01", 5.0)]):
        wavesplat.convert(small, tmp_path / f"{n}.wspl", times=HOURS, time_unit=unit)
        file = wavesplat.open(tmp_path / f"{n}.wspl")
        assert (file.time_unit, file.times[-1]) == (unit, last)


@pytest.mark.parametrize("calendar", ["noleap", "360_day", "julian", "standard"])
def test_dates_of_calendars(tmp_path, small, calendar):
    times = xr.date_range("2001-02-27", periods=6, calendar=calendar, use_cftime=True)
    for n, given in enumerate([times, times.to_numpy(), list(times)]):
        wavesplat.convert(small, tmp_path / f"{n}.wspl", times=given, tolerance=0)
        found = xr.open_dataset(tmp_path / f"{n}.wspl", decode_times=xr.coders.CFDatetimeCoder(use_cftime=True)).time
        assert [each.strftime() for each in found.values] == [each.strftime() for each in times]
        assert isinstance(found.values[0], cftime.datetime)


@pytest.mark.parametrize(
    ("times", "kind", "words"),
    [
        (7, TypeError, "one for each frame"),
        ("2001", TypeError, "one for each frame"),
        (["a", "b", "c", "d", "e", "f"], TypeError, "frame 0 has 'a'"),
        (np.zeros((6, 2)), ValueError, "of shape (6, 2)"),
        (np.array(["2001-01-01", "NaT"] * 3, "M8[D]"), ValueError, "frame 1 has none"),
        (STAMPS[:3], ValueError, "3 for 6 frame"),
    ],
)
def test_wrong_times(tmp_path, small, times, kind, words):
    with pytest.raises(kind, match="times: .*" + re.escape(words)):
        wavesplat.convert(small, tmp_path / "a.wspl", times=times)
    with pytest.raises(ValueError, match="time_unit: times are dates"):
        wavesplat.convert(small, tmp_path / "a.wspl", times=STAMPS, time_unit="days")


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"spacing": (1, 2)}, ValueError, "spacing: takes three numbers, along x, y and z, not (1, 2)"),
        ({"spacing": 2.0}, ValueError, "spacing: takes three numbers"),
        ({"origin": "abc"}, TypeError, "origin: takes three numbers"),
        ({"origin": (0, None, 1)}, TypeError, "origin: takes a number, not None"),
        ({"window": 3.5}, TypeError, "window: takes a whole number, not 3.5"),
        ({"block": "8"}, TypeError, "block: takes a whole number, not '8'"),
        ({"memory": "1GiB"}, TypeError, "memory: takes a whole number"),
        ({"tolerance": "small"}, TypeError, "tolerance: takes a number, not 'small'"),
        ({"max_error": [1]}, TypeError, "max_error: takes a number, not [1]"),
        ({"range": 5}, ValueError, "range: takes (LO, HI), not 5"),
        ({"range": "0,5"}, TypeError, "range: takes (LO, HI), not '0,5'"),
        ({"range": (1, 2, 3)}, ValueError, "range: takes (LO, HI)"),
        ({"time_unit": 7, "times": range(6)}, TypeError, "time_unit: takes a text, not 7"),
    ],
)
def test_wrong_arguments_say_what_is_wanted(tmp_path, small, options, kind, words):
    with pytest.raises(kind, match=re.escape(words)):
        wavesplat.convert(small, tmp_path / "a.wspl", **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.nc", "a.NPY", "a.zarr", "a.tif"])
def test_names_of_other_formats_are_refused(tmp_path, small, name):
    with pytest.raises(ValueError, match=r"named \.wspl, not \."):
        wavesplat.convert(small, tmp_path / name)
    with pytest.raises(ValueError, match=r"named \.wspl, not \."):
        xr.DataArray(small, dims=tuple("tzyx")).to_wavesplat(tmp_path / name)
    with pytest.raises(ValueError, match=r"named \.wspl, not \."):
        wavesplat.merge([tmp_path / "b.wspl"], tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_numbers_of_numpy_mean_missing(tmp_path, small):
    small[:, 0] = -999
    wavesplat.convert(small, tmp_path / "a.wspl", missing=np.float32(-999))
    assert wavesplat.open(tmp_path / "a.wspl").missing_value == -999


def test_sizes_of_pictures(file):
    for size, kind in ((512, ValueError), ((1, 2, 3), ValueError), ((5.5, 4), TypeError)):
        with pytest.raises(kind, match="^size: takes"):
            file.render(size=size)


class OnDevice:
    """An array as those of CuPy are: numpy cannot convert it."""

    def __init__(self, array):
        self.array, self.shape, self.dtype = array, array.shape, array.dtype

    def __getitem__(self, key):
        return OnDevice(self.array[key])

    def __array__(self, *_):
        raise TypeError("use get()")

    def get(self):
        return self.array


class ByDlpack:
    """An array that others know by DLPack alone."""

    def __init__(self, array):
        self.array, self.shape, self.dtype = array, array.shape, f"mine.{array.dtype}"

    def __getitem__(self, key):
        return ByDlpack(self.array[key])

    def __dlpack__(self, **options):
        return self.array.__dlpack__()

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


@pytest.mark.parametrize("kind", [OnDevice, ByDlpack])
def test_arrays_of_devices_and_of_dlpack(tmp_path, small, kind):
    wavesplat.convert(kind(small), tmp_path / "a.wspl", tolerance=0)
    np.testing.assert_array_equal(back(tmp_path / "a.wspl"), small)
    wavesplat.convert((kind(frame) for frame in small), tmp_path / "b.wspl", tolerance=0)
    np.testing.assert_array_equal(back(tmp_path / "b.wspl"), small)


@pytest.mark.parametrize(
    ("axes", "shape"),
    [
        ("xyzt", (9, 8, 7, 6)),
        ("ctzyx", (1, 6, 7, 8, 9)),
        ("zyxtc", (7, 8, 9, 6, 1)),
        ("zyx", (7, 8, 9)),
        ("yx", (8, 9)),
    ],
)
def test_axes_say_what_an_array_counts(tmp_path, axes, shape):
    samples = np.random.default_rng(3).random(shape).astype(np.float32)
    place = {letter: n for n, letter in enumerate(axes)}
    expected = np.empty([shape[place[a]] if a in place else 1 for a in "tzyx"], np.float32)
    for index in np.ndindex(*expected.shape):
        expected[index] = samples[tuple(0 if a == "c" else index["tzyx".index(a)] for a in axes)]
    for name, array in {"numpy": samples, "dask": da.from_array(samples, chunks=3)}.items():
        path = tmp_path / f"{name}.wspl"
        wavesplat.convert(array, path, tolerance=0, axes=axes)
        assert np.array_equal(wavesplat.open(path)[...], expected)
    if "t" in axes:
        wavesplat.append(samples, tmp_path / "numpy.wspl", axes=axes, overwrite=True)
        assert np.array_equal(wavesplat.open(tmp_path / "numpy.wspl")[6:], expected)


def test_wrong_axes_are_refused(tmp_path):
    class Sliced:
        shape, dtype = (4, 5, 6, 7), np.dtype("f4")

        def __getitem__(self, key):
            return np.zeros(self.shape, "f4")[key]

    samples = np.zeros((4, 5, 6, 7), "f4")
    for source, axes, words in (
        (samples, "zyx", "each axis of the array, which has 4"),
        (samples, "tzyy", "takes a letter"),
        (samples, "tzyq", "takes a letter"),
        (samples, "tczy", r"axis 1 counts no frames .* has 5 items; .*array\[:, n, :, :\]"),
        (Sliced(), "xyzt", "cannot be transposed"),
        (iter([samples[0]]), "zyx", "iterable"),
    ):
        with pytest.raises(ValueError, match=words):
            wavesplat.convert(source, tmp_path / "a.wspl", axes=axes)
    wavesplat.convert(Sliced(), tmp_path / "a.wspl", axes="tzyx")
