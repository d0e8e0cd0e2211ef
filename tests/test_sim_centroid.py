"""The Centroid program on its simulated control, and the habits of that control."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from postprocessors._base import load, program
from sim_controller.faults import faults
from sim_controller.interpreters import Alarm, centroid
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language, profile
from tango_cnc.files import read_cell
from tango_cnc.link._client import Ended, Touched
from tango_cnc.link._words import record
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import InputError, Plan, World

GOLDEN = Path(__file__).parent / "golden" / "cell"


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(read_cell(GOLDEN))


def lines_of(made: Plan, **options: Any) -> list[str]:
    return list(program(load("centroid"), made, options, plan_hash(made))[2]())


@dataclass
class Ran:
    """What came of a program."""

    out: bytes = b""
    alarm: str = ""
    events: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        return self.out.decode("ascii").splitlines()

    @property
    def said(self) -> list[str]:
        return [data["message"] for event, data in self.events if event == "stop"]

    @property
    def moved(self) -> bool:
        return any(event in ("feed", "rapid", "skip", "contact") for event, _ in self.events)

    def flags(self, made: Plan) -> list[int]:
        return [event.flag for event in (record(line, made.machine.names) for line in self.lines) if isinstance(event, Touched)]


def run(
    lines: list[str], made: Plan, world: World | None = None, fault: tuple[str, ...] = (), stuck: bool = False, **settings: Any
) -> Ran:
    """program, true machine → what came of it."""
    ran, out = Ran(), []

    def note(event: str, **data: Any) -> None:
        ran.events.append((event, data))

    motion = Motion(rig(made.machine, made.artefact, world or World()), note, faults=faults(fault))
    motion._stuck = stuck
    try:
        set_up = replace(centroid.default_profile(made.machine), **settings)
        centroid.Control(motion, set_up, out.append, note).run(lines, False)
    except Alarm as alarm:
        ran.alarm = str(alarm)
    ran.out = b"".join(out)
    return ran


# The program


def test_every_touch_is_recorded_where_it_happened(made: Plan) -> None:
    ran = run(lines_of(made), made)
    assert not ran.alarm and not ran.said
    truly = [data["at"] for event, data in ran.events if event == "contact"]
    touched = [record(line, made.machine.names) for line in ran.lines][1:-1]
    for event, touch, there in zip(touched, made.touches, truly, strict=True):
        assert isinstance(event, Touched) and (event.number, event.flag) == (touch.number, 1)
        for name in ("X", "Y", "Z"):
            assert event.position[name] == pytest.approx(there[name], abs=1e-4)
    assert record(ran.lines[-1], made.machine.names) == Ended(6)


def test_records_are_machine_coordinates_whatever_the_offset(made: Plan) -> None:
    assert run(lines_of(made), made, g54={"X": 11.5, "Y": -3.25, "Z": 100.25}).lines == run(lines_of(made), made).lines


def test_a_miss_and_an_early_contact_are_flagged(made: Plan) -> None:
    assert run(lines_of(made), made, World(facets={"4": -8.0})).flags(made)[-1] == 0
    assert run(lines_of(made), made, World(facets={"4": 7.0})).flags(made)[-1] == 2


def test_a_dead_probe_ends_it_in_words(made: Plan) -> None:
    world = World(facets={facet: -30.0 for facet in ("1", "top", "3", "4", "5")})
    ran = run(lines_of(made, misses=2), made, world)
    assert ran.said == ["TANGO STOPPED. NO CONTACT. IS THE PROBE ALIVE"]
    assert ran.flags(made) == [0] and not ran.alarm


def test_contact_on_the_way_is_cancelled_by_the_control(made: Plan) -> None:
    ran = run(lines_of(made), made, World(facets={"top": 40.0}))
    assert "unexpected probe contact" in ran.alarm


def test_a_probe_that_is_on_lets_nothing_move(made: Plan) -> None:
    for wired in (15.0, -15.0, 50015.0):
        ran = run(lines_of(made), made, stuck=True, probe={"P": wired})
        assert ran.said == ["TANGO STOPPED. PROBE IS DEFLECTED"] and not ran.moved


def test_a_probe_that_comes_on_between_touches_cancels_the_job(made: Plan) -> None:
    ran = run(lines_of(made), made, fault=("bounce-after=2",))
    assert "unexpected probe contact" in ran.alarm and ran.flags(made) == [1, 1]


def test_a_machine_in_inches_is_found_at_the_first_move(made: Plan) -> None:
    ran = run(lines_of(made), made, inches=True)
    assert ran.said == ["TANGO STOPPED. PROBE MET SOMETHING ON ITS WAY OR UNITS ARE NOT MM"]
    assert len([1 for event, _ in ran.events if event in ("skip", "contact", "rapid", "feed")]) == 1


def test_a_contact_that_is_not_stored_is_found(made: Plan) -> None:
    ran = run(lines_of(made), made, old_contact=True)
    assert ran.said == ["TANGO STOPPED. PLACE OF THE CONTACT IS AN OLD ONE"] and ran.flags(made) == []


def test_options_that_do_not_fit_are_refused(made: Plan) -> None:
    with pytest.raises(InputError, match=r"controller\.readings"):
        lines_of(made, readings='a";M2')
    with pytest.raises(InputError, match=r"controller\.axis_numbers"):
        lines_of(made, axis_numbers={"X": 1})


# The control


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("M115 /X10. P15 F100.", "probe did not detect the surface"),
        ("M115 /X10. P14 F100. L1", "Missing or invalid P value"),
        ("M115 /X10. P15 L1", "no feed"),
        ("M115 /A10. P15 F100. L1", "no axis that there is"),
        ('M223 "A\\n"', "no data file is open"),
        ("M2", "Z goes home"),
        ("G91 G53 X1.", "only be used with G90"),
        ("G31 X1. F100.", "invalid G code"),
        ("M77", "M77 is not defined"),
        ("#5021 = 1", "no assignment"),
        ("GOTO 77", "N77 not found"),
        ("G1 X10.", "feedrate is zero"),
        ('M225 #100 "A %f', "a string is not closed"),
        ("IF [1 == 1] GOTO 5", "THEN expected"),
    ],
)
def test_what_cancels_the_job(line: str, complaint: str, made: Plan) -> None:
    assert complaint in run(["G21 G90", line], made).alarm


def test_variables_lag_behind_until_something_waits(made: Plan) -> None:
    program = [
        "G21 G90",
        "G53 X5.",
        "#29001 = #5021",
        "IF #50010",
        "#29002 = #5021",
        'M121 "a.txt"',
        'M223 "%.1f %.1f\\n" #29001 #29002',
    ]
    assert run(program, made).lines == ["0.0 5.0"]


def test_conditions_jumps_and_numbers(made: Plan) -> None:
    program = [
        "#100 = 2 + 3 * 2 ^ 2 % 5",
        "IF [#100 >= 4 && [#100 != 3]] THEN #101 = 1 ELSE #101 = 2",
        "IF #101 == [1] THEN GOTO 20",
        "#101 = 99",
        "N20 ; here",
        "#102 = ABS[SIN[-30.]]",
        'M120 "b.txt"',
        'M223 "%.0f %.0f %.2f\\n" #100 #101 #102',
    ]
    assert run(program, made).lines == ["4 1 0.50"]


def test_its_settings_come_as_text_too(made: Plan) -> None:
    said = {"probe": "P:-15", "macros": "M19 M77", "inches": "true", "g54": "X:1.5", "axes": "X Y Z C B"}
    told = profile(language("centroid"), made.machine, said)
    assert told.probe == {"P": -15.0} and told.axes[3:] == ("C", "B")
    assert "M77" not in run(["M77"], made, macros=told.macros).alarm
