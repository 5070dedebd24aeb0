"""Files for ParaView, read back by VTK; and what is said when VTK is missing."""

from __future__ import annotations

import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.muckpile.balls.particles import Particles, particles_at_rest
from castblast.report.piles.vtk_files import VtkSeries, need_vtk, write_vtkhdf

TIMES = (0.0, 0.1, 0.25)


def states(count: int = 7) -> list[Particles]:
    rng = np.random.default_rng(1)
    first = particles_at_rest(
        rng.uniform(-5, 5, (count, 3)), rng.uniform(0.1, 0.3, count),
        block=np.arange(count) - 1, velocity=rng.normal(size=(count, 3)),
    )  # fmt: skip
    return [first._replace(position=first.position + t * first.velocity) for t in TIMES]


def test_without_vtk_the_option_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "vtkmodules.vtkIOHDF", None)
    with pytest.raises(SpecError, match=r'needs VTK 9.4 or later: pip install -U "castblast'):
        need_vtk("--vtk")


@pytest.fixture
def series(tmp_path: Path) -> VtkSeries:
    pytest.importorskip("vtkmodules.vtkIOHDF", reason="VTK is not installed")
    (tmp_path / "balls_00009.vtp").write_text("of an earlier run with more frames")
    (tmp_path / "balls_mine.vtp").write_text("of somebody else")
    made = VtkSeries(tmp_path)
    for time, state in zip(TIMES, states(), strict=True):
        made.add(time, state)
    return made


def check(data: object, state: Particles) -> None:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    points = vtk_to_numpy(data.GetPoints().GetData())
    np.testing.assert_allclose(points, state.position, rtol=1e-6, atol=1e-6)
    arrays = data.GetPointData()
    for name in ("radius", "velocity", "block"):
        found = vtk_to_numpy(arrays.GetArray(name))
        np.testing.assert_allclose(found, getattr(state, name), rtol=1e-6)
    assert data.GetNumberOfVerts() == 1
    assert data.GetVerts().GetNumberOfConnectivityIds() == len(state.radius)


def test_series_reads_back(series: VtkSeries, tmp_path: Path) -> None:
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    for path, state in zip(series.paths, states(), strict=True):
        reader = vtkXMLPolyDataReader()
        reader.SetFileName(str(path))
        reader.Update()
        check(reader.GetOutput(), state)
    entries = ElementTree.parse(series.close()).getroot().findall("Collection/DataSet")
    assert [float(entry.get("timestep")) for entry in entries] == list(TIMES)
    assert [tmp_path / entry.get("file") for entry in entries] == series.paths
    names = {path.name for path in tmp_path.iterdir()}
    assert "balls_00009.vtp" not in names
    assert "balls_mine.vtp" in names


def test_vtkhdf_holds_every_state(series: VtkSeries, tmp_path: Path) -> None:
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    path = write_vtkhdf(tmp_path / "balls.vtkhdf", series)
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    info = reader.GetOutputInformation(0)
    times = info.Get(Pipeline.TIME_STEPS())
    np.testing.assert_allclose(times, TIMES)  # VTK writes them as float32
    for time, state in zip(times, states(), strict=True):
        reader.UpdateTimeStep(time)
        check(reader.GetOutputDataObject(0), state)
