"""Every target of the export, run in its own language, gives the answers of the network.

The network is random and holds everything that a record can: SiLU, a derived length, codes that
are no one-hot, rules, a joint density. The truth is `castblast.network`; a target whose tool is
not installed is skipped with the reason that users are told.
"""

import ast
import csv
import errno
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from toy_network import toy_network

from castblast.bands import BASIS, PRIORS, Prior
from castblast.errors import CheckError, OutputError, SpecError
from castblast.export.parity import TOLERANCE, check_parity
from castblast.export.sheet.runner import recalculated
from castblast.export.sheet.workbook import TOP
from castblast.export.source.answers import NotVerifiedError, answers
from castblast.export.source.c import STRICT_FLAGS
from castblast.export.source.runners import oldest_python, run_program, written
from castblast.export.targets import TARGETS
from castblast.network import (
    GoldenRows,
    Network,
    domain_violations,
    evaluate_rows,
    explosive_index,
)
from castblast.network.json_file import from_json, to_json
from castblast.stages.export import TARGET_NAMES, export

pytest.importorskip("onnxruntime", reason="ONNX files are run with onnxruntime")
#: Targets that answer any rows, each in a language of its own.
LANGUAGES = ("json", "onnx", "c", "js", "python")


@pytest.fixture(scope="module")
def network() -> Network:
    return toy_network()


def run(target: str, network: Network, rows, index):
    try:
        return TARGETS[target].run(network, TARGETS[target].write(network), rows, index)[0]
    except NotVerifiedError as reason:
        pytest.skip(str(reason))


def parity(target: str, network: Network, files=None):
    report = check_parity(network, target, files or TARGETS[target].write(network))
    if not report.verified:
        pytest.skip(report.remark)
    return report


def test_the_stage_names_every_target() -> None:
    assert tuple(TARGETS) == TARGET_NAMES


@pytest.mark.parametrize("target", TARGET_NAMES)
def test_golden_rows_agree(network: Network, target: str) -> None:
    """Values, bands, score, flag and the names of the inputs at fault, 200 rows in and out."""
    inside = answers(network, network.golden.inputs, np.zeros(200, dtype=np.int64)).inside
    assert 20 < np.count_nonzero(inside) < 180
    report = parity(target, network)
    assert report.rows == 200
    assert report.passed, report.faults
    assert report.largest <= TOLERANCE
    assert report.tool


@pytest.mark.parametrize("target", ["c", "js", "python"])
def test_every_activation(target: str) -> None:
    """Hidden layers of tanh, ReLU, logistic and SiLU in one network."""
    assert parity(target, toy_network(("tanh", "relu", "logistic", "silu"))).passed


@pytest.mark.parametrize("target", ["c", "js", "python"])
def test_a_network_with_nothing_optional(network: Network, target: str) -> None:
    """No rules, no derived columns, no density: the score is NaN, the box alone decides."""
    first, golden = network.layers[0], network.golden
    weights = np.delete(first.weights, 3, axis=0)
    bare = replace(
        network, derived=(), constraints=(), density=None, members=(),
        layers=(replace(first, weights=weights), *network.layers[1:]),
    )  # fmt: skip
    index = np.array([explosive_index(bare, name) for name in golden.explosives])
    outputs = evaluate_rows(bare, golden.inputs, index)
    bare = replace(bare, golden=replace(golden, outputs=outputs))
    assert parity(target, bare).passed
    found = run(target, bare, golden.inputs, index)
    assert np.isnan(found.score).all()


def awkward_rows(network: Network) -> np.ndarray:
    """A design inside, then each input in turn NaN, infinite, nought, negative, out of range."""
    inside = answers(network, network.golden.inputs, np.zeros(200, dtype=np.int64)).inside
    row = network.golden.inputs[inside][0]
    rows = [row]
    for i, column in enumerate(network.inputs):
        far = (0.5 * column.lower, 2.0 * column.upper)
        for value in (np.nan, np.inf, -np.inf, 0.0, -1.0, *far, column.lower, column.upper):
            rows.append(row.copy())
            rows[-1][i] = value
    return np.array(rows)


