"""What grbl says of itself, and what its numbers mean (report.c, errors.h, alarms.h of grbl 1.1 and grblHAL)."""

from __future__ import annotations

import re
from collections.abc import Mapping

from . import _grbl_targets as targets

ALARMS = {
    "1": "hard limit",
    "2": "target outside the travel",
    "3": "reset while moving",
    "4": "the probe was on before the search",
    "5": "no contact",
    "6": "reset while homing",
    "13": "the probe tripped outside a probing move",
    "17": "motor fault",
}
TURNS = "grbl: found a plan that turns the spindle; allowed: one angle S, or orient=m19 in the port's URL"
ERRORS = {"9": "it is locked, in alarm", "20": "unsupported word", "33": "invalid target", "24": "two axis commands in a line"}
CLAMPS = re.compile(r"^\((CLAMP|UNCLAMP) ([ABC]) M(\d{1,3})\)\r?$", re.MULTILINE)


def clamps(program: str) -> dict[tuple[str, str], int]:
    """program of the post → {(CLAMP or UNCLAMP, axis letter): M code}, as its head states them; none where it states none."""
    return {(found[1], found[2]): int(found[3]) for found in CLAMPS.finditer(program)}


def hello(options: Mapping[str, str]) -> bytes:
    """→ what moves nothing: what are you, your settings, a parameter that you set and say, your state."""
    tried = [*targets.assignments({"G": targets.SEARCH}), targets.question(("G",))]
    return "".join(f"{line}\n" for line in ("$I", "$$", *tried)).encode("ascii") + b"?"


def told(data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
    """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item."""
    lines = [line.strip("\r\0 ") for line in data.decode("latin-1").split("\n")[:-1]]
    version = [line for line in lines if line.startswith("[VER:")]
    if not version:
        return False, ["this is no answer of grbl: is it the right port, and the right baud rate (grbl: baud=115200)?"]
    axes = next((line.strip("[]").split(":")[-1] for line in lines if line.startswith("[AXS:")), "")
    sentences = [f"grbl, {version[-1].strip('[]:')}" + (f", axes {' '.join(axes)}" if axes else ", which does not name its axes")]
    settings = dict(line[1:].split("=", 1) for line in lines if re.fullmatch(r"\$\d+=.*", line))
    report = next((line for line in reversed(lines) if re.fullmatch(r"<[^<>]+>", line)), "")
    if "13" not in settings or not report:
        return False, [*sentences, "its settings and its state have not come"]
    sentences.append(f"positions come in {'inches' if settings['13'] == '1' else 'mm'} ($13={settings['13']})")
    fine = not settings.get("10", "1").isdecimal() or int(settings.get("10", "1")) & 1 == 1
    if not fine:
        sentences.append("it reports work positions: set $10=1, so that it reports machine positions")
    state, *fields = report.strip("<>").split("|")
    pin = next((field[3:] for field in fields if field.startswith("Pn:")), "")
    ready = state.partition(":")[0] in ("Idle", "Run", "Jog")
    sentences.append(f"its state is {state}" + ("" if ready else ": nothing will move before that is cleared"))
    sentences.append(f"the probe signal is {'on: is it free, and its polarity right ($6)?' if 'P' in pin else 'off'}")
    able = targets.confirmed([targets.SEARCH], lines)
    plain = options.get("targets") == "plain"
    if able:
        sentences.append("it confirms targets before it moves")
    elif ready:
        sentences.append(
            "it does not confirm targets, and targets=plain says that it need not: keep a hand on feed hold"
            if plain
            else f"it cannot be used as it is: {targets.CANNOT.format('it does not say a parameter that was set')}"
        )
    return fine and ready and (able or plain) and "P" not in pin, sentences


def busy(data: bytes, options: Mapping[str, str]) -> str:
    """what came after `hello` → why nobody may begin here unattended; empty where it stands idle."""
    found = re.findall(r"<([A-Za-z]+)[^<>\n]*>", data.decode("latin-1"))
    return f"its state is {found[-1]}, not Idle" if found and found[-1] != "Idle" else ""
