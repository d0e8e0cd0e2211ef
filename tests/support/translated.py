"""A shop whose catalogue of texts is in other letters, and what is left of English on its pages."""

from __future__ import annotations

import html
import json
import re
import string
from pathlib import Path

import pytest

from tango_cnc.report.texts import texts

LETTERS = {ord(a): chr(0x430 + i) for i, a in enumerate(string.ascii_lowercase)}
LETTERS |= {ord(a): chr(0x410 + i) for i, a in enumerate(string.ascii_uppercase)}
NO_WORD = re.compile(
    r"'tango [^']*'"  # commands
    r"|\b[\w./-]+\.(?:yaml|csv|toml|html|pdf|db|md|json)\b"  # files
    r"|\btolerances\.\w+|\bEZf\d+\b|µrad|\bE[XYZABC]\w*(?:-E\w+)?\b|\b[0-9a-f]{32,}\b"  # symbols of ISO 230-1, hashes
    r"|\b(?:UTC|CET|ISO|rms|min|mm|deg|rad|tango|tango_cnc|numpy|scipy|Python|Linux|x86_64)\b"
)


def other(text: str) -> str:
    """Text of the catalogue → the same in other letters; {names} stay."""
    return "".join(part if part.startswith("{") else part.translate(LETTERS) for part in re.split(r"(\{[^{}]*\})", text))


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shop")
    lines = (f"{key} = {json.dumps(other(texts()(key)), ensure_ascii=False)}" for key in texts().keys if key != "language")
    (folder / "texts.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def english(page: str, *names: str) -> list[str]:
    """HTML, names that belong to the machine → the words in Latin letters that a person reads or hears."""
    text = re.sub(r"<(style|script|code)\b.*?</\1>", " ", page, flags=re.DOTALL)
    heard = " ".join(re.findall(r'(?:aria-label|title|alt|data-more|placeholder)="([^"]*)"', text))
    seen = html.unescape(re.sub(r"<[^>]*>", " ", text) + " " + heard)
    for name in sorted(names, key=len, reverse=True):
        seen = seen.replace(name, " ")
    return sorted(set(re.findall(r"[A-Za-z]{3,}(?: [a-z]{2,})*", NO_WORD.sub(" ", seen))))