@pytest.mark.parametrize("target", LANGUAGES)
def test_inputs_at_fault_are_the_same_in_every_language(network: Network, target: str) -> None:
    """NaN, infinities, zeros and values out of range: same flag, same names, no crash."""
    rows = np.concatenate([awkward_rows(network), network.golden.inputs])
    index = np.arange(len(rows)) % 2
    truth, found = answers(network, rows, index), run(target, network, rows, index)
    np.testing.assert_array_equal(found.inside, truth.inside)
    np.testing.assert_array_equal(found.offending, truth.offending)
    finite = np.isfinite(rows).all(axis=1) & (rows > 0.0).all(axis=1)
    finite &= rows[:, 0] > rows[:, 1]  # a stemming that has a logarithm
    np.testing.assert_allclose(found.values[finite], truth.values[finite], rtol=1e-11)
    assert not found.inside[np.isnan(rows).any(axis=1) | ~(rows[:, 0] > rows[:, 1])].any()
    kinds = {tuple(v.kind for v in domain_violations(network, dict(zip(network.input_names, row,
             strict=True)))) for row in rows[finite]}  # fmt: skip
    assert {(), ("box",), ("rule",), ("density",)} <= kinds


def test_names_at_fault_are_those_of_the_messages(network: Network) -> None:
    """The truth itself: the array of flags says what `domain_violations` says row by row."""
    rows = np.concatenate([awkward_rows(network), network.golden.inputs])
    flags = answers(network, rows, np.zeros(len(rows), dtype=np.int64)).offending
    for row, flag in zip(rows, flags, strict=True):
        with np.errstate(invalid="ignore"):
            faults = domain_violations(network, dict(zip(network.input_names, row, strict=True)))
        named = {name for fault in faults for name in fault.inputs}
        assert {n for n, f in zip(network.input_names, flag, strict=True) if f} == named


@pytest.mark.parametrize("target", TARGET_NAMES)
def test_equal_networks_give_equal_bytes(network: Network, target: str) -> None:
    again = from_json(to_json(network))
    assert TARGETS[target].write(network) == TARGETS[target].write(again)


def test_a_workbook_tells_no_time(network: Network) -> None:
    content = TARGETS["excel"].write(network)["model.xlsx"]
    with zipfile.ZipFile(BytesIO(content)) as book:
        assert {entry.date_time for entry in book.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        stamps = re.findall(rb"<dcterms:\w+[^>]*>([^<]*)", book.read("docProps/core.xml"))
    assert set(stamps) == {b"2020-01-01T00:00:00Z"}


@pytest.mark.parametrize("target", LANGUAGES)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda n: replace(n, density=replace(n.density, threshold=6.001)), "density score"),
        (lambda n: replace(n, density=None), "density score"),
        (lambda n: replace(n, constraints=()), "domain flag differs"),
        (lambda n: replace(n, outputs=(replace(n.outputs[0], relative_band=0.011), n.outputs[1])),
         "network band"),
    ],
    ids=["threshold", "no density", "no rule", "band"],
)  # fmt: skip
def test_a_copy_that_lost_something_is_seen(network: Network, target, change, message) -> None:
    report = parity(target, network, TARGETS[target].write(change(network)))
    assert message in "\n".join(report.faults)


@pytest.mark.parametrize("target", ["json", "onnx"])
def test_a_derived_column_scaled_otherwise_is_seen(network: Network, target: str) -> None:
    other = replace(network, derived=(replace(network.derived[0], mean=2.0 + 1e-8),))
    assert "deviates" in str(parity(target, network, TARGETS[target].write(other)).faults)


