"""xarray, VTK, ITK, pynrrd and nibabel read what `wavesplat extract` wrote into this folder, and find what is in p.npy and u.npy."""

import nibabel
import nrrd
import numpy
import SimpleITK
import xarray
import xml.etree.ElementTree
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOImage import vtkNrrdReader
from vtkmodules.vtkIONetCDF import vtkNetCDFCFReader
from vtkmodules.vtkIOXML import vtkXMLImageDataReader

SPACING, ORIGIN, TIMES = (0.5, 0.25, 2.0), (1.5, 2.0, 38.0), (3.375, 3.875, 4.375, 4.875, 5.375)
expected = numpy.load("p.npy")


def check_image(image, frame):
    samples = vtk_to_numpy(image.GetPointData().GetArray(0))
    assert (samples.reshape(frame.shape) == frame).all()
    assert image.GetSpacing() == SPACING and image.GetOrigin() == ORIGIN, (image.GetSpacing(), image.GetOrigin())


def check_with_xarray():
    for engine in ("scipy", "netcdf4"):
        with xarray.open_dataset("p.nc", engine=engine) as data:
            values = data["values"]
            assert values.dims == ("time", "z", "y", "x") and (values == expected).all()
            assert tuple(data.time.values) == TIMES
            for name, axis in zip("xyz", range(3)):
                places = ORIGIN[axis] + SPACING[axis] * numpy.arange(len(data[name]))
                assert (data[name] == places).all()
    with xarray.open_dataset("u.nc", engine="netcdf4") as data:
        assert data["values"].dtype == numpy.uint8 and (data["values"] == numpy.load("u.npy")).all()


def check_with_vtk():
    reader = vtkNetCDFCFReader()
    reader.SetFileName("p.nc")
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert times == TIMES, times
    for time, frame in zip(times, expected):
        reader.UpdateTimeStep(time)
        check_image(reader.GetOutput(), frame)
    sets = list(xml.etree.ElementTree.parse("p.pvd").getroot().iter("DataSet"))
    assert tuple(float(item.get("timestep")) for item in sets) == TIMES
    for item, frame in zip(sets, expected):
        reader = vtkXMLImageDataReader()
        reader.SetFileName(item.get("file"))
        reader.Update()
        check_image(reader.GetOutput(), frame)
        assert reader.GetOutput().GetPointData().GetScalars().GetName() == "values"
    reader = vtkNrrdReader()
    reader.SetFileName("p.nrrd")
    reader.Update()
    check_image(reader.GetOutput(), expected[0])


def check_with_itk():
    """Frames in one file: with times at regular steps, and with times that nobody gave."""
    image = SimpleITK.ReadImage("q.nrrd")
    assert (SimpleITK.GetArrayFromImage(image) == expected).all()
    assert image.GetSpacing() == (*SPACING, 0.5) and image.GetOrigin() == (*ORIGIN, TIMES[0])
    for name in ("u.nrrd", "u.nhdr", "u.nii"):
        assert (SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(name)) == numpy.load("u.npy")).all(), name


def check_with_pynrrd_and_nibabel():
    samples, header = nrrd.read("q.nrrd", index_order="C")
    assert (samples == expected).all()
    assert header["space dimension"] == 4 and header["space directions"][3, 3] == 0.5
    assert header["space origin"].tolist() == [*ORIGIN, TIMES[0]]
    samples, header = nrrd.read("u.nrrd", index_order="C")
    assert (samples == numpy.load("u.npy")).all() and numpy.isnan(header["space directions"][3]).all()
    assert nibabel.load("u.nii").header["pixdim"][4] == 0, "a step that nobody gave"


check_with_xarray()
check_with_vtk()
check_with_itk()
check_with_pynrrd_and_nibabel()
