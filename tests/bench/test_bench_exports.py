"""Microseconds per prediction of every copy of one network, against scikit-learn in the same run.

The model is a fit of the shipped size (32 + 32 tanh nodes, 4 outputs). scikit-learn is asked as its
users ask: the fitted pipeline, scalings included, predicts a data frame. One design: a call per
design. Batch: 10^6 designs, for NumPy, ONNX and scikit-learn in ten calls; the C and JavaScript
copies have no other way than one design after the other. One thread, processor time: other work
on the machine does not enter. The copies and NumPy also say where a design lies; scikit-learn does
not.
"""

import shutil
import time

import numpy as np
import pytest
from sklearn.neural_network import MLPRegressor

from castblast.export.source.runners import RUN_ROWS, compile_c, run_program, written
from castblast.export.targets import TARGETS
from castblast.network import explosive_index, predict_rows
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, MlpSpec
from castblast.surrogate.fitting import estimators
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec

SPEC = MlpSpec(
    name="wide",
    hidden_layers=(32, 32),
    input_transform="log",
    target_transform="log",
    max_iterations=30,
)
BATCH, CALLS = 1_000_000, 10


@pytest.fixture(scope="module")
def fit(toy_dataset):
    return fit_spec(SPEC, read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS))


@pytest.fixture(scope="module")
def golden(fit):
    network = fit.network
    index = np.array([explosive_index(network, name) for name in network.golden.explosives])
    return network.golden.inputs, index


def best(call, repeats: int, tries: int = 3) -> float:
    """Processor time of a call in microseconds, the best of a few tries."""
    call()
    found = []
    for _ in range(tries):
        start = time.process_time()
        for _ in range(repeats):
            call()
        found.append((time.process_time() - start) / repeats)
    return 1e6 * min(found)


@pytest.mark.benchmark(group="exports")
def test_microseconds_per_prediction(fit, golden, figure, benchmark) -> None:
    """Notes a figure per copy; C on one design is held against scikit-learn."""
    rows, index = golden
    names = list(fit.network.golden.explosives)
    frame = fit.table.frame.head(0).reindex(range(200))
    for j, name in enumerate(fit.network.input_names):
        frame[name] = rows[:, j]
    frame["explosive"] = names
    many = frame.loc[np.arange(BATCH // CALLS) % 200].reset_index(drop=True)
    one = frame.head(1)
    single = best(lambda: estimators.predict(fit.estimator, one), 50)
    figure("scikit-learn, one design", single, "us")
    bare = MLPRegressor(hidden_layer_sizes=(32, 32), activation="tanh", max_iter=20)
    scaled = np.random.default_rng(0).normal(size=(200, 10))
    bare.fit(scaled, scaled[:, :4])
    alone = best(lambda: bare.predict(scaled[:1]), 200)
    figure("scikit-learn, its bare network, one design", alone, "us")
    batch = best(lambda: estimators.predict(fit.estimator, many), CALLS, 1) / len(many)
    figure("scikit-learn, batch", batch, "us")
    _numpy(fit.network, rows, index, figure)
    _onnx(fit.network, rows, index, figure)
    _python(fit.network, figure)
    _node(fit.network, figure)
    with written(TARGETS["c"].write(fit.network)) as folder:
        program = compile_c(folder)
        run_program([program, "--time", "100000"])
        times = [float(run_program([program, "--time", str(BATCH)])) for _ in range(3)]
        benchmark.pedantic(run_program, args=([program],), rounds=1)
    ours = 1e6 * min(times) / BATCH
    figure("C, one design after the other, 10^6", ours, "us")
    figure("C over scikit-learn, one design", single / ours, "times", at_least=500.0)
    figure("C over scikit-learn's bare network, one design", alone / ours, "times")
    figure("C over scikit-learn, batch", batch / ours, "times")


def _numpy(network, rows, index, figure) -> None:
    figure("NumPy, one design", best(lambda: predict_rows(network, rows[:1], index[:1]), 200), "us")
    pick = np.arange(BATCH // CALLS) % 200
    many, kinds = rows[pick], index[pick]
    time_ = best(lambda: predict_rows(network, many, kinds), CALLS, 1) / len(many)
    figure("NumPy, batch", time_, "us")


def _onnx(network, rows, index, figure) -> None:
    runtime = pytest.importorskip("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    model = TARGETS["onnx"].write(network)["model.onnx"]
    session = runtime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    one = {"numeric": rows[:1], "explosive": index[:1]}
    figure("ONNX, one design", best(lambda: session.run(None, one), 200), "us")
    pick = np.arange(BATCH // CALLS) % 200
    many = {"numeric": rows[pick], "explosive": index[pick]}
    figure("ONNX, batch", best(lambda: session.run(None, many), CALLS, 1) / len(pick), "us")


def _python(network, figure) -> None:
    """The standard-library file, in this interpreter."""
    names: dict = {"__name__": "model"}
    source = TARGETS["python"].write(network)["model.py"]
    exec(compile(source, "model.py", "exec"), names)
    row = list(network.golden.inputs[0])
    figure("Python file, one design", best(lambda: names["predict_row"](0, row), 200), "us")


def _node(network, figure) -> None:
    node = shutil.which("node")
    if node is None:
        return
    with written(TARGETS["js"].write(network)) as folder:
        (folder / "package.json").write_text('{"type": "module"}')
        command = [node, RUN_ROWS, folder / "model.js", str(BATCH)]
        seconds = float(run_program(command))
    figure("JavaScript, one design after the other, 10^6", 1e6 * seconds / BATCH, "us")
