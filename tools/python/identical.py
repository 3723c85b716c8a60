"""Archives that come back as they were: written with the field's own software, converted, extracted, and compared in
everything but the samples' error.

    python tools/python/identical.py WAVESPLAT FOLDER [CASE ...]

WAVESPLAT is the program. Prints `ok CASE` for each case; ends with an error at the first difference.
"""

import pathlib
import subprocess
import sys

import netCDF4
import numpy as np
import xarray as xr

TOLERANCE = 0.01


def wave(shape, seed):
    """A smooth field of any number of axes that moves along the first."""
    random = np.random.default_rng(seed)
    axes = np.meshgrid(*[np.linspace(0, 3, n) for n in shape], indexing="ij")
    phases = random.uniform(0, 6, len(shape))
    field = sum(np.sin((i + 2) * a + 2 * axes[0] + p) for i, (a, p) in enumerate(zip(axes, phases)))
    return (10 + 3 * field).astype("f4")


def dataset_roms():
    """An ocean model: a sigma axis, curvilinear places, a land mask, several small fields, records of time."""
    t, s, y, x = 6, 8, 12, 10
    temp = wave((t, s, y, x), 1)
    land = np.hypot(*np.mgrid[-3 : y - 3, -2 : x - 2]) < 3
    temp[:, :, land] = np.nan
    lon, lat = np.meshgrid(np.linspace(-70, -60, x), np.linspace(30, 42, y))
    dims = ("ocean_time", "s_rho", "eta_rho", "xi_rho")
    data = xr.Dataset(
        {
            "temp": (dims, temp, {"long_name": "potential temperature", "units": "Celsius", "field": "temperature"}),
            "h": (dims[2:], 1000 + 500 * np.sin(lon), {"units": "meter", "long_name": "bathymetry"}),
            "Cs_r": (("s_rho",), -np.linspace(1, 0, s) ** 2, {"long_name": "S-coordinate stretching curves"}),
            "hc": ((), 250.0, {"units": "meter"}),
            "Vtransform": ((), np.int32(2), {"flag_values": np.array([1, 2], "i4")}),
            "spherical": ((), "T"),
        },
        coords={
            "s_rho": (("s_rho",), np.linspace(-0.95, -0.05, s), {"valid_min": -1.0, "valid_max": 0.0, "positive": "up"}),
            "lon_rho": (dims[2:], lon + 0.1 * lat, {"units": "degree_east", "standard_name": "longitude"}),
            "lat_rho": (dims[2:], lat - 0.1 * lon, {"units": "degree_north", "standard_name": "latitude"}),
            "ocean_time": (("ocean_time",), np.datetime64("2016-02-03", "ns") + np.arange(t) * np.timedelta64(1, "D")),
        },
        attrs={"title": "an ocean", "Conventions": "CF-1.4", "ndefhis": np.int32(30), "grid": "θ-S"},
    )
    encoding = {"ocean_time": {"units": "seconds since 1900-01-01", "dtype": "f8"}, "temp": {"_FillValue": np.float32(1e37)}}
    return data, "temp", {"encoding": encoding, "unlimited_dims": ["ocean_time"]}


def dataset_cmip():
    """A climate model: bounds, a scalar height, a calendar of 365 days, single-precision samples with a missing value."""
    t, y, x = 24, 16, 20
    time = xr.date_range("1850-01-16 12:00", periods=t, freq="MS", calendar="noleap", use_cftime=True)
    edges = lambda c, d: np.stack([c - d / 2, c + d / 2], axis=1)
    lat, lon = np.linspace(-84.375, 84.375, y), np.linspace(0, 342, x)
    tas = 250 + wave((t, y, x), 2)
    coords = {
        "time": (("time",), time, {"bounds": "time_bnds", "axis": "T", "long_name": "time", "standard_name": "time"}),
        "lat": (("lat",), lat, {"bounds": "lat_bnds", "units": "degrees_north", "axis": "Y", "standard_name": "latitude"}),
        "lon": (("lon",), lon, {"bounds": "lon_bnds", "units": "degrees_east", "axis": "X", "standard_name": "longitude"}),
        "height": ((), 2.0, {"units": "m", "axis": "Z", "positive": "up", "standard_name": "height"}),
    }
    days = np.cumsum([0] + [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] * 2).astype("f8")
    data = xr.Dataset(
        {
            "tas": (("time", "lat", "lon"), tas, {"standard_name": "air_temperature", "units": "K", "cell_methods": "area: time: mean"}),
            "lat_bnds": (("lat", "bnds"), edges(lat, 11.25)),
            "lon_bnds": (("lon", "bnds"), edges(lon, 18.0)),
            "time_bnds": (("time", "bnds"), np.stack([days[:-1], days[1:]], axis=1)),
        },
        coords=coords,
        attrs={"Conventions": "CF-1.7 CMIP-6.2", "branch_time_in_parent": 36500.0, "realization_index": np.int32(1), "tracking_id": "hdl:21.14100/0"},
    )
    encoding = {
        "time": {"units": "days since 1850-01-01", "calendar": "noleap", "dtype": "f8"},
        "tas": {"_FillValue": np.float32(1e20), "missing_value": np.float32(1e20)},
    }
    return data, "tas", {"encoding": encoding, "unlimited_dims": ["time"]}