@pytest.mark.parametrize("target", ["onnx", "c", "js", "python", "excel", "web"])
def test_a_copy_with_another_prior_is_seen(network: Network, target: str, monkeypatch) -> None:
    """The file of another prior: its velocities carry another band, and nothing else differs."""
    with monkeypatch.context() as changed:
        changed.setitem(PRIORS, "burden_velocity", Prior(0.36, "another"))
        files = TARGETS[target].write(network)
    report = parity(target, network, files)
    assert [line.split(" deviates")[0] for line in report.faults] == ["prediction band"]


@pytest.mark.parametrize("target", TARGET_NAMES)
def test_a_quantity_without_a_prior_has_no_prediction_band(network: Network, target: str) -> None:
    """Work of the gas: value and network band in every language, ends of the other one unknown."""
    first, second = network.outputs
    other = replace(network, outputs=(first, replace(second, name="gas_work", unit="J m-1")))
    report = parity(target, other)
    assert report.passed, report.faults
    golden = other.golden
    index = np.array([explosive_index(other, name) for name in golden.explosives])
    found = run(target, other, golden.inputs, index)
    assert np.isnan(found.prediction.lower[:, 1]).all()
    assert np.isfinite(found.prediction.lower[:, 0]).all()
    assert np.isfinite(found.network.upper).all()


# C


@pytest.fixture(scope="module")
def compiler() -> str:
    found = shutil.which("gcc")
    if found is None:
        pytest.skip("gcc is not installed")
    return found


def test_c_has_no_state_and_allocates_nothing(network: Network, compiler: str) -> None:
    """The object file defines constants and code only, and calls mathematics and strcmp only."""
    with written(TARGETS["c"].write(network)) as folder:
        source = folder / "model.c"
        run_program([compiler, *STRICT_FLAGS, "-O2", "-c", source, "-o", folder / "model.o"])
        symbols = run_program(["nm", folder / "model.o"])
        header = folder / "model.h"
        run_program([compiler, *STRICT_FLAGS, "-fsyntax-only", "-x", "c", header])
    kinds = {line.split()[-2] for line in symbols.splitlines()}
    assert kinds <= {"T", "t", "R", "r", "U"} | {"D", "d"}
    changing = [line.split()[-1] for line in symbols.splitlines() if line.split()[-2] in "DdBb"]
    # Tables of pointers to names count as data that the loader fills in; they are `const`.
    assert all(name.endswith(("_names", "_units")) for name in changing)
    needed = {line.split()[-1] for line in symbols.splitlines() if line.split()[-2] == "U"}
    assert needed <= {"exp", "log", "tanh", "fabs", "strcmp", "_GLOBAL_OFFSET_TABLE_"}


def test_c_refuses_an_unknown_explosive(network: Network, compiler: str) -> None:
    program = """
        #include "model.h"
        #include <stdio.h>
        int main(void) {
          const double inputs[CASTBLAST_INPUTS] = {12.0, 6.0, 3.0};
          castblast_prediction answer;
          int bad = castblast_predict(castblast_explosive("anfoo"), inputs, &answer);
          printf("%d %d %d", bad, answer.value[0] != answer.value[0], answer.in_domain);
          printf(" %d", castblast_explosive("heavy_anfo") == CASTBLAST_EXPLOSIVE_HEAVY_ANFO);
          return 0;
        }
    """
    files = TARGETS["c"].write(network) | {"user.c": program.encode()}
    with written(files) as folder:
        sources = [folder / "user.c", folder / "model.c"]
        run_program([compiler, *STRICT_FLAGS, *sources, "-lm", "-o", folder / "user"])
        assert run_program([folder / "user"]) == "-1 1 0 1"


def test_names_that_clash_in_c_are_told(network: Network) -> None:
    clash = replace(network, explosives=("an-fo", "an_fo"), golden=GoldenRows(
        network.golden.inputs[:0], (), network.golden.outputs[:0]))  # fmt: skip
    with pytest.raises(SpecError, match="become the same name in C"):
        TARGETS["c"].write(clash)


