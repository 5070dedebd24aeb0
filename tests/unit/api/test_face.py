"""The face of the package: fourteen names, typed, loaded late, honest about what is missing."""

import subprocess
import sys
from pathlib import Path

import pytest

import castblast as cb

NAMES = {
    "simulate", "simulate_many", "sample", "generate", "open_dataset", "fit", "compare",
    "load_model", "Model", "Bench", "load_bench", "cast", "explosives", "variables",
}  # fmt: skip


def test_the_face_has_fourteen_names() -> None:
    assert set(cb.__all__) == NAMES | {"__version__"}
    assert set(dir(cb)) >= NAMES
    assert all(callable(getattr(cb, name)) for name in NAMES)
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = cb.simulat  # type: ignore[attr-defined]


def test_types_are_seen_and_other_names_are_not(tmp_path: Path, repository: Path) -> None:
    script = tmp_path / "use.py"
    script.write_text(
        "import castblast as cb\n"
        "speed: float = cb.simulate('anfo', burden=4.0).burden_velocity\n"
        "wrong: int = cb.load_model('full')\n"
        "cb.simulat()\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", repository / "pyproject.toml",
         "--cache-dir", repository / ".mypy_cache", script],
        capture_output=True, text=True, check=False, cwd=repository, timeout=300,
    )  # fmt: skip
    lines = [line for line in done.stdout.splitlines() if "error:" in line]
    assert [line.split(":")[1] for line in lines] == ["3", "4"], done.stdout


@pytest.mark.parametrize(
    ("name", "library", "extra"),
    [("sample", "scipy", "simulate"), ("open_dataset", "xarray", "data")],
)
def test_a_missing_library_is_one_line_with_its_extra(name: str, library: str, extra: str) -> None:
    code = (
        f"import sys; sys.modules['{library}'] = None\n"
        "import castblast\nfrom castblast.errors import MissingLibraryError\n"
        f"try: castblast.{name}\n"
        "except MissingLibraryError as fault: print(fault)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    (line,) = done.stdout.splitlines()
    assert f"castblast.{name} needs" in line
    assert f"castblast[{extra}]" in line
