"""Every target of an export: who writes it and who runs it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from castblast.export.engines.bench_runners import run_lammps, run_pfc
from castblast.export.engines.bench_scripts import to_lammps, to_pfc
from castblast.export.onnx.file import to_onnx
from castblast.export.sheet.runner import run_excel
from castblast.export.sheet.workbook import to_excel
from castblast.export.source.c import to_c
from castblast.export.source.javascript import to_javascript
from castblast.export.source.plain import Files
from castblast.export.source.python import to_python
from castblast.export.source.runners import Runner, run_c, run_js, run_json, run_onnx, run_python
from castblast.export.web import run_web, to_web
from castblast.network import Network
from castblast.network.json_file import to_json


class Target(NamedTuple):
    """Writer and runner of one target."""

    write: Callable[[Network], Files]
    run: Runner


def _write_json(network: Network) -> Files:
    return {"network.json": to_json(network).encode()}


def _write_onnx(network: Network) -> Files:
    return {"model.onnx": to_onnx(network)}


TARGETS: dict[str, Target] = {
    "json": Target(_write_json, run_json),
    "onnx": Target(_write_onnx, run_onnx),
    "c": Target(to_c, run_c),
    "js": Target(to_javascript, run_js),
    "python": Target(to_python, run_python),
    "pfc": Target(to_pfc, run_pfc),
    "lammps": Target(to_lammps, run_lammps),
    "excel": Target(to_excel, run_excel),
    "web": Target(to_web, run_web),
}
