"""What a line said while nobody asked it anything, in words that lead to the right settings."""

from __future__ import annotations

from collections.abc import Sequence

from .client import Begun, Ended, Touched
from .words import record

NAMES = {0x11: "DC1 (send)", 0x12: "DC2 (print begins)", 0x13: "DC3 (stop sending)", 0x14: "DC4 (print ends)"}
ENOUGH = 8  # characters that it takes to see the parity


def parity_of(data: bytes) -> str | None:
    """bytes → 'even' or 'odd' when every one of them has that number of ones in all eight bits, None when neither."""
    for name, rest in (("even", 0), ("odd", 1)):
        if len(data) >= ENOUGH and all(byte.bit_count() % 2 == rest for byte in data):
            return name
    return None


def noise(data: bytes) -> list[str]:
    """bytes → what their eighth bits say of the settings of the line; nothing when they look right."""
    parity = parity_of(data)
    high = sum(byte > 0x7F for byte in data)
    if parity and high:
        return [f"every character has {parity} parity in its eighth bit: set bits=7&parity={parity}"]
    if high > len(data) // 4:
        return [f"{high} of {len(data)} characters are none: the baud rate, or parity and bits, are set wrongly"]
    return []


def heard(data: bytes, letters: Sequence[str]) -> list[str]:
    """bytes, axis letters of the machine → what they are and what to set, one sentence an item."""
    if not data:
        return [
            "nothing came: does the control send (print a variable, press start), are TX and RX crossed, is the port the right one?"
        ]
    sentences = noise(data)
    plain = bytes(byte & 0x7F for byte in data) if parity_of(data) else data
    codes = [f"{plain.count(code)} x {name}" for code, name in NAMES.items() if code in plain]
    if codes:
        sentences.append(f"flow and print codes: {', '.join(codes)}")
    text = plain.translate(None, bytes([*NAMES, 0x00, 0x7F])).decode("latin-1").replace("\r", "\n")
    lines = [line for line in text.split("\n") if line.strip()]
    records = sum(isinstance(record(line, letters), Begun | Touched | Ended) for line in lines)
    if lines:
        sentences.append(f"{len(lines)} lines, {records} of them records of a TANGO program")
    return sentences
