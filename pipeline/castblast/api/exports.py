"""A model as a file for another tool, run on its golden rows before it is written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from warnings import warn

from castblast.disk.files import write_bytes
from castblast.errors import CheckError, SpecError, nearest_name
from castblast.extras import require
from castblast.network import Network
from castblast.progress import ProgressCallback, silent

if TYPE_CHECKING:
    from castblast.export.parity import ParityReport
    from castblast.surrogate.fitting.training import Fit

#: Target of an export by the suffix of its file.
SUFFIXES = {
    ".json": "json",
    ".onnx": "onnx",
    ".c": "c",
    ".js": "js",
    ".py": "python",
    ".xlsx": "excel",
    ".html": "web",
}


def target_of(path: Path) -> str:
    """Target of a file by its suffix.

    Raises
    ------
    SpecError
        No target has this suffix.
    """
    target = SUFFIXES.get(path.suffix.lower())
    if target is None:
        hint = nearest_name(path.suffix, SUFFIXES)
        message = f"{path}: no export has the suffix '{path.suffix}'{hint}; {', '.join(SUFFIXES)}"
        raise SpecError(message, field="path", value=str(path), allowed=tuple(SUFFIXES))
    require("excel" if target == "excel" else "export", purpose=f"export target '{target}'")
    return target


def write_network(network: Network, path: Path, *, verify: bool) -> list[Path]:
    """Write a network by the suffix of `path`; files that belong to it go beside it.

    Raises
    ------
    SpecError
        No target has this suffix, or it cannot take the network.
    CheckError
        A file does not give the answers of the fitted estimator; nothing is written then.
    """
    target = target_of(path)
    from castblast.export.parity import verify as run
    from castblast.export.targets import TARGETS

    files = TARGETS[target].write(network)
    if verify:
        report = run(network, target, files)
        if not report.verified:
            warn(f"{path}: {report.remark}", stacklevel=3)
    return [
        write_bytes(path if Path(name).suffix == path.suffix else path.with_name(name), content)
        for name, content in files.items()
    ]


def write_module(fit: Fit, path: Path, *, verify: bool) -> list[Path]:
    """Write a fit that is no chain of dense layers: a torch module as ONNX.

    Raises
    ------
    SpecError
        No target can carry it.
    CheckError
        The file does not give the answers of the fitted estimator.
    """
    from castblast.surrogate.fitting.estimators import bare_model, is_torch_model

    target = target_of(path)
    if target != "onnx" or not is_torch_model(bare_model(fit.estimator)):
        message = (
            f"{fit.spec.name}: not a chain of dense layers; the target {target} cannot carry it"
        )
        raise SpecError(message, field="path", value=str(path), allowed=(".onnx",))
    return [write_bytes(path, module_onnx(fit, verify=verify)[0])]


def module_onnx(
    fit: Fit, *, verify: bool, progress: ProgressCallback = silent
) -> tuple[bytes, ParityReport | None]:
    """ONNX file of a torch module of any shape, and how well it agrees.

    Raises
    ------
    SpecError
        An operator that ONNX or this exporter does not have.
    CheckError
        The file does not give the answers of the fitted estimator.
    """
    from castblast.export.onnx.file import wrap_onnx
    from castblast.export.parity import check_wrapped_parity
    from castblast.surrogate.torch_onnx import torch_core

    name = fit.spec.name
    progress(0.0, f"tracing {name}")
    shell = fit.shell()
    try:
        content = wrap_onnx(shell, torch_core(fit))
    except SpecError as fault:
        lines = [line.removeprefix(f"{name}: ") for line in str(fault).splitlines()]
        raise SpecError("\n".join(f"{name}: {line}" for line in lines)) from fault
    if not verify:
        return content, None
    progress(0.5, "running onnx")
    try:
        report = check_wrapped_parity(shell, content)
    except CheckError as fault:
        message = f"onnx: {fault}"
        raise CheckError(message) from fault
    if report.faults:
        raise CheckError("\n".join(f"onnx: {line}" for line in report.faults))
    return content, report
