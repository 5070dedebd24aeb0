"""Write a network for other tools and prove that each file gives the same numbers."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from castblast.errors import CheckError, SpecError, nearest_name
from castblast.export.json_file import read_network, to_json
from castblast.files import write_text, write_with
from castblast.network import Network


def _onnx(network: Network) -> bytes:
    from castblast.export.onnx_file import to_onnx

    return to_onnx(network)


#: Target to file name and writer.
_WRITERS: dict[str, tuple[str, Callable[[Network], bytes]]] = {
    "json": ("network.json", lambda network: to_json(network).encode()),
    "onnx": ("model.onnx", _onnx),
}


@dataclass(frozen=True)
class ExportOutcome:
    """What was written and how well it agrees: a document and lines for people."""

    document: dict[str, Any]
    lines: list[str]
    files: list[Path] = field(default_factory=list)


def export(
    fit: Path,
    out: Path | None = None,
    *,
    targets: Sequence[str] = ("json", "onnx"),
    verify: bool = True,
    parity: Path | None = None,
) -> ExportOutcome:
    """Write the network of a fit.

    Parameters
    ----------
    fit : path
        Folder of `castblast compare` (its chosen fit is taken), of one fit, or a network.json.
    out : path, optional
        Folder for the files; default ``export`` beside the fit.
    targets : sequence of str
        Any of ``json``, ``onnx``.
    verify : bool
        Run every file on the golden rows first; nothing is written if one disagrees.
    parity : path, optional
        Where to write the deviations found (JSON).

    Raises
    ------
    SpecError
        No usable network, an unknown target.
    CheckError
        A file that does not give the answers of the fitted estimator.
    """
    wanted = _targets(targets)
    source = find_network(fit)
    network = read_network(source)
    contents = {target: _WRITERS[target][1](network) for target in wanted}
    reports = _verify(network, contents) if verify else {}
    folder = source.parent / "export" if out is None else out
    files, lines = [], []
    for target, content in contents.items():
        path = folder / _WRITERS[target][0]
        files.append(write_with(path, partial(_write_bytes, content=content)))
        lines.append(f"wrote {path} ({len(content) / 1000:.1f} kB){_verdict(reports.get(target))}")
    if parity is not None:
        files.append(write_text(parity, json.dumps(reports, indent=2) + "\n"))
    document = {"network": str(source), "files": [str(path) for path in files], "parity": reports}
    return ExportOutcome(document, lines, files)


def _write_bytes(path: Path, content: bytes) -> None:
    path.write_bytes(content)


def find_network(fit: Path) -> Path:
    """Find the network.json meant by a file, the folder of a fit, or a folder of fits.

    Raises
    ------
    SpecError
        There is none.
    """
    if fit.is_file():
        return fit
    comparison = fit / "comparison.json"
    if comparison.is_file():
        try:
            chosen = json.loads(comparison.read_text(encoding="utf-8"))["chosen"]
        except (ValueError, KeyError, TypeError):
            message = f"{comparison}: does not name a chosen model; compare again"
            raise SpecError(message) from None
        if chosen is None:
            message = f"{comparison}: no model passed the physics gate, so none is chosen"
            raise SpecError(message)
    if (fit / "network.json").is_file():
        return fit / "network.json"
    what = "no such file or folder"
    if fit.is_dir():
        what = "holds no network.json; give a folder of castblast compare"
    message = f"{fit}: {what}"
    raise SpecError(message)


def _targets(targets: Sequence[str]) -> list[str]:
    wanted = list(dict.fromkeys(target.strip() for target in targets if target.strip()))
    for engine in ("lammps", "liggghts"):
        if {engine, f"{engine}-deck"} & set(wanted):
            raise SpecError(
                f"export target '{engine}': a bench is written for {engine.upper()} by "
                f"castblast muckpile BENCH --{engine} DIR; a network is exported to "
                f"{' or '.join(_WRITERS)}"
            )
    faults = [
        f"export target '{target}': not known{nearest_name(target, _WRITERS)} "
        f"(there are {', '.join(_WRITERS)})"
        for target in wanted
        if target not in _WRITERS
    ]
    if not wanted:
        faults.append(f"no export target given (there are {', '.join(_WRITERS)})")
    if faults:
        raise SpecError("\n".join(faults))
    return wanted


def _verify(network: Network, contents: dict[str, bytes]) -> dict[str, Any]:
    from castblast.export.parity import check_parity

    reports = {
        target: check_parity(network, target, content) for target, content in contents.items()
    }
    faults = [
        f"{target}: {line}"
        for target, report in reports.items()
        if report.verified
        for line in report.faults
    ]
    if faults:
        raise CheckError("\n".join(faults))
    return {target: report.to_document() for target, report in reports.items()}


def _verdict(report: dict[str, Any] | None) -> str:
    if report is None:
        return ""
    if not report["verified"]:
        return f"; {report['remark']}"
    worst = max(report["relative"].values())
    return f"; {report['golden_rows']} golden rows, largest relative deviation {worst:.1e}"
