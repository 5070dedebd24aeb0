"""Torch modules that are no chain of dense layers, exported to ONNX: the file gives their answers.

The bound is 1e-12 relative, on golden rows that hold the corners of the training box, and on
batches of one and of seven rows.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from castblast.api.training.fits import FIT_FILE
from castblast.disk.files import write_json
from castblast.errors import CheckError, SpecError
from castblast.export.onnx.file import run_onnx_rows, wrap_onnx
from castblast.export.parity import TOLERANCE, check_wrapped_parity
from castblast.network import in_domain, offending_inputs, predict_rows
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, read_model_spec
from castblast.stages.export import export
from castblast.surrogate.fitting import estimators
from castblast.surrogate.fitting.features import Table, read_table
from castblast.surrogate.fitting.fit_store import fit_key, save_kept
from castblast.surrogate.fitting.training import Fit, fit_spec

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime", reason="ONNX files are run with onnxruntime")

SHAPES = """
import torch
from torch import nn


class Residual(nn.Module):
    def __init__(self, inputs, outputs, activation="GELU", nodes=8):
        super().__init__()
        self.enter, self.leave = nn.Linear(inputs, nodes), nn.Linear(nodes, outputs)
        self.norm, self.inner = nn.LayerNorm(nodes), nn.Linear(nodes, nodes)
        self.activation = getattr(nn, activation)()

    def forward(self, x):
        x = self.enter(x)
        return self.leave(x + self.activation(self.inner(self.norm(x))))


class Attention(nn.Module):
    "Every column is a token."

    def __init__(self, inputs, outputs):
        super().__init__()
        self.places = nn.Parameter(0.1 * torch.randn(inputs, 4))
        self.enter, self.look = nn.Linear(1, 4), nn.MultiheadAttention(4, 2, batch_first=True)
        self.leave = nn.Linear(4 * inputs, outputs)

    def forward(self, x):
        tokens = self.enter(x[:, :, None]) + self.places
        seen, _ = self.look(tokens, tokens, tokens, need_weights=False)
        return self.leave((tokens + seen).flatten(1))


class RootMeanSquare(nn.Module):
    def __init__(self, inputs, outputs):
        super().__init__()
        self.norm, self.leave = nn.RMSNorm(inputs), nn.Linear(inputs, outputs)

    def forward(self, x):
        return self.leave(self.norm(x))


class Single(nn.Module):
    "Computes in float32 on the way."

    def __init__(self, inputs, outputs):
        super().__init__()
        self.leave = nn.Linear(inputs, outputs)

    def forward(self, x):
        return self.leave(torch.tanh(x.float()).double())


class Fixed(nn.Module):
    "Holds the number of rows that it was traced with."

    def __init__(self, inputs, outputs):
        super().__init__()
        self.leave = nn.Linear(inputs, outputs)

    def forward(self, x):
        return self.leave(x) + torch.zeros(int(x.shape[0]), 1, dtype=x.dtype)


def neighbours():
    from sklearn.neighbors import KNeighborsRegressor

    return KNeighborsRegressor(3)