def test_fast_mathematics_are_refused_at_compile_time(network: Network, compiler: str) -> None:
    """Without NaN there is no "outside the domain": the compiler says so, not a wrong answer."""
    with written(TARGETS["c"].write(network)) as folder:
        for flag in ("-ffast-math", "-Ofast", "-ffinite-math-only"):
            command = [compiler, "-std=c99", flag, "-c", folder / "model.c", "-o", folder / "m.o"]
            with pytest.raises(CheckError, match=r"-ffast-math .* is not allowed"):
                run_program(command)
        run_program([compiler, "-std=c99", "-O2", "-c", folder / "model.c", "-o", folder / "m.o"])


# Python and JavaScript


@pytest.fixture(scope="module")
def module(network: Network) -> dict:
    """Names of the Python file, run here."""
    names: dict = {"__name__": "model"}
    exec(compile(TARGETS["python"].write(network)["model.py"], "model.py", "exec"), names)
    return names


def test_python_is_3_6_and_the_standard_library(network: Network) -> None:
    text = TARGETS["python"].write(network)["model.py"].decode("ascii")
    tree = ast.parse(text, feature_version=(3, 6))
    top = {name.name for node in tree.body if isinstance(node, ast.Import) for name in node.names}
    assert top <= {"csv", "json", "math", "sys"}
    every = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    inside = [node for node in every if node not in tree.body]
    assert [name.name for node in inside for name in node.names] == ["itasca"]
    major, minor = map(int, oldest_python()[1].split("."))
    assert (3, 6) <= (major, minor) <= sys.version_info[:2]


def assert_bands(network: Network, answer: dict, truth, form: str) -> None:
    """Both bands of an answer by name, under keys such as `prediction_band`."""
    for kind in ("prediction", "network"):
        ends = getattr(truth, kind)
        for j, name in enumerate(network.output_names):
            found = answer[form.format(kind)][name]
            wanted = ends.lower[0, j], ends.upper[0, j]
            assert (found["lower"], found["upper"]) == pytest.approx(wanted, rel=1e-12)


def test_python_predicts_by_name(network: Network, module: dict) -> None:
    design = {"bench_height": 12.0, "charge_length": 5.0, "burden": 2.0}
    answer = module["predict"]("heavy_anfo", **design)
    row = np.array([[design[name] for name in network.input_names]])
    truth = answers(network, row, np.array([1]))
    np.testing.assert_allclose(list(answer["values"].values()), truth.values[0], rtol=1e-12)
    assert_bands(network, answer, truth, "{}_band")
    assert answer["in_domain"] == truth.inside[0]
    wide = module["predict"]("anfo", **(design | {"burden": 50.0}))
    assert wide["domain"] == "outside"
    assert wide["offending"] == ["bench_height", "burden"]


def test_python_tells_every_fault_at_once(module: dict) -> None:
    with pytest.raises(ValueError, match="known are anfo, heavy_anfo") as fault:
        module["predict"]("anfoo", bench_height="12", burdn=2.0)
    for words in ("bench_height: not a number", "burden: missing", "burdn: no input"):
        assert words in str(fault.value)


def test_javascript_predicts_by_name(network: Network) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    script = """
        import { predict, selfTest, inputs } from "./model.mjs";
        const wide = predict("anfo", {bench_height: 12, charge_length: 5, burden: 50});
        let told = "";
        try { predict("anfoo", {bench_height: "12", burdn: 2}); } catch (e) { told = e.message; }
        console.log(JSON.stringify([wide, selfTest(), inputs.map((c) => c.name), told]));
    """
    content = TARGETS["js"].write(network)["model.js"]
    assert not re.search(rb"\bimport\s*\(|^import |require\(|fetch\(", content, re.MULTILINE)
    with written({"model.mjs": content, "user.mjs": script.encode()}) as folder:
        wide, deviation, names, told = json.loads(run_program([node, folder / "user.mjs"]))
    assert (wide["inDomain"], wide["domain"]) == (False, "outside")
    assert wide["offending"] == ["bench_height", "burden"]
    truth = answers(network, np.array([[12.0, 5.0, 50.0]]), np.array([0]))
    np.testing.assert_allclose(list(wide["values"].values()), truth.values[0], rtol=1e-12)
    assert_bands(network, wide, truth, "{}Band")
    assert deviation <= TOLERANCE
    assert names == list(network.input_names)
    for words in ("known are anfo", "bench_height: not a number", "burden: missing", "burdn: no"):
        assert words in told


