"""Mach4: Fanuc's macro B without DPRNT, so that five M codes, written in Lua, keep the records and look at the probe.

Mill GCode Programming (G31 ends at its target when nothing is met, #5021 #5041 #5061 by axis X Y Z A B C, #3000 stops with the
text behind it, M codes from 100 on are user scripts mNNN.mcs in the profile's Macros folder), Mach4CoreAPI (names of the calls).
The scripts travel with the program as companion files. One stops while the probe is deflected; the others decide nothing: the
G-code tells contact from none and stops.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from tango_cnc.records import InputError

from ._base import Job, Leg, Option, Post, number, with_defaults
from ._common import axes, spares, spindle
from ._macro_b import OPTIONS as FAMILY_OPTIONS
from ._macro_b import numbers_of_stops, steps
from ._macro_b_text import FLAG, Words
from ._remedies import MACH4

START, RECORD, END, WAIT, LOOK = 880, 881, 882, 883, 884  # M codes
SET, SUM, SPINDLE, TOUCH = 117, 118, 119, 120  # common variables: number of the set of scripts; what the record is made of
PLACE = {name: i for i, name in enumerate("XYZABC", 1)}  # of an axis in #5021 …
# G49 moves nothing here, and the reset line has the words that cancel what is asked elsewhere.
FIXED: Mapping[str, Any] = {
    **{"macros": "inline", "print_format": "44", "length_check": False, "must_be_off": {}},
    **{"alarm": "tidy", "skip": "G31", "wait": f"M{WAIT}"},
}
FILE = "tango-readings.txt"

WORDS = Words(open=(), close=(), wait=f"M{WAIT}", dwell="G4 P{}.", shown="(MSG,{})", look=f"M{LOOK}")
FAMILY = steps(WORDS)
OPTIONS = (
    *with_defaults(
        tuple(o for o in FAMILY_OPTIONS if o.name not in (*FIXED, "axis_numbers", "probe_state", "show")),
        reset="G15 G17 G40 G49 G50 G69 G80 G90 G94 M5",
    ),
    Option(
        "probe_state",
        True,
        f"M{LOOK} stops while the probe's signal (ISIG_PROBE) is on, before every G31; false: G31 itself has to end at once",
    ),
    Option("readings", FILE, "file of the records, in the folder of the program", verified=True),
)
DOUBTS = (
    "IF … THEN, IF … GOTO and #3000 in a program, and no read-ahead beyond G31 and M codes",
    "#5021 #5041 #5061 come in millimetres after G21",
    "G53 G0 turns a rotary axis in machine coordinates",
    "#506x, #502x and #504x of axes at rest differ by constants",
    "a probe that is off stops nothing: protected moves protect only while it is on",
)


def _stated(job: Job) -> Job:
    """→ the job with what is fixed on this control."""
    numbers = {name: PLACE[name] for name in axes(job.machine)}
    return replace(job, options={**job.options, **FIXED, "axis_numbers": numbers})


def _of_family(name: str) -> Callable[..., Iterator[str]]:
    def step(job: Job, *leg: Leg) -> Iterator[str]:
        return FAMILY[name](_stated(job), *leg)

    return step


def begin(job: Job) -> Iterator[str]:
    """That of the family, with the start mark as a comment that the script reads."""
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,60}\.[a-z]{1,4}", job.options["readings"]):
        raise InputError(
            f"controller.readings: found {job.options['readings']!r}; allowed: a file name of letters, digits, _ and -"
        )
    spares(job, START, LOOK)
    for line in FAMILY["begin"](_stated(job)):
        if line == f"M{WAIT}":
            yield f"#{SET}={_set(_scripts(job))}"
        if line.startswith("DPRNT["):
            yield f"M{START}(TANGO START {job.mark} {len(job.plan.touches)})"
        elif not line.startswith(f"#{FLAG}="):
            yield line


def record(job: Job, leg: Leg) -> Iterator[str]:
    """Touch, spindle and sum into variables; the script writes the line."""
    places = [f"#{FLAG + PLACE[name]}" for name in axes(job.machine)]
    yield f"#{TOUCH}={number(leg.touch.number)}"
    yield f"#{SPINDLE}={spindle(job, leg.to['S'])}"
    yield f"#{SUM}={'+'.join([*places, f'#{SPINDLE}'])}(CHECK SUM K)"
    yield f"M{RECORD}(RECORD)"


def end(job: Job) -> Iterator[str]:
    """End mark, ways out and end of program."""
    yield f"M{END}(TANGO END {job.mark} {len(job.plan.touches)})"
    job = _stated(job)
    yield from WORDS.ways_out(job, numbers_of_stops(job, WORDS))
    yield "M30"
    yield "%"


def scripts(job: Job) -> dict[str, list[str]]:
    """→ the five M codes for the Macros folder of the profile; each stops unless the program was written for this set."""
    found = _scripts(job)
    number = _set(found)
    return {name: [line.replace("SETNUMBER", str(number)) for line in lines] for name, lines in found.items()}


def _set(found: Mapping[str, list[str]]) -> int:
    whole = "\n".join(line for lines in found.values() for line in lines)
    return int(hashlib.sha256(whole.encode()).hexdigest(), 16) % 900_000 + 100_000


def _scripts(job: Job) -> dict[str, list[str]]:
    variables = {name: FLAG + PLACE[name] for name in axes(job.machine)} | {"S": SPINDLE, "K": SUM}
    form = " ".join(["P%.0f H%.0f", *(f"{name}%.4f" for name in variables)])
    values = ", ".join(f"value({number})" for number in (TOUCH, FLAG, *variables.values()))
    return {
        f"m{START}.mcs": _script(
            START,
            "writes the start mark that stands in the loaded program",
            [
                'local mark = text():match("TANGO START %x+ %d+")',
                'if mark then say(mark) else stop("NO START MARK IN THE PROGRAM") end',
            ],
            job,
        ),
        f"m{RECORD}.mcs": _script(
            RECORD,
            "writes one touch",
            [
                f'say(string.format("{form}", {values}))',
            ],
            job,
        ),
        f"m{END}.mcs": _script(
            END,
            "writes the end mark that stands in the loaded program",
            [
                'local mark = text():match("TANGO END %x+ %d+")',
                'if mark then say(mark) else stop("NO END MARK IN THE PROGRAM") end',
            ],
            job,
        ),
        f"m{WAIT}.mcs": _script(
            WAIT,
            "does nothing: an M code is carried out when the axes stand, and so is what follows it, in the loaded program",
            [],
            job,
        ),
        f"m{LOOK}.mcs": _script(
            LOOK,
            "stops while the probe is deflected",
            [
                "local signal = (mc.mcSignalGetHandle(inst, mc.ISIG_PROBE))",
                'if (mc.mcSignalGetState(signal)) ~= 0 then stop("PROBE IS DEFLECTED") end',
            ],
            job,
        ),
    }


def _script(code: int, what: str, body: list[str], job: Job) -> list[str]:
    off = job.options["probe_off"]
    head = [
        f"-- M{code} of tango, set SETNUMBER: {what}",
        f"function m{code}()",
        "    local inst = mc.mcGetInstance()",
        "    local function stop(why)",
        *([f'        mc.mcCntlGcodeExecuteWait(inst, "{off}")'] if off else []),
        f'        mc.mcCntlMacroAlarm(inst, {code}, "TANGO " .. why)',
        "    end",
        "    local function value(number) return (mc.mcCntlGetPoundVar(inst, number)) end",
        f'    if value({SET}) ~= SETNUMBER then stop("SCRIPTS ARE NOT THOSE OF THIS PROGRAM") return end',
    ]
    files = [
        "    local program = (mc.mcCntlGetGcodeFileName(inst))",
        f'    local file = (program:match("^(.*[/\\\\])") or "") .. "{job.options["readings"]}"',
        "    local function say(line)",
        '        local f = io.open(file, "a")',
        '        if f == nil then stop("CANNOT WRITE " .. file) return end',
        '        f:write(line, "\\n")',
        "        f:close()",
        "    end",
    ]
    reads = [
        "    local function text()",
        '        local f = io.open(program, "r")',
        '        local all = f and f:read("*a") or ""',
        "        if f then f:close() end",
        "        return all",
        "    end",
    ]
    needs = [*(files if any("say(" in line for line in body) else []), *(reads if any("text()" in line for line in body) else [])]
    return [*head, *needs, *(f"    {line}" for line in body), "end"]


POST = Post(
    title="Mach4",
    extension="nc",
    language="mach4",
    links=("file", "remote", "modbus"),
    options=OPTIONS,
    memory=512,
    remedies=MACH4,
    doubts=DOUBTS,
    link="file",
    companions=scripts,
    **{name: _of_family(name) for name in FAMILY if name != "stem"}
    | {"stem": FAMILY["stem"], "begin": begin, "record": record, "end": end},
)
