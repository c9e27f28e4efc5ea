"""croissant.json: description of the Parquet files for MLCommons' readers. Effects: reads the files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from pbrs_farm.views.packing.data_card import TITLE, RootFacts

# fmt: off
_CONTEXT: Final[dict[str, Any]] = {
    "@language": "en", "@vocab": "https://schema.org/", "citeAs": "cr:citeAs",
    "column": "cr:column", "conformsTo": "dct:conformsTo", "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"}, "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"}, "extract": "cr:extract",
    "field": "cr:field", "fileObject": "cr:fileObject", "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet", "format": "cr:format", "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath", "key": "cr:key",
    "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/", "recordSet": "cr:recordSet",
    "references": "cr:references", "regex": "cr:regex", "repeated": "cr:repeated",
    "replace": "cr:replace", "samplingRate": "cr:samplingRate", "sc": "https://schema.org/", "separator": "cr:separator",
    "source": "cr:source", "subField": "cr:subField", "transform": "cr:transform",
}
# fmt: on
_PARQUET: Final = "application/x-parquet"


def croissant_json(files: Sequence[Path], columns: Mapping[str, str], facts: RootFacts) -> bytes:
    """Croissant 1.0: the Parquet files with their digests, and a record set for each split.

    columns: name -> data type. Labels are nested lists of integers.
    """
    splits = dict.fromkeys(file.name.partition("-")[0] for file in files)
    licences = sorted({home.licence for home in facts.homes if home.licence})
    row = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": "rendered-rooms",
        "description": f"{TITLE}: {sum(h.n_views for h in facts.homes)} views of"
        f" {len(facts.homes)} homes, rendered by pbrs_farm. README.md describes it.",
        "version": "1.0.0",
        **({"license": licences} if licences else {}),
        **({"creditText": "\n".join(facts.credits)} if facts.credits else {}),
        "distribution": [*map(_file_object, files), *map(_file_set, splits)],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": split,
                "name": split,
                "field": [_field(split, name, kind) for name, kind in columns.items()],
            }
            for split in splits
        ],
    }
    return (json.dumps(row, indent=1, ensure_ascii=False) + "\n").encode()


def _file_object(file: Path) -> dict[str, Any]:
    with file.open("rb") as data:
        digest = hashlib.file_digest(data, "sha256").hexdigest()
    return {
        "@type": "cr:FileObject",
        "@id": file.name,
        "name": file.name,
        "contentUrl": f"data/{file.name}",
        "contentSize": f"{file.stat().st_size} B",
        "encodingFormat": _PARQUET,
        "sha256": digest,
    }


def _file_set(split: str) -> dict[str, Any]:
    name = f"{split}-files"
    return {
        "@type": "cr:FileSet",
        "@id": name,
        "name": name,
        "encodingFormat": _PARQUET,
        "includes": f"data/{split}-*.parquet",
    }


def _field(split: str, name: str, kind: str) -> dict[str, Any]:
    source: dict[str, Any] = {"fileSet": {"@id": f"{split}-files"}, "extract": {"column": name}}
    if kind == "sc:ImageObject":
        source["transform"] = {"jsonPath": "bytes"}
    return {
        "@type": "cr:Field",
        "@id": f"{split}/{name}",
        "name": name,
        "source": source,
        "dataType": kind,
        **({"repeated": True} if kind == "sc:Integer" else {}),
    }
