"""Write a network for other tools and prove that each file gives the same numbers.

A torch module that is no chain of dense layers has no network.json; it goes to ONNX only, from the
fit that is kept beside where that would be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castblast.api.training.fits import FIT_FILE
from castblast.disk.files import tried, write_bytes, write_json
from castblast.disk.reading import read_json
from castblast.disk.resources import SHIPPED_NETWORKS, is_bare_name, resource
from castblast.errors import CheckError, SpecError, nearest_name
from castblast.export.parity import verify
from castblast.export.targets import TARGETS
from castblast.extras import require
from castblast.network import Network
from castblast.network.json_file import read_network
from castblast.progress import ProgressCallback, silent
from castblast.stages.outcome import Outcome
from castblast.stages.web import build_page

if TYPE_CHECKING:
    from castblast.export.parity import ParityReport


#: Every target; `all` stands for them together.
TARGET_NAMES = ("json", "onnx", "c", "js", "python", "pfc", "lammps", "excel", "web")
#: Extras that some of them need.
_EXTRAS = {"excel": ("excel",)} | dict.fromkeys(
    ("onnx", "c", "js", "python", "pfc", "lammps", "web"), ("export",)
)


def export(
    fit: str | Path,
    out: str | Path | None = None,
    *,
    targets: Sequence[str] = ("json", "onnx"),
    verify: bool = True,
    parity: str | Path | None = None,
    histories: str | Path | None = None,
    progress: ProgressCallback = silent,
) -> Outcome:
    """Write the network of a fit.

    Parameters
    ----------
    fit : path
        Folder of `castblast compare` (its chosen fit is taken), of one fit, or a network.json.
        A fit without a network.json is taken from the cache of this user on this machine.
    out : path, optional
        Folder for the files; default ``export`` beside the fit.
    targets : sequence of str
        Any of `TARGET_NAMES`, or ``all``.
    verify : bool
        Run every file on the golden rows first; nothing is written if one disagrees. What cannot
        be run here, for want of a compiler say, is written and said to be not verified.
    parity : path, optional
        Where to write the deviations found (JSON).
    histories : path, optional
        For the web page, see `castblast.stages.web.read_histories`.

    Raises
    ------
    MissingLibraryError
        A target needs a library that is not installed.
    SpecError
        No usable network, an unknown target.
    OutputError
        The folder cannot be written to.
    CheckError
        A file that does not give the answers of the fitted estimator.
    """
    fit = Path(fit)
    out = None if out is None else Path(out)
    parity = None if parity is None else Path(parity)
    histories = None if histories is None else Path(histories)
    wanted = _targets(targets)
    if histories is not None and "web" not in wanted:
        message = f"histories: {histories} is for the target web, not for {', '.join(wanted)}"
        raise SpecError(message)
    for target in wanted:
        require(*_EXTRAS.get(target, ()), purpose=f"export target '{target}'")
    source = _find_source(fit)
    folder = source.parent / "export" if out is None else out
    lines = []
    with tried(folder):
        if source.name == FIT_FILE:
            contents, reports = _export_module(source, wanted, verify, progress)
        else:
            network = read_network(source)
            contents = _write(network, wanted, source, histories)
            reports = _verify(network, contents, progress) if verify else {}
        named = {name: content for part in contents.values() for name, content in part.items()}
        files = [write_bytes(folder / name, content) for name, content in named.items()]
    for target, part in contents.items():
        size = sum(map(len, part.values())) / 1000
        line = f"{target}: {', '.join(part)} ({size:.1f} kB){_verdict(reports.get(target))}"
        lines.append(line)
    lines.append(f"wrote {len(files)} files to {folder}")
    documents = {target: report.to_document() for target, report in reports.items()}
    if parity is not None:
        files.append(write_json(parity, documents))
    document = {"network": str(source), "files": [str(path) for path in files], "parity": documents}
    return Outcome(document=document, lines=lines)


def _write(
    network: Network, wanted: Sequence[str], source: Path, histories: Path | None
) -> dict[str, dict[str, bytes]]:
    """Files of every target, all faults at once."""
    contents, faults = {}, []
    for target in wanted:
        try:
            contents[target] = (
                build_page(network, source, histories)
                if target == "web"
                else TARGETS[target].write(network)
            )
        except SpecError as fault:
            faults.append(str(fault))
    if faults:
        raise SpecError("\n".join(faults))
    return contents


def find_network(fit: str | Path) -> Path:
    """Find the network.json meant by a file, the folder of a fit or of fits, or a shipped name.

    Raises
    ------
    SpecError
        There is none.
    """
    fit = Path(fit)
    if fit.is_file():
        return fit
    if is_bare_name(fit) and not fit.is_dir() and str(fit) in SHIPPED_NETWORKS:
        return resource(SHIPPED_NETWORKS[str(fit)])
    comparison = fit / "comparison.json"
    if comparison.is_file():
        found = read_json(comparison)
        if not isinstance(found, dict) or "chosen" not in found:
            message = f"{comparison}: does not name a chosen model; compare again"
            raise SpecError(message)
        if found["chosen"] is None:
            message = f"{comparison}: no model passed the physics gate, so none is chosen"
            raise SpecError(message)
    if (fit / "network.json").is_file():
        return fit / "network.json"
    what = "no such file or folder"
    if fit.is_dir():
        what = "holds no network.json; give a folder of castblast compare"
    message = f"{fit}: {what}"
    raise SpecError(message)


def _find_source(fit: Path) -> Path:
    """As `find_network`; the scores of a fit that has no network."""
    alone = fit / FIT_FILE
    has_network = any((fit / name).is_file() for name in ("comparison.json", "network.json"))
    return alone if alone.is_file() and not has_network else find_network(fit)


def _export_module(
    source: Path, wanted: Sequence[str], verify: bool, progress: ProgressCallback
) -> tuple[dict[str, dict[str, bytes]], dict[str, ParityReport]]:
    """Files and reports of a fit that is no chain of dense layers."""
    from castblast.api.exports import module_onnx
    from castblast.surrogate.fitting.estimators import bare_model, is_torch_model
    from castblast.surrogate.fitting.fit_store import open_fit

    fit = open_fit(source.parent)
    name, model = fit.spec.name, bare_model(fit.estimator)
    if fit.network is not None:
        message = f"{source.parent}: its network.json is gone; run castblast train again"
        raise SpecError(message)
    if not is_torch_model(model):
        message = (
            f"{name} ({type(model).__name__}): neither a chain of dense layers nor a torch module, "
            "no target can represent it"
        )
        raise SpecError(message)
    others = [target for target in wanted if target != "onnx"]
    if others:
        message = (
            f"{name}: this torch module is not a chain of dense layers, only onnx can carry it, "
            f"not {', '.join(others)} (--to onnx)"
        )
        raise SpecError(message)
    content, report = module_onnx(fit, verify=verify, progress=progress)
    return {"onnx": {"model.onnx": content}}, {} if report is None else {"onnx": report}


def _targets(targets: Sequence[str]) -> list[str]:
    wanted = list(dict.fromkeys(target.strip() for target in targets if target.strip()))
    if wanted == ["all"]:
        return list(TARGET_NAMES)
    known = (*TARGET_NAMES, "all")
    faults = [_unknown(target) for target in wanted if target not in TARGET_NAMES]
    if not wanted:
        faults.append(f"no export target given (there are {', '.join(known)})")
    if faults:
        raise SpecError("\n".join(faults))
    return wanted


def _unknown(target: str) -> str:
    if target == "all":
        return "export target 'all': stands alone"
    engine = target.removesuffix("-deck")
    if engine in ("lammps", "liggghts"):
        return (
            f"export target '{target}': a bench is written for {engine.upper()} by castblast "
            f"muckpile BENCH --{engine} DIR; a network is exported to {', '.join(TARGET_NAMES)}"
        )
    known = (*TARGET_NAMES, "all")
    hint = nearest_name(target, known)
    return f"export target '{target}': not known{hint} (there are {', '.join(known)})"


def _verify(
    network: Network, contents: Mapping[str, dict[str, bytes]], progress: ProgressCallback
) -> dict[str, ParityReport]:
    """Run every target on the golden rows; all disagreements at once."""
    reports, faults = {}, []
    for number, (target, files) in enumerate(contents.items()):
        progress(number / len(contents), f"running {target}")
        try:
            reports[target] = verify(network, target, files)
        except CheckError as fault:
            faults.append(str(fault))
    if faults:
        raise CheckError("\n".join(faults))
    return reports


def _verdict(report: ParityReport | None) -> str:
    if report is None:
        return ""
    if not report.verified:
        return f"; {report.remark}"
    return (
        f"; {report.rows} golden rows in {report.tool}, largest relative deviation "
        f"{report.largest:.1e}"
    )
