"""Files for ParaView: a series of ``.vtp`` with its ``.pvd``, and one ``.vtkhdf`` over time.

The only module that knows VTK, which is an extra (``pip install "castblast[vtk]"``). Each state is
poly data of points, one per ball, with the arrays ``radius`` [m], ``velocity`` [m s-1],
``angular_velocity`` [rad s-1] and ``block``, all as float32 or int32. In ParaView show them as
Point Gaussian with the shader preset Sphere and the scale array ``radius``, or as sphere glyphs
scaled by twice the radius.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from castblast.disk.files import write_text, write_with
from castblast.errors import SpecError
from castblast.extras import require
from castblast.muckpile.balls.particles import Particles

_FRAME = re.compile(r"_\d{5}\.vtp$")


def need_vtk(option: str) -> None:
    """Refuse `option` if VTK is missing or too old.

    Raises
    ------
    SpecError
        What to install.
    """
    require("vtk", purpose=option)
    try:
        from vtkmodules.vtkIOHDF import vtkHDFWriter  # noqa: F401
        from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter  # noqa: F401
    except ImportError:
        message = f'{option}: needs VTK 9.4 or later: pip install -U "castblast[vtk]"'
        raise SpecError(message) from None


class VtkSeries:
    """States of a run as they come, each in a file of its own.

    Parameters
    ----------
    folder : path
        Frames of an earlier series in it are removed, unless they are gone on with.
    name : str
        Files are called NAME_00000.vtp and so on, and NAME.pvd.
    """

    def __init__(self, folder: Path, name: str = "balls") -> None:
        self.folder, self.name = folder, name
        self.times: list[float] = []
        folder.mkdir(parents=True, exist_ok=True)

    def resume(self, times: Sequence[float]) -> None:
        """Go on after the states at `times` [s] that an earlier process has written.

        Raises
        ------
        SpecError
            They are not there.
        """
        self.times = list(times)
        for path in self.paths:
            if not path.is_file():
                message = f"{path}: the frames of the run that was stopped are gone"
                raise SpecError(message)
        self._remove_others()

    def _remove_others(self) -> None:
        ours = set(self.paths)
        for old in self.folder.glob(f"{self.name}_*.vtp"):
            if _FRAME.search(old.name) and old not in ours:
                old.unlink()

    @property
    def paths(self) -> list[Path]:
        """Files of the states, in order of time."""
        return [self.folder / f"{self.name}_{k:05d}.vtp" for k in range(len(self.times))]

    def add(self, time: float, balls: Particles) -> Path:
        """Write the state at `time` [s]."""
        from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

        if not self.times:
            self._remove_others()
        data = _poly_data(balls)
        self.times.append(time)

        def write(path: Path) -> None:
            writer = vtkXMLPolyDataWriter()
            writer.SetInputData(data)
            writer.SetFileName(str(path))
            writer.SetDataModeToAppended()
            writer.EncodeAppendedDataOff()
            writer.SetCompressorTypeToZLib()
            if not writer.Write():
                message = f"{path}: VTK could not write the file"
                raise OSError(message)

        return write_with(self.paths[-1], write)

    def close(self) -> Path:
        """Write the ``.pvd`` that names the files and their times."""
        root = ElementTree.Element(
            "VTKFile", type="Collection", version="0.1", byte_order="LittleEndian"
        )
        collection = ElementTree.SubElement(root, "Collection")
        for time, path in zip(self.times, self.paths, strict=True):
            ElementTree.SubElement(
                collection, "DataSet", timestep=repr(time), part="0", file=path.name
            )
        ElementTree.indent(root)
        text = '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
        return write_text(self.folder / f"{self.name}.pvd", text)


def write_vtkhdf(path: Path, series: VtkSeries) -> Path:
    """Write all states of a series into one ``.vtkhdf``, one after the other.

    No more than one state is in memory at a time.
    """
    from vtkmodules.vtkIOHDF import vtkHDFWriter

    source = _series_source(series)

    def write(name: Path) -> None:
        writer = vtkHDFWriter()
        writer.SetInputConnection(source.GetOutputPort())
        writer.SetFileName(str(name))
        writer.SetWriteAllTimeSteps(True)
        writer.SetCompressionLevel(4)
        writer.Write()
        if not name.is_file():
            message = f"{path}: VTK could not write the file"
            raise OSError(message)

    return write_with(path, write)


def _series_source(series: VtkSeries) -> Any:
    """VTK source that hands out the state nearest to the time it is asked for."""
    from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
    from vtkmodules.vtkCommonDataModel import vtkDataObject
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    times, paths = series.times, series.paths

    class Source(VTKPythonAlgorithmBase):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")

        def RequestInformation(self, _request: Any, _inputs: Any, outputs: Any) -> int:  # noqa: N802
            info = outputs.GetInformationObject(0)
            info.Set(Pipeline.TIME_STEPS(), times, len(times))
            info.Set(Pipeline.TIME_RANGE(), [times[0], times[-1]], 2)
            return 1

        def RequestData(self, _request: Any, _inputs: Any, outputs: Any) -> int:  # noqa: N802
            info = outputs.GetInformationObject(0)
            key = Pipeline.UPDATE_TIME_STEP()
            asked = info.Get(key) if info.Has(key) else times[0]
            reader = vtkXMLPolyDataReader()
            reader.SetFileName(str(paths[int(np.argmin(np.abs(np.array(times) - asked)))]))
            reader.Update()
            data = info.Get(vtkDataObject.DATA_OBJECT())
            data.ShallowCopy(reader.GetOutput())
            data.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), asked)
            return 1

    return Source()


def _poly_data(balls: Particles) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    count = len(balls.radius)
    points = vtkPoints()
    points.SetData(numpy_to_vtk(balls.position.astype(np.float32), deep=1))
    cells = vtkCellArray()  # one cell of all points: a small part of the size of n cells
    cells.SetData(
        numpy_to_vtkIdTypeArray(np.array([0, count], dtype=np.int64), deep=1),
        numpy_to_vtkIdTypeArray(np.arange(count, dtype=np.int64), deep=1),
    )
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetVerts(cells)
    for name, values in (
        ("radius", balls.radius.astype(np.float32)),
        ("velocity", balls.velocity.astype(np.float32)),
        ("angular_velocity", balls.angular_velocity.astype(np.float32)),
        ("block", balls.block.astype(np.int32)),
    ):
        array = numpy_to_vtk(values, deep=1)
        array.SetName(name)
        data.GetPointData().AddArray(array)
    data.GetPointData().SetActiveScalars("radius")
    return data
