"""`learned/<name>.yaml` of a cell: shapes that a diagnosis learned, as plain numbers, with a sentence that a person may add."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..records import InputError, TermItem
from .checked import load, suggestion, there
from .write import dump

FOLDER = "learned"
FORMAT = "tango-learned/1"
FACTOR = ("covariate", "kind", "low", "high", "count", "cycles")
FIELDS = ("factors", "weight", "values")
OTHER = ("text", "learned", "amplitude_um", "like")


def learned(folder: Path) -> list[dict[str, Any]]:
    """folder of a cell → its learned shapes, by name. Raises InputError for whatever is wrong in one of the files."""
    return [read_learned(file) for file in sorted((folder / FOLDER).glob("*.yaml"))]


def read_learned(file: Path) -> dict[str, Any]:
    """file → name, factors, weight, values, and text and date (`learned`) where they are given."""
    root = load(file)
    fields = root.fields(["format", *FIELDS], [*OTHER])
    if fields["format"].text() != FORMAT:
        raise fields["format"].wrong(FORMAT)
    factors = []
    for node in fields["factors"].list():
        part = node.fields(list(FACTOR[:5]), list(FACTOR[5:]))
        factor: dict[str, Any] = {key: part[key].text() for key in FACTOR[:2]}
        factor |= {key: part[key].number() for key in ("low", "high", "cycles") if key in part}
        factors.append(factor | {"count": part["count"].integer(1)})
    values = [node.number() for node in fields["values"].list()]
    found: dict[str, Any] = {"name": file.stem, "factors": factors, "weight": fields["weight"].text(), "values": values}
    return found | {key: str(fields[key].plain()) for key in ("text", "learned") if key in fields}


def learned_text(shape: Mapping[str, Any]) -> str:
    """what `read_learned` gives, without the name → text of the file."""
    return dump({"format": FORMAT, **{key: shape[key] for key in (*OTHER, *FIELDS) if key in shape}})


def resolved(item: TermItem, folder: Path | None) -> TermItem:
    """term, folder of its cell → the same; a learned shape gets its numbers from its file. Raises InputError without one."""
    if isinstance(item, str) or item["cause"] != "learned" or "values" in item or folder is None:
        return item
    name = str(item.get("name", ""))
    file = folder / FOLDER / f"{name}.yaml"
    if not name or not there(file):
        known = [f.stem for f in sorted((folder / FOLDER).glob("*.yaml"))]
        raise InputError(
            f"{folder}: found the learned shape {name[:80]!r}, which has no file in {folder / FOLDER}; allowed: "
            f"{', '.join(known) or 'none yet: tango diagnose --learn NAME writes one'}.{suggestion(name, known)}"
        )
    found = read_learned(file)
    return {**item, **{key: found[key] for key in FIELDS}}
