"""The web page: built from a network and its pressure histories, and found where it is shipped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.disk.files import write_bytes
from castblast.disk.reading import read_json
from castblast.disk.resources import resource
from castblast.errors import SpecError
from castblast.network import Network

if TYPE_CHECKING:
    from castblast.export.source.plain import Files

SHIPPED_PAGE = "models/chosen/index.html"
HISTORIES = "histories.json"


def shipped_page(out: str | Path | None = None) -> Path:
    """Give the path of the page that comes with castblast, or of a copy of it.

    Parameters
    ----------
    out : path, optional
        File or existing folder for a copy.

    Raises
    ------
    SpecError
        The page did not come with this installation.
    """
    out = None if out is None else Path(out)
    page = resource(SHIPPED_PAGE)
    if out is None:
        return page
    target = out / page.name if out.is_dir() else out
    return write_bytes(target, page.read_bytes())


def build_page(network: Network, source: Path, histories: Path | None = None) -> Files:
    """Files of the target `web`: the page, and the histories it shows as plain numbers.

    Parameters
    ----------
    network : Network
    source : path
        Where it was read from; a ``histories.json`` beside it is taken if none is given.
    histories : path, optional
        A dataset with histories, or a ``histories.json``.

    Raises
    ------
    SpecError, DatasetError
        Unusable histories.
    """
    from castblast.export.web import to_web

    beside = source.parent / HISTORIES
    given = histories if histories is not None or not beside.is_file() else beside
    if given is None:
        return to_web(network)
    record = read_histories(given)
    _require_fit(record, network, given)
    text = json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"
    return to_web(network, record) | {HISTORIES: text.encode()}


def read_histories(path: str | Path) -> Mapping[str, Any]:
    """Read a record of histories, or fit one to a dataset.

    Raises
    ------
    SpecError
        Missing file, or no such record.
    DatasetError
        A dataset without histories.
    """
    path = Path(path)
    from castblast.surrogate.history_modes import FORMAT, fit_history_modes

    if path.suffix != ".json":
        from castblast.dataset.file.store import open_dataset

        return fit_history_modes(open_dataset(path))
    record = read_json(path)
    if not (isinstance(record, dict) and record.get("format") == FORMAT and _is_whole(record)):
        message = f"{path}: no record of pressure histories"
        raise SpecError(message)
    return record


def _is_whole(record: Mapping[str, Any]) -> bool:
    """Whether a record has the parts that are looked at here; the page looks at the others."""
    dataset = record.get("dataset")
    names = ("name", "dataset_version", "content_sha256")
    return isinstance(dataset, Mapping) and all(isinstance(dataset.get(n), str) for n in names)


def _require_fit(record: Mapping[str, Any], network: Network, path: Path) -> None:
    """Histories must come from the data of the network, or their curve would be another rock's."""
    own = network.provenance.get("dataset", {}).get("content_sha256")
    other = record["dataset"]["content_sha256"]
    if own and other and own != other:
        message = (
            f"{path}: histories of dataset {record['dataset']['name']} "
            f"{record['dataset']['dataset_version']}, but the network was trained on other data"
        )
        raise SpecError(message)
