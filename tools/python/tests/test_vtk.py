"""Frames in ParaView and PyVista are those of the file, where they are."""

import os
import shutil
import subprocess

import numpy as np
import pytest
from conftest import smooth
from test_xarray import ocean

import wavesplat
from wavesplat import _volumes

SCRIPT = """
import inspect
import sys

inspect.getargspec = inspect.getfullargspec  # Debian's ParaView 5.11 wants what Python 3.11 lacks
sys.path.append(sys.argv[1])

from paraview.simple import ExtractSubset, LoadPlugin
from paraview.servermanager import Fetch

LoadPlugin(sys.argv[1] + "/wavesplat/paraview_reader.py", ns=globals())
reader = WavesplatReader(FileName=sys.argv[2])
reader.UpdatePipelineInformation()
times = list(reader.TimestepValues)
print(len(times), times[0], times[-1])


def show(source, time):
    source.UpdatePipeline(time)
    image = Fetch(source)
    array = image.GetPointData().GetScalars()
    picked = [array.GetTuple1(n) for n in range(0, array.GetNumberOfTuples(), 97)]
    bounds = source.GetDataInformation().GetBounds()
    print(image.GetClassName(), *image.GetDimensions(), *bounds, array.GetName(), *picked)


show(reader, times[7])
show(ExtractSubset(Input=reader, VOI=[1, 4, 2, 8, 3, 6]), times[2])
reader.LevelOfDetail = 1
show(reader, times[7])
"""


@pytest.fixture(scope="module")
def pvpython():
    """ParaView's Python, if it has the version of this one or a later one."""
    found = shutil.which("pvpython")
    script = "import sys; sys.exit(sys.version_info < (3, 10))"
    if not found or subprocess.run([found, "-c", script], check=False).returncode:
        pytest.skip("needs pvpython with Python 3.10 or later")
    return found


def shown(pvpython, path, tmp_path):
    (tmp_path / "show.py").write_text(SCRIPT)
    site = os.path.dirname(wavesplat.__path__[0])
    done = subprocess.run([pvpython, tmp_path / "show.py", site, path], capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.splitlines()]


def test_paraview_shows_frames_boxes_and_levels(pvpython, tmp_path):
    samples = smooth((12, 9, 10, 11))
    path = tmp_path / "run.wspl"
    wavesplat.convert(
        samples, path, tolerance=1e-3, times=np.arange(12) * 0.5, spacing=(1, 2, 3), origin=(5, 0, 0), block=8
    )
    decoded = wavesplat.open(path)[...]
    times, whole, part, coarse = shown(pvpython, path, tmp_path)
    assert times == ["12", "0.0", "5.5"]
    assert whole[:11] == ["vtkImageData", "11", "10", "9", "5.0", "15.0", "0.0", "18.0", "0.0", "24.0", "samples"]
    np.testing.assert_allclose(np.array(whole[11:], float), decoded[7].reshape(-1)[::97], rtol=1e-6)
    assert part[:11] == ["vtkImageData", "4", "7", "4", "6.0", "9.0", "4.0", "16.0", "9.0", "18.0", "samples"]
    np.testing.assert_allclose(np.array(part[11:], float), decoded[2, 3:7, 2:9, 1:5].reshape(-1)[::97], rtol=1e-6)
    assert coarse[:4] == ["vtkImageData", "6", "5", "5"]
    np.testing.assert_allclose(np.array(coarse[11:], float), decoded[7, ::2, ::2, ::2].reshape(-1)[::97], rtol=1e-6)


def test_uneven_axes_make_a_rectilinear_grid(pvpython, tmp_path):
    ocean("f4").to_wavesplat(tmp_path / "a.wspl", block=8, window=4)
    file = wavesplat.open(tmp_path / "a.wspl")
    _, whole, *_ = shown(pvpython, tmp_path / "a.wspl", tmp_path)
    assert whole[0] == "vtkRectilinearGrid"
    assert whole[4:10] == [str(float(end)) for along in _volumes.places(file) for end in (along[0], along[-1])]


def test_pyvista_has_places_and_samples(path, file, decoded):
    pytest.importorskip("pyvista")
    grid = file.to_pyvista(5)
    assert (grid.dimensions, grid.spacing, grid.origin) == (decoded.shape[:0:-1], file.spacing, file.origin)
    np.testing.assert_array_equal(grid["samples"], decoded[5].reshape(-1))
    part = file.to_pyvista(5, z=slice(2, 9), x=slice(-4, None))
    assert part.dimensions == (4, decoded.shape[2], 7)
    assert part.origin == (decoded.shape[3] - 4.0, 0.0, 2.0)
    np.testing.assert_array_equal(part["samples"], decoded[5, 2:9, :, -4:].reshape(-1))
    with pytest.raises(ValueError, match="without steps"):
        file.to_pyvista(0, z=slice(None, None, 2))


def test_places_are_coordinates_and_ascend(tmp_path):
    dataset = ocean("f4")
    dataset.to_wavesplat(tmp_path / "a.wspl", block=8, window=4)
    where = _volumes.places(wavesplat.open(tmp_path / "a.wspl"))
    assert not _volumes.is_even(where)
    np.testing.assert_array_equal(where[2], -dataset.depth.values[::-1])
    np.testing.assert_array_equal(where[1], dataset.lat.values[::-1])


def test_even_depths_are_negative(tmp_path):
    dataset = ocean("f4").assign_coords(depth=("depth", np.arange(5) * 2.0, {"positive": "down", "units": "m"}))
    dataset.to_wavesplat(tmp_path / "a.wspl", block=8, window=4)
    file = wavesplat.open(tmp_path / "a.wspl")
    where = _volumes.places(file)
    assert _volumes.is_even(where)
    assert (_volumes.corner(where)[2], _volumes.distances(file, where)[2]) == (-8.0, 2.0)
