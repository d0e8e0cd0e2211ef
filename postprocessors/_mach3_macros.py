"""Mach3's macros in Basic, one an M code: everything that moves, looks or stops is in them, as Mach3's G-code knows no conditions.

    M880 start    M881 protected move    M882 measuring move    M883 off the facet    M884 a rotary axis    M885 record    M886 end
    M887 the step that shows whether positions come in mm

Public macros do it the same way: G31 by Code, waiting for IsMoving, GetVar(2000 …), GetOEMDRO for positions, GetOEMLED(825) for
the probe. Variables: #101 #102 #103 target, #104 feed, #105 angle of an axis, #106 #107 #108 stand-off (machine coordinates, mm),
#109 early, #110 tolerance, #111 misses allowed, #112 angle of the spindle, #113 number of the set of macros that the program was
written for, #114 how many calls of macros there are with this one, #141 #142 #143 which of X Y Z a protected move moves.
The macros keep #120 … (flag and place of the touch), #131 … (machine minus work), #150 (not 0: stopped, and every macro refuses),
#151 (misses) and #152 (how many calls have been carried out): where one has not, because its file is missing, because Basic has
complained or because somebody has started in the middle of the program, the next one stops.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from tango_cnc.gate import INCH, MIRRORED
from tango_cnc.records import OFF, Machine

START, PROTECTED, MEASURE, FREE, TURN, RECORD, END, STEPS = range(880, 888)
PLACE = {name: i for i, name in enumerate("XYZABC")}
TARGET, FEED, ANGLE, STANDOFF, EARLY, TOLERANCE, MISSES, SPINDLE = 101, 104, 105, 106, 109, 110, 111, 112
SET, CALL, MOVES, DONE = 113, 114, 141, 152
_FLAG, _AT, _FRAME, _STOPPED, _MISSED = 120, 121, 131, 150, 151
_MACHINE, _WORK, _PROBE, _STOP = 83, 800, 825, 1003
_WAIT = ["While IsMoving()", "  Sleep 20", "Wend"]
_DONE = f"Call SetVar({DONE}, GetVar({CALL}))"
CHANGED = 0.005  # mm; the sum of three differences of positions that may come rounded to 0.001
SHORTEST = 0.26  # mm of a G31: below 0.254 RS274/NGC complains, and what Mach3 does then nobody has written down
_HALF_DEGREE = 0.00872664626  # rad


def macros(machine: Machine, readings: str, probe_off: str = "") -> dict[str, list[str]]:
    """machine, file of the records on the control's disk, word for the probe → {file name: lines} for the macros folder."""
    texts = {
        START: ("looks whether the probe is free, takes the frame, writes the start mark", _start(readings)),
        PROTECTED: ("protected move: whatever stops it short stops the program", _protected()),
        MEASURE: ("measuring move: contact, none, or early", _measure(machine)),
        FREE: (f"{OFF:g} mm off the facet, the way it came", _off()),
        TURN: ("turns rotary axis P (4 A, 5 B, 6 C)", _turn()),
        RECORD: ("writes touch P", _record(machine, readings)),
        END: ("writes the end mark", _end(readings)),
        STEPS: ("a step that shows whether positions come in mm", _steps()),
    }
    number = _number("\n".join(line for code, (_, body) in texts.items() for line in _switched(_whole(0, code, body), probe_off)))
    return {
        f"m{code}.m1s": [f"' M{code} of tango, set {number}: {what}", *_switched(_whole(number, code, body), probe_off)]
        for code, (what, body) in texts.items()
    }


def set_number(machine: Machine, readings: str, probe_off: str = "") -> int:
    """machine, file of the records, word for the probe → number of the set of macros, which program and macros have to agree on."""
    return int(macros(machine, readings, probe_off)[f"m{START}.m1s"][0].split(",")[1].split()[1].rstrip(":"))


def _whole(number: int, code: int, body: list[str]) -> list[str]:
    return [*_belongs(number, code), *_WAIT, *body, _DONE]


def _switched(lines: list[str], probe_off: str) -> list[str]:
    """lines of a macro → the same; every stop switches the probe off first, where the profile has a word for it."""
    found: list[str] = []
    for line in lines:
        if probe_off and line.startswith("  Message "):
            found += [f'  Code "{probe_off}"', *(f"  {wait}" for wait in _WAIT)]
        found.append(line)
    return found


def _number(text: str) -> int:
    return int(hashlib.sha256(text.encode()).hexdigest(), 16) % 900_000 + 100_000


