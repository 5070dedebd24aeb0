"""The store of a user gives back what this user put there on this machine, or nothing."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from castblast.surrogate.fitting import kept as store
from castblast.surrogate.fitting.kept import keep, kept

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX owners and modes")


@pytest.fixture(autouse=True)
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A cache of its own for every test."""
    monkeypatch.setenv("CASTBLAST_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "fits").mkdir()
    return tmp_path / "fits" / "first"


def sealed(place: Path) -> Path:
    entry = store._entry(place)
    assert entry is not None
    return entry


def test_what_was_kept_comes_back_and_nothing_lies_at_the_place(place: Path) -> None:
    assert kept(place) is None
    assert keep(place, b"one")
    assert keep(place, b"two")
    assert kept(place) == b"two"
    assert kept(place.with_name("second")) is None
    assert not list(place.parent.iterdir())


def test_a_changed_byte_breaks_the_seal(place: Path) -> None:
    keep(place, b"a pickle of our own")
    whole = sealed(place).read_bytes()
    for changed in (whole[:-1], whole + b".", b"\0" + whole[1:], whole[:40], b"", whole[32:]):
        sealed(place).write_bytes(changed)
        assert kept(place) is None
    sealed(place).write_bytes(whole)
    assert kept(place) == b"a pickle of our own"


def test_an_entry_cannot_stand_in_for_another(place: Path) -> None:
    other = place.with_name("second")
    keep(place, b"first")
    keep(other, b"second")
    sealed(other).write_bytes(sealed(place).read_bytes())
    assert kept(other) is None


def test_what_another_machine_sealed_is_not_there(place: Path, cache: Path) -> None:
    keep(place, b"theirs")
    (cache / "kept" / "key").unlink()
    assert kept(place) is None
    assert keep(place, b"ours")
    assert kept(place) == b"ours"


def test_the_key_is_for_one_user(place: Path, cache: Path) -> None:
    """A key that others can read, or that others made, seals nothing."""
    keep(place, b"one")
    key = cache / "kept" / "key"
    assert key.stat().st_mode & 0o777 == 0o600
    assert len(key.read_bytes()) == 32
    assert (cache / "kept").stat().st_mode & 0o777 == 0o700
    key.chmod(0o640)
    assert kept(place) is None
    assert not keep(place, b"two")
    key.chmod(0o600)
    assert kept(place) == b"one"
    real = key.rename(key.with_name("elsewhere"))
    key.symlink_to(real)
    assert kept(place) is None


@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only root can give files away")
def test_a_key_of_another_user_seals_nothing(place: Path, cache: Path) -> None:
    keep(place, b"one")
    os.chown(cache / "kept" / "key", 12345, 12345)
    assert kept(place) is None
    assert not keep(place, b"two")


def test_whoever_comes_second_takes_the_key_of_the_first(cache: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        keys = list(pool.map(lambda _: store._machine_key(), range(32)))
    assert len(set(keys)) == 1
    assert [path.name for path in (cache / "kept").iterdir()] == ["key"]


def test_without_a_cache_nothing_is_kept(monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    monkeypatch.setattr(store, "cache_folder", lambda *_: None)
    assert not keep(place, b"one")
    assert kept(place) is None


def test_what_belongs_to_folders_that_are_gone_is_removed(place: Path, tmp_path: Path) -> None:
    keep(place, b"one")
    old = sealed(place)
    place.parent.rmdir()
    (tmp_path / "new").mkdir()
    keep(tmp_path / "new" / "first", b"two")
    assert not old.parent.exists()
    assert kept(tmp_path / "new" / "first") == b"two"
