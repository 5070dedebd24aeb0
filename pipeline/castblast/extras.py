"""Optional libraries: which extra of castblast brings each, and one line where it is missing.

The core computes an answer; whatever simulates, trains, draws or writes another tool's format comes
with an extra. A verb asks for all that it will need before its work begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec

from castblast.errors import MissingLibraryError

#: Extra to what it brings, by import name. The extras of ``pyproject.toml`` bring the same.
EXTRAS: Mapping[str, tuple[str, ...]] = {
    "simulate": ("numba", "scipy"),
    "data": ("xarray", "netCDF4", "dask", "distributed", "pandas"),
    "train": ("sklearn", "mapie", "SALib", "threadpoolctl"),
    "track": ("mlflow", "skops"),
    "torch": ("torch",),
    "tune": ("optuna",),
    "plot": ("matplotlib", "PIL", "contourpy", "shapely"),
    "export": ("jinja2", "onnx"),
    "vtk": ("vtkmodules",),
    "stl": ("trimesh",),
    "excel": ("openpyxl",),
    "parquet": ("pyarrow",),
    "onnx-test": ("onnxruntime",),
    "dvc": ("dvc",),
    "docs": ("mkdocs", "mkdocstrings"),
    "web": ("playwright",),
}
#: Names of libraries as people know them, where the import name is another one.
_TITLES = {
    "sklearn": "scikit-learn", "mapie": "MAPIE", "mlflow": "MLflow", "torch": "PyTorch",
    "optuna": "Optuna", "matplotlib": "Matplotlib", "PIL": "Pillow", "vtkmodules": "VTK",
    "dask": "Dask", "numba": "Numba", "scipy": "SciPy", "onnx": "ONNX", "onnxruntime":
    "ONNX Runtime", "jinja2": "Jinja", "dvc": "DVC", "playwright": "Playwright",
}  # fmt: skip
#: A line names at most so many libraries.
_MOST_NAMED = 4


def missing_libraries(*extras: str) -> list[str]:
    """Import names of the libraries of some extras that are not installed."""
    wanted = dict.fromkeys(name for extra in extras for name in EXTRAS[extra])
    return [name for name in wanted if not is_installed(name)]


def is_installed(library: str) -> bool:
    """Say whether a library can be found, without importing it.

    Parameters
    ----------
    library : str
        Import name of a top-level package.
    """
    try:
        return find_spec(library) is not None
    except (ImportError, ValueError):
        return False


def require(*extras: str, purpose: str) -> None:
    """Refuse to begin what needs a library that is not installed.

    Parameters
    ----------
    *extras : str
        Names out of `EXTRAS`.
    purpose : str
        What needs them, for people; the subject of a sentence, such as ``castblast tune``.

    Raises
    ------
    MissingLibraryError
        With the command that installs all that is missing.
    """
    missing = missing_libraries(*extras)
    if missing:
        raise MissingLibraryError(missing_line(missing, purpose))


def missing_line(libraries: Sequence[str], purpose: str) -> str:
    """One line: what is missing for what, and the command that installs it."""
    names = [_TITLES.get(name, name) for name in libraries]
    if len(names) > _MOST_NAMED:
        names = [*names[: _MOST_NAMED - 1], f"{len(names) - _MOST_NAMED + 1} more libraries"]
    listed = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    return f"{purpose} needs {listed}: {install_command(libraries)}"


def install_command(libraries: Sequence[str]) -> str:
    """Command that installs the extras of some libraries."""
    extras = dict.fromkeys(extra_of(name) for name in libraries)
    return f'pip install "castblast[{",".join(filter(None, extras))}]"'


def extra_of(library: str) -> str | None:
    """Extra that brings a library, by its import name; None for one that no extra brings."""
    return next((extra for extra, brought in EXTRAS.items() if library in brought), None)


def explained(fault: ModuleNotFoundError, purpose: str) -> MissingLibraryError | None:
    """Turn a failed import into one line; None where no extra brings the module."""
    library = (fault.name or "").partition(".")[0]
    if extra_of(library) is None or is_installed(library):
        return None
    return MissingLibraryError(missing_line([library], purpose))
