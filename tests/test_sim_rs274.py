"""The simulated RS-274/NGC control: the LinuxCNC program on it, its habits, and its values against LinuxCNC's own interpreter."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest
from support import controls
from support.controls import GOLDEN, Ran, run_on

from sim_controller.languages import rs274
from tango_cnc.files import read_cell
from tango_cnc.link.client import Begun, Ended, Touched
from tango_cnc.link.words import record
from tango_cnc.plan import plan
from tango_cnc.records import Cell, Plan, World

HEAD = ["G21 G90 G94 G17 G40 G49"]


@pytest.fixture(scope="module")
def cell() -> Cell:
    return read_cell(GOLDEN)


@pytest.fixture(scope="module")
def made(cell: Cell) -> Plan:
    return plan(cell)


def run(
    lines: list[str], made: Plan, world: World | None = None, fault: str | None = None, stuck: bool = False, **settings: Any
) -> Ran:
    """program, true machine, a fault, probe deflected at first, what differs from the usual profile → what came of it."""
    known = rs274.Profile(**settings)
    return run_on(lambda motion, punch, note: rs274.Control(motion, known, punch, note), lines, made, None, world, fault, stuck)


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("linuxcnc", made, **options)


def stopped(lines: list[str], made: Plan, **settings: Any) -> str:
    """→ what the control complains of; empty when it does not."""
    alarm = run([*HEAD, *lines], made, **settings).alarm
    return alarm.text if alarm else ""


# The program


def test_every_touch_is_recorded_where_it_happened(made: Plan) -> None:
    ran = run(lines_of(made), made)
    begun, *touched, ended = [record(line, made.machine.names) for line in ran.lines]
    assert isinstance(begun, Begun) and begun.count == 6
    assert isinstance(begun, Begun) and ended == Ended(6, begun.mark)
    truly = [data["at"] for event, data in ran.events if event == "contact"]
    for event, touch, there in zip(touched, made.touches, truly, strict=True):
        assert isinstance(event, Touched) and (event.number, event.flag) == (touch.number, 1)
        for name in ("X", "Y", "Z", "B", "C"):
            assert event.position[name] == pytest.approx(there[name], abs=1e-6)
        assert [there[n] for n in "XYZ"] == pytest.approx(touch.contact[:3], abs=1e-4)


def test_records_are_machine_coordinates_whatever_the_offsets(made: Plan) -> None:
    plain = run(lines_of(made), made).lines
    shifted = run(lines_of(made), made, g54={"X": 11.5, "Y": -3.25, "Z": 100.25, "B": 3.0}, g92={"X": 1.0, "Z": 2.0}).lines
    assert shifted == plain


def test_a_rotated_work_frame_ends_the_program_before_anything_moves(made: Plan) -> None:
    ran = run(lines_of(made), made, rotation={"R": 10.0})
    assert ran.alarm is not None and ran.alarm.text == "THE WORK FRAME IS ROTATED"
    assert not ran.places and not ran.lines


def test_a_miss_and_an_early_contact_are_flagged(made: Plan) -> None:
    assert run(lines_of(made), made, World(facets={"4": -8.0})).flags(made) == [1, 1, 1, 1, 1, 0]
    assert run(lines_of(made), made, World(facets={"4": 7.0})).flags(made) == [1, 1, 1, 1, 1, 2]


def test_three_touches_without_contact_in_a_row_end_it(made: Plan) -> None:
    world = World(facets={facet: -30.0 for facet in ("1", "top", "3", "4", "5")})
    ran = run(lines_of(made, misses=2), made, world)
    assert ran.alarm is not None and ran.alarm.text == "NO CONTACT. IS THE PROBE ALIVE"
    assert ran.flags(made) == [0]


def test_contact_on_the_way_ends_it(made: Plan) -> None:
    ran = run(lines_of(made), made, World(facets={"top": 12.0}))
    assert ran.alarm is not None and ran.alarm.text == "Probe tripped during non-probe move."


def test_a_probe_that_stays_on_ends_it_before_the_way_up(made: Plan) -> None:
    """No other move would notice: LinuxCNC looks for the moment of tripping."""
    ran = run(lines_of(made), made, fault="probe-stuck-after=1")
    assert ran.alarm is not None and "already tripped" in ran.alarm.text
    assert ran.flags(made) == [1] and ran.places[-1]["Z"] < 300


def test_a_probe_that_is_on_before_the_start_is_refused_by_the_program(made: Plan) -> None:
    ran = run(lines_of(made), made, stuck=True)
    assert ran.alarm is not None and ran.alarm.text == "THE PROBE IS DEFLECTED"
    assert not ran.places and not ran.flags(made)


def test_a_probe_that_is_on_before_the_start_is_refused_by_the_control_where_no_pins_can_be_read(made: Plan) -> None:
    ran = run(lines_of(made), made, stuck=True, hal=False)
    assert ran.alarm is not None and "already tripped" in ran.alarm.text
    assert not ran.places and run(lines_of(made), made, hal=False).alarm is None


def test_a_probe_that_is_on_before_the_search_ends_it(made: Plan) -> None:
    ran = run(lines_of(made), made, fault="bounce-after=2")
    assert ran.alarm is not None and "already tripped" in ran.alarm.text
    assert len(ran.flags(made)) == 2


def test_a_preview_goes_through_without_an_abort(made: Plan) -> None:
    """The interpreter that draws the path sees #5070 = 0 and no contact: the program must not end there."""
    world = World(facets={facet: -30.0 for facet in ("1", "top", "3", "4", "5")})
    assert run(lines_of(made), made, world, preview=True, rotation={"R": 0.0}).alarm is None


