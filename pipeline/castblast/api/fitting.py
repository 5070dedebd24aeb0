"""Models from datasets: one fitted, several compared on held-out rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeAlias, Union

from castblast.api.datasets import encoded, open_dataset
from castblast.api.model import Model
from castblast.api.shared.frames import frame
from castblast.api.shared.markup import box, table
from castblast.api.shared.reporting import Progress, reporter
from castblast.disk.files import write_text
from castblast.disk.resources import shipped_specs
from castblast.errors import SpecError
from castblast.extras import require
from castblast.progress import part
from castblast.specs.models.model import (
    ModelSpec,
    SurrogateSpec,
    make_model_spec,
    read_model_spec,
    refuse_code,
)
from castblast.types import FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from castblast.api.training.found import Comparison as Found
    from castblast.surrogate.fitting.features import Table
    from castblast.surrogate.fitting.training import Fit
    from castblast.surrogate.judging.comparison import ComparisonDocument

#: What the face takes as a spec: a shipped name, a file, the content of one, or a spec.
Spec: TypeAlias = Union[str, Path, Mapping[str, Any], "SurrogateSpec"]
Source: TypeAlias = Union[str, Path, "xr.Dataset"]


def fit(
    dataset: Source,
    spec: Spec = "levenberg",
    *,
    seed: int | None = None,
    allow_code: bool = False,
    progress: Progress = None,
) -> Model:
    """Fit a model on the training rows of a dataset.

    Parameters
    ----------
    dataset : Dataset or path
        As of `castblast.open_dataset` or `castblast.generate`.
    spec : str, path, mapping or ModelSpec
        Name of a spec that comes with castblast, a YAML file, its content with a `name`, or a spec.
    seed : int, optional
        Instead of that of the spec.
    allow_code : bool
        Run the Python code that a spec of kind ``custom`` names.
    progress : bool or callable, optional
        True: a line on the screen.

    Returns
    -------
    Model

    Raises
    ------
    MissingLibraryError
        A library that the spec needs is not installed.
    SpecError
        An unusable spec.
    DatasetError
        An unusable dataset: missing columns, too few rows.

    Examples
    --------
    >>> import castblast as cb
    >>> ds = cb.generate("quickstart", size=900, workers=1)
    >>> model = cb.fit(ds, "ridge")
    >>> bool(model.score(ds)["r2"].min() > 0.8)
    True
    """
    wanted = _read_spec(spec, seed)
    refuse_code([wanted], allowed=allow_code)
    require("data", "simulate", "train", *wanted.needs, purpose=f"castblast.fit: {wanted.name}")
    from castblast.surrogate.fitting.training import fit_spec

    return model_of(fit_spec(wanted, _table(dataset, [wanted]), reporter(progress)))


def compare(
    dataset: Source,
    specs: Sequence[Spec] | None = None,
    *,
    quick: bool = False,
    workers: int | None = None,
    allow_code: bool = False,
    progress: Progress = None,
) -> Comparison:
    """Rank models on held-out rows, check them against physical constraints and select one.

    Parameters
    ----------
    dataset : Dataset or path
    specs : sequence of str, path, mapping or ModelSpec, optional
        Default: all that come with castblast; those whose libraries are missing are left out.
    quick : bool
        Fewer rows, iterations and starts: a first look.
    workers : int, optional
        Fits at a time; default: the cores there are. Changes no number.
    allow_code : bool
        Run the Python code that specs of kind ``custom`` name.
    progress : bool or callable, optional
        True: a line on the screen.

    Returns
    -------
    Comparison

    Raises
    ------
    MissingLibraryError, SpecError, DatasetError
        As `castblast.fit`; two specs of one name; no model that can be exported.

    Examples
    --------
    >>> import castblast as cb
    >>> ds = cb.generate("quickstart", size=900, workers=1)
    >>> found = cb.compare(ds, ["ridge", "reference_mlp_log"], quick=True, workers=1)
    >>> sorted(found.league.index), found.best.name in found.league.index
    (['reference_mlp_log', 'ridge'], True)
    """
    require("data", "simulate", "train", "plot", purpose="castblast.compare")
    from castblast.api.training.fits import fit_all, without_missing
    from castblast.api.training.judging import FULL, QUICK, judge

    extent = QUICK if quick else FULL
    given = shipped_specs("model spec").values() if specs is None else specs
    wanted = [_read_spec(spec) for spec in given]
    _require_distinct(wanted)
    refuse_code(wanted, allowed=allow_code)
    remarks: list[str] = []
    wanted = without_missing([s.quick() if quick else s for s in wanted], remarks)
    rows = _table(dataset, wanted)
    rows = rows if extent.train_rows is None else rows.with_train_rows(extent.train_rows)
    report = reporter(progress)
    with TemporaryDirectory(prefix="castblast-") as scratch, _as_file(dataset, scratch) as path:
        folder = Path(scratch, "fits")
        made = fit_all(wanted, rows, folder, workers=workers, progress=part(report, 0.0, 0.5))
        judging = part(report, 0.5, 1.0)
        found = judge(made, rows, path, folder, extent, remarks, workers, judging)
    return Comparison(found)


class Comparison:
    """Models of one dataset, ranked; made by `compare`.

    Parameters
    ----------
    found : castblast.api.training.found.Comparison
    """

    def __init__(self, found: Found) -> None:
        self._found = found

    @property
    def league(self) -> pd.DataFrame:
        """Best model first: `valid_error`, `test_error`, whether it is exportable and passes the
        gate, and R² and 95th-percentile relative error of every target on test rows.
        """  # noqa: D205 - one sentence
        entries, targets = self._found.league["league"], self._found.league["targets"]
        columns: dict[str, list[Any]] = {
            key: [entry[key] for entry in entries]
            for key in ("valid_error", "test_error", "exportable", "gate_passed", "parameters")
        }
        for target in targets:
            for key in ("r2", "relative_error_95"):
                columns[f"{target}_{key}"] = [entry["targets"][target][key] for entry in entries]
        names = [entry["name"] for entry in entries]
        return frame(columns, names, "model", "Comparison.league")

    @property
    def gate(self) -> pd.DataFrame:
        """Whether each model passes the physics gate, and the reasons why not."""
        gates = self._found.gates
        return frame(
            {
                "passed": [bool(gate["passed"]) for gate in gates.values()],
                "reasons": ["; ".join(gate["reasons"]) for gate in gates.values()],
            },
            list(gates),
            "model",
            "Comparison.gate",
        )

    @property
    def chosen(self) -> str | None:
        """Name of the model chosen by the rule; None where none passes the physics gate."""
        name: str | None = self._found.league["chosen"]
        return name

    @property
    def best(self) -> Model:
        """The chosen model; the best that can be exported where none passes the gate."""
        return model_of(self._found.chosen)

    @property
    def models(self) -> dict[str, Model]:
        """Every model by its name."""
        return {fit.spec.name: model_of(fit) for fit in self._found.fits}

    @property
    def remarks(self) -> list[str]:
        """What could not be done, and why."""
        return list(self._found.remarks)

    def document(self) -> ComparisonDocument:
        """Everything found out as plain JSON values."""
        from castblast.api.training.document import comparison_document

        return comparison_document(self._found)

    def report(self, path: str | Path) -> Path:
        """Write the comparison for people as one HTML file, pictures inside.

        Raises
        ------
        OutputError
            It cannot be written.
        """
        from castblast.api.training.document import draw_comparison
        from castblast.api.training.page import write_page

        path, document = Path(path), self.document()
        with TemporaryDirectory(prefix="castblast-") as scratch:
            pictures = draw_comparison(Path(scratch), self._found, document)
            page = write_page(Path(scratch, "report.html"), document, pictures)
            return write_text(path, page.read_text(encoding="utf-8"))

    def __repr__(self) -> str:
        league = self._found.league
        names = ", ".join(entry["name"] for entry in league["league"])
        return f"<Comparison of {names}: {self.chosen or 'none'} chosen>"

    def _repr_html_(self) -> str:
        league = self._found.league
        gates = {True: "passed", False: "failed", None: "-"}
        header = ["model", "gate", "test error", *(t.replace("_", " ") for t in league["targets"])]
        rows = [
            [
                entry["name"] + (" (chosen)" if entry["name"] == self.chosen else ""),
                gates[entry["gate_passed"]],
                _percent(entry["test_error"]),
                *(_percent(entry["targets"][t]["relative_error_95"]) for t in league["targets"]),
            ]
            for entry in league["league"]
        ]
        lead = (
            f"95th-percentile relative error on {league['test_rows']} held-out rows: how closely a "
        )
        lead += "model repeats the simulator, no statement about a blast"
        return box(repr(self).strip("<>"), table(header, rows), lead=lead)


def model_of(made: Fit) -> Model:
    """Model of a fit of any shape."""
    if made.network is not None:
        return Model(made.network, fit=made)
    shell = made.shell()
    return Model(shell, partial(_evaluate, made, shell.explosives), made)


def _evaluate(
    made: Fit, explosives: tuple[str, ...], numeric: FloatArray, index: IntArray
) -> FloatArray:
    """Values of a fit for rows of SI inputs."""
    import pandas as pd

    from castblast.surrogate.fitting.estimators import predict

    rows = pd.DataFrame(dict(zip(made.table.feature_names, numeric.T, strict=True)))
    rows["explosive"] = [explosives[k] for k in index.tolist()]
    return predict(made.estimator, rows)


def _read_spec(spec: Spec, seed: int | None = None) -> ModelSpec:
    read: Any = spec
    if isinstance(spec, Mapping):
        read = make_model_spec(spec, str(spec.get("name", "spec")), Path())
    elif not isinstance(spec, SurrogateSpec):
        read = read_model_spec(Path(spec))
    if seed is None:
        return read  # type: ignore[no-any-return]  # one of the families of ModelSpec
    if "seed" not in type(read).model_fields:
        message = f"seed: models of kind {read.kind} have none"
        raise SpecError(message, field="seed", value=seed)
    return read.model_copy(update={"seed": int(seed)})  # type: ignore[no-any-return]


def _require_distinct(specs: Sequence[ModelSpec]) -> None:
    """Models are kept, ranked and found by their names."""
    names = [spec.name for spec in specs]
    for name in names:
        if names.count(name) > 1:
            message = f"specs: name: '{name}' is that of {names.count(name)} specs"
            raise SpecError(message, field="specs", value=name)


def _table(dataset: Source, specs: Sequence[ModelSpec]) -> Table:
    from castblast.surrogate.fitting.rows import read_rows

    opened = open_dataset(dataset) if isinstance(dataset, str | Path) else dataset
    where = opened.encoding.get("source", dataset if isinstance(dataset, str | Path) else "dataset")
    return read_rows(encoded(opened), specs, str(where))


@contextmanager
def _as_file(dataset: Source, scratch: str) -> Iterator[Path]:
    """Path of a dataset, for work in other processes; one in memory is written for that time."""
    if isinstance(dataset, str | Path):
        yield Path(dataset)
        return
    from castblast.dataset.file.store import write_dataset

    yield write_dataset(encoded(dataset).load(), Path(scratch, "data.nc"))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2%}"
