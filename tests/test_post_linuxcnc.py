"""The LinuxCNC program, read by LinuxCNC's own interpreter (rs274), which prints the motion it would command."""

from __future__ import annotations

import math
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.blockcell import machine
from support.few import every

from postprocessors import load, may_roll, program
from tango_cnc.files import read_cell
from tango_cnc.plan import last_motion, plan, plan_hash
from tango_cnc.records import InputError, Plan

GOLDEN = Path(__file__).parent / "golden" / "cell"
EXAMPLES = Path(__file__).parent.parent / "examples"
BACK_OFF = 0.2541  # mm
SHIFT = "G21 G10 L2 P1 X10 Y-20 Z5 B3 C-40\nG54\nG92 X1 Z2\n"


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(read_cell(GOLDEN))


def text_of(made: Plan, **options: Any) -> str:
    return "".join(f"{line}\n" for line in program(load("linuxcnc"), made, {"gate": "none"} | options, plan_hash(made))[2]())


def interpreted(text: str, folder: Path) -> list[str]:
    """program → what rs274 prints; fails with its complaint when it does not accept the program."""
    file = folder / "tango.ngc"
    file.write_text(text, encoding="ascii")
    done = subprocess.run(["rs274", "-g", str(file)], cwd=folder, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-500:]
    return done.stdout.splitlines()


def moves(lines: list[str]) -> list[tuple[str, list[float]]]:
    """output of rs274 → (kind, X Y Z B C) of every motion and (orient, [deg]) of the spindle."""
    found = []
    for line in lines:
        if match := re.search(r"STRAIGHT_(TRAVERSE|FEED|PROBE)\((.*)\)", line):
            x, y, z, _, b, c = (float(v) for v in match[2].split(","))
            found.append((match[1].lower(), [x, y, z, b, c]))
        elif match := re.search(r"ORIENT_SPINDLE\(0, ([-\d.]+)", line):
            found.append(("orient", [float(match[1])]))
    return found


def expected(made: Plan) -> list[tuple[str, list[float]]]:
    """plan → the same, from its moves."""
    at = dict.fromkeys("XYZBC", 0.0)
    found = []
    for move in made.moves:
        values = {n: v if n in made.machine.linear else math.degrees(v) for n, v in move.target.items()}
        if "S" in values:
            found.append(("orient", [values["S"] % 360]))
        if move.kind == "index":
            for name in made.machine.rotary:
                if name in values:
                    at[name] = values[name]
                    found.append(("traverse", list(at.values())))
            continue
        at |= values
        found.append(("probe" if move.kind in ("probe", "retract") else "feed", list(at.values())))
    return found


@pytest.mark.system("rs274")
def test_the_interpreter_commands_the_moves_of_the_plan(made: Plan, tmp_path: Path) -> None:
    got, wanted = moves(interpreted(text_of(made), tmp_path)), expected(made)
    assert [kind for kind, _ in got] == [kind for kind, _ in wanted]
    for (kind, a), (_, b) in zip(got, wanted, strict=True):  # this interpreter backs off a little after every search
        assert a == pytest.approx(b, abs=BACK_OFF if kind == "traverse" else 1e-4), kind


@pytest.mark.system("rs274")
def test_targets_are_machine_coordinates_whatever_the_work_offsets(made: Plan, tmp_path: Path) -> None:
    """G54 and G92 shifted before the program: rs274 shows positions in the frame of its own, which is the machine's minus these."""
    got, wanted = moves(interpreted(SHIFT + text_of(made), tmp_path)), expected(made)
    assert [kind for kind, _ in got] == [kind for kind, _ in wanted]
    linear = [[a[i] - b[i] for i in range(3)] for (kind, a), (_, b) in zip(got, wanted, strict=True) if kind in ("feed", "probe")]
    for difference in linear[2:]:  # the first two have not moved every axis yet
        assert difference == pytest.approx(linear[2], abs=2e-4)


@pytest.mark.system("rs274")
@pytest.mark.parametrize("shift", ["", SHIFT])
def test_records_are_machine_coordinates_in_order(made: Plan, shift: str, tmp_path: Path) -> None:
    lines = [match[1] for line in interpreted(shift + text_of(made), tmp_path) if (match := re.search(r'LOG\("(.*)"\)', line))]
    mark = program(load("linuxcnc"), made, {"gate": "none"}, plan_hash(made))[1]
    assert lines[0] == f"TANGO START {mark} 6" and lines[-1] == f"TANGO END {mark} 6"
    assert [re.match(r"P(\d+) ", line)[1] for line in lines[1:-1]] == list("123456")  # type: ignore[index]
    for line, touch in zip(lines[1:-1], made.touches, strict=True):
        # This interpreter's probe never trips, so it reports the search end and no contact.
        words = dict(re.findall(r"([A-Z])(-?[\d.]+)", line))
        assert words["H"] == "0"
        for name, value in zip(made.machine.names, touch.end, strict=True):
            shown = value if name in made.machine.linear else math.degrees(value)
            assert float(words[name]) == pytest.approx(shown, abs=1e-4), name


