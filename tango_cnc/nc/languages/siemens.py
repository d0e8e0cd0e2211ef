"""SINUMERIK, its own words: absolute, metric, without frames, cycles and transformations."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ..blocks import Block, Modal, refused
from . import _iso

SAYS = "SINUMERIK"
READS = ("siemens",)
LENGTH = True
COUNTED = False
UNITS = ("G71 or G710", "G90")
HEAD = re.compile(r"\s*(%.*|;.*)?\s*")
STYLE = _iso.Style(
    re.compile(rf"(?<![A-Za-z])(?P<letter>[Cc][Rr]|[A-Za-z])\s*=?\s*(?P<value>{_iso.NUMBER})(?!EX|[\d.#\[(])"),
    re.compile(
        r";.*|MSG\s*\(\"[^\"]*\"\)|^%.*"
        r"|(?<![A-Za-z])(?:M[1-9]=[345](?!\d)|S[1-9]=\d+(?:\.\d*)?)|FGROUP\s*\([XYZABC,\s]*\)"  # other spindles, whose feed F is
    ),
    {
        **{k: v for k, v in _iso.REFUSED.items() if k not in (20, 5, 7, 10, 15, 16, 51, 52, 92)},
        63: "tapping is not compensated",
        331: "tapping is not compensated",
        332: "tapping is not compensated",
        70: _iso.REFUSED[20],
        700: _iso.REFUSED[20],
        110: "polar coordinates are not followed",
        111: "polar coordinates are not followed",
        112: "polar coordinates are not followed",
        291: "the ISO language is another one: make two programs",
        **dict.fromkeys((147, 148, 247, 248, 347, 348, 340, 341), "soft approaches are not followed"),
        58: "programmable offsets are not followed",
        59: "programmable offsets are not followed",
    },
    harmless=frozenset({"SOFT", "BRISK", "FFWON", "FFWOF", "STOPRE", "DIAMOF", "CFC", "CFTCP", "CFIN", "G601", "COMPOF", "SUPA"}),
    inch=(70, 700),
    metric=(71, 710),
    cycles=False,
    passed=frozenset({9, 40, 60, 64, *range(601, 604), *range(641, 646), 94, 95, 97, 450, 451, *range(460, 463)}),
    alone=frozenset({290}),
    offsets=frozenset({*range(54, 58), 500, *range(505, 600)}),
    forgets=frozenset({74, 75}),
    height=None,
    subprograms=(),
    ends=frozenset({*_iso.ENDS, 17}),
    machine=(53, 153),
    radius="CR",
    begins=re.compile(r"(?i)\s*(?:%\s*(?:_N_|MPF|SPF)|[O:]\d+\s*(?:$|[(<;]))"),
)
WORDS = {
    "TRAORI": _iso.REFUSED[43.4],
    "ROT": "frames are not followed",
    "AROT": "frames are not followed",
    "TRANS": "frames are not followed",
    "ATRANS": "frames are not followed",
    "SCALE": "frames are not followed",
    "MIRROR": "frames are not followed",
    "MCALL": "cycles are not expanded here: let the post-processor write their moves",
    "CYCLE": "cycles are not expanded here: let the post-processor write their moves",
    "HOLES": "cycles are not expanded here",
    "POCKET": "cycles are not expanded here",
    "CALL": "subprograms are not followed: write them out",
    "EXTCALL": "subprograms are not followed: write them out",
    "CIP": "arcs by a point between are not followed",
    "CT": "tangential arcs are not followed",
    "BSPLINE": "splines are not followed",
    "CSPLINE": "splines are not followed",
    "COMPCAD": "the control's compressor would smooth the correction away: switch it off",
    "IF": "jumps are not followed",
    "GOTO": "jumps are not followed",
    "FOR": "jumps are not followed",
    "REPEAT": "jumps are not followed",
    "TURN": "arcs of several turns are not followed",
    "AC": "words with AC( ) and IC( ) are not followed",
    "IC": "words with AC( ) and IC( ) are not followed",
    "DC": "words with DC( ) are not followed",
    "RND": "roundings are not followed",
    "CHF": "chamfers are not followed",
    "OFFN": "offsets of the contour are not followed",
    "TOFF": "offsets of the tool are not followed",
}
NAME = re.compile(r"(?<![A-Z])[A-Z]{2,}")
BARE_RADIUS = re.compile(r"(?<![A-Z])CR\s*[-+.\d]")


def mark(text: str) -> str:
    """text → a comment line."""
    return f"; {text}"


def read(line: str, number: int, modal: Modal, axes: str) -> Block:
    """line, its number, modal state, axes → block. Raises InputError by name."""
    bare = STYLE.comment.sub(lambda m: " " * len(m[0]), line)
    for match in NAME.finditer(bare.upper()):
        for word, why in WORDS.items():
            if match[0] == word or (len(word) > 3 and match[0].startswith(word)):
                raise refused(number, match[0], why)
    if BARE_RADIUS.search(bare.upper()):
        raise refused(number, bare.strip(), "a radius without =: the control stops there; write CR=")
    if "SUPA" in bare.upper():
        bare_line = re.sub("(?i)SUPA", "G153", line)
        block = _iso.read(STYLE, bare_line, number, modal, axes)
        block.text = line
    else:
        block = _iso.read(STYLE, line, number, modal, axes)
    # With M6 a T only prepares the next tool; a machine without M6 changes at T. The first M6 tells which one it is.
    modal.changed = modal.changed or any(w.letter == "M" and w.value == 6 for w in block.words)
    if any(w.letter == "T" for w in block.words) and not modal.changed:
        block.tool = modal.tool
    if block.tool is not None:
        block.length = True
    for w in block.words:
        if w.letter == "D":
            if w.value not in (0, 1):
                raise refused(number, f"D{w.value:g}", "lengths of further edges of a tool are not followed")
            block.length = w.value == 1
    return block


def write(block: Block, moves: Sequence[Mapping[str, float]], decimals: int) -> list[str]:
    """block, corrected parts → lines."""
    return _iso.write(block, moves, decimals)