# benches


def test_a_bench_outside_the_domain_is_refused(module: dict) -> None:
    design = {
        "group": "left", "explosive": "anfo", "bench_height": 12.0, "charge_length": 5.0,
        "burden": 50.0, "direction_x": 0.0, "direction_y": 3.0, "direction_z": 4.0,
    }  # fmt: skip
    with pytest.raises(ValueError, match=r"left: outside \(bench_height, burden\)"):
        module["block_velocities"]([design])
    ((group, velocity),) = module["block_velocities"]([design], allow_outside=True)
    speed = module["predict"]("anfo", bench_height=12.0, charge_length=5.0, burden=50.0)
    speed = speed["values"]["burden_velocity"]
    assert group == "left"
    np.testing.assert_allclose(velocity, (0.0, 0.6 * speed, 0.8 * speed), rtol=1e-14)
    with pytest.raises(ValueError, match="left: a direction of no length"):
        module["block_velocities"]([design | {"direction_y": 0.0, "direction_z": 0.0}], True)


def predicted_speeds(network: Network, files) -> np.ndarray:
    """Velocities of the two blocks of the shipped table of a bench."""
    rows = list(csv.DictReader(files["bench.csv"].decode().splitlines()))
    numeric = np.array([[float(row[name]) for name in network.input_names] for row in rows])
    return answers(network, numeric, np.zeros(2, dtype=np.int64)).values[:, 0]


def test_pfc_example_throws_the_balls_of_its_groups(network: Network) -> None:
    """The shipped script with a stand-in of `itasca`; a group without balls is told."""
    stand_in = """
class Ball:
    def __init__(self, group):
        self.group, self.velocity = group, (0.0, 0.0, 0.0)
    def in_group(self, name, slot):
        return (name, slot) == (self.group, "block")
    def set_vel(self, velocity):
        self.velocity = velocity
        print(self.group, *map(repr, velocity))
class ball:
    kept = [Ball(g) for g in open("groups.txt").read().split()]
    @classmethod
    def list(cls):
        return iter(cls.kept)
"""
    files = TARGETS["pfc"].write(network)
    files |= {"itasca.py": stand_in.encode(), "groups.txt": b"block_1 floor block_2 block_2"}
    python = oldest_python()[0]
    with written(files) as folder:
        lines = run_program([python, "pfc_bench.py"], folder=folder).splitlines()
        (folder / "groups.txt").write_text("block_1 floor")
        with pytest.raises(CheckError, match="no ball is in group block_2 of slot block"):
            run_program([python, "pfc_bench.py"], folder=folder)
    assert lines[-2:] == ["block_1: 1 balls", "block_2: 2 balls"]
    truth = predicted_speeds(network, files)
    assert BASIS in lines[0]
    speeds = [float(line.split()[1]) for line in lines[1:-2]]
    np.testing.assert_allclose(speeds, truth[[0, 1, 1]], rtol=1e-12)
    written_in = re.findall(rb"velocity-x (\S+)", files["pfc_bench.dat"])
    np.testing.assert_allclose([float(speed) for speed in written_in], truth, rtol=1e-12)


