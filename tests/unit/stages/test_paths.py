"""Stages take a path as text as well as a `Path`, everywhere."""

import ast
from pathlib import Path

import castblast as cb
from castblast.stages.datasets.dataset import describe_dataset, reproduce_sample
from castblast.stages.datasets.diff import diff_datasets
from castblast.stages.datasets.generate import generate
from castblast.stages.examples import copy_examples
from castblast.stages.export import export
from castblast.stages.predict import predict_design
from castblast.stages.predict_table import predict_csv
from castblast.stages.training.train import train

#: Functions of one stage for another, which hand on what is a path already.
_INNER = {"outcome", "read_extras", "build_page", "compare_with_physics", "write_demo_report",
          "summarise", "read_runs"}  # fmt: skip


def test_no_verb_asks_for_a_path_object(repository: Path) -> None:
    wanting, seen = {}, 0
    for file in (repository / "pipeline/castblast/stages").rglob("*.py"):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
                continue
            for argument in (*node.args.args, *node.args.kwonlyargs):
                kind = "" if argument.annotation is None else ast.unparse(argument.annotation)
                seen += "Path" in kind
                if node.name not in _INNER and "Path" in kind and "str | Path" not in kind:
                    wanting[f"{file.name}: {node.name}"] = argument.arg
    assert seen > 40
    assert not wanting


def test_text_will_do(tmp_path: Path) -> None:
    data = str(tmp_path / "data.nc")
    generate("quickstart", data, size=900, workers=1)
    assert describe_dataset(data).document["size"] == 900
    assert reproduce_sample(data, 3).ok
    assert diff_datasets(data, data).ok
    train(data, [str(p) for p in [Path("ridge")]], str(tmp_path / "fits"))
    export(str(tmp_path / "fits/ridge"), str(tmp_path / "out"), targets=["json"])
    network = str(tmp_path / "out/network.json")
    answer = predict_design({"burden": "4 m"}, "anfo", network).document["burden_velocity"]
    assert answer == cb.load_model(network).predict({"burden": 4.0})["burden_velocity"].iloc[0]
    table = tmp_path / "designs.csv"
    table.write_text("burden [m]\n4\n", encoding="utf-8")
    assert len(predict_csv(str(table), network).rows) == 1
    assert copy_examples(str(tmp_path / "mine"))
