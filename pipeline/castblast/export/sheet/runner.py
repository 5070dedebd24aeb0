"""Recalculate a workbook with LibreOffice and read what its golden rows give."""

from __future__ import annotations

import io
import shutil
from typing import Any

import numpy as np

from castblast.errors import CheckError
from castblast.export.sheet.workbook import TOP
from castblast.export.source.answers import Answers, NotVerifiedError, answers
from castblast.export.source.plain import Files
from castblast.export.source.runners import run_program, written
from castblast.network import Bounds, Network
from castblast.types import FloatArray, IntArray


def run_excel(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Answers of sheet Check, whose rows must be the ones asked for; Predict must agree too."""
    book = recalculated(files["model.xlsx"])
    k, m = len(network.inputs), len(network.outputs)
    check, start = _table(book["Check"], len(numeric)), _starts(book["Check"])
    kinds = check[:, 0] - 1.0
    # LibreOffice writes 15 digits.
    same = np.allclose(check[:, 1 : k + 1], numeric, rtol=1e-13, atol=0.0)
    if not (same and np.array_equal(kinds, index)):
        message = "a workbook answers its own golden rows only"
        raise NotVerifiedError(message)
    found = _read(check, start, k, m)
    working, start = _table(book["Working"], 1), _starts(book["Working"])
    design = working[:, 1 : k + 1]
    truth = answers(network, design, (working[:, 0] - 1.0).astype(np.int64))
    shown = _read(working, start, k, m)
    if not np.allclose(shown.values, truth.values, rtol=1e-12, atol=0.0):
        message = "sheet Predict does not give the answer of the network for its design"
        raise CheckError(message)
    return found, "LibreOffice"


def recalculated(content: bytes) -> Any:
    """Open a workbook with all its values as LibreOffice computes them."""
    office = shutil.which("soffice") or shutil.which("libreoffice")
    if office is None:
        message = "LibreOffice (soffice) is not installed"
        raise NotVerifiedError(message)
    import openpyxl

    with written({"model.xlsx": content}) as folder:
        run_program(
            [office, f"-env:UserInstallation=file://{folder}/profile", "--headless",
             "--convert-to", "xlsx", "--outdir", folder / "out", folder / "model.xlsx"]
        )  # fmt: skip
        result = folder / "out" / "model.xlsx"
        if not result.is_file():
            message = "LibreOffice did not open the workbook"
            raise CheckError(message)
        return openpyxl.load_workbook(io.BytesIO(result.read_bytes()), data_only=True)


def _table(sheet: Any, rows: int) -> FloatArray:
    """Numbers of the rows of designs; errors and empty cells are NaN."""
    lines = sheet.iter_rows(min_row=TOP, max_row=TOP + rows - 1, values_only=True)
    return np.array(
        [[value if isinstance(value, int | float) else np.nan for value in line] for line in lines],
        dtype=np.float64,
    )


def _starts(sheet: Any) -> dict[str, int]:
    """First column of every titled part, from 0."""
    (heads,) = sheet.iter_rows(min_row=TOP - 1, max_row=TOP - 1, values_only=True)
    return {str(head): i for i, head in enumerate(heads) if head is not None}


def _read(table: FloatArray, start: dict[str, int], k: int, m: int) -> Answers:
    ends = [f"{kind} {end}" for kind in ("prediction", "network") for end in Bounds._fields]
    values, *parts = (table[:, start[title] : start[title] + m] for title in ("value", *ends))
    bands = Bounds(*parts[:2]), Bounds(*parts[2:])
    offending = table[:, start["offending"] : start["offending"] + k]
    inside = table[:, start["domain"]] == 0.0
    return Answers(values, *bands, table[:, start["score"]], inside, offending != 0.0)
