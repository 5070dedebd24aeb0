"""C, Python and JavaScript files of the export, as their own programs see them."""

import ast
import json
import re
import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest

from castblast.errors import CheckError, SpecError
from castblast.export.parity import TOLERANCE
from castblast.export.source.answers import answers
from castblast.export.source.c import STRICT_FLAGS
from castblast.export.source.runners import oldest_python, run_program, written
from castblast.export.targets import TARGETS
from castblast.network import (
    GoldenRows,
    Network,
)


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