def dataset_packed():
    """A reanalysis: packed samples, descending latitudes, irregular levels of pressure, integer hours."""
    t, z, y, x = 8, 5, 9, 12
    dims = ("time", "level", "latitude", "longitude")
    data = xr.Dataset(
        {"z": (dims, 5e4 + 1e3 * wave((t, z, y, x), 3).astype("f8"), {"units": "m**2 s**-2", "long_name": "Geopotential"})},
        coords={
            "longitude": (dims[3:], np.linspace(350, 383, x).astype("f4") % 360, {"units": "degrees_east", "long_name": "longitude"}),
            "latitude": (dims[2:3], np.linspace(60, 40, y).astype("f4"), {"units": "degrees_north"}),
            "level": (dims[1:2], np.array([200, 300, 500, 850, 1000], "i4"), {"units": "millibars"}),
            "time": (dims[:1], np.datetime64("2020-02-28", "ns") + np.arange(t) * np.timedelta64(6, "h"), {"long_name": "time"}),
        },
        attrs={"Conventions": "CF-1.6", "history": "2020-03-01 made here"},
    )
    packed = {"dtype": "i2", "scale_factor": 1.25, "add_offset": 6e4, "_FillValue": np.int16(-32767)}
    return data, "z", {"encoding": {"z": packed, "time": {"units": "hours since 1900-01-01 00:00:0.0", "dtype": "i4"}}}


def dataset_turned():
    """Time is the fastest axis, x the slowest; no coordinates but one, which is irregular; text coordinates."""
    x, y, z, t = 7, 6, 5, 10
    depth = np.array([0.5, 2, 10, 100, 3000.0])
    data = xr.Dataset(
        {"phi": (("i", "j", "depth", "snapshot"), np.moveaxis(wave((t, z, y, x), 4), [0, 1, 2, 3], [3, 2, 1, 0]), {"units": "1"})},
        coords={"depth": (("depth",), depth, {"units": "m", "positive": "down"}), "station": (("j",), list("abcdef"))},
    )
    return data, "phi", {"axes": "xyzt"}


def check_netcdf(name, run, folder, engine="netcdf4"):
    data, variable, options = globals()[f"dataset_{name}"]()
    axes = options.pop("axes", None)
    source, back = folder / f"{name}.nc", folder / f"{name}_back.nc"
    data.to_netcdf(source, engine=engine, **options)
    extra = ["--axes", axes] if axes else []
    run("convert", source, "-o", folder / f"{name}.wspl", "--variable", variable, "--tolerance", TOLERANCE, *extra, "--force")
    run("extract", folder / f"{name}.wspl", "-o", back, "--force")
    compare(source, back, variable)
    run("extract", folder / f"{name}.wspl", "-o", folder / f"{name}.zarr", "--force")
    compare(source, folder / f"{name}.zarr", variable)


def compare(source, back, variable):
    """Both files say the same, but for the samples' error."""
    sources = [xr.load_dataset(path) for path in (source if isinstance(source, list) else [source])]
    before = sources[0] if len(sources) == 1 else xr.concat(sources, "time", data_vars="minimal")
    after = xr.open_zarr(back, chunks=None).load() if back.suffix == ".zarr" else xr.load_dataset(back)
    a, b = before[variable], after[variable]
    assert a.dims == b.dims, f"{a.dims} became {b.dims}"
    bound = TOLERANCE * float(a.max() - a.min())
    error = float(abs(a - b).max())
    assert error <= bound * (1 + 1e-6), f"an error of {error}, but {bound} is allowed"
    assert (a.isnull() == b.isnull()).all(), "missing samples differ"
    after[variable] = b.copy(data=a.data)
    xr.testing.assert_identical(before, after)


def check_roms(run, folder):
    check_netcdf("roms", run, folder)


def check_cmip(run, folder):
    check_netcdf("cmip", run, folder)


def check_packed(run, folder):
    check_netcdf("packed", run, folder)


def check_turned(run, folder):
    check_netcdf("turned", run, folder)


