"""A program that the control has punched out again, compared with the file: what nothing on the way there could find."""

from __future__ import annotations

from .heard import parity_of

CODES = bytes([0x00, 0x11, 0x12, 0x13, 0x14, 0x7F])  # leader and flow codes
PERCENT = (b"%", b"\xa5")  # without and with even parity; with odd parity it is the former
SHOWN = 60  # characters of a line in a sentence


def plain(data: bytes) -> bytes:
    """bytes of a tape → without its parity, leader and flow codes."""
    seven = bytes(byte & 0x7F for byte in data) if parity_of(data) else data
    return seven.translate(None, CODES)


def complete(data: bytes) -> bool:
    """bytes of a tape → whether its closing % has come."""
    text = plain(data)
    return text.count(b"%") >= 2 and text.rstrip().endswith(b"%")


def blocks(text: str) -> list[str]:
    """program → its blocks without blanks, which controls put in and leave out as they like; O and : are one word."""
    lines = ("".join(line.split()) for line in text.replace("\r", "\n").split("\n"))
    return [f"O{line[1:]}" if line.startswith(":") else line for line in lines if line.strip("%")]


def compared(program: str, data: bytes) -> tuple[bool, list[str]]:
    """text of the file, bytes that came → whether they are the same program, and where they differ first, a sentence an item."""
    if not data:
        return False, ["nothing came: let the control punch the program out (on many: EDIT, READ/PUNCH, its O number, PUNCH)"]
    file, control = blocks(program), blocks(plain(data).decode("latin-1"))
    if not complete(data):
        return False, [f"{len(control)} of {len(file)} blocks came and no closing %: the control stopped punching"]
    for number, (ours, theirs) in enumerate(zip(file, control, strict=False), 1):
        if ours != theirs:
            return False, [
                f"block {number} of {len(file)} differs: the file has {ours[:SHOWN]!r}, the control {theirs[:SHOWN]!r}. "
                "Delete the program at the control and send it again"
            ]
    if len(file) != len(control):
        return False, [f"the file has {len(file)} blocks, the control {len(control)}: delete the program there and send it again"]
    return True, [f"{len(file)} blocks, all of them as in the file"]
