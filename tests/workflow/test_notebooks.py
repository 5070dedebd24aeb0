"""The notebooks: stored without results, and every cell of them runs in a fresh kernel."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

FOLDER = Path(__file__).resolve().parents[2] / "pipeline/notebooks"
#: Every notebook, and how many results of castblast it shows as a box of its own.
NOTEBOOKS = {"engineer": 3, "data_maker": 0, "modeller": 2}
#: Of a stored notebook: text and code only.
MOST_BYTES = 40_000
SECONDS_A_CELL = 600


@pytest.fixture
def kernel_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Empty folder for a kernel with inline pictures; its own files go elsewhere."""
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    for name in ("JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(tmp_path / "jupyter"))
    home = tmp_path / "home"
    home.mkdir()
    return home


def read(name: str) -> nbformat.NotebookNode:
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def execute(notebook: nbformat.NotebookNode, folder: Path) -> None:
    NotebookClient(
        notebook,
        timeout=SECONDS_A_CELL,
        kernel_name="python3",
        resources={"metadata": {"path": str(folder)}},
    ).execute()


def results(notebook: nbformat.NotebookNode) -> list[str]:
    """What is left of a run in a notebook."""
    left = []
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type == "code" and (cell.outputs or cell.execution_count is not None):
            left.append(f"cell {number}: results")
        if cell.metadata:
            left.append(f"cell {number}: metadata")
    return left


def shown(notebook: nbformat.NotebookNode, kind: str) -> list[Any]:
    """Everything of one MIME type that the cells show."""
    outputs = [out for cell in notebook.cells for out in cell.get("outputs", ())]
    return [out["data"][kind] for out in outputs if kind in out.get("data", {})]


def test_every_notebook_is_run() -> None:
    assert {path.name for path in FOLDER.iterdir()} == {f"{name}.ipynb" for name in NOTEBOOKS}


def test_results_are_found() -> None:
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1")])
    assert results(notebook) == []
    notebook.cells[0].execution_count = 1
    notebook.cells[0].metadata["execution"] = {}
    assert results(notebook) == ["cell 0: results", "cell 0: metadata"]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_stored_without_results(name: str) -> None:
    notebook = read(name)
    nbformat.validate(notebook)
    assert results(notebook) == []
    assert notebook.cells[0].source.startswith("# ")
    assert (FOLDER / f"{name}.ipynb").stat().st_size < MOST_BYTES


def test_a_fault_in_a_cell_is_not_passed_over(kernel_home: Path) -> None:
    cells = [nbformat.v4.new_code_cell("import castblast as cb\ncb.simulate(burden='3 kg')")]
    with pytest.raises(CellExecutionError, match="'kg' is a mass"):
        execute(nbformat.v4.new_notebook(cells=cells), kernel_home)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_runs_from_top_to_bottom(name: str, kernel_home: Path) -> None:
    """Without a warning, with pictures, with tables that browsers take, and no file is left."""
    notebook = read(name)
    execute(notebook, kernel_home)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    streams = [out for cell in code for out in cell.outputs if out.output_type == "stream"]
    said = [out.text for out in streams if out.name == "stderr"]
    assert [text for text in said if "is not installed" not in text] == []
    assert len(shown(notebook, "image/png")) >= 2
    boxes = [html for html in shown(notebook, "text/html") if html.startswith("<div style=")]
    assert len(boxes) == NOTEBOOKS[name]
    for html in boxes:
        ElementTree.fromstring(html)
    assert not list(kernel_home.iterdir())
