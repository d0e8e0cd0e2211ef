"""The Centroid program on its simulated control, and the habits of that control."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support import controls
from support.controls import Ran, assert_as_it_happened, golden, run_on
from support.gates import ran

from postprocessors import load, program, settings
from sim_controller.languages import centroid
from sim_controller.session import language, profile
from tango_cnc import readback
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError, Plan, World


@pytest.fixture(scope="module")
def made() -> Plan:
    return golden()


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("centroid", made, **options)


def run(
    lines: list[str], made: Plan, world: World | None = None, fault: str | None = None, stuck: bool = False, **settings: Any
) -> Ran:
    """program, true machine, a fault, probe deflected at first, what differs from the usual profile → what came of it."""
    known = replace(centroid.default_profile(made.machine), **settings)
    return run_on(lambda motion, punch, note: centroid.Control(motion, known, punch, note), lines, made, None, world, fault, stuck)


# The program


def test_every_touch_is_recorded_where_it_happened(made: Plan) -> None:
    ran = run(lines_of(made), made)
    assert not ran.why and not ran.stops
    assert_as_it_happened(ran, made)


@pytest.mark.few(0)
def test_records_are_machine_coordinates_whatever_the_offset(made: Plan) -> None:
    assert run(lines_of(made), made, g54={"X": 11.5, "Y": -3.25, "Z": 100.25}).lines == run(lines_of(made), made).lines


def test_a_miss_and_an_early_contact_are_flagged(made: Plan) -> None:
    assert run(lines_of(made), made, World(facets={"4": -8.0})).flags(made)[-1] == 0
    assert run(lines_of(made), made, World(facets={"4": 7.0})).flags(made)[-1] == 2


def test_a_dead_probe_ends_it_in_words(made: Plan) -> None:
    world = World(facets={facet: -30.0 for facet in ("1", "top", "3", "4", "5")})
    ran = run(lines_of(made, misses=2), made, world)
    assert ran.stops == ["TANGO STOPPED. NO CONTACT. IS THE PROBE ALIVE"]
    assert ran.flags(made) == [0] and not ran.why


def test_contact_on_the_way_is_cancelled_by_the_control(made: Plan) -> None:
    ran = run(lines_of(made), made, World(facets={"top": 40.0}))
    assert "unexpected probe contact" in ran.why


def test_a_probe_that_is_on_lets_nothing_move(made: Plan) -> None:
    for wired in (15.0, -15.0, 50015.0):
        ran = run(lines_of(made), made, stuck=True, probe={"P": wired})
        assert ran.stops == ["TANGO STOPPED. PROBE IS DEFLECTED"] and not ran.moves


def test_a_probe_that_comes_on_between_touches_cancels_the_job(made: Plan) -> None:
    ran = run(lines_of(made), made, fault="bounce-after=2")
    assert "unexpected probe contact" in ran.why and ran.flags(made) == [1, 1]


def test_a_machine_in_inches_is_found_at_the_step(made: Plan) -> None:
    ran = run(lines_of(made), made, inches=True)
    assert ran.stops == ["TANGO STOPPED. POSITIONS ARE IN INCHES"]
    assert len([1 for event, _ in ran.events if event in ("skip", "contact", "rapid", "feed")]) == 1


def test_a_contact_that_is_not_stored_is_found(made: Plan) -> None:
    ran = run(lines_of(made), made, old_contact=True)
    assert ran.stops == ["TANGO STOPPED. PLACE OF THE CONTACT IS AN OLD ONE"] and ran.flags(made) == []


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
    assert complaint in run(["G21 G90", line], made).why


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
    assert "M77" not in run(["M77"], made, macros=told.macros).why


@pytest.mark.few(1)
@pytest.mark.parametrize(("on", "off"), [("M94 /1", "M95 /1"), ("M94/12", "M95/12")])
def test_an_output_of_the_plc_switches_the_probe(on: str, off: str) -> None:
    """A slash is no word of other profiles: at the beginning of a block it skips the block."""
    stated = {"probe_on": on, "probe_off": off}
    lines = list(program(load("centroid"), golden(), stated, plan_hash(golden()))[2]())
    assert not readback.check(lambda: iter(lines), golden(), settings(load("centroid"), stated), {}, written_in="centroid")
    found = ran("centroid", golden(), stated)
    switched = [data["code"] for event, data in found.events if event == "m" and "output" in data]
    assert not found.why and switched == [94, 95]


@pytest.mark.parametrize("word", ["M94 1", "M94"])
def test_an_output_without_its_slash_is_refused(word: str) -> None:
    """The header of the program has "E.G. M94 1", as no comment may have the slash: copied, it was taken."""
    with pytest.raises(InputError, match=r"controller\.probe_on: found 'M94.*allowed: e\.g\. M94 /1"):
        list(program(load("centroid"), golden(), {"probe_on": word}, plan_hash(golden()))[2]())


@pytest.mark.parametrize("word", ["/M94 1", "/1", "M5 /1", "M94 /1 M30", "M94 /1\nM30", "M94 /1/2", "M94 / 1"])
def test_no_other_slash_is_taken(word: str) -> None:
    with pytest.raises(InputError, match=r"controller\.probe_on"):
        settings(load("centroid"), {"probe_on": word})
