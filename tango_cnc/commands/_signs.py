"""stdout and stderr whose encoding lacks a character (a file on Windows) → one that it has stands for it."""

from __future__ import annotations

import codecs
import io
from typing import Any

INSTEAD = dict(zip("▁▂▃▄▅▆▇█", "_.,-=+*#", strict=True)) | {
    **{"·": ".", "│": "|", "═": "=", "╪": "+", "●": "o", "○": "o", "■": "#", "◐": "o", "✓": "+", "▲": "!", "✕": "x", "–": "-"},
    **{"→": "->", "−": "-", "…": "...", "µ": "u", "±": "+-", "°": "deg", "²": "2", "³": "3", "≤": "<=", "≥": ">=", "×": "x"},
    **{"“": '"', "”": '"', "’": "'", "‘": "'", "σ": "sigma", "Δ": "d", "ν": "nu", "χ": "chi"},
}


def _instead(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(INSTEAD.get(c, "?") for c in error.object[error.start : error.end]), error.end


codecs.register_error("tango", _instead)


def written(stream: Any) -> None:
    """stdout or stderr → the same; a character that its encoding lacks (a file on Windows) is replaced, not an error."""
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="tango")
