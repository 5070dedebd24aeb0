"""Files from elsewhere: text, JSON and archives end as content or as one line, in bounded time."""

import io
import json
import os
import pickle
import struct
import threading
import zipfile
from pathlib import Path

import numpy as np
import pytest

from castblast.disk.reading import parse_json, read_json, read_npz, read_text
from castblast.errors import SpecError


def _line(fault: pytest.ExceptionInfo[SpecError], path: Path) -> str:
    text = str(fault.value)
    assert "\n" not in text
    assert text.startswith(f"{path}: ")
    assert "pickle" not in text.lower()
    return text


def test_arrays_come_back_to_the_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    arrays = {
        "plain": rng.normal(size=(3, 4)),
        "columns first": np.asfortranarray(rng.normal(size=(5, 2, 3))),
        "flags": np.array([True, False]),
        "text": np.array("a key"),
        "whole": np.arange(6, dtype=">i4"),
        "none": np.empty((0, 3)),
        "scalar": np.float64(2.5),
    }
    for save in (np.savez, np.savez_compressed):
        path = tmp_path / f"{save.__name__}.npz"
        save(path, **arrays)
        found = read_npz(path)
        assert sorted(found) == sorted(arrays)
        for name, value in arrays.items():
            assert found[name].dtype == np.asarray(value).dtype
            np.testing.assert_array_equal(found[name], value)
            assert found[name].flags.writeable


def _npy(array: np.ndarray, **options: bool) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, **options)
    return stream.getvalue()


def _archive(path: Path, **entries: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(f"{name}.npy", content)
    return path


class _Trap:
    """Makes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return (os.mkdir, (str(self.path),))


def test_objects_are_never_unpickled(tmp_path: Path) -> None:
    trap = np.array([_Trap(tmp_path / "sprung")], dtype=object)
    path = _archive(tmp_path / "a.npz", x=_npy(trap, allow_pickle=True))
    with pytest.raises(SpecError, match="holds Python objects, not numbers") as fault:
        read_npz(path)
    _line(fault, path)
    plain = tmp_path / "b.npz"
    plain.write_bytes(pickle.dumps(_Trap(tmp_path / "sprung")))
    with pytest.raises(SpecError, match="damaged") as fault:
        read_npz(plain)
    _line(fault, plain)
    assert not (tmp_path / "sprung").exists()


def test_a_single_array_is_called_so(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(_npy(np.ones(3)))
    with pytest.raises(SpecError, match=r"is a single array \(\.npy\); a ball file is needed"):
        read_npz(path, "a ball file")


def test_bombs_are_refused_before_they_are_unpacked(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        head = _npy(np.empty((0,)))
        with archive.open("x.npy", "w") as part:
            part.write(head)
            for _ in range(256):
                part.write(bytes(1 << 20))
    assert (tmp_path / "a.npz").stat().st_size < 1 << 20
    with pytest.raises(SpecError, match=r"unpack to 256 MB") as fault:
        read_npz(tmp_path / "a.npz")
    _line(fault, tmp_path / "a.npz")


def test_a_head_that_promises_too_much_allocates_nothing(tmp_path: Path) -> None:
    head = _npy(np.ones(3)).replace(b"(3,)", b"(9999999999999,)")
    path = _archive(tmp_path / "a.npz", x=head)
    with pytest.raises(SpecError, match=r"cut short|damaged") as fault:
        read_npz(path)
    _line(fault, path)


def test_encrypted_and_damaged_archives(tmp_path: Path) -> None:
    path = _archive(tmp_path / "a.npz", x=_npy(np.arange(1000.0)))
    content = bytearray(path.read_bytes())
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(mark) + place] |= 1
    path.write_bytes(content)
    with pytest.raises(SpecError, match="encrypted") as fault:
        read_npz(path)
    _line(fault, path)
    whole = _archive(tmp_path / "b.npz", x=_npy(np.arange(1000.0))).read_bytes()
    for cut in (0, 3, 10, len(whole) // 2, len(whole) - 5):
        path.write_bytes(whole[:cut])
        with pytest.raises(SpecError, match=r"damaged|no archive") as fault:
            read_npz(path)
        _line(fault, path)
    flipped = bytearray(whole)
    flipped[200] ^= 0xFF
    path.write_bytes(flipped)
    with pytest.raises(SpecError, match=r"damaged|cut short") as fault:
        read_npz(path)
    _line(fault, path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("notes.txt", "hello")
    with pytest.raises(SpecError, match=r"'notes\.txt' in it is not an array"):
        read_npz(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("x.npy", _npy(np.ones(3)))
    with pytest.raises(SpecError, match="packed in a way"):
        read_npz(path)


def test_places_that_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no such file"):
        read_npz(tmp_path / "none.npz")
    with pytest.raises(SpecError, match="is a folder"):
        read_npz(tmp_path)
    with pytest.raises(SpecError, match="is not a valid file name"):
        read_text(Path("a\0b"))
    with pytest.raises(SpecError, match="cannot be read"):
        read_text(Path("a" * 5000))


def test_a_text_that_never_ends_is_cut_off(tmp_path: Path) -> None:
    """A device or a pipe has no size to look at first."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def feed() -> None:
        try:
            with pipe.open("wb") as stream:
                for _ in range(1 << 10):
                    stream.write(b"x" * 4096)
        except BrokenPipeError:
            pass

    writer = threading.Thread(target=feed)
    writer.start()
    with pytest.raises(SpecError, match=r"is larger than 1 MB, the most a text file may have"):
        read_text(pipe, largest=1 << 20)
    writer.join()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "nested too deeply"),
        ('{"a":' * 100_000, "nested too deeply"),
        ("9" * 5000, "an integer is too long"),
        ("[NaN]", "NaN is not a JSON number"),
        ("[-Infinity]", "-Infinity is not a JSON number"),
        ('{"a": 1,\n"b" 2}', r"line 2: not JSON"),
        ("", "line 1: not JSON"),
    ],
)
def test_json_faults_are_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(SpecError, match=message) as fault:
        read_json(path)
    _line(fault, path)


def test_json_comes_back(tmp_path: Path) -> None:
    value = {"a": [1, 2.5, None, True, "x"], "b": {"c": "é"}}
    path = tmp_path / "a.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(value, ensure_ascii=False).encode())
    assert read_json(path) == value
    assert parse_json(json.dumps(value)) == value


def test_a_version_three_head_with_odd_length(tmp_path: Path) -> None:
    path = _archive(tmp_path / "a.npz", x=b"\x93NUMPY\x01\x00" + struct.pack("<H", 60000) + b"x")
    with pytest.raises(SpecError, match="damaged"):
        read_npz(path)
