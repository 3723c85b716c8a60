"""The code on the guide's page about other programs runs."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import smooth

import wavesplat
import wavesplat.xarray

PAGE = Path(__file__).parents[2] / "guide/pipelines.md"


def blocks(heading):
    """The blocks of code below a heading of the page."""
    sections = PAGE.read_text().split("\n## ")
    (section,) = [text for text in sections if text.startswith(heading)]
    assert len(section.split()) <= 300
    return [part.split("```")[0] for part in section.split("```python\n")[1:]]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a file."""
    monkeypatch.chdir(tmp_path)
    wavesplat.convert(smooth(), "run.wspl", tolerance=1e-3, block=8, times=np.arange(40) * 4.0)
    return tmp_path


def test_whole_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data, times = smooth(), np.arange(40) * 4.0
    for name, values in {"u": data, "v": 2 * data}.items():
        ds = xr.Dataset({name: (("time", "z", "y", "x"), values)}, {"time": times})
        ds.to_wavesplat(f"run_{name}.wspl", tolerance=0)
    names = {}
    exec(blocks("Whole runs")[0], names)
    assert set(names["ds"].data_vars) == {"u", "v"}
    assert np.array_equal(names["ds"].v.values, 2 * data)


def test_parts_of_space(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = smooth()
    places = {name: 1 + 0.1 * np.arange(n) for name, n in zip("zyx", data.shape[1:], strict=True)}
    whole = xr.Dataset({"u": (("time", "z", "y", "x"), data)}, {"time": np.arange(40) * 4.0, **places})
    halves = slice(None, 9), slice(9, None)
    for rank, (y, x) in enumerate((y, x) for y in halves for x in halves):
        whole.isel(y=y, x=x).to_wavesplat(f"rank_{rank}.wspl", tolerance=0)
    (code,) = [code for code in PAGE.read_text().split("`") if "rank_*" in code]
    assert np.array_equal(eval(code, {"xr": xr}).u.values, data)


def test_ensembles_and_groups(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = np.stack([smooth(), smooth(seed=2)])
    axes = ("member", "time", "z", "y", "x")
    ds = xr.Dataset({"u": (axes, data), "v": (axes, 2 * data)}, {"member": [3, 5], "time": np.arange(40.0)})
    names = {"ds": ds}
    members, groups, objects = blocks("Ensembles")
    exec(members, names)
    assert list(names["ensemble"].member) == [3, 5]
    for name in "u", "v":
        assert np.abs(names["ensemble"][name] - ds[name]).max() <= 1e-3 * np.ptp(ds[name].values)
    one = ds.isel(member=0, drop=True)
    names["tree"] = xr.DataTree.from_dict({"/ocean": one, "/ocean/ice": one[["u"]] * 3})
    exec(groups, names)
    assert set(names["back"]["ocean"].data_vars) == {"u", "v"}
    assert np.abs(names["back"]["ocean/ice"].u - 3 * one.u).max() <= 3e-3 * np.ptp(one.u.values)
    one.u.to_wavesplat("run.wspl", tolerance=0)
    exec(objects, names)
    assert np.array_equal(xr.open_dataset("part.nc").u, one.u[:10, :, :8])


def test_zarr(folder):
    pytest.importorskip("zarr")
    data = smooth((40, 16, 64, 64))
    ds = xr.Dataset({"thetao": (("time", "depth", "lat", "lon"), data)}, {"time": np.arange(40)})
    names = {"ds": ds}
    exec(blocks("A Zarr codec")[0], names)
    assert 0 < np.abs(names["back"].thetao.values - data).max() <= 0.05
    ds.to_wavesplat("run.wspl", tolerance=1e-3, overwrite=True)
    exec(blocks("Files as Zarr")[0], names)
    assert names["group"]["thetao"].shape == data.shape


def test_numcodecs():
    pytest.importorskip("numcodecs")
    names = {}
    exec(blocks("numcodecs")[0], names)
    assert 0 < np.abs(names["again"] - names["array"]).max() <= 0.05


def test_pyvista(folder):
    pyvista = pytest.importorskip("pyvista")
    pyvista.OFF_SCREEN = True
    exec(blocks("ParaView")[1].replace(".plot()", ""), {})
    assert pyvista.read("part.vtk").dimensions == (22, 18, 8)


def test_paraview(folder):
    program = shutil.which("pvpython")
    if not program:
        pytest.skip("needs pvpython")
    site = str(Path(wavesplat.__path__[0]).parent)
    begin = f"import inspect, sys; inspect.getargspec = inspect.getfullargspec; sys.path.append({site!r})\n"
    (folder / "script.py").write_text(begin + blocks("ParaView")[0] + "print(reader.PointData[0].Name)\n")
    done = subprocess.run([program, "script.py"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["samples"]
