"""Whatever stands in a binary file, reading it ends with a result or with a fault in words.

Archives of arrays (balls, heights, restarts) and datasets in netCDF. Datasets are changed through
the library, entry by entry, or cut: bytes turned inside HDF5 are for its own developers to survive.
"""

import io
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import netCDF4
import numpy as np
import pytest
from fake_blast import fake_generate, fake_simulator, write_recipe
from hostile import BRIEF, TIMES, VALUES, mangled, outcome
from hypothesis import given, settings
from hypothesis import strategies as st

from castblast.dataset.building.extend import read_existing
from castblast.dataset.file.store import open_dataset
from castblast.disk.reading import read_npz
from castblast.errors import DatasetError
from castblast.muckpile.cast.restart import read_restart
from castblast.specs.bench.balls.files import read_balls
from castblast.specs.bench.ground.spec import GroundSpec, read_ground
from castblast.stages.datasets import dataset as stage
from castblast.stages.datasets.diff import diff_datasets


def _saved(save: Callable[..., None], **arrays: Any) -> bytes:
    stream = io.BytesIO()
    save(stream, **arrays)
    return stream.getvalue()


_BALLS = {"x": np.array([[0.0, 0.0, 1.0], [3.0, 0.0, 1.0]]), "r": np.array([0.5, 0.4])}
_HEIGHTS = {"x": np.arange(3.0), "y": np.arange(2.0), "height": np.ones((2, 3))}
_READERS: dict[str, tuple[dict[str, Any], Callable[[Path], Any]]] = {
    "arrays": ({**_BALLS, "text": np.array("a")}, read_npz),
    "balls": (_BALLS, read_balls),
    "heights": (
        _HEIGHTS,
        lambda path: read_ground(
            (GroundSpec.model_validate({"heightmap": path.name}),), path.parent
        ),
    ),
    "restart": ({**_BALLS, "case": np.array("key")}, lambda path: read_restart(path, "key")),
}


@pytest.mark.parametrize("kind", _READERS)
def test_archives_of_any_bytes(kind: str) -> None:
    arrays, read = _READERS[kind]
    whole = [_saved(save, **arrays) for save in (np.savez, np.savez_compressed)]

    @given(st.sampled_from(whole).flatmap(mangled))
    @BRIEF
    def check(content: bytes) -> None:
        with TemporaryDirectory() as name:
            path = Path(name) / "a.npz"
            path.write_bytes(content)
            outcome(lambda: read(path))

    check()


_ARRAYS = st.one_of(
    st.sampled_from(
        [
            np.array(1.0), np.array("x"), np.array(b"x"), np.zeros(0), np.zeros((0, 3)),
            np.zeros((2, 3)), np.full((2, 3), np.nan), np.full(2, np.inf), np.array([True, False]),
            np.array([1 + 2j]), np.array([["a", "b"]]), np.array(["2001-01-01"], dtype="M8[D]"),
            np.zeros((2, 3, 4)), np.zeros(2, dtype=[("a", "f8"), ("b", "i4")]),
            np.array([2**63], dtype="u8"), np.full(2, -1.0), np.full(2, 1e308), np.arange(6)[::-1],
        ]
    ),
)  # fmt: skip


