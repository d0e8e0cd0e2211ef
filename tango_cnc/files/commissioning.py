"""`commissioning.yaml` of a cell: what has been proven of its control, by which program, and when. It only ever grows.

    format: tango-commissioning/1
    dialect: fanuc
    proofs:
      - {belief: alive, verdict: PASS, found: "…", value: null, unit: "", date: "2026-11-23T06:00:00Z",
         program: 0F3A…, control: "", profile: 8C01…}

The latest proof of a belief counts, and only while what it depends on is what it was then: `profile` is the key of that
(`commission/keys.py`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..records import InputError
from .checked import Node, Scalar, load, printable
from .write import dump, write_text

NAME = "commissioning.yaml"
FORMAT = "tango-commissioning/1"
VERDICTS = ("PASS", "FAIL", "OPEN")


@dataclass(frozen=True)
class Proof:
    """One belief about a control, tried on it: the verdict, what was found in words, and a number where there is one."""

    belief: str
    verdict: str  # PASS, FAIL or OPEN
    found: str
    value: float | None = None
    unit: str = ""
    date: str = ""  # UTC, ISO 8601
    program: str = ""  # hash of the program that tried it
    control: str = ""  # what the control calls itself, where it can be asked
    profile: str = ""  # key of what it depends on


def read_commissioning(folder: Path) -> tuple[Proof, ...]:
    """folder of a cell → its proofs, the oldest first; none where there is no file. Raises InputError for a malformed file."""
    file = folder / NAME
    if not file.is_file():
        return ()
    try:
        data = dict(load(file).items())
        if (stated := data["format"].plain()) != FORMAT:
            raise InputError(f"{file}: format: found {stated!r:.80}; allowed: {FORMAT}")
        proofs = tuple(_proof(item) for item in data["proofs"].list())
    except (KeyError, TypeError) as error:
        said = printable(str(error))
        raise InputError(f"{file}: is no {FORMAT} file: {said}; move it away and run 'tango commission' again") from None
    for proof in proofs:
        if proof.verdict not in VERDICTS:
            raise InputError(f"{file}: verdict of {proof.belief:.80}: found {proof.verdict!r:.80}; allowed: {', '.join(VERDICTS)}")
    return proofs


def _proof(item: Node) -> Proof:
    """one of the file → proof. Raises TypeError for members that no proof has."""
    stated: dict[str, Any] = {key: child.plain() if key == "value" else _words(child) for key, child in item.items()}
    proof = Proof(**stated)
    if not isinstance(proof.value, (float, int, type(None))) or isinstance(proof.value, bool):
        raise TypeError(f"value: found {proof.value!r}")
    return proof


def _words(value: Node) -> str:
    """scalar → its characters, also where they look like a number: older files have hashes such as 2E9312264611 without quotes."""
    if not isinstance(value.raw, Scalar) or value.raw.tag == "tag:yaml.org,2002:null":
        raise TypeError(f"{value.path}: found no text")
    return str(value.raw.value)


def latest(proofs: Iterable[Proof], keys: Mapping[str, str]) -> dict[str, Proof]:
    """proofs, {belief: key of what it depends on today} → {belief: its latest proof that still holds, PASS or FAIL}."""
    return {proof.belief: proof for proof in proofs if proof.profile == keys.get(proof.belief) and proof.verdict != "OPEN"}


def add_proofs(folder: Path, dialect: str, proofs: Iterable[Proof]) -> Path:
    """folder of a cell, its dialect, new proofs → the file, with these at its end. Raises InputError as the reader does."""
    every = [*read_commissioning(folder), *proofs]
    write_text(folder / NAME, dump({"format": FORMAT, "dialect": dialect, "proofs": [asdict(proof) for proof in every]}))
    return folder / NAME
