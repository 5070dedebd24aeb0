"""Tables of a dataset: the same numbers to the last bit, and a Croissant record that fits them."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import castblast as cb
from castblast.dataset.file import store
from castblast.dataset.file.store import open_dataset
from castblast.dataset.file.tables import column_names
from castblast.disk.reading import read_json
from castblast.errors import MissingLibraryError, SpecError
from castblast.identity import file_hash
from castblast.stages.datasets.export import export_dataset

pytest.importorskip("pyarrow")
ROWS = 90


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "data.nc"
    cb.generate("quickstart", out=path, size=ROWS, workers=1)
    return path


@pytest.fixture(scope="module")
def tables(stored: Path) -> Path:
    export_dataset(str(stored), ("csv", "parquet"))
    return stored.parent / "tables"


def test_both_files_hold_the_numbers_of_the_dataset(stored: Path, tables: Path) -> None:
    dataset = open_dataset(stored)
    with cb.open_dataset(stored) as named:
        for table in (
            pd.read_csv(tables / "samples.csv", dtype=str, keep_default_na=False),
            pd.read_parquet(tables / "samples.parquet"),
        ):
            assert list(table.columns) == column_names(dataset)
            assert len(table) == ROWS
            for name in table.columns:
                if name in ("explosive", "split", "status"):
                    assert table[name].tolist() == named[name].values.tolist()
                else:
                    values = np.broadcast_to(dataset[name].to_numpy(), ROWS)
                    found = [float("nan" if cell == "" else cell) for cell in table[name]]
                    assert np.array_equal(found, values, equal_nan=True), name


def test_columns_of_a_user_come_last(stored: Path, tmp_path: Path) -> None:
    """Numbers, truth values and texts, described by the record; a text is never a formula."""
    texts = np.array(["=1+1", *["quarry"] * (ROWS - 1)])
    with cb.open_dataset(stored) as dataset:
        before = column_names(dataset)
        mine = dataset.assign(
            mean_burden=dataset["burden"] / 2,
            is_hard=dataset["ucs"] > 1e8,
            site=("sample", texts),
            per_kind=("explosive_type", np.arange(4.0)),
        )
        mine["mean_burden"].attrs = {"units": "m", "long_name": "half of the burden"}
        mine.castblast.export(tmp_path, ["csv", "parquet"])
        half, hard = (mine[name].to_numpy() for name in ("mean_burden", "is_hard"))
    for table in (
        pd.read_csv(tmp_path / "samples.csv"),
        pd.read_parquet(tmp_path / "samples.parquet"),
    ):
        assert list(table.columns) == [*before, "mean_burden", "is_hard", "site"]
        assert np.array_equal(table["mean_burden"], half)
        assert np.array_equal(table["is_hard"], hard)
        assert table["site"].tolist() == ["'=1+1", *texts[1:]]
    record: Any = read_json(tmp_path / "croissant.json")
    fields = {each["name"]: each for each in record["recordSet"][0]["field"]}
    assert fields["mean_burden"]["description"] == "half of the burden [m]"
    kinds = [fields[name]["dataType"] for name in ("mean_burden", "is_hard", "site")]
    assert kinds == ["sc:Float", "sc:Boolean", "sc:Text"]


def test_blocks_change_no_byte(
    stored: Path, tables: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def small(dataset: xr.Dataset, rows: int = 17) -> Any:
        return store.row_blocks(dataset, rows)

    monkeypatch.setattr("castblast.dataset.file.tables.row_blocks", small)
    export_dataset(stored, ["csv", "parquet"], str(tmp_path))
    assert (tmp_path / "samples.csv").read_bytes() == (tables / "samples.csv").read_bytes()
    whole, cut = (pd.read_parquet(f / "samples.parquet") for f in (tables, tmp_path))
    assert whole.equals(cut)


def test_the_record_describes_the_files_beside_it(tables: Path) -> None:
    record: Any = read_json(tables / "croissant.json")
    assert record["conformsTo"] == "http://mlcommons.org/croissant/1.0"
    assert record["@type"] == "sc:Dataset"
    for key in ("name", "description", "license", "creator", "version", "citeAs"):
        assert record[key], key
    files = {entry["@id"]: entry for entry in record["distribution"]}
    assert set(files) == {"samples.csv", "samples.parquet"}
    for name, entry in files.items():
        assert entry["sha256"] == file_hash(tables / name)
        assert entry["contentSize"] == f"{(tables / name).stat().st_size} B"
    heads = pd.read_csv(tables / "samples.csv", nrows=0).columns
    for records in record["recordSet"]:
        fields = {field["@id"]: field for field in records["field"]}
        assert records["key"]["@id"] in fields
        assert len(fields) == len(records["field"]) == len(heads)
        assert [f["source"]["extract"]["column"] for f in records["field"]] == list(heads)
        assert {f["source"]["fileObject"]["@id"] for f in records["field"]} <= set(files)
        assert {f["dataType"] for f in records["field"]} == {"sc:Text", "sc:Integer", "sc:Float"}
        speed = fields[f"{records['@id']}/burden_velocity"]
        assert speed["description"].endswith("[m s-1]")


@pytest.mark.skipif(not find_spec("mlcroissant"), reason="mlcroissant is not installed")
def test_mlcroissant_reads_the_record(tables: Path) -> None:
    import mlcroissant

    read = mlcroissant.Dataset(jsonld=str(tables / "croissant.json"))
    assert not read.metadata.ctx.issues.errors
    for records in read.metadata.record_sets:
        assert len(list(read.records(record_set=records.id))) == ROWS


def test_from_memory_they_are_the_same_files(stored: Path, tables: Path, tmp_path: Path) -> None:
    dataset = cb.open_dataset(stored).load()
    files = dataset.castblast.export(str(tmp_path / "mine"), ["csv", "parquet"])
    assert [file.name for file in files] == ["samples.csv", "samples.parquet", "croissant.json"]
    for file in files:
        assert file.read_bytes() == (tables / file.name).read_bytes()


def test_the_verb(
    castblast_here: Callable[..., CompletedProcess[str]], stored: Path, tmp_path: Path
) -> None:
    done = castblast_here("dataset", "export", stored, "--to", "csv", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "90 rows" in done.stdout
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"samples.csv", "croissant.json"}
    wrong = castblast_here("dataset", "export", stored, "--to", "parket", "--out", tmp_path / "no")
    assert wrong.returncode == 2
    assert "did you mean 'parquet'" in wrong.stderr
    assert not (tmp_path / "no").exists()


def test_a_missing_library_is_named(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("castblast.extras.is_installed", lambda name: name != "pyarrow")
    with pytest.raises(MissingLibraryError, match=r'pip install "castblast\[parquet\]"'):
        export_dataset(stored, ["parquet"])
    with pytest.raises(SpecError, match="none given"):
        export_dataset(stored, [])
