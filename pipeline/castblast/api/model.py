"""Models: networks that repeat the physics in microseconds, with bands and a domain."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castblast.api.shared.designs import Designs, Table, read_designs
from castblast.api.shared.frames import frame, library
from castblast.api.shared.markup import box, table
from castblast.bands import BAND_TITLE, BAND_WORDS, prediction_factor
from castblast.design.variables import VARIABLES
from castblast.disk.files import write_text
from castblast.errors import SpecError
from castblast.names import as_words
from castblast.network import (
    Evaluate,
    Network,
    Shell,
    evaluate_rows,
    explosive_index,
    offending_inputs,
)
from castblast.network.json_file import to_json
from castblast.prediction.answer import load_network
from castblast.prediction.blanks import predict_with_blanks
from castblast.prediction.columns import ColumnPredictions, explosive_position, held_inputs
from castblast.specs.case import require_none
from castblast.types import FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from castblast.surrogate.fitting.training import Fit

_SCORES = ("r2", "relative_error_95", "share_within", "rows")


class Model:
    """A model with its units, bands and training domain; made by `load_model` or `fit`.

    Parameters
    ----------
    network : Network, or Shell of a model of another shape
    evaluate : callable, optional
        What computes the values of a model that is no network.
    fit : Fit, optional
        Where it comes from.

    Examples
    --------
    >>> import castblast as cb
    >>> model = cb.load_model("full")
    >>> model.inputs.loc["burden", ["unit", "lower", "upper"]].to_dict()
    {'unit': 'm', 'lower': 1.0..., 'upper': 15.0...}
    """

    def __init__(
        self, network: Shell, evaluate: Evaluate | None = None, fit: Fit | None = None
    ) -> None:
        self._network, self._evaluate, self._fit = network, evaluate, fit

    @property
    def name(self) -> str:
        """Name of the spec it was fitted from."""
        spec = self._network.provenance.get("spec", {})
        return str(spec.get("name", "network"))

    @property
    def network(self) -> Network:
        """The record itself, for castblast's own functions.

        Raises
        ------
        SpecError
            The model is no chain of dense layers.
        """
        if not isinstance(self._network, Network):
            message = f"{self.name}: not a chain of dense layers, so it has no network.json"
            raise SpecError(message, field="model", value=self.name)
        return self._network

    @property
    def fitted(self) -> Fit | None:
        """The fit it comes from, with its estimator and table; None for one read from a file."""
        return self._fit

    @property
    def inputs(self) -> pd.DataFrame:
        """Inputs: SI `unit`, `lower` and `upper` of the training rows, `meaning`.

        Inputs that were the same in every training row have one value for both ends.
        """
        held = held_inputs(self._network)
        ranges = {c.name: (c.lower, c.upper) for c in self._network.inputs}
        ranges |= {name: (value, value) for name, value in held.items() if name not in ranges}
        return frame(
            {
                "unit": [VARIABLES[name].unit for name in ranges],
                "lower": [low for low, _ in ranges.values()],
                "upper": [high for _, high in ranges.values()],
                "meaning": [VARIABLES[name].long_name for name in ranges],
            },
            list(ranges),
            "input",
            "Model.inputs",
        )

    @property
    def outputs(self) -> pd.DataFrame:
        """Outputs: SI `unit`, `prediction_factor` and `network_band`, `meaning`.

        The prediction band reaches from the value over the factor to the value times it; 95 % of
        simulations lie within the network band, relative to the value.
        """
        columns = self._network.outputs
        return frame(
            {
                "unit": [c.unit for c in columns],
                "prediction_factor": [prediction_factor(c.name, c.relative_band) for c in columns],
                "network_band": [c.relative_band for c in columns],
                "meaning": [VARIABLES[c.name].long_name for c in columns],
            },
            [c.name for c in columns],
            "output",
            "Model.outputs",
        )

    @property
    def explosives(self) -> pd.DataFrame:
        """Explosives that the model was trained on, with the numbers of the catalogue."""
        from castblast.api.catalogue import explosives

        return explosives().reindex(list(self._network.explosives)).rename_axis("explosive")

    def predict(self, designs: Table, explosive: str | None = None) -> pd.DataFrame:
        """Predict every row of a table.

        Parameters
        ----------
        designs : DataFrame, Dataset or mapping of name to (n,)
            As in `castblast.simulate_many`.
        explosive : str, optional
            Of all rows, where there is no column of that name; default ``anfo``.

        Returns
        -------
        DataFrame
            With the index of `designs`. For each output its value and the ends of its prediction
            band, ``NAME``, ``NAME_prediction_lower``, ``NAME_prediction_upper`` [SI]; `domain`:
            inside, unusual or outside the training data; `at_fault`: the inputs responsible.

        Raises
        ------
        SpecError
            Unknown columns, units, explosives, impossible designs; with the label of the row.

        Examples
        --------
        >>> import castblast as cb
        >>> answer = cb.load_model("full").predict({"burden": "4 m", "ucs": ["80 MPa", 4e8]})
        >>> answer[["burden_velocity", "domain", "at_fault"]].round(1)
             burden_velocity   domain at_fault
        row
        0               10.1   inside
        1                12.6  outside      ucs
        """
        pandas = library("pandas", "Model.predict")
        read = read_designs(designs, explosive)
        index = self._explosives(read)
        answers = predict_with_blanks(read.columns, index, self._network, self._evaluate)
        read.require_possible(answers.designs.faults)
        columns: dict[str, Any] = {}
        for j, name in enumerate(self._network.output_names):
            columns[name] = answers.rows.values[:, j]
            columns[f"{name}_prediction_lower"] = answers.rows.prediction.lower[:, j]
            columns[f"{name}_prediction_upper"] = answers.rows.prediction.upper[:, j]
        columns["domain"] = answers.domain.astype(object)
        columns["at_fault"] = self._at_fault(answers)
        labels = read.index
        if not hasattr(labels, "nlevels"):
            labels = pandas.Index(labels, name=read.index_name)
        answer = pandas.DataFrame(columns, index=labels)
        answer.attrs["units"] = {c.name: c.unit for c in self._network.outputs}
        return answer

    def save(self, path: str | Path) -> Path:
        """Write the model as a ``network.json``, which `castblast.load_model` reads.

        Parameters
        ----------
        path : str or path
            A file, or a folder for ``network.json``.

        Raises
        ------
        OutputError
            It cannot be written.
        """
        path = Path(path)
        file = path if path.suffix == ".json" else path / "network.json"
        return write_text(file, to_json(self.network))

    def score(self, dataset: xr.Dataset | str | Path, split: str | None = "test") -> pd.DataFrame:
        """Compare with simulated rows.

        Parameters
        ----------
        dataset : Dataset or path
        split : str, optional
            None: all finished rows.

        Returns
        -------
        DataFrame
            One row for each output: `r2`; `relative_error_95`, the 95th-percentile relative error;
            `share_within`, rows within 2.5 %; number of `rows`.

        Raises
        ------
        DatasetError
            A column that the model needs is missing, or an explosive it does not know.

        Examples
        --------
        >>> import castblast as cb
        >>> ds = cb.generate("full", size=100, workers=1)
        >>> bool(cb.load_model("full").score(ds, split=None)["r2"].min() > 0.999)
        True
        """
        from castblast.api.datasets import decoded, open_dataset
        from castblast.surrogate.fitting.metrics import score_targets

        opened = open_dataset(dataset) if isinstance(dataset, str | Path) else decoded(dataset)
        names, outputs = self._network.input_names, self._network.output_names
        x, y = opened.castblast.training_table(
            split, features=names, targets=outputs, one_hot=False
        )
        index = np.array([explosive_index(self._network, str(e)) for e in x["explosive"]])
        values = self._values(x[list(names)].to_numpy(), index)
        scores = score_targets(y.to_numpy(), values, outputs)
        return frame(
            {key: [getattr(scores[name], key) for name in outputs] for key in _SCORES},
            list(outputs),
            "output",
            "Model.score",
        )

    def export(self, path: str | Path, *, verify: bool = True) -> list[Path]:
        """Write the model for another tool.

        Parameters
        ----------
        path : str or path
            Its suffix chooses the target: ``.json``, ``.onnx``, ``.c``, ``.js``, ``.py``,
            ``.xlsx``, ``.html``. Files that belong to it (``model.h``) go beside it.
        verify : bool
            Run the file on the golden rows first; nothing is written if it disagrees. What cannot
            be run here is written with a warning.

        Returns
        -------
        list of path

        Raises
        ------
        MissingLibraryError
            The target needs a library that is not installed.
        SpecError
            No target has this suffix, or it cannot carry the model.
        CheckError
            The file does not give the answers of the fitted estimator.
        """
        from castblast.api.exports import write_module, write_network

        if self._fit is not None and self._fit.network is None:
            return write_module(self._fit, Path(path), verify=verify)
        return write_network(self.network, Path(path), verify=verify)

    def _values(self, numeric: FloatArray, index: IntArray) -> FloatArray:
        """Outputs (n, m) of rows of SI inputs (n, k)."""
        if self._evaluate is not None:
            return self._evaluate(numeric, index)
        return evaluate_rows(self.network, numeric, index)

    def _explosives(self, read: Designs) -> IntArray:
        """Position of the explosive of every row."""
        position, faults = {}, []
        for text in dict.fromkeys(read.explosive):
            try:
                position[text] = explosive_position(self._network, text or "anfo")
            except SpecError as fault:
                where = read.where(read.explosive.index(text))
                known = self._network.explosives
                faults.append(
                    SpecError(f"{where}: {fault}", field="explosive", value=text, allowed=known)
                )
        require_none(faults)
        return np.array([position[text] for text in read.explosive], dtype=np.int64)

    def _at_fault(self, answers: ColumnPredictions) -> list[str]:
        """Inputs at fault of every row; empty inside the training data."""
        words = [""] * len(answers.domain)
        rows = np.flatnonzero(answers.domain != "inside")
        if not len(rows):
            return words
        numeric = np.stack(list(answers.designs.inputs.values()), axis=1)[rows]
        names = [*self._network.input_names, *(entry.name for entry in answers.designs.unseen)]
        flags = np.concatenate(
            [
                offending_inputs(self._network, numeric),
                *(entry.rows[rows, None] for entry in answers.designs.unseen),
            ],
            axis=1,
        )
        for row, at in zip(rows.tolist(), flags, strict=True):
            words[row] = " ".join(
                dict.fromkeys(n for n, is_at in zip(names, at, strict=True) if is_at)
            )
        return words

    def __repr__(self) -> str:
        dataset = self._network.provenance.get("dataset", {})
        made = f", trained on {dataset['name']} {dataset['dataset_version']}" if dataset else ""
        outputs = ", ".join(self._network.output_names)
        return f"<Model {self.name}: {len(self._network.inputs)} inputs -> {outputs}{made}>"

    def _repr_html_(self) -> str:
        inputs = [
            (as_words(c.name), _range(c.name, c.lower, c.upper)) for c in self._network.inputs
        ]
        outputs = [
            (
                as_words(c.name),
                f"a factor {prediction_factor(c.name, c.relative_band):.2g} either way",
                f"{c.relative_band:.2%}",
            )
            for c in self._network.outputs
        ]
        return box(
            repr(self).strip("<>"),
            table(("input", "training range"), inputs),
            table(("output", BAND_TITLE, "network band"), outputs),
            table(("explosive",), [(name,) for name in self._network.explosives]),
            lead=BAND_WORDS,
        )


def _range(name: str, lower: float, upper: float) -> str:
    """Training range for people, to three figures; the exact ends are in `Model.inputs`."""
    variable = VARIABLES[name]
    ends = " to ".join(f"{end * variable.display_factor:.3g}" for end in (lower, upper))
    return ends if variable.shown_unit == "1" else f"{ends} {variable.shown_unit}"


def load_model(name_or_path: str | Path = "full") -> Model:
    """Read a model that comes with castblast, or a file of your own.

    Parameters
    ----------
    name_or_path : str or path
        ``full`` or ``paper``, or a ``network.json``.

    Raises
    ------
    SpecError
        A missing or unusable file.

    Examples
    --------
    >>> import castblast as cb
    >>> cb.load_model()
    <Model levenberg: 14 inputs -> equilibrium_pressure, burden_velocity, crushed_zone_radius, expanded_hole_radius, trained on full 1.1.0>
    """  # noqa: E501 - one line of a screen
    return Model(load_network(Path(name_or_path)))