@pytest.mark.few(1)
@pytest.mark.system("rs274")
@pytest.mark.parametrize("example", every(sorted(p.name for p in EXAMPLES.iterdir() if p.is_dir()), 3))
def test_the_program_of_every_example_is_accepted(example: str, tmp_path: Path) -> None:
    made = plan(read_cell(EXAMPLES / example), "leave-out")
    got = moves(interpreted(text_of(made), tmp_path))
    assert sum(kind == "probe" for kind, _ in got) == sum(move.kind in ("probe", "retract") for move in made.moves)


def test_probing_moves_are_touches_and_retracts_and_always_have_their_feed(made: Plan) -> None:
    lines = text_of(made).splitlines()
    assert [line for line in lines if "G38" in line] == [
        f"G38.3 X[#1 - #<_tango_x>] Y[#2 - #<_tango_y>] Z[#3 - #<_tango_z>] F#{which}" for which in (7, 4)
    ]
    searches = [line for line in lines if line.startswith("O<tango_free> CALL")]
    assert len(searches) == sum(move.kind == "retract" for move in made.moves)
    assert searches[0] == "O<tango_free> CALL [#<_abs_x>] [#<_abs_y>] [478.9967] [3000.]"
    assert all(" F" in line for line in lines if re.match(r"G53 G1 ", line))
    assert sum("O<tango_touch> CALL" in line for line in lines) == len(made.touches)


def test_a_preview_never_aborts(made: Plan) -> None:
    """Every (ABORT,…) stands behind an IF that asks for #<_task> first."""
    lines = text_of(made).splitlines()
    aborts = [i for i, line in enumerate(lines) if line.startswith("(ABORT")]
    assert len(aborts) == 7
    assert all("[#<_task> EQ 1] AND" in lines[i - 2] and lines[i - 1] == "(LOGCLOSE)" for i in aborts)


def test_rotary_axes_move_alone_and_wrap_only_when_told(made: Plan) -> None:
    def turns(**options: bool) -> list[str]:
        return [line for line in text_of(made, **options).splitlines() if line.startswith("G53 G0")]

    assert all(len(line.split()) == 3 for line in turns())
    assert "G53 G0 C-90." in turns() and "G53 G0 C-270." in turns(wrapped=True)


@pytest.mark.few(2)
@pytest.mark.parametrize("example", ["hu40t", "trunnion", "golden"])
@pytest.mark.parametrize("wrapped", [False, True])
def test_rotary_axes_come_to_every_touch_in_the_sense_that_the_readings_will_say(example: str, wrapped: bool) -> None:
    """Backlash is signed by it. A wrapped axis (ini-config.adoc) goes to 0 … 360 of its turn in the sense of the word's sign."""
    folder = GOLDEN if example == "golden" else EXAMPLES / example
    made = plan(read_cell(folder), "leave-out")
    wanted = iter(last_motion(made))
    rolls = {n for n in made.machine.rotary if wrapped and may_roll(made.machine, n)}
    assert not wrapped or rolls
    at, sense = dict.fromkeys(made.machine.rotary, 7.0), dict.fromkeys(made.machine.rotary, 0.0)
    for line in text_of(made, wrapped=wrapped).splitlines():
        if match := re.fullmatch(r"G53 G0 ([ABC])(-?)([\d.]+)", line):
            name, there = match[1], float(match[3])
            if name in rolls:
                assert there < 360
                change = -((at[name] - there) % 360) if match[2] else (there - at[name]) % 360
            else:
                change = float(match[2] + match[3]) - at[name]
            at[name] += change
            sense[name] = math.copysign(1.0, change) if change else sense[name]
        elif "O<tango_touch> CALL" in line:
            row = next(wanted)
            assert [sense[n] for n in made.machine.rotary] == [row[made.machine.column(n)] for n in made.machine.rotary]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"log": "a file)"}, "a path of letters"),
        ({"orient": False}, "this strategy turns the spindle"),
        ({"positioning_feed": -1.0}, "controller.positioning_feed: found .*; allowed: 1 … 1000000"),
        ({"positioning_feed": "fast"}, "a number"),
    ],
)
def test_options_that_do_not_fit_are_refused(made: Plan, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        text_of(made, **options)


@pytest.mark.parametrize(
    ("travel", "rolls"),
    [
        (None, True),  # without limits
        ((0.0, 360.0), True),  # a whole turn from 0 on, to the last digit of a profile
        ((0.0, 359.9), False),
        ((0.1, 400.0), False),
        ((-200.0, 200.0), False),  # what lies from 200 to 360 cannot be reached under that number
        ((-400.0, 400.0), True),
    ],
)
def test_an_angle_is_written_from_0_to_360_where_the_travel_holds_a_whole_turn(travel, rolls):
    whole = machine("wCBXfZY(S)t")
    limits = None if travel is None else tuple(np.radians(travel).tolist())
    assert may_roll(replace(whole, axes=tuple(replace(a, travel=limits) if a.name == "C" else a for a in whole.axes)), "C") is rolls
