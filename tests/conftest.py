"""Shared fixtures: floating-point faults raise, and no test may change a global default."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    import xarray as xr

os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
os.environ.setdefault("OMP_NUM_THREADS", "1")
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # So a shell script starts what ends in `&`; every process that a test starts would inherit it.
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(autouse=True)
def _floating_point_faults_raise() -> Iterator[None]:
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.fixture(autouse=True)
def _global_state_unchanged() -> Iterator[None]:
    before = (Path.cwd(), dict(np.get_printoptions()))
    yield
    assert (Path.cwd(), dict(np.get_printoptions())) == before


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the source tree."""
    return ROOT


@pytest.fixture(scope="session")
def castblast() -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """Run the command line in its own process, as a user does."""

    def run(*arguments: str | Path, **options: object) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(  # type: ignore[call-overload,no-any-return]
            [sys.executable, "-m", "castblast", *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
            **options,
        )

    return run


@pytest.fixture(scope="session")
def castblast_here() -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """Run the command line in this process: the same words and codes without the start-up."""

    def run(*arguments: str | Path) -> "subprocess.CompletedProcess[str]":
        from castblast.cli import main

        given = [str(argument) for argument in arguments]
        with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
            code = main(given)
        return subprocess.CompletedProcess(given, code, out.getvalue(), err.getvalue())

    return run


@pytest.fixture(scope="session", autouse=True)
def _coarse_pictures() -> Iterator[None]:
    """A third of the resolution: ink, words and layout are the same, most of the time is saved.

    A test that draws in this process pays for the pixels of up to twelve pictures a muckpile; the
    full size is drawn wherever a test starts the command line.
    """
    if not all(map(find_spec, ("matplotlib", "numba"))):
        yield
        return
    from matplotlib.figure import Figure

    from castblast.report.piles.ball_picture import Canvas

    save, paint = Figure.savefig, Canvas.__init__

    def save_coarse(figure: Figure, *names: object, dpi: float, **options: object) -> None:
        save(figure, *names, dpi=dpi / 3.0, **options)  # type: ignore[arg-type]

    def paint_coarse(canvas: Canvas, view: Any, extent: Any, pixels: int = 1400) -> None:
        paint(canvas, view, extent, pixels // 3 if pixels > 600 else pixels)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", save_coarse)
        patch.setattr(Canvas, "__init__", paint_coarse)
        yield


TOY_EXPLOSIVES = ("anfo", "doped_emulsion", "gassed_emulsion", "heavy_anfo")


@pytest.fixture(scope="session")
def toy_dataset() -> "Callable[..., xr.Dataset]":
    """Make a dataset of the stored layout from smooth formulas instead of simulations.

    Targets: products of powers of the inputs with a factor per explosive, bent a little (`bend`),
    so that a power law is exact at bend 0 and a network has something to learn otherwise.
    """

    def make(rows: int = 600, bend: float = 1.0, seed: int = 0) -> "xr.Dataset":
        import xarray as xr

        rng = np.random.default_rng(seed)
        lower = np.array([5e9, 2e7, 0.08, 8.0, 1.5, 0.4])
        upper = np.array([6e10, 2.5e8, 0.30, 25.0, 6.0, 1.0])
        young, ucs, diameter, height, burden, ratio = (
            lower + (upper - lower) * rng.random((rows, 6))
        ).T
        charge = height - ratio * burden
        kind = rng.integers(0, 4, rows)
        strength = np.array([1.0, 1.3, 1.1, 1.2])[kind]
        pressure = 2e8 * (ucs / 1e8) ** 0.55 * (young / 2e10) ** 0.3 * strength**1.2
        pressure *= 1.0 + bend * 0.05 * np.tanh(np.log(young / ucs / 200.0))
        hole = 0.5 * diameter * 1.3 * (pressure / 2e8) ** -0.2 * strength
        crushed = hole * 2.5 * (young / ucs / 200.0) ** 0.3 * (1.0 + bend * 0.1 * (ucs / 1e8))
        velocity = 12.0 * (diameter / 0.15) * burden**-0.8 * charge**0.5 * height**-0.5 * strength
        velocity *= 1.0 + bend * 0.1 * np.tanh(burden / 3.0 - 1.0)
        flags = {"flag_values": np.arange(4, dtype="int8")}
        split = np.searchsorted([0.6, 0.7, 0.85], rng.random(rows), side="right").astype("int8")
        columns = {
            "young_modulus": young, "ucs": ucs, "hole_diameter": diameter, "bench_height": height,
            "burden": burden, "charge_length": charge, "stemming_length": height - charge,
            "poisson_ratio": np.full(rows, 0.25), "equilibrium_pressure": pressure,
            "expanded_hole_radius": hole, "crushed_zone_radius": crushed,
            "burden_velocity": velocity,
        }  # fmt: skip
        labels = {
            "explosive": (kind.astype("int8"), " ".join(TOY_EXPLOSIVES)),
            "split": (split, "train valid calibration test"),
        }
        return xr.Dataset(
            {name: ("sample", values) for name, values in columns.items()}
            | {
                name: ("sample", values, {**flags, "flag_meanings": meanings})
                for name, (values, meanings) in labels.items()
            }
            | {"status": ("sample", np.zeros(rows, dtype="int8"))},
            coords={"sample": np.arange(rows, dtype="int32")},
            attrs={
                "schema": "castblast near-field dataset",
                "schema_version": "1.0",
                "name": "toy",
                "dataset_version": "1.0.0",
                "content_sha256": "a" * 64,
                "recipe_sha256": "b" * 64,
            },
        )

    return make
