"""Cache folders: what lies in them is run, so they must be the user's own, or there is no cache."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from castblast.caches import cache_folder, is_private

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX owners and modes")


@pytest.fixture
def no_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A user whom nobody knows: no HOME, no entry in the password file; gives the temp folder."""
    for name in ("HOME", "XDG_CACHE_HOME", "CASTBLAST_CACHE_DIR", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)

    def unknown() -> Path:
        message = "Could not determine home directory."
        raise RuntimeError(message)

    monkeypatch.setattr(Path, "home", unknown)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_a_folder_in_the_home_is_made_for_its_user_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("CASTBLAST_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = cache_folder("kernels", "abc")
    assert folder == tmp_path / "castblast" / "kernels" / "abc"
    assert folder.stat().st_mode & 0o777 == 0o700


def test_without_a_home_a_private_folder_with_the_user_in_its_name_is_used(no_home: Path) -> None:
    folder = cache_folder("kernels", "abc")
    assert folder is not None
    assert folder.parent == no_home
    assert str(os.geteuid()) in folder.name.split("-")
    assert folder.stat().st_mode & 0o777 == 0o700
    assert cache_folder("kernels", "abc") == folder, "the second run finds what the first kept"


@pytest.mark.parametrize("trap", ["open to all", "open to the group", "a link", "a file"])
def test_a_folder_that_others_can_fill_is_no_cache(no_home: Path, trap: str) -> None:
    place = no_home / f"castblast-{os.geteuid()}-kernels-abc"
    elsewhere = no_home / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    if trap == "a link":
        place.symlink_to(elsewhere)
    elif trap == "a file":
        place.touch()
    else:
        place.mkdir()
        place.chmod(0o777 if trap == "open to all" else 0o770)
    assert cache_folder("kernels", "abc") is None


@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only root can give folders away")
def test_a_folder_of_another_user_is_no_cache(no_home: Path) -> None:
    place = no_home / f"castblast-{os.geteuid()}-kernels-abc"
    place.mkdir(mode=0o700)
    os.chown(place, 12345, 12345)
    assert not is_private(place)
    assert cache_folder("kernels", "abc") is None


@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only root can give folders away")
def test_a_home_of_another_user_is_left_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """`sudo` may keep HOME: then root must not run what lies in the folder of the user."""
    monkeypatch.delenv("CASTBLAST_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    theirs = tmp_path / "home" / "castblast" / "kernels"
    theirs.mkdir(parents=True, mode=0o700)
    os.chown(theirs, 12345, 12345)
    assert cache_folder("kernels") == tmp_path / f"castblast-{os.geteuid()}-kernels"


def test_a_named_folder_is_taken_as_it_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels").chmod(0o777)
    monkeypatch.setenv("CASTBLAST_CACHE_DIR", str(tmp_path))
    assert cache_folder("kernels") == tmp_path / "kernels"


def test_kernels_run_without_any_cache(tmp_path: Path, repository: Path) -> None:
    """An unknown user with a cache of somebody else in the way: compiled afresh, same result."""
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(
            """
            import pathlib, tempfile
            def unknown():
                raise RuntimeError("no home")
            pathlib.Path.home = unknown
            import castblast.caches
            castblast.caches.is_private = lambda folder: False
            from castblast.kernel import kernel
            import numba
            @kernel
            def twice(x):
                return 2.0 * x
            assert twice(21.0) == 42.0
            assert numba.config.CACHE_DIR == ""
            print(type(twice._cache).__name__)
            """
        )
    )
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("HOME", "XDG_CACHE_HOME", "CASTBLAST_CACHE_DIR", "NUMBA_CACHE_DIR")
    }
    environment |= {"PYTHONPATH": str(repository / "pipeline"), "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "NullCache"


def test_a_container_without_home_and_password_entry_predicts(repository: Path) -> None:
    """As in a container that is started with ``--user 54321``."""
    unshare = ["unshare", "--user", "--map-user=54321", "--map-group=54321"]
    try:
        possible = subprocess.run([*unshare, "true"], capture_output=True, check=False)
    except OSError:
        pytest.skip("no unshare")
    if possible.returncode != 0:
        pytest.skip("no user namespaces here")
    environment = {n: v for n, v in os.environ.items() if n not in ("HOME", "XDG_CACHE_HOME")}
    environment |= {"PYTHONPATH": str(repository / "pipeline")}
    done = subprocess.run(
        [*unshare, sys.executable, "-m", "castblast", "predict", "--json"],
        capture_output=True, text=True, check=False, env=environment, cwd="/",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
