"""Tables of a dataset described for machines: a Croissant 1.0 record (MLCommons 2024), JSON-LD.

https://docs.mlcommons.org/croissant/docs/croissant-spec.html
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

CROISSANT = "croissant.json"
_CONFORMS_TO = "http://mlcommons.org/croissant/1.0"
_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
_ENCODINGS = {".csv": "text/csv", ".parquet": "application/x-parquet"}
_FLAGS = ("explosive", "split", "status")


class TableFile(NamedTuple):
    """A table that lies beside the record."""

    name: str
    size: int
    sha256: str

    @property
    def suffix(self) -> str:
        """``.csv`` or ``.parquet``."""
        return self.name[self.name.rindex(".") :]


def croissant_record(
    dataset: xr.Dataset, columns: Sequence[str], tables: Sequence[TableFile]
) -> dict[str, Any]:
    """Describe tables of a dataset; a function of the dataset alone, without the time.

    Parameters
    ----------
    dataset : Dataset
        With codes and flags, as in the file.
    columns : sequence of str
        Of every table, in order.
    tables : sequence of TableFile
    """
    attributes = dataset.attrs
    license_id = str(attributes.get("license", ""))
    creator = str(attributes.get("creator_name", "castblast"))
    identity = str(attributes.get("id", attributes.get("name", "dataset")))
    cite = f"{creator}: {attributes.get('title', identity)}, {identity}, content "
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": str(attributes.get("name", "dataset")),
        "description": str(attributes.get("summary", attributes.get("title", ""))),
        "conformsTo": _CONFORMS_TO,
        "license": f"https://spdx.org/licenses/{license_id}",
        "version": str(attributes.get("dataset_version", "0.0.0")),
        "creator": {"@type": "sc:Organization", "name": creator},
        "keywords": str(attributes.get("keywords", "")),
        "citeAs": cite + str(attributes.get("content_sha256", "unknown")),
        "isLiveDataset": False,
        "distribution": [_file(table) for table in tables],
        "recordSet": [_record_set(dataset, columns, table) for table in tables],
    }


def _file(table: TableFile) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": table.name,
        "name": table.name,
        "contentUrl": table.name,
        "contentSize": f"{table.size} B",
        "encodingFormat": _ENCODINGS[table.suffix],
        "sha256": table.sha256,
    }


def _record_set(dataset: xr.Dataset, columns: Sequence[str], table: TableFile) -> dict[str, Any]:
    name = table.name.replace(".", "_")
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": "One record for each simulated blast, in SI; failed runs have no outputs.",
        "key": {"@id": f"{name}/sample"},
        "field": [_field(dataset[column], column, name, table) for column in columns],
    }


def _field(variable: xr.DataArray, column: str, name: str, table: TableFile) -> dict[str, Any]:
    unit = str(variable.attrs.get("units", "1"))
    words = str(variable.attrs.get("long_name", column))
    return {
        "@type": "cr:Field",
        "@id": f"{name}/{column}",
        "name": column,
        "description": words if unit == "1" or column in _FLAGS else f"{words} [{unit}]",
        "dataType": _kind(variable, column),
        "source": {
            "fileObject": {"@id": table.name},
            "extract": {"column": column},
        },
    }


def _kind(variable: xr.DataArray, column: str) -> str:
    if column in _FLAGS or variable.dtype.kind in "OU":
        return "sc:Text"
    if variable.dtype.kind == "b":
        return "sc:Boolean"
    return "sc:Integer" if np.issubdtype(variable.dtype, np.integer) else "sc:Float"