def check_daily(run, folder):
    """A file a day, each with one step and its own clock."""
    frames = wave((5, 4, 6, 8), 5)
    paths = []
    for day in range(5):
        path = folder / f"day_{day:02}.nc"
        date = np.datetime64("2001-02-27", "ns") + np.timedelta64(day, "D")
        data = xr.Dataset(
            {"o3": (("time", "lev", "lat", "lon"), frames[day : day + 1], {"units": "ppm"})},
            coords={
                "time": (("time",), [date + np.timedelta64(12, "h")]),
                "lev": (("lev",), np.array([1000.0, 700, 400, 100]), {"units": "hPa", "positive": "down"}),
                "lat": (("lat",), np.linspace(-50, 50, 6), {"units": "degrees_north"}),
                "lon": (("lon",), np.linspace(0, 315, 8), {"units": "degrees_east"}),
            },
            attrs={"source": "daily"},
        )
        units = f"days since {str(date)[:10]}"
        data.to_netcdf(path, encoding={"time": {"units": units, "dtype": "f8"}}, unlimited_dims=["time"])
        paths.append(path)
    run("convert", folder / "day_*.nc", "-o", folder / "daily.wspl", "--tolerance", TOLERANCE, "--force")
    run("extract", folder / "daily.wspl", "-o", folder / "daily_back.nc", "--force")
    compare(paths, folder / "daily_back.nc", "o3")


def volume(seed=6):
    return wave((7, 12, 10, 9), seed)  # t z y x


def check_nifti(run, folder):
    """Oblique functional MRI: sform and qform, codes, units, scaled whole numbers, texts of the header."""
    import nibabel

    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.1], [np.sin(angle), np.cos(angle), 0], [-0.1, 0, 1]])
    turn = np.linalg.qr(turn)[0] * [-1, 1, 1]
    affine = np.eye(4)
    affine[:3, :3] = turn * [2.5, 2.5, 3.5]
    affine[:3, 3] = [90.5, -120.25, -60]
    for name, kind, endian in [("one", nibabel.Nifti1Image, "<"), ("two", nibabel.Nifti2Image, "<"), ("big", nibabel.Nifti1Image, ">")]:
        header = kind.header_class(endianness=endian)
        header.set_data_dtype("i2" if name == "one" else "f4")
        image = kind((volume() * 50).T.astype(header.get_data_dtype()), affine, header)
        image.header.set_sform(affine, 1)
        image.header.set_qform(affine, 1)
        image.header.set_xyzt_units("mm", "sec")
        image.header["pixdim"][4] = 2.2
        image.header["descrip"] = b"a scan"
        image.header["cal_max"] = 900
        image.header["intent_name"] = b"bold"
        source, back = folder / f"{name}.nii.gz", folder / f"{name}_back.nii.gz"
        image.to_filename(source)
        run("convert", source, "-o", folder / "scan.wspl", "--tolerance", TOLERANCE, "--force")
        run("extract", folder / "scan.wspl", "-o", back, "--force")
        before, after = nibabel.load(source), nibabel.load(back)
        assert type(before) is type(after)
        np.testing.assert_array_equal(before.affine, after.affine)
        for key in before.header:
            if key not in ("vox_offset", "scl_slope", "scl_inter"):
                np.testing.assert_array_equal(before.header[key], after.header[key], err_msg=key)
        assert_samples(before.get_fdata(), after.get_fdata())
        run("extract", folder / "scan.wspl", "-o", back, "--region", "2:8,1:9,3:11", "--force")
        crop = nibabel.load(back)
        np.testing.assert_allclose(crop.affine, before.slicer[2:8, 1:9, 3:11].affine, rtol=1e-6, atol=1e-4)


def assert_samples(before, after):
    assert before.shape == after.shape, f"{before.shape} became {after.shape}"
    error = abs(before - after).max()
    assert error <= TOLERANCE * (before.max() - before.min()) * (1 + 1e-6), error


def check_metaimage(run, folder):
    """A rotated scan, by ITK: as MetaImage, NRRD and NIfTI."""
    import SimpleITK as itk

    frame = volume()[0]
    image = itk.GetImageFromArray(frame)
    angle = 0.4
    image.SetDirection([np.cos(angle), -np.sin(angle), 0, np.sin(angle), np.cos(angle), 0, 0, 0, -1])
    image.SetSpacing([0.7, 0.8, 2.5])
    image.SetOrigin([-100.5, 20.25, 333])
    itk.WriteImage(image, str(folder / "scan.mha"))
    text = (folder / "scan.mha").read_bytes()
    (folder / "scan.mha").write_bytes(text.replace(b"ElementSpacing", b"Comment = after contrast\nElementSpacing", 1))
    run("convert", folder / "scan.mha", "-o", folder / "scan.wspl", "--tolerance", TOLERANCE, "--force")
    for extension in ["mha", "nrrd", "nii.gz"]:
        back = folder / f"scan_back.{extension}"
        run("extract", folder / "scan.wspl", "-o", back, "--force")
        after = itk.ReadImage(str(back))
        for get in ["GetDirection", "GetSpacing", "GetOrigin", "GetSize"]:
            np.testing.assert_allclose(getattr(image, get)(), getattr(after, get)(), rtol=1e-6, atol=1e-6, err_msg=f"{extension} {get}")
        assert_samples(frame, itk.GetArrayFromImage(after))
        if extension == "mha":
            assert all(getattr(image, get)() == getattr(after, get)() for get in ["GetDirection", "GetSpacing", "GetOrigin"])
    assert b"Comment = after contrast" in (folder / "scan_back.mha").read_bytes()
    run("convert", folder / "scan_back.nrrd", "-o", folder / "again.wspl", "--tolerance", TOLERANCE, "--force")
    run("extract", folder / "again.wspl", "-o", folder / "again.nrrd", "--force")
    np.testing.assert_allclose(image.GetDirection(), itk.ReadImage(str(folder / "again.nrrd")).GetDirection(), atol=1e-12)