def _belongs(number: int, code: int) -> list[str]:
    """What every macro asks first: stopped before, of another set than the program, has the call before been carried out?"""
    awake = [f"If GetVar({_STOPPED}) <> 0 Then", "  Exit Sub", "End If"] if code != START else []
    own = _stop(f"GetVar({SET}) <> {number}", "MACROS ARE NOT THOSE OF THIS PROGRAM")
    return [*awake, *own, *_stop(f"GetVar({DONE}) + 1 <> GetVar({CALL})", "A MACRO IS MISSING OR A LINE WAS LEFT OUT")]


def _stop(condition: str, text: str) -> list[str]:
    return [
        f"If {condition} Then",
        f"  Call SetVar({_STOPPED}, 1)",
        f'  Message "TANGO STOPPED. {text}"',
        f"  Call DoOEMButton({_STOP})",
        "  Exit Sub",
        "End If",
    ]


def _start(readings: str) -> list[str]:
    return [
        f"Call SetVar({_STOPPED}, 1)",
        *_stop(f"GetOEMLED({_PROBE}) <> 0", "PROBE IS DEFLECTED"),
        *_stop('InStr(Format(0.5, "0.0"), ",") > 0', "WINDOWS WRITES A DECIMAL COMMA. SET ITS REGION TO A POINT"),
        *(f"Call SetVar({_FRAME + i}, GetOEMDRO({_MACHINE + i}) - GetOEMDRO({_WORK + i}))" for i in range(6)),
        f"Call SetVar({_MISSED}, 0)",
        *_mark("TANGO START ", readings, "NO START MARK IN THE PROGRAM"),
        f"Call SetVar({_STOPPED}, 0)",
    ]


def _end(readings: str) -> list[str]:
    return _mark("TANGO END ", readings, "NO END MARK IN THE PROGRAM")


def _mark(words: str, readings: str, missing: str) -> list[str]:
    """Copies what stands behind ( in the loaded program into the file of the records."""
    return [
        'Mark = ""',
        "Open FileName() For Input As #1",
        "While Not EOF(1)",
        "  Line Input #1, Text",
        f'  At = InStr(Text, "{words}")',
        "  If At > 0 Then",
        "    Mark = Mid(Text, At, Len(Text) - At)",
        "  End If",
        "Wend",
        "Close #1",
        *_stop('Mark = ""', missing),
        *_written("Mark", readings),
    ]


def _written(value: str, readings: str) -> list[str]:
    return [f'Open "{readings}" For Append As #1', f"Print #1, {value}", "Close #1"]


def _code(word: str, names: str, feed: str) -> str:
    axes = " & ".join(f'" {name}" & Format({name} - GetVar({_FRAME + PLACE[name]}), "0.0000")' for name in names)
    return f'Code "G90 G21 {word}" & {axes} & " F" & {feed}'


def _protected() -> list[str]:
    goals = []
    for name in "XYZ":
        i = PLACE[name]
        goals += [
            f"{name} = GetOEMDRO({_MACHINE + i})",
            f"If GetVar({MOVES + i}) <> 0 Then",
            f"  {name} = GetVar({TARGET + i})",
            "End If",
        ]
    off = " + ".join(f"Abs(GetOEMDRO({_MACHINE + PLACE[n]}) - {n})" for n in "XYZ")
    ways = [f"({n} - GetOEMDRO({_MACHINE + PLACE[n]}))" for n in "XYZ"]
    return [
        *goals,
        *_stop(f"Sqr({' + '.join(f'{way} * {way}' for way in ways)}) < {SHORTEST}", "START IS TOO NEAR TO THE TARGET. MOVE Z 1 MM"),
        _code("G31", "XYZ", f"GetVar({FEED})"),
        *_WAIT,
        f"Off = {off}",
        *_stop(f"Off > GetVar({TOLERANCE}) Or GetOEMLED({_PROBE}) <> 0", "PROBE MET SOMETHING ON ITS WAY OR UNITS ARE NOT MM"),
    ]


def _steps() -> list[str]:
    """A step of so much in each of X Y Z; positions in inches would make a wrong frame, and send the first move anywhere."""
    axes = " & ".join(f'" {n}" & Format(GetVar({TARGET + PLACE[n]}), "0.0000")' for n in "XYZ")
    way = " + ".join(f"(GetOEMDRO({_MACHINE + PLACE[n]}) - From{n}) * GetVar({TARGET + PLACE[n]})" for n in "XYZ")
    wanted = " + ".join(f"Abs(GetVar({TARGET + PLACE[n]}))" for n in "XYZ")
    return [
        *_stop(f"GetOEMLED({_PROBE}) <> 0", "PROBE IS DEFLECTED"),
        *(f"From{n} = GetOEMDRO({_MACHINE + PLACE[n]})" for n in "XYZ"),
        f'Code "G91 G21 G31" & {axes} & " F" & GetVar({FEED})',
        *_WAIT,
        'Code "G90"',
        *_WAIT,
        f"Wanted = {wanted}",
        f"Off = ({way}) / Wanted",
        *_stop(f"Abs(Off - Wanted / {INCH:g}) < 0.005", "POSITIONS ARE IN INCHES"),
        *_stop(f"Abs(Off - Wanted / 2) > Wanted / 2 + GetVar({TOLERANCE})", MIRRORED),
        *_stop(
            f"Abs(Off - Wanted) > GetVar({TOLERANCE}) Or GetOEMLED({_PROBE}) <> 0",
            "PROBE MET SOMETHING ON ITS WAY OR UNITS ARE NOT MM",
        ),
    ]