@pytest.mark.parametrize("kind", ["balls", "heights", "restart"])
def test_archives_of_other_arrays(kind: str) -> None:
    arrays, read = _READERS[kind]
    changes = st.dictionaries(st.sampled_from([*arrays, "v", "block"]), _ARRAYS, max_size=3)

    @given(changes, st.sampled_from(["", *arrays]))
    @BRIEF
    def check(changed: dict[str, Any], dropped: str) -> None:
        with TemporaryDirectory() as name:
            path = Path(name) / "a.npz"
            content = {k: v for k, v in {**arrays, **changed}.items() if k != dropped}
            path.write_bytes(_saved(np.savez, **content))
            outcome(lambda: read(path))

    check()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A dataset of 60 rows, whose samples are computed again by a closed form."""
    folder = tmp_path_factory.mktemp("made")
    recipe = write_recipe(folder / "r.yaml", max_failed_share=1.0)
    fake_generate(recipe, folder / "data.nc", simulator=fake_simulator(recipe, fail_above=100e6))
    patch = pytest.MonkeyPatch()
    patch.setattr(stage, "blast_simulator", lambda *_: fake_simulator(recipe))
    yield folder / "data.nc"
    patch.undo()


def _use(path: Path, whole: Path) -> None:
    """Ask everything that can be asked of a dataset."""
    outcome(lambda: stage.describe_dataset(path))
    outcome(lambda: stage.check_dataset(path))
    outcome(lambda: stage.reproduce_sample(path, 3))
    outcome(lambda: diff_datasets(path, whole))
    outcome(lambda: read_existing(path))
    outcome(lambda: open_dataset(path))


def _attribute(value: Any) -> Any:
    """A value as netCDF can hold it."""
    if isinstance(value, bool) or value is None or isinstance(value, dict):
        return str(value)
    if isinstance(value, int):
        return value if abs(value) < 2**31 else str(value)[:40]
    if isinstance(value, list):
        return np.arange(len(value) + 2)
    return value.replace("\0", "0") if isinstance(value, str) else value


@st.composite
def _changes(draw: st.DrawFn, path: Path) -> list[tuple[str, ...]]:
    with netCDF4.Dataset(path) as file:
        columns = list(file.variables)
        places = [("", key) for key in file.ncattrs()]
        places += [(name, key) for name in columns for key in file[name].ncattrs()]
    made = []
    for _ in range(draw(st.integers(1, 3))):
        action = draw(st.sampled_from(["set", "set", "drop", "rename", "fill"]))
        if action in ("set", "drop"):
            place = draw(st.sampled_from(places))
            made.append((action, *place, _attribute(draw(VALUES))))
        else:
            names = [n for n in columns if n not in ("explosive_name",)]
            made.append((action, draw(st.sampled_from(names)), "", draw(st.integers(-3, 100))))
    return made


def _apply(path: Path, changes: list[tuple[Any, ...]]) -> None:
    with netCDF4.Dataset(path, "a") as file:
        for action, name, key, value in changes:
            if name and name not in file.variables:
                continue
            target = file[name] if name else file
            if action == "set" and key != "_FillValue":
                target.setncattr(key, value)
            elif action == "drop" and key in target.ncattrs() and key != "_FillValue":
                target.delncattr(key)
            elif action == "rename":
                file.renameVariable(name, f"{name}_x")
            elif action == "fill":
                target[...] = value


def test_datasets_with_other_entries(made: Path) -> None:
    @given(_changes(made))
    @settings(BRIEF, max_examples=5 * TIMES)
    def check(changes: list[tuple[str, ...]]) -> None:
        with TemporaryDirectory() as name:
            path = Path(name) / "d.nc"
            shutil.copy(made, path)
            _apply(path, changes)
            _use(path, made)

    check()


def test_datasets_that_are_cut(made: Path) -> None:
    content = made.read_bytes()

    @given(st.integers(0, len(content) - 1))
    @settings(BRIEF, max_examples=5 * TIMES)
    def check(length: int) -> None:
        with TemporaryDirectory() as name:
            path = Path(name) / "d.nc"
            path.write_bytes(content[:length])
            _use(path, made)

    check()


@pytest.mark.parametrize("key", ["long_name", "units", "role"])
def test_an_attribute_that_is_an_array_is_a_fault(made: Path, tmp_path: Path, key: str) -> None:
    path = tmp_path / "d.nc"
    shutil.copy(made, path)
    _apply(path, [("set", "ucs", key, np.array([0, 1]))])
    with pytest.raises(DatasetError, match="ucs"):
        stage.describe_dataset(path)