# The control


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("G31 X1 F100", "Unknown g code used"),
        ("G53 G38.2 X1 F100", "Must use g0 or g1 with g53"),
        ("G38.2 X1 F100", "G38.2 move finished without making contact"),
        ("G38.3 F100", "missing with G38"),
        ("G38.3 X1", "zero feed rate"),
        ("G1 X1 F100 (A (B))", "Nested comment found"),
        ("G1 X1 F100" + " " * 250, "Command too long"),
        ("G0 G1 X1 F100", "same modal group"),
        ("G0 A10", "Cannot move axis A: it does not exist"),
        ("G0 X1 X2", "Multiple words of one letter"),
        ("M98 P1", "Unknown m code used"),
        ("#1 = #<_nothing>", "Named parameter #<_nothing> not defined"),
        ("#5061 = 1", "Cannot assign to read-only parameter #5061"),
        ("#<_x> = 1", "Cannot assign to read-only parameter #<_x>"),
        ("#1 = SQRT[-1]", "out of range"),
        ("#1 = [1 / 0]", "divide by zero"),
        ("G0 X[1 + ]", "Bad format"),
        ("G38.4 X1 F100", "Unknown g code used"),
        ("G0 X1000", "would exceed joint X's limit"),
        ("O<none> CALL", "Unable to open file of subroutine"),
        ("O1 IF [1 EQ 2]", "Unclosed O word"),
        ("DPRNT[X]", "Bad format"),
    ],
)
def test_what_it_complains_of(line: str, complaint: str, made: Plan) -> None:
    assert complaint in stopped([line], made)


def test_what_it_takes(made: Plan) -> None:
    assert not stopped(["N10 g1 x 1. y-2 f100 (ok) ; and more", "/G0 Z700", "G38.3 X1 Y-2 Z700 F10", "%", "G31"], made)


def test_g94_in_a_block_clears_the_feed(made: Plan) -> None:
    assert "zero feed" in stopped(["G1 X1 F100", "G94", "G1 X2"], made)


def test_values_are_set_after_the_line_has_been_read(made: Plan) -> None:
    assert run(["#1=5", "#1=6 #2=#1", "(PRINT,%d#1 #2)"], made).messages == ["6 5"]


def test_inches_and_relative_moves(made: Plan) -> None:
    ran = run(["G20 G90 G0 X1", "G91 G0 X1", "G21 G0 X-0.8", "(PRINT,%f#<_abs_x>)"], made)
    assert ran.messages == ["50.0000"]


def test_angles_are_taken_as_they_are(made: Plan) -> None:
    assert run([*HEAD, "G0 C370", "G0 C-10"], made).places[-1]["C"] == pytest.approx(-10.0)
    assert run([*HEAD, "G0 C370"], made).places[-1]["C"] == pytest.approx(370.0)


def test_a_record_without_an_open_file_is_lost(made: Plan) -> None:
    ran = run(["(LOG,LOST)", "(LOGOPEN,a.txt)", "(LOG,KEPT)", "(LOGCLOSE)", "(LOG,LOST)"], made)
    assert ran.lines == ["KEPT"]


PROGRAM = """
#1 = [1 + 2 * 3 ** 2 - 8 / 4 MOD 3]
(PRINT,%.6f#1)
#<_a_b> = [1 + 1 EQ 2 AND 3 GT 2 OR 0]
(PRINT,%.6f#<_a_b>)
#2 = [ATAN[1]/[-1] + ROUND[-2.5] + FIX[-2.5] + FUP[-2.5] + -7 MOD 3]
(PRINT,%.6f#2 %d#2 #1 %f#2)
#3 = -#2
(PRINT,%.6f#3)
#4=[2 ** 3 ** 2]
(PRINT,%.2f#4)
#5=[10 - 4 - 3 + -[2]]
(PRINT,#5)
#6=[-2 ** 2]
#7=[1 XOR 0 AND 0]
(PRINT,#6 #7)
#8=abs[-1]
#8=9 #9=#8
(PRINT,#9 #8)
O1 IF [#1 GT 30]
(PRINT,A)
O1 ELSEIF [#1 GT 2]
(PRINT,B)
O1 ELSE
(PRINT,C)
O1 ENDIF
#10=0
O2 WHILE [#10 LT 3]
(PRINT,%d#10)
#10=[#10+1]
O2 ENDWHILE
O<s> SUB
(PRINT,%.1f#1 #2 #3)
O3 IF [#1 EQ 1.5]
O<s> RETURN
O3 ENDIF
(PRINT,NEVER)
O<s> ENDSUB
O<s> CALL [1.5] [2]
(PRINT,%.1f#1)
M2
"""


@pytest.mark.system("rs274")
def test_values_are_those_of_linuxcnc_itself(made: Plan, tmp_path: Path) -> None:
    file = tmp_path / "values.ngc"
    file.write_text(PROGRAM.lstrip(), encoding="ascii")
    done = subprocess.run(["rs274", "-g", str(file)], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    said = [line for line in done.stdout.splitlines() if line.strip() != "executing" and " N..... " not in line]
    assert run(PROGRAM.splitlines(), made).messages == said