def _measure(machine: Machine) -> list[str]:
    places = []
    for name in "XYZ":
        i = PLACE[name]
        places.append(f"P{name} = GetVar({2000 + i}) + GetOEMDRO({_MACHINE + i}) - GetOEMDRO({_WORK + i})")
    moved = " + ".join(
        f"Abs(GetOEMDRO({_MACHINE + PLACE[n]}) - GetOEMDRO({_WORK + PLACE[n]}) - GetVar({_FRAME + PLACE[n]}))" for n in "XYZ"
    )
    lag = " + ".join(f"Abs(P{n} - GetOEMDRO({_MACHINE + PLACE[n]}))" for n in "XYZ")
    short = " + ".join(f"Abs(P{n} - {n})" for n in "XYZ")
    way = " + ".join(f"(P{n} - GetVar({STANDOFF + PLACE[n]})) * (P{n} - GetVar({STANDOFF + PLACE[n]}))" for n in "XYZ")
    return [
        *(f"{name} = GetVar({TARGET + PLACE[name]})" for name in "XYZ"),
        _code("G31", "XYZ", f"GetVar({FEED})"),
        *_WAIT,
        *places,
        *_stop(f"{moved} > {CHANGED}", "WORK OFFSET CHANGED"),
        *_stop(f"{lag} > 1", "PLACE OF THE CONTACT IS AN OLD ONE"),
        "Flag = 1",
        f"If Sqr({way}) < GetVar({EARLY}) Then",
        "  Flag = 2",
        "End If",
        f"If {short} < GetVar({TOLERANCE}) Then",
        "  Flag = 0",
        "End If",
        f"Missed = GetVar({_MISSED}) + 1",
        "If Flag <> 0 Then",
        "  Missed = 0",
        "End If",
        f"Call SetVar({_MISSED}, Missed)",
        *_stop(f"Missed >= GetVar({MISSES})", "NO CONTACT. IS THE PROBE ALIVE"),
        f"Call SetVar({_FLAG}, Flag)",
        *(f"Call SetVar({_AT + PLACE[n]}, P{n})" for n in "XYZ"),
        *(f"Call SetVar({_AT + PLACE[n]}, GetOEMDRO({_MACHINE + PLACE[n]}))" for n in machine.rotary),
    ]


def _off() -> list[str]:
    ways = [f"W{n} = GetVar({STANDOFF + PLACE[n]}) - GetVar({TARGET + PLACE[n]})" for n in "XYZ"]
    return [
        *ways,
        "Far = Sqr(WX * WX + WY * WY + WZ * WZ)",
        *(f"{n} = GetOEMDRO({_MACHINE + PLACE[n]}) + {OFF:g} * W{n} / Far" for n in "XYZ"),
        _code("G1", "XYZ", f"GetVar({FEED})"),
        *_WAIT,
    ]


def _turn() -> list[str]:
    letters = []
    for name in "ABC":
        letters += [f"If Param1() = {PLACE[name] + 1} Then", f'  Letter = "{name}"', "End If"]
    return [
        'Letter = ""',
        *letters,
        *_stop('Letter = ""', "NO SUCH AXIS"),
        f'Code "G90 G21 G53 G0 " & Letter & Format(GetVar({ANGLE}), "0.0000")',
        *_WAIT,
        f"Off = Abs(Sin((GetOEMDRO({_MACHINE - 1} + Param1()) - GetVar({ANGLE})) * {_HALF_DEGREE}))",
        *_stop("Off > 0.000087", "ROTARY AXIS NOT IN PLACE"),
    ]


def _record(machine: Machine, readings: str) -> list[str]:
    values: Mapping[str, str] = {n: f"GetVar({_AT + PLACE[n]})" for n in machine.names if n != "S"} | {"S": f"GetVar({SPINDLE})"}
    words = " & ".join(f'" {name}" & Format({value}, "0.0000")' for name, value in values.items())
    total = " + ".join(values.values())
    text = f'"P" & Format(Param1(), "0") & " H" & Format(GetVar({_FLAG}), "0") & {words} & " K" & Format({total}, "0.0000")'
    return _written(text, readings)
