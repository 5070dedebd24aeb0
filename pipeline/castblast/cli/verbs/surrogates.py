"""From a dataset to a model other tools can use: `train`, `tune`, `compare`, `runs`, `export`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import MODELS, AllowCode, OutFolder
from castblast.cli.screen import Screen
from castblast.cli.verb import Verb, verb

_Dataset = Annotated[Path, typer.Argument(help="Dataset (netCDF).")]
_Tracking = Annotated[
    bool | None,
    typer.Option(
        "--tracking/--no-tracking",
        help="Record runs in MLflow; default: if MLflow is installed.",
        show_default=False,
    ),
]
_Runs = Annotated[Path, typer.Option(help="Folder of the MLflow record.")]
_Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        min=1,
        help="Fits in parallel, one process each; default: all cores.",
        show_default=False,
    ),
]
_RUNS = Path("runs")


def train(
    screen: Screen,
    dataset: _Dataset,
    specs: Annotated[
        list[Path] | None,
        typer.Argument(help="Model specs (YAML); default: the reference.", show_default=False),
    ] = None,
    out: OutFolder = None,
    workers: _Workers = None,
    tracking: _Tracking = None,
    runs: _Runs = _RUNS,
    allow_code: AllowCode = False,
) -> Mapping[str, Any]:
    """Fit models and score them on held-out rows; existing fits are kept."""
    from castblast.stages.training.train import train as run

    with screen.progress("train") as progress:
        outcome = run(
            dataset,
            specs or [],
            out,
            workers=workers,
            tracking=_is_tracked(screen, tracking),
            runs=runs,
            allow_code=allow_code,
            progress=progress,
        )
    return screen.show(outcome)


def tune(
    screen: Screen,
    dataset: _Dataset,
    spec: Annotated[Path, typer.Argument(help="Model spec (YAML) with a block 'search'.")],
    trials: Annotated[
        int | None,
        typer.Option(help="Total number of trials, including earlier ones.", show_default=False),
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(help="Start no trial later than this [s].", show_default=False),
    ] = None,
    study: Annotated[
        Path | None,
        typer.Option(help="File of the study; default: in the folder.", show_default=False),
    ] = None,
    out: OutFolder = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the sampler.")] = 0,
    tracking: _Tracking = None,
    runs: _Runs = _RUNS,
    allow_code: AllowCode = False,
) -> Mapping[str, Any]:
    """Tune the hyperparameters a spec declares; resumes an interrupted study."""
    from castblast.stages.training.tune import tune as run

    with screen.progress("tune") as progress:
        outcome = run(
            dataset,
            spec,
            trials=trials,
            timeout=timeout,
            study=study,
            out=out,
            seed=seed,
            tracking=_is_tracked(screen, tracking),
            runs=runs,
            allow_code=allow_code,
            progress=progress,
        )
    return screen.show(outcome)


def compare(
    screen: Screen,
    dataset: Annotated[
        Path, typer.Argument(help="Dataset (netCDF), or a folder of fits made from one.")
    ],
    specs: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Model specs (YAML) or folders of them; default: all shipped ones.",
            show_default=False,
        ),
    ] = None,
    out: OutFolder = None,
    fits: Annotated[
        Path | None,
        typer.Option(help="Folder of the fits; default: beside the dataset.", show_default=False),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A first look: fewer rows and iterations.")
    ] = False,
    workers: _Workers = None,
    tracking: _Tracking = None,
    runs: _Runs = _RUNS,
    allow_code: AllowCode = False,
) -> Mapping[str, Any]:
    """Rank models on held-out rows and select one (exit code 4: none qualifies).

    Models are checked against physical constraints. Existing fits are reused; an interrupted
    comparison resumes.
    """
    from castblast.api.training.judging import FULL, QUICK
    from castblast.stages.comparison.run import compare as run

    with screen.progress("compare") as progress:
        outcome = run(
            dataset,
            specs or [],
            out,
            fits=fits,
            extent=QUICK if quick else FULL,
            workers=workers,
            tracking=_is_tracked(screen, tracking),
            runs=runs,
            allow_code=allow_code,
            progress=progress,
        )
    return screen.show(outcome)


def runs(
    screen: Screen,
    folder: Annotated[Path, typer.Argument(help="Folder of the MLflow record.")] = _RUNS,
    experiment: Annotated[
        str | None, typer.Option(help="Only this experiment, e.g. paper/1.", show_default=False)
    ] = None,
    stage: Annotated[
        str | None,
        typer.Option(help="Only compare, tune, train, fit or trial.", show_default=False),
    ] = None,
    sort: Annotated[
        str | None,
        typer.Option(help="Sort by a metric, e.g. valid_error, best first.", show_default=False),
    ] = None,
    limit: Annotated[int, typer.Option(min=0, help="Show at most this many; 0: all.")] = 30,
) -> Mapping[str, Any]:
    """List the recorded runs, newest first."""
    from castblast.stages.training.runs import list_runs

    outcome = list_runs(folder, experiment=experiment, stage=stage, sort=sort, limit=limit)
    return screen.show(outcome)


def export(
    screen: Screen,
    fit: Annotated[
        Path, typer.Argument(help="Folder of a comparison or a fit, or a network.json.")
    ],
    out: OutFolder = None,
    to: Annotated[
        str,
        typer.Option(
            help="Targets, separated by commas: json, onnx, c, js, python, pfc, lammps, excel, "
            "web; or all."
        ),
    ] = "json,onnx",
    verify: Annotated[
        bool,
        typer.Option(help="Run every export on golden rows and compare (exit code 4: differs)."),
    ] = True,
    histories: Annotated[
        Path | None,
        typer.Option(
            help="For web: dataset (netCDF) whose pressure histories the page shows, or a "
            "histories.json; default: the one beside the network.",
            show_default=False,
        ),
    ] = None,
) -> Mapping[str, Any]:
    """Write the network for other tools and verify that it gives the same numbers."""
    from castblast.stages.export import export as run

    with screen.progress("export") as progress:
        outcome = run(
            fit, out, targets=to.split(","), verify=verify, histories=histories, progress=progress
        )
    return screen.show(outcome)


def _is_tracked(screen: Screen, wanted: bool | None) -> bool:
    """Whether to keep a record: as asked for, else where the library for it is installed."""
    from castblast.extras import install_command, is_installed

    if wanted is None and not is_installed("mlflow"):
        screen.note(f"no record of the runs is kept: {install_command(['mlflow'])} for one")
    return is_installed("mlflow") if wanted is None else wanted


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    examples: dict[Verb, str] = {
        train: "train data/paper/1.3.0/data.nc levenberg",
        tune: "tune data/paper/1.3.0/data.nc torch_mlp --trials 40",
        compare: "compare data/paper/1.3.0/data.nc --quick",
        runs: "runs --stage compare --sort valid_error",
        export: "export data/paper/1.3.0/comparison --to json,c",
    }
    for function, example in examples.items():
        verb(app, panel=MODELS, example=example)(function)
