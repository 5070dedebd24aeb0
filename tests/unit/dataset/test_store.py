"""Files: whole or not at all, equal bytes every time, one clear line when they are unreadable."""

import os
import time

import netCDF4
import numpy as np
import pytest
import xarray as xr
from fake_blast import fake_generate, write_recipe

from castblast.dataset.file.store import open_dataset, write_dataset
from castblast.disk.files import require_writable
from castblast.errors import DatasetError, OutputError


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("store")
    return fake_generate(write_recipe(folder / "r.yaml"), folder / "data.nc").path


def _copy_with(dataset, path, version):
    dataset.attrs["schema_version"] = version
    write_dataset(dataset, path)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path, file: None, "no such file"),
        (lambda path, file: path.mkdir(), "is a folder"),
        (lambda path, file: path.touch(), "is empty (0 bytes)"),
        (lambda path, file: path.write_text("burden,velocity\n3,12\n"), "is not a netCDF file"),
        *(
            (lambda path, file, share=share: path.write_bytes(
                file.read_bytes()[: int(share * file.stat().st_size)]), "is truncated or damaged")
            for share in (0.02, 0.5, 0.99)
        ),
        (lambda path, file: xr.Dataset({"heat": ("x", np.zeros(3))}).to_netcdf(path),
         "not written by castblast"),
        (lambda path, file: _copy_with(open_dataset(file), path, "2.0"), "has format 2.0"),
    ],
    ids=["missing", "folder", "empty", "text", "2 %", "50 %", "99 %", "stranger", "newer"],
)  # fmt: skip
def test_what_cannot_be_opened_is_one_line(file, tmp_path, make, words):
    path = tmp_path / "data.nc"
    make(path, file)
    with pytest.raises(DatasetError) as caught:
        open_dataset(path)
    text = str(caught.value)
    assert words in text
    assert str(path) in text
    assert "\n" not in text


def test_equal_content_gives_equal_bytes(file, tmp_path):
    """Seconds apart and under another name: no time, path or host gets into the file."""
    dataset = open_dataset(file)
    one = write_dataset(dataset, tmp_path / "a.nc").read_bytes()
    time.sleep(1.1)
    (tmp_path / "elsewhere").mkdir()
    two = write_dataset(dataset, tmp_path / "elsewhere" / "b.nc").read_bytes()
    assert one == two


def test_a_failed_write_leaves_nothing(file, tmp_path):
    dataset = open_dataset(file)
    dataset["bad"] = ("sample", np.full(dataset.sizes["sample"], None, dtype=object))
    dataset["bad"].attrs["attribute"] = {"a": 1}
    with pytest.raises((TypeError, ValueError)):
        write_dataset(dataset, tmp_path / "data.nc")
    assert list(tmp_path.iterdir()) == []


def test_compression_and_fill_values(file):
    """Deflate with shuffle on columns; a fill value only where a failed sample leaves a hole."""
    with netCDF4.Dataset(file) as stored:
        for name, variable in stored.variables.items():
            filled = "_FillValue" in variable.ncattrs()
            role = variable.getncattr("role")
            assert filled == (role in ("target", "diagnostic", "history")), name
            if "sample" in variable.dimensions:
                assert variable.filters()["zlib"]
                assert variable.filters()["shuffle"]
                assert variable.filters()["complevel"] == 4


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="permissions do not bind here")
def test_unwritable_folder(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="cannot be written to"):
            require_writable(tmp_path)
    finally:
        tmp_path.chmod(0o700)