def test_lammps_example_runs(network: Network) -> None:
    """LAMMPS itself: the two blocks start with the predicted velocities."""
    lammps = shutil.which("lmp")
    if lammps is None:
        pytest.skip("LAMMPS (lmp) is not installed")
    files = TARGETS["lammps"].write(network)
    with written(files) as folder:
        script = ["lammps_bench.py", "bench.csv", "velocities.in"]
        run_program([oldest_python()[0], *script], folder=folder)
        said = run_program([lammps, "-in", "lammps_bench.in", "-log", "none"], folder=folder)
    left, right = re.search(r"^block_1 (\S+) block_2 (\S+)", said, re.MULTILINE).groups()
    truth = predicted_speeds(network, files)
    np.testing.assert_allclose([float(left), float(right)], truth, rtol=1e-12)


@pytest.mark.parametrize("target", ["pfc", "lammps"])
def test_a_network_without_velocity_throws_nothing(network: Network, target: str) -> None:
    still = replace(network, outputs=(replace(network.outputs[0], name="swell"),
                                      network.outputs[1]))  # fmt: skip
    with pytest.raises(SpecError, match="gives no burden_velocity"):
        TARGETS[target].write(still)


# Excel


def typed(network: Network, explosive: str, *design: float) -> dict[str, tuple]:
    """Lines of the sheet Predict for a design that is typed in, calculated by LibreOffice."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(BytesIO(TARGETS["excel"].write(network)["model.xlsx"]))
    book["Predict"]["B4"] = explosive
    for row, value in zip((6, 7, 8), design, strict=True):
        book["Predict"].cell(row, 2, value)
    changed = BytesIO()
    book.save(changed)
    try:
        found = recalculated(changed.getvalue())["Predict"]
    except NotVerifiedError as reason:
        pytest.skip(str(reason))
    return {row[0]: row[1:] for row in found.iter_rows(values_only=True) if row[0]}


def test_workbook_answers_what_is_typed(network: Network) -> None:
    """A design out of range and a cell that holds a text."""
    cells = typed(network, "heavy_anfo", 12.0, 5.0, 20.0)
    truth = answers(network, np.array([[12.0, 5.0, 20.0]]), np.array([1]))
    assert cells["Domain"][0] == "outside"
    assert cells["Inputs at fault"][0] == "bench_height burden"
    assert cells["burden at the crest"][4] == "at fault"
    assert cells["charge length"][4] == "ok"
    value, lower, upper, unit = cells["final velocity of the burden"][:4]
    assert value == pytest.approx(truth.values[0, 0], rel=1e-13)
    assert (lower, upper, unit) == ("unknown", "unknown", "m s-1")


def test_a_workbook_refuses_what_no_bench_can_hold(network: Network) -> None:
    """14 m of charge in 12 m of bench: the reason, and no value."""
    cells = typed(network, "anfo", 12.0, 14.0, 3.0)
    assert cells["Domain"][0] == "impossible"
    assert cells["Design"][0] == (
        "charge length 14 m leaves no room for stemming: at most the bench height of 12 m."
    )
    assert cells["final velocity of the burden"][0] == "no value"


def test_a_workbook_says_which_band_is_which(network: Network) -> None:
    """Both bands stand on Predict, each under its name, and point at the columns of that name."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(BytesIO(TARGETS["excel"].write(network)["model.xlsx"]))
    lines = {row[0].value: row for row in book["Predict"].iter_rows() if row[0].value}
    assert any(BASIS in str(text) for text in lines)
    heads = {cell.value: cell.column_letter for cell in book["Working"][TOP - 1]}
    row = lines["final velocity of the burden"]
    titles = ("value", "prediction lower", "prediction upper", None, "network lower",
              "network upper")  # fmt: skip
    for cell, title in zip(row[1:], titles, strict=True):
        if title is not None:
            assert f"Working!${heads[title]}${TOP}*" in cell.value