def check_vtr(run, folder):
    """Depths of a model as a rectilinear grid, read back by VTK; an oblique image as .vti."""
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    data, variable, options = dataset_turned()
    data.isel(snapshot=[0]).to_netcdf(folder / "deep.nc")
    run("convert", folder / "deep.nc", "-o", folder / "deep.wspl", "--axes", "xyzt", "--tolerance", TOLERANCE, "--force")
    run("extract", folder / "deep.wspl", "-o", folder / "deep.vtr", "--force")
    reader = vtk.vtkXMLRectilinearGridReader()
    reader.SetFileName(str(folder / "deep.vtr"))
    reader.Update()
    grid = reader.GetOutput()
    np.testing.assert_array_equal(vtk_to_numpy(grid.GetZCoordinates()), np.sort(-data.depth.values if is_down(data) else data.depth.values))
    samples = vtk_to_numpy(grid.GetPointData().GetArray(variable)).reshape(grid.GetDimensions()[::-1])
    expected = np.moveaxis(data[variable].values[..., 0], [0, 1, 2], [2, 1, 0])
    assert_samples(expected[::-1] if is_down(data) else expected, samples)


def check_rectilinear(run, folder):
    """A rectilinear grid with irregular axes that VTK wrote."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    frame = volume(8)[0]
    places = [np.cumsum(np.random.default_rng(9).uniform(0.5, 2, n)) for n in frame.shape[::-1]]
    grid = vtk.vtkRectilinearGrid()
    grid.SetDimensions(*frame.shape[::-1])
    for put, at in zip([grid.SetXCoordinates, grid.SetYCoordinates, grid.SetZCoordinates], places):
        put(numpy_to_vtk(at, deep=True))
    samples = numpy_to_vtk(frame.ravel(), deep=True)
    samples.SetName("density")
    grid.GetPointData().SetScalars(samples)
    constants = {"Re": np.array([100.5]), "ids": np.array([2**60 + 1, -7], "i8"), "axis": np.array([[0, 0.1, 1]], "f4")}
    for name, values in constants.items():
        array = numpy_to_vtk(values, deep=True, array_type=vtk.VTK_LONG_LONG if values.dtype == "i8" else None)
        array.SetName(name)
        grid.GetFieldData().AddArray(array)
    writer = vtk.vtkXMLRectilinearGridWriter()
    writer.SetFileName(str(folder / "grid.vtr"))
    writer.SetInputData(grid)
    writer.Write()
    run("convert", folder / "grid.vtr", "-o", folder / "grid.wspl", "--tolerance", TOLERANCE, "--force")
    run("extract", folder / "grid.wspl", "-o", folder / "grid_back.vtr", "--force")
    reader = vtk.vtkXMLRectilinearGridReader()
    reader.SetFileName(str(folder / "grid_back.vtr"))
    reader.Update()
    after = reader.GetOutput()
    for get, at in zip([after.GetXCoordinates, after.GetYCoordinates, after.GetZCoordinates], places):
        np.testing.assert_array_equal(vtk_to_numpy(get()), at)
    assert_samples(frame, vtk_to_numpy(after.GetPointData().GetArray("density")).reshape(frame.shape))
    for name, values in constants.items():
        back = vtk_to_numpy(after.GetFieldData().GetArray(name))
        assert back.dtype == values.dtype and back.reshape(values.shape).tolist() == values.tolist(), name


def is_down(data):
    """Whether depths are counted downwards, so that wavesplat turns the axis."""
    return data.depth.attrs.get("positive") == "down"


def main():
    program, folder, *cases = sys.argv[1:]
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)

    def run(*words):
        done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(map(str, words))}\n{done.stderr}")
        return done

    checks = {name[6:]: check for name, check in globals().items() if name.startswith("check_") and name != "check_netcdf"}
    for name in cases or checks:
        checks[name](run, folder)
        print("ok", name)


main()
