"""Files: whole or not at all, equal bytes every time, one clear line when they are unreadable."""

import os
import subprocess
import sys
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


def message_for(path):
    with pytest.raises(DatasetError) as caught:
        open_dataset(path)
    text = str(caught.value)
    assert str(path) in text
    assert "\n" not in text
    return text


def test_missing(tmp_path):
    assert "no such file" in message_for(tmp_path / "none.nc")


def test_folder(tmp_path):
    assert "is a folder" in message_for(tmp_path)


def test_empty(tmp_path):
    path = tmp_path / "data.nc"
    path.touch()
    assert "is empty (0 bytes)" in message_for(path)


def test_text(tmp_path):
    path = tmp_path / "data.nc"
    path.write_text("burden,velocity\n3,12\n")
    assert "is not a netCDF file" in message_for(path)


@pytest.mark.parametrize("share", [0.02, 0.5, 0.99])
def test_truncated(file, tmp_path, share):
    path = tmp_path / "data.nc"
    content = file.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    assert "is truncated or damaged" in message_for(path)


def test_another_netcdf(tmp_path):
    path = tmp_path / "data.nc"
    xr.Dataset({"temperature": ("x", np.zeros(3))}).to_netcdf(path)
    assert "not written by castblast" in message_for(path)


def test_newer_format(file, tmp_path):
    dataset = open_dataset(file)
    dataset.attrs["schema_version"] = "2.0"
    path = write_dataset(dataset, tmp_path / "data.nc")
    assert "has format 2.0" in message_for(path)


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


@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
def test_full_disk_is_one_line_and_leaves_nothing(file, tmp_path):
    """A limit on the size of files stands in for a full disk."""
    code = (
        "import resource, signal, sys; from pathlib import Path\n"
        "from castblast.dataset.file.store import open_dataset, write_dataset\n"
        "from castblast.errors import DatasetError\n"
        "dataset = open_dataset(Path(sys.argv[1]))\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))\n"
        "try:\n    write_dataset(dataset, Path(sys.argv[2]))\n"
        "except DatasetError as fault:\n    print(fault)\n"
    )
    target = tmp_path / "data.nc"
    done = subprocess.run(
        [sys.executable, "-c", code, file, target], capture_output=True, text=True, check=True
    )
    assert f"{target}: cannot be written" in done.stdout
    assert len(done.stdout.splitlines()) == 1
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


def test_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written to"):
        require_writable(tmp_path / "file" / "folder")


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="permissions do not bind here")
def test_unwritable_folder(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="cannot be written to"):
            require_writable(tmp_path)
    finally:
        tmp_path.chmod(0o700)
