"""Later frames are added to a file."""

import numpy as np
import pytest
import xarray as xr
from conftest import smooth

import wavesplat
import wavesplat.xarray

SETTINGS = {"tolerance": 1e-3, "range": (-5, 5), "window": 8, "block": 8}


def test_appended_frames_are_those_of_one_conversion(tmp_path):
    data, times = smooth(), np.arange(40) * 0.5
    wavesplat.convert(data, tmp_path / "all.wspl", times=times, time_unit="s", **SETTINGS)
    path = tmp_path / "run.wspl"
    wavesplat.convert(data[:16], path, times=times[:16], time_unit="s", **SETTINGS)
    old = wavesplat.open(path)
    report = wavesplat.append(data[16:24], path, times=times[16:24], time_unit="s")
    assert (report["frames_before"], report["frames"]) == (16, 24)
    assert old.shape[0] == 16  # who reads the old file is not disturbed
    seen = []
    wavesplat.append(data[24:], path, times=times[24:], time_unit="s", progress=lambda *at: seen.append(at))
    assert seen
    found, whole = wavesplat.open(path), wavesplat.open(tmp_path / "all.wspl")
    assert np.array_equal(found[:], whole[:])
    assert np.array_equal(found.times, whole.times)
    found.check()


def test_datasets_continue_on_the_clock_of_the_file(tmp_path):
    data = smooth()
    dates = np.datetime64("2001-02-03") + np.arange(40) * np.timedelta64(6, "h")
    x = 10 + 0.25 * np.arange(data.shape[3])
    ds = xr.Dataset({name: (("time", "z", "y", "x"), data) for name in "uv"}, {"time": dates, "x": x})
    ds.to_wavesplat(tmp_path / "whole_%n.wspl", **SETTINGS)
    ds.isel(time=slice(0, 16)).to_wavesplat(tmp_path / "run_%n.wspl", **SETTINGS)
    reports = wavesplat.append(ds.isel(time=slice(16, None)), tmp_path / "run_%n.wspl")
    assert set(reports) == {"u", "v"}
    assert reports["v"]["frames"] == 40
    whole = xr.open_dataset(tmp_path / "whole_u.wspl")
    xr.testing.assert_identical(xr.open_dataset(tmp_path / "run_u.wspl"), whole)
    assert np.array_equal(whole.time, dates)


def test_what_does_not_fit_is_refused_and_leaves_the_file(tmp_path):
    data, times, path = smooth(), np.arange(40.0), tmp_path / "run.wspl"
    wavesplat.convert(data[:16], path, times=times[:16], **SETTINGS)
    before = path.read_bytes()
    with pytest.raises(wavesplat.InputError, match="new frames have none"):
        wavesplat.append(data[16:], path)
    with pytest.raises((ValueError, wavesplat.InputError), match="was begun with|dimensions|volume"):
        wavesplat.append(data[16:, 1:], path, times=times[16:])
    with pytest.raises(ValueError, match="is for a Dataset"):
        wavesplat.append(data[16:], path, variable="u")
    with pytest.raises(ValueError, match="coordinates of its own"):
        wavesplat.append(xr.Dataset({"u": (("time", "z", "y", "x"), data)}), path, times=times)
    with pytest.raises(FileNotFoundError):
        wavesplat.append(data[16:], tmp_path / "gone.wspl", times=times[16:])
    assert path.read_bytes() == before
    assert sorted(each.name for each in tmp_path.iterdir()) == ["run.wspl"]


def test_frames_that_fail_leave_windows_to_resume_after(tmp_path):
    data, path = smooth(), tmp_path / "run.wspl"
    wavesplat.convert(data[:8], path, **SETTINGS)

    def frames():
        yield from data[8:30]
        raise RuntimeError("the disk is gone")

    with pytest.raises(RuntimeError, match="disk is gone"):
        wavesplat.append(frames(), path)
    with pytest.raises(ValueError, match="not finished"):
        wavesplat.append(data[8:], path)
    report = wavesplat.append(data[8:], path, resume=True)
    assert report["frames"] == 40
    assert report["frames_before"] > 8
    assert np.abs(wavesplat.open(path)[:] - data).max() <= 0.01


def test_frames_are_not_added_twice(tmp_path):
    data, times, path = smooth(), np.arange(40.0), tmp_path / "run.wspl"
    ds = xr.Dataset({"u": (("time", "z", "y", "x"), data)})
    ds.isel(time=slice(0, 16)).to_wavesplat(path, **SETTINGS)
    later = ds.isel(time=slice(16, None))
    wavesplat.append(later, path)
    with pytest.raises(wavesplat.InputError, match="ends with these frames already"):
        wavesplat.append(later, path)
    assert wavesplat.append(later, path, resume=True) == {}
    assert wavesplat.open(path).shape[0] == 40
    wavesplat.convert(data[:16], path, times=times[:16], overwrite=True, **SETTINGS)
    with pytest.raises(wavesplat.InputError, match="up to the time 15, and the new ones begin at 8"):
        wavesplat.append(data[8:], path, times=times[8:])


def test_no_file_is_changed_if_one_is_not_there(tmp_path):
    ds = xr.Dataset({name: (("time", "z", "y", "x"), smooth()) for name in "uv"})
    ds[["u"]].isel(time=slice(0, 16)).to_wavesplat(tmp_path / "run_u.wspl", **SETTINGS)
    with pytest.raises(FileNotFoundError, match="run_v"):
        wavesplat.append(ds.isel(time=slice(16, None)), tmp_path / "run_%n.wspl")
    assert wavesplat.open(tmp_path / "run_u.wspl").shape[0] == 16


def test_masked_frames_are_masked_as_before(tmp_path):
    data = np.ma.masked_greater(smooth(), 1.5)
    for missing in ("mask", -999.0):
        path = tmp_path / f"run_{missing}.wspl"
        wavesplat.convert(data[:16], path, missing=missing, **SETTINGS)
        wavesplat.append(data[16:], path)
        found = np.ma.masked_invalid(wavesplat.open(path)[:])
        assert np.array_equal(np.ma.getmaskarray(np.ma.masked_equal(found, -999.0)), data.mask)
