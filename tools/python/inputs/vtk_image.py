"""VTK's images from numpy's arrays."""

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk
from vtk.util.vtkAlgorithm import VTKPythonAlgorithmBase

from .case import DIMS, NAME, ORIGIN, SPACING, TIMES, frame


def image(arrays: dict, active: str | None = "first", cells: bool = False) -> vtk.vtkImageData:
    """An image of arrays [z, y, x] or [z, y, x, component]; samples of `cells` lie where those of points would."""
    found = vtk.vtkImageData()
    found.SetSpacing(SPACING)
    found.SetOrigin([o - s / 2 for o, s in zip(ORIGIN, SPACING)] if cells else ORIGIN)
    found.SetDimensions([n + cells for n in DIMS])
    data = found.GetCellData() if cells else found.GetPointData()
    for name, samples in arrays.items():
        flat = np.ascontiguousarray(samples).reshape(-1, *samples.shape[3:])
        array = numpy_to_vtk(flat, deep=True)
        array.SetName(name)
        data.AddArray(array)
    if active:
        data.SetActiveScalars(next(iter(arrays)) if active == "first" else active)
    return found


def with_time(found: vtk.vtkImageData, time: float) -> vtk.vtkImageData:
    """The image with the field array that VTK's readers take the time from."""
    array = vtk.vtkDoubleArray()
    array.SetName("TimeValue")
    array.InsertNextValue(time)
    found.GetFieldData().AddArray(array)
    return found


class Source(VTKPythonAlgorithmBase):
    """A source of the field that makes only the extent and the time that are asked for."""

    def __init__(self, times: bool = False):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self.times = TIMES if times else ()

    def RequestInformation(self, request, inputs, outputs):
        info, pipeline = outputs.GetInformationObject(0), vtk.vtkStreamingDemandDrivenPipeline
        info.Set(pipeline.WHOLE_EXTENT(), [b for n in DIMS for b in (0, n - 1)], 6)
        info.Set(vtk.vtkAlgorithm.CAN_PRODUCE_SUB_EXTENT(), 1)
        if self.times:
            info.Set(pipeline.TIME_STEPS(), self.times, len(self.times))
            info.Set(pipeline.TIME_RANGE(), (self.times[0], self.times[-1]), 2)
        return 1

    def RequestData(self, request, inputs, outputs):
        info, pipeline = outputs.GetInformationObject(0), vtk.vtkStreamingDemandDrivenPipeline
        x0, x1, y0, y1, z0, z1 = extent = info.Get(pipeline.UPDATE_EXTENT())
        time = info.Get(pipeline.UPDATE_TIME_STEP()) if self.times else None
        samples = frame("f32", self.times.index(time) if self.times else 0)
        found = image({NAME: samples[z0 : z1 + 1, y0 : y1 + 1, x0 : x1 + 1]})
        found.SetExtent(extent)
        if self.times:
            found.GetInformation().Set(vtk.vtkDataObject.DATA_TIME_STEP(), time)
        vtk.vtkImageData.GetData(outputs).ShallowCopy(found)
        return 1
