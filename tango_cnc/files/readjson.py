"""JSON files as they may come back from a disk or a stranger: read whole, with finite numbers and printable texts, or refused."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, NoReturn

from .checked import complaint, read_text

HALF = re.compile(r"\\u[dD][89a-fA-F]")  # half of a character, as JSON can write it; no text file can hold one alone


def _none(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number")


def _finite(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise ValueError(f"{text[:40]} is too large for a number")
    return value


def parse_json(text: str, *, finite: bool = True) -> Any:
    """text → plain values, numbers finite unless somebody else looks at them. Raises ValueError: what is wrong with it."""
    try:
        found = json.loads(text, parse_constant=_none, parse_float=_finite) if finite else json.loads(text)
        if HALF.search(text):
            json.dumps(found, ensure_ascii=False).encode()
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except UnicodeEncodeError:
        raise ValueError("it has half a character in a text") from None
    return found


def read_json(file: Path, allowed: str) -> dict[str, Any]:
    """file, what would be right → its object. Raises InputError when it cannot be read or is no JSON object."""
    try:
        found = parse_json(read_text(file))
    except ValueError as error:
        raise complaint(file, None, "", f"no JSON: {error}", f"allowed: {allowed}") from None
    if not isinstance(found, dict):
        raise complaint(file, None, "", "no JSON object", f"allowed: {allowed}")
    return found