"""
TRAINING = "{adam_epochs: 2, max_iterations: 15}"
#: Activations that onnxruntime lacks in float64, and others.
ACTIVATIONS = (
    "ELU", "GELU", "SELU", "LeakyReLU", "PReLU", "Softplus", "Mish", "Hardswish", "ReLU6",
)  # fmt: skip
Make = Callable[..., tuple[Fit, Path]]


@pytest.fixture(scope="module")
def table(toy_dataset) -> Table:
    return read_table(toy_dataset(400), PAPER_FEATURES, PAPER_TARGETS)


@pytest.fixture(scope="module")
def make(table, tmp_path_factory) -> Make:
    """Fit a factory of `SHAPES` and keep it as `castblast train` does: the fit and its folder."""
    folder = tmp_path_factory.mktemp("shapes")
    (folder / "my_shapes.py").write_text(SHAPES)
    made: dict[str, tuple[Fit, Path]] = {}

    def fit(factory: str, options: str = "{}", training: str = TRAINING) -> tuple[Fit, Path]:
        name = f"{factory.lower()}_{len(made)}"
        if factory + options not in made:
            path = folder / f"{name}.yaml"
            path.write_text(
                f"kind: custom\nfactory: my_shapes:{factory}\noptions: {options}\n"
                f"training: {training}\ninput_transform: log\ntarget_transform: log\n"
                "derived: {stemming: {coefficients: {bench_height: 1.0, charge_length: -1.0}}}\n"
            )
            spec = read_model_spec(path)
            found = fit_spec(spec, table)
            save_kept(folder / name, found, fit_key(spec, table), spec)
            write_json(folder / name / FIT_FILE, found.to_document())
            made[factory + options] = found, folder / name
        return made[factory + options]

    return fit


@pytest.mark.parametrize(("factory", "opset"), [("Residual", 13), ("Attention", 14)])
def test_a_module_of_any_shape_is_the_estimator(
    make: Make, tmp_path: Path, factory: str, opset: int
) -> None:
    fit, folder = make(factory)
    assert fit.network is None
    outcome = export(folder, tmp_path, targets=("onnx",), parity=tmp_path / "parity.json")
    assert [Path(path).name for path in outcome.document["files"]] == ["model.onnx", "parity.json"]
    found = outcome.document["parity"]["onnx"]
    assert found["passed"]
    assert found["golden_rows"] == 200
    bands = found["band"], found["prediction_band"]
    assert max(*found["relative"].values(), *bands) <= TOLERANCE
    content, shell = (tmp_path / "model.onnx").read_bytes(), fit.shell()
    model = onnx.load_from_string(content)
    assert [entry.version for entry in model.opset_import] == [opset]
    assert not any(tensor.data_type == onnx.TensorProto.FLOAT for tensor in model.graph.initializer)
    assert str(folder.parent) not in str(model), "no path of this machine in the file"
    for rows in (1, 7):
        part = fit.table.frame.iloc[fit.table.rows("test")[:rows]]
        numeric = part[list(shell.input_names)].to_numpy()
        index = np.array([shell.explosives.index(name) for name in part["explosive"]])
        truth = estimators.predict(fit.estimator, part)
        np.testing.assert_allclose(run_onnx_rows(content, numeric, index).values, truth, rtol=1e-12)


def test_the_file_is_like_that_of_a_network(make: Make, tmp_path: Path) -> None:
    """Same inputs, outputs and metadata; golden rows hold the corners; the domain is told."""
    fit, folder = make("Residual")
    export(folder, tmp_path, targets=("onnx",))
    content, shell = (tmp_path / "model.onnx").read_bytes(), fit.shell()
    model = onnx.load_from_string(content)
    names = list(shell.output_names)
    ends = [
        f"{name}_{kind}_{end}"
        for kind in ("prediction", "network") for end in ("lower", "upper") for name in names
    ]  # fmt: skip
    assert [entry.name for entry in model.graph.input] == ["numeric", "explosive"]
    found = [entry.name for entry in model.graph.output]
    assert found == [*names, *ends, "domain_score", "in_domain", "offending"]
    metadata = {entry.key: json.loads(entry.value) for entry in model.metadata_props}
    assert metadata["inputs"] == list(PAPER_FEATURES)
    assert metadata["relative_band"] == fit.band.tolist()
    assert metadata["provenance"]["spec"]["factory"] == "my_shapes:Residual"
    box = np.array([[column.lower, column.upper] for column in shell.inputs])
    rows = shell.golden.inputs
    corners = np.all((rows == box[:, 0]) | (rows == box[:, 1]), axis=1)
    assert np.count_nonzero(corners) >= 30
    rows = np.concatenate([rows[corners], rows[:5] * 1.7])
    told = run_onnx_rows(content, rows, np.zeros(len(rows), dtype=np.int64))
    np.testing.assert_array_equal(told.inside, in_domain(shell, rows))
    np.testing.assert_array_equal(told.offending, offending_inputs(shell, rows))
    assert not told.inside[-5:].any()


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_activations_keep_float64(make: Make, tmp_path: Path, activation: str) -> None:
    """In float64 onnxruntime lacks half of these, and float32 would cost eight digits."""
    options = f"{{activation: {activation}, nodes: 5}}"
    _, folder = make("Residual", options, "{adam_epochs: 1, max_iterations: 2}")
    found = export(folder, tmp_path, targets=("onnx",)).document["parity"]["onnx"]
    assert found["passed"]
    assert max(found["relative"].values()) <= TOLERANCE


def test_one_model_one_file(make: Make) -> None:
    from castblast.surrogate.torch_onnx import torch_core

    fit, _ = make("Residual")
    dtype = torch.get_default_dtype()
    assert wrap_onnx(fit.shell(), torch_core(fit)) == wrap_onnx(fit.shell(), torch_core(fit))
    assert torch.get_default_dtype() == dtype


def test_a_shell_cannot_be_evaluated(make: Make) -> None:
    shell = make("Residual")[0].shell()
    with pytest.raises(AttributeError, match="layers"):
        predict_rows(shell, shell.golden.inputs, np.zeros(200, dtype=np.int64))


def test_other_targets_cannot_carry_it(make: Make, tmp_path: Path) -> None:
    _, folder = make("Residual")
    out = tmp_path / "out"
    with pytest.raises(SpecError, match=r"not a chain of dense layers, only onnx .* not json, c"):
        export(folder, out, targets=("json", "onnx", "c"))
    with pytest.raises(SpecError, match="only onnx can carry it, not json, c, js"):
        export(folder, out, targets=("all",))
    assert not out.exists()


def test_what_is_neither_chain_nor_module_is_told(make: Make, tmp_path: Path) -> None:
    _, folder = make("neighbours")
    with pytest.raises(SpecError, match=r"neighbours_\d+ \(KNeighborsRegressor\): neither a chain"):
        export(folder, tmp_path, targets=("onnx",))


@pytest.mark.parametrize(
    ("factory", "message"),
    [
        ("RootMeanSquare", r"rootmeansquare_\d+: torch.onnx cannot export .*rms_norm.*[^\n]$"),
        ("Single", r"single_\d+: ONNX core: .*Cast.* is computed in float32"),
    ],
)
def test_what_cannot_be_exported_is_told_in_a_line(
    make: Make, tmp_path: Path, capfd: pytest.CaptureFixture[str], factory: str, message: str
) -> None:
    _, folder = make(factory)
    with pytest.raises(SpecError, match=message) as raised:
        export(folder, tmp_path, targets=("onnx",))
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def test_a_fixed_number_of_rows_is_seen(make: Make, tmp_path: Path) -> None:
    _, folder = make("Fixed")
    message = "onnx: (onnxruntime does not run|the file has a fixed batch size)"
    with pytest.raises(CheckError, match=message):
        export(folder, tmp_path / "out", targets=("onnx",))
    assert not list((tmp_path / "out").glob("*"))


def test_a_file_of_another_model_is_seen(make: Make) -> None:
    from castblast.surrogate.torch_onnx import torch_core

    fit, _ = make("Residual")
    shell = fit.shell()
    golden = replace(shell.golden, outputs=shell.golden.outputs * (1.0 + 1e-10))
    content = wrap_onnx(shell, torch_core(fit))
    assert check_wrapped_parity(shell, content).passed
    report = check_wrapped_parity(replace(shell, golden=golden), content)
    assert len(report.faults) == len(shell.outputs) + 2  # both bands


def test_a_core_of_other_columns_is_refused(make: Make) -> None:
    from castblast.surrogate.torch_onnx import torch_core

    fit, _ = make("Residual")
    shell = fit.shell()
    fewer = replace(shell, derived=())
    with pytest.raises(SpecError, match=rf"its input must be float64 \[n, {fewer.width}\]"):
        wrap_onnx(fewer, torch_core(fit))


def test_a_fit_of_other_code_is_not_exported(make: Make, table: Table, tmp_path: Path) -> None:
    """Changed code, or another machine: what it would answer is not what was scored."""
    fit, _ = make("Residual")
    other = tmp_path / "other"
    key = fit_key(fit.spec, table) | {"factory": "another"}
    save_kept(other, fit, key, fit.spec)
    write_json(other / FIT_FILE, fit.to_document())
    with pytest.raises(SpecError, match="was fitted with other factory than there is now"):
        export(other, targets=("onnx",))
    elsewhere = other.rename(tmp_path / "elsewhere")
    with pytest.raises(SpecError, match="elsewhere: its fit is not kept on this machine"):
        export(elsewhere, targets=("onnx",))
