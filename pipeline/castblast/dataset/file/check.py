"""Departures of a dataset from its format, all of them at once.

A checker that stops at the first fault makes people run it many times; this one returns a list. It
looks at one block of rows at a time, so the length of the dataset does not matter.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from castblast.dataset.file.check_rows import RowCheck
from castblast.dataset.file.content import ContentHash
from castblast.dataset.file.form import Fault, form_faults
from castblast.dataset.file.store import row_blocks
from castblast.names import shortened
from castblast.progress import ProgressCallback, silent


def check(dataset: xr.Dataset, progress: ProgressCallback = silent) -> list[Fault]:
    """Compare a dataset with the format and report every fault, not the first only.

    Parameters
    ----------
    dataset : xr.Dataset
        In memory, or open and not read yet (`store.reading`).
    """
    rows, content = RowCheck(), ContentHash()
    size, done = dataset.sizes.get("sample", 0), 0
    for block in row_blocks(dataset):
        rows.add(block)
        content.add(block)
        done += block.sizes.get("sample", 0)
        progress(done / max(size, 1), f"checked {done} of {size} samples")
    faults = form_faults(dataset)
    faults += _count_faults(dataset, rows.failed)
    faults += _code_faults(dataset, rows)
    faults += [Fault(*fault) for fault in rows.faults()]
    stored = dataset.attrs.get("content_sha256")
    if stored is not None and stored != content.hexdigest():
        faults.append(
            Fault("content_sha256", "the values are not those that were written (hash differs)")
        )
    return faults


def _count_faults(dataset: xr.Dataset, failed: int) -> list[Fault]:
    if "status" not in dataset.variables:
        return []
    counts = (("n_ok", dataset["status"].size - failed), ("n_failed", failed))
    return [
        Fault(f"attribute {name}", f"is {shortened(dataset.attrs[name])}, not {count}")
        for name, count in counts
        if name in dataset.attrs and not np.array_equal(dataset.attrs[name], count)
    ]


def _code_faults(dataset: xr.Dataset, rows: RowCheck) -> list[Fault]:
    """Codes that no flag stands for."""
    faults = []
    for name, codes in rows.codes.items():
        meanings = str(dataset[name].attrs.get("flag_meanings", "")).split()
        strange = sorted(codes - set(range(len(meanings))))
        if strange:
            allowed = ", ".join(f"{flag} {meaning}" for flag, meaning in enumerate(meanings))
            faults.append(Fault(name, f"unknown codes {strange[:5]}; allowed: {allowed}"))
    return faults
