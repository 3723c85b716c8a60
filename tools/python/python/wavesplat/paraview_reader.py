"""A reader for ParaView, with time, levels of detail and parts of the volume: load this file as a plugin."""

from __future__ import annotations

from typing import Any

import numpy as np
from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smdomain, smhint, smproperty, smproxy
from vtkmodules.numpy_interface import dataset_adapter
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkRectilinearGrid
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkStreamingDemandDrivenPipeline

import wavesplat
from wavesplat._volumes import arrays, corner, distances, is_even, name, places, times

_PIPELINE = vtkStreamingDemandDrivenPipeline


@smproxy.reader(
    name="WavesplatReader",
    label="Wavesplat Reader",
    extensions="wspl",
    file_description="wavesplat coefficient files",
)
class WavesplatReader(VTKPythonAlgorithmBase):
    """The samples of a coefficient file on points: an image, or a rectilinear grid where distances differ along an axis."""

    def __init__(self) -> None:
        """Of no file yet."""
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkDataSet")
        self._path: str | None = None
        self._lod = 0
        self._file: wavesplat.File | None = None

    @smproperty.stringvector(name="FileName")
    @smdomain.filelist()
    @smhint.filechooser(extensions="wspl", file_description="wavesplat coefficient files")
    def SetFileName(self, path: str) -> None:
        """A path or an address."""
        if path != self._path:
            self._path, self._file = path, None
            self.Modified()

    @smproperty.intvector(name="LevelOfDetail", default_values=0)
    @smdomain.intrange(min=0, max=8)
    def SetLevelOfDetail(self, lod: int) -> None:
        """Every 2**lod-th voxel along each axis is shown; levels beyond the coarsest of a file mean that."""
        if lod != self._lod:
            self._lod, self._file = lod, None
            self.Modified()

    @smproperty.doublevector(name="TimestepValues", information_only="1", si_class="vtkSITimeStepsProperty")
    def GetTimestepValues(self) -> list[float]:
        """The time of each frame."""
        return times(self._open()).tolist() if self._path else []

    def _open(self) -> wavesplat.File:
        if self._file is None:
            whole = wavesplat.open(self._path or "")
            coarsest = min(self._lod, whole.coarsest)
            self._file = whole if coarsest == 0 else wavesplat.open(self._path or "", lod=coarsest)
        return self._file

    def RequestDataObject(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Makes an empty data set of the right kind."""
        kind = vtkImageData if is_even(places(self._open())) else vtkRectilinearGrid
        information = outputs.GetInformationObject(0)
        if not isinstance(vtkDataObject.GetData(information), kind):
            information.Set(vtkDataObject.DATA_OBJECT(), kind())
        return 1

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Says when and where there are samples."""
        file, information = self._open(), outputs.GetInformationObject(0)
        when, where = times(file), places(file)
        information.Set(_PIPELINE.TIME_STEPS(), when.tolist(), len(when))
        information.Set(_PIPELINE.TIME_RANGE(), [when.min(), when.max()], 2)
        ends = [end for length in file.shape[:0:-1] for end in (0, length - 1)]
        information.Set(_PIPELINE.WHOLE_EXTENT(), ends, 6)
        information.Set(vtkAlgorithm.CAN_PRODUCE_SUB_EXTENT(), 1)
        information.Set(vtkDataObject.SPACING(), distances(file, where), 3)
        information.Set(vtkDataObject.ORIGIN(), corner(where), 3)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Decodes the frame nearest to a time, in the part of the volume that is asked for."""
        file, information = self._open(), outputs.GetInformationObject(0)
        when, frame = times(file), 0
        if information.Has(_PIPELINE.UPDATE_TIME_STEP()):
            frame = int(np.argmin(np.abs(when - information.Get(_PIPELINE.UPDATE_TIME_STEP()))))
        extent = information.Get(_PIPELINE.UPDATE_EXTENT())
        x, y, z = (slice(extent[2 * axis], extent[2 * axis + 1] + 1) for axis in range(3))
        output = vtkDataObject.GetData(information)
        output.SetExtent(extent)
        where = places(file)
        if is_even(where):
            output.SetSpacing(distances(file, where))
            output.SetOrigin(corner(where))
        else:
            for axis, part, along in zip("XYZ", (x, y, z), where, strict=True):
                getattr(output, f"Set{axis}Coordinates")(numpy_to_vtk(along[part], deep=True))
        output.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), when[frame])
        for called, samples in arrays(file, frame, (z, y, x)):
            dataset_adapter.WrapDataObject(output).PointData.append(samples, called)
        output.GetPointData().SetActiveScalars(name(file))
        return 1
