"""Files of the cell that somebody has changed since the last night that was believed: what follows may come from there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..files.origin import FEW, changes
from ..files.readjson import parse_json
from ..texts import Said, joined, say
from .ports import Disk, Past

ORIGIN = "readings.origin.json"
LONG = 40  # characters of a value that a sentence shows


def edited(
    past: Past, disk: Disk, machine: str, stamp: str, terms: object = None, now: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """history, disk, machine, stamp of tonight, its terms, files of the cell (None: those beside its readings) → `edited`: since
    which night, `text`, and by file the keys with what they were and are; {} where nothing was changed, and where nobody can know.
    """
    if (known := past.latest_knowledge(machine)) is None:
        return {}
    last = known[0]  # what tonight is compared with: a night in doubt carried nothing on
    record = past.night(last.entry).record
    before = str((record.get("artefacts") or {}).get("folder") or "").rpartition("/")[2]
    found = changes(_cell(disk, before), _cell(disk, stamp) if now is None else now)
    if terms is not None and record.get("terms") not in (None, terms):
        found["tango.yaml"] = [("terms", record["terms"], terms)]
    if not found:
        return {}
    files = {file: [dict(zip(("key", "was", "now"), one, strict=True)) for one in keys] for file, keys in found.items()}
    text = say("night.edited.text", what=joined("; ", [changed_in(*one) for one in found.items()]), night=last.night)
    return {"edited": {"since": last.night, "files": files, "text": text}}


def asked(record: dict[str, Any]) -> dict[str, Any]:
    """record of a night → the same; where files of the cell were changed, its alarms and its doubts ask for that first."""
    if not (found := record.get("edited")):
        return record
    if record["verdict"] == "doubtful":
        doubt = record.get("plausible") or {}
        record = record | {"plausible": {**doubt, "reasons": [found["text"], *doubt.get("reasons", ())]}}
    return record | {"alarms": [{**a, "do": say("night.edited.do", do=a["do"])} for a in record["alarms"]]}


def _cell(disk: Disk, stamp: str) -> Mapping[str, str]:
    """disk, stamp of a night → texts of the files of its cell; {} where they are not kept."""
    try:
        text = disk.read(stamp, ORIGIN) if stamp else None
        kept = parse_json(text)["cell"] if text else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return {str(k): str(v) for k, v in kept.items()} if isinstance(kept, dict) else {}


def changed_in(file: str, keys: Sequence[tuple[str, Any, Any]]) -> Said:
    """file, its keys with what they were and are → artefact.yaml (scale_bar.length 200 → 200.03 and 2 more)."""
    named = ", ".join(f"{key} {_shown(was)} → {_shown(now)}" for key, was, now in keys[:FEW])
    more = say("night.edited.more", count=len(keys) - FEW) if len(keys) > FEW else ""
    return say("night.edited.file", file=file, keys=named, more=more)


def _shown(value: object) -> str:
    text = "–" if value is None else ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
    return text if len(text) <= LONG else f"{text[: LONG - 1]}…"