def test_lookup_table_holds_answers_of_the_network(network: Network) -> None:
    lines = list(
        csv.DictReader(TARGETS["excel"].write(network)["lookup.csv"].decode().splitlines())
    )
    assert {line["domain"] for line in lines} <= {"inside", "unusual"}
    assert {line["explosive"] for line in lines} == set(network.explosives)
    for line in lines[::7]:
        row = np.array([[float(line[f"{name} [m]"]) for name in network.input_names]])
        index = np.array([network.explosives.index(line["explosive"])])
        truth = answers(network, row, index)
        found = float(line["burden_velocity [m s-1]"])
        assert found == pytest.approx(truth.values[0, 0], rel=1e-3)  # six figures in the table
        upper = float(line["burden_velocity_prediction_upper [m s-1]"])
        assert upper == pytest.approx(truth.prediction.upper[0, 0], rel=1e-3)


# the verb


@pytest.fixture
def source(network: Network, tmp_path):
    path = tmp_path / "network.json"
    path.write_text(to_json(network))
    return path


@pytest.mark.parametrize(
    ("to", "words"),
    [
        ("pyton", "'pyton': not known, did you mean 'python'?"),
        ("json,exel", "did you mean 'excel'?"),
        (",", "no export target given"),
        ("all,json", "'all': stands alone"),
        ("lammps-deck", "castblast muckpile BENCH --lammps DIR"),
    ],
)
def test_unknown_targets(source, to: str, words: str) -> None:
    with pytest.raises(SpecError) as fault:
        export(source, targets=to.split(","))
    assert words in str(fault.value)
    assert fault.value.exit_code == 2


def test_places_without_a_network(tmp_path) -> None:
    with pytest.raises(SpecError, match="no such file or folder"):
        export(tmp_path / "none")
    with pytest.raises(SpecError, match="holds no network"):
        export(tmp_path)


def test_a_folder_that_cannot_be_written(source, tmp_path, monkeypatch) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot be written to: "):
        export(source, tmp_path / "file" / "out")
    monkeypatch.setattr("pathlib.Path.write_bytes", _refused)
    with pytest.raises(OutputError, match="cannot be written to: Permission denied"):
        export(source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def _refused(path: Path, content: bytes) -> int:
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def test_a_missing_tool_is_said(source, tmp_path, monkeypatch) -> None:
    """The file is written, the line and the document say that nobody ran it."""
    monkeypatch.setattr(shutil, "which", lambda *_, **__: None)
    outcome = export(source, tmp_path / "out", targets=["json", "c", "js", "lammps", "excel"])
    states = {name: entry["status"] for name, entry in outcome.document["parity"].items()}
    assert states == {
        "json": "passed",
        "c": "not verified: no C compiler (gcc) is installed",
        "js": "not verified: node is not installed",
        "lammps": "not verified: LAMMPS (lmp) is not installed",
        "excel": "not verified: LibreOffice (soffice) is not installed",
    }
    assert sum("not verified" in line for line in outcome.lines) == 4
    assert (tmp_path / "out" / "model.c").is_file()


def test_a_file_that_does_not_compile_is_not_written(source, tmp_path, monkeypatch) -> None:
    broken = tmp_path / "gcc"
    broken.write_text("#!/bin/sh\necho no such instruction >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(shutil, "which", lambda *_, **__: str(broken))
    with pytest.raises(CheckError, match="c: gcc failed with exit code 1") as fault:
        export(source, tmp_path / "out", targets=["c"])
    assert "no such instruction" in str(fault.value)
    assert fault.value.exit_code == 4
    assert not (tmp_path / "out").exists()


def test_the_verb_prints_the_deviation(castblast, source, tmp_path) -> None:
    done: subprocess.CompletedProcess[str] = castblast(
        "export", source, "--to", "json,python", "--out", tmp_path / "out", "--json"
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["parity"]["python"]
    assert found["status"] == "passed"
    assert found["golden_rows"] == 200
    assert max(found["relative"].values()) <= TOLERANCE
    assert "CPython 3." in found["tool"]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["model.py", "network.json"]
