"""Cycle 444 of Heidenhain controls: the second of two touches, at the place where the cycle would go to by itself.

The simulated control keeps the habits that the program must live with: a frame of its own, a tool length, a calibration that
corrects results, a probe table that says how far and how fast, and an error where nothing is met.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.controls import ACTIVE, Ran, assert_as_planned, far_away, lines_of, run_on
from support.dialects import EXAMPLE, PRINTED, measured
from support.readback import bare, changed, read_back, refused, renumbered

from postprocessors import load, unverified
from postprocessors.heidenhain import mask
from sim_controller.languages import klartext
from sim_controller.simulate import simulate
from tango_cnc.files import read_cell, read_world
from tango_cnc.link.client import Ended
from tango_cnc.plan import plan
from tango_cnc.readback.languages.klartext import cycle_444
from tango_cnc.readback.twins import Twin
from tango_cnc.records import Cell, Find, InputError, Plan, World

GOLDEN = Path(__file__).parent / "golden"
FIND = Find(feed=800.0, retreat=8.5)  # of touches with standoff 10, search 5, feed 180
CYCLE = {"cycle": 444, "gate": "none"}
MASK = ("TNC:\\TANGO.A", *mask())
LINE = "RESULT IS NOT IN MACHINE COORDINATES"


def twice(cell: Cell, find: Find = FIND) -> Cell:
    """cell → the same with every facet touched twice."""
    return replace(cell, strategy=replace(cell.strategy, approach=replace(cell.strategy.approach, find=find)))


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(twice(read_cell(GOLDEN / "cell")))


def run(lines: list[str], made: Plan, world: World | None = None, **profile: Any) -> Ran:
    """program, true machine, what differs from the usual profile of the control → what came of it."""
    fault, stuck = profile.pop("fault", None), profile.pop("stuck", False)
    known = replace(klartext.default_profile(made.machine), **(ACTIVE | profile))
    return run_on(
        lambda motion, punch, note: klartext.Control(motion, known, punch, note, MASK), lines, made, None, world, fault, stuck
    )


def program_of(made: Plan, **options: Any) -> list[str]:
    return lines_of("heidenhain", made, **CYCLE, **options)


# The program


def test_the_program_is_the_golden_one(made: Plan) -> None:
    file, text = GOLDEN / "heidenhain" / "CYCLE444.H", "".join(f"{line}\n" for line in program_of(made))
    if os.environ.get("TANGO_GOLDEN") == "write":
        file.write_text(text, encoding="utf-8")
    assert text == file.read_text(encoding="utf-8")


def test_the_cycle_is_one_block_of_many_lines(made: Plan) -> None:
    lines = program_of(made)
    begun = next(i for i, line in enumerate(lines) if line.endswith("TCH PROBE 444 PROBING IN 3-D ~"))
    assert all(line.startswith("    Q") and line.endswith("~") for line in lines[begun + 1 : begun + 10])
    assert lines[begun + 10] == "    Q309=+0 ;ERROR REACTION"
    assert int(lines[begun + 11].split()[0]) == int(lines[begun].split()[0]) + 1


def test_what_nobody_has_confirmed_of_it_is_said_where_it_is_used(made: Plan) -> None:
    post = load("heidenhain")
    more = set(unverified(post, CYCLE)) - set(unverified(post, {}))
    assert any("ID350" in doubt for doubt in more) and any("Q115" in doubt for doubt in more)
    assert "ID350" in "".join(program_of(made)) and "ID350" not in "".join(lines_of("heidenhain", made))


def test_facets_that_are_touched_once_are_not_for_it() -> None:
    once = plan(read_cell(GOLDEN / "cell"))
    with pytest.raises(InputError, match=r"controller\.cycle: found 444 .* approach\.find in strategy\.yaml"):
        lines_of("heidenhain", once, **CYCLE)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cycle": 4444}, r"controller\.cycle: found 4444; allowed: 4, 444"),
        ({"cycle": "444"}, r"controller\.cycle: found '444'; allowed: 4, 444"),
        ({"cycle": 444, "misses": 1}, r"controller\.misses: found 1; allowed with cycle: 444: 2 … 20"),
    ],
)
def test_options_that_do_not_fit_are_refused(made: Plan, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        lines_of("heidenhain", made, **options)


# On the simulated control


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "profile"),
    [
        ({}, {}),
        ({"decimals": 3}, {"tool_lengths": {1: 5.0}, "g54": {}}),
        ({"axis_numbers": {"X": 1, "Y": 2, "Z": 3, "B": 5, "C": 6}}, {"probe_table": {"R": 2.9}}),
        ({"length_ends": "centre"}, {"length_ends": "centre"}),
        ({}, {"calibration": {"X": 0.04, "Y": -0.1, "Z": 0.2}}),
        ({}, {"mirrored": ("X", "Z"), "scale": 1.5}),
    ],
)
def test_every_touch_is_made_where_it_is_planned(made: Plan, options: dict[str, Any], profile: dict[str, Any]) -> None:
    """Frame, tool length, where that ends, the radius as calibrated and what else calibration knows change nothing."""
    ran = run(program_of(made, **options), made, **profile)
    assert ran.alarm is None and not ran.stops, ran.why
    assert_as_planned(ran.records(made), made, "heidenhain", CYCLE | options)


@pytest.mark.few(1)
@pytest.mark.parametrize("ends", ["pole", "centre"])
def test_the_cycle_goes_nowhere_by_itself_before_it_probes(made: Plan, ends: str) -> None:
    """What it does besides probing and coming back are ways of nothing."""
    ran = run(program_of(made, length_ends=ends), made, length_ends=ends)
    places = [(e, d["position"]) for e, d in ran.events if e in ("rapid", "feed", "skip", "contact")]
    for (_, before), (event, after) in pairwise(places):
        if event == "rapid":
            assert max(abs(after[name] - before[name]) for name in "XYZ") < 1e-3


@pytest.mark.few(0)
def test_the_readings_are_those_of_tch_probe_4() -> None:
    """On a machine with errors, to the last digit of a record or two."""
    whole = read_cell(EXAMPLE)
    some = [i for i in whole.strategy.indexations if len(i.facets) > 1][::8]
    cell = replace(whole, strategy=replace(whole.strategy, indexations=tuple(replace(i, facets=i.facets[::3]) for i in some)))
    world = replace(read_world(EXAMPLE / "world.yaml"), noise=0.0)
    once = measured(plan(cell), "heidenhain", world)
    double = measured(plan(twice(cell)), "heidenhain", world, CYCLE)
    true = simulate(cell.machine, cell.artefact, cell.strategy, world)
    assert set(double.status) == {"ok"} and double.facet == once.facet == true.facet
    assert np.abs(double.position - once.position).max() <= 2.5 * PRINTED
    assert np.abs(double.position - true.position).max() <= 2.5 * PRINTED


def test_a_facet_that_is_not_found_is_a_miss_without_a_second_touch(made: Plan) -> None:
    ran = run(program_of(made), made, World(facets={"4": -8.0}))
    assert ran.flags(made) == [1, 1, 1, 1, 1, 0]
    assert isinstance(ran.records(made)[-1], Ended)
    measuring = [data for event, data in ran.events if event == "block" and str(data["text"]).startswith("TCH PROBE 444")]
    assert len(measuring) == 5


@pytest.mark.few(3)
@pytest.mark.parametrize("program", ["pole", "centre"])
@pytest.mark.parametrize("facets", [{}, {"1": 4.9, "top": 4.9}, {"1": -4.9, "top": -4.9}])
def test_a_ball_one_radius_from_where_it_should_be_stops_without_meeting_anything(
    made: Plan, program: str, facets: dict[str, float]
) -> None:
    """The cycle goes by itself to where it takes the ball to be: up, down, or beside the line of the first touch, in rapid."""
    other = {"pole": "centre", "centre": "pole"}[program]
    ran = run(program_of(made, length_ends=program), made, World(facets=facets), length_ends=other)
    assert ran.flags(made) == []
    assert ran.stops == ["CYCLE 444 HAS LEFT THE LINE OF ITS TOUCH"]


def test_a_contact_before_the_search_zone_is_early_without_a_second_touch(made: Plan) -> None:
    ran = run(program_of(made), made, World(facets={"3": 7.0}))
    assert ran.flags(made) == [1, 1, 1, 1, 2, 1]
    assert sum(str(data["text"]).startswith("TCH PROBE 444") for event, data in ran.events if event == "block") == 5


def test_what_comes_nearer_than_the_second_touch_begins_stops_with_a_text(made: Plan) -> None:
    ran = run(program_of(made), made, World(facets={"4": 9.0}))
    assert ran.flags(made) == [1] * 5
    assert ran.stops == ["PROBE MET SOMETHING OR A FRAME IS ROTATED MIRRORED OR SCALED"]


def test_a_probe_that_never_answers_ends_it_at_the_third_touch(made: Plan) -> None:
    away = far_away(made).facets["far"]
    nothing = replace(made, artefact=replace(made.artefact, facets=dict.fromkeys(made.artefact.facets, away), balls={}))
    ran = run(program_of(made), nothing)
    assert ran.flags(made) == [0, 0]
    assert ran.stops == ["NO CONTACT. IS THE PROBE ALIVE"]


@pytest.mark.parametrize("table", [{"F": 200.0}, {"DIST": 14.0}, {"DIST": 13.0}, {"SET_UP": 9.0}, {"SET_UP": 2.0}, {"R": 6.0}])
def test_a_probe_table_that_says_something_else_stops_it_before_anything_moves(made: Plan, table: dict[str, float]) -> None:
    ran = run(program_of(made), made, probe_table=table)
    assert ran.stops == ["PROBE TABLE NEEDS F 180 DIST 13.5 SET UP 8.5 BALL RADIUS 3"]
    assert not ran.moves and not ran.out


@pytest.mark.parametrize("which", ["first", "locked", "corrected"])
def test_results_that_are_not_the_places_of_its_axes_are_noticed_at_the_first_touch(made: Plan, which: str) -> None:
    ran = run(program_of(made), made, q115=which, calibration={"X": 0.04, "Y": -0.12, "Z": 0.15})
    assert (ran.flags(made), ran.stops) == ([], [LINE])


def test_where_its_results_are_while_a_work_offset_acts() -> None:
    """The reader of programs has them in the frame of the program: 10 mm along X on the machine are 7 mm with a datum at 3."""
    machine = Twin("stop", "", {}, {"X": 10.0, "Y": -2.0, "Z": 5.0}, {"X": 3.0, "Y": 1.0, "Z": -200.0})
    cycle_444.contact(machine)
    assert machine.shared == {"Q115": 7.0, "Q116": -3.0, "Q117": 205.0}


def test_a_cycle_that_speaks_of_another_contact_than_its_axes_is_noticed(made: Plan) -> None:
    ran = run(program_of(made), made, calibration={"X": 0.8})
    assert (ran.flags(made), ran.stops) == ([], ["CYCLE 444 AND ITS AXES DISAGREE"])


def test_a_probe_that_dies_between_the_two_touches_is_an_error_of_the_control(made: Plan) -> None:
    """And nothing of it is on record."""
    text = changed(bare("heidenhain", made, **CYCLE), "    Q320=+0", "    Q320=+60")
    ran = run(renumbered(text), made)
    assert "TOUCH POINT INACCESSIBLE" in ran.why
    assert ran.flags(made) == []


@pytest.mark.parametrize("how", [{"stuck": True}, {"fault": "probe-stuck-after=1"}, {"fault": "probe-stuck-after=2"}])
def test_a_probe_that_stays_deflected_stops_it(made: Plan, how: dict[str, Any]) -> None:
    ran = run(program_of(made), made, **how)
    assert "TOUCH PROBE IS DEFLECTED" in ran.why
    assert len(ran.flags(made)) < 2


@pytest.mark.few(5)
@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('QS400="0"', 'QS400="0.1-0.1"', "TOLERANCE BAND NOT SIMULATED"),
        ("    Q260=+Q63 ;CLEARANCE HEIGHT ~\n", "", "NC BLOCK FAULTY"),
        ("Q309=+0 ;ERROR REACTION", "Q309=+0 ;ERROR REACTION ~", "BLOCK NUMBER FAULTY"),
        (
            "TCH PROBE 444",
            "CYCL DEF 8.0 MIRROR IMAGE\nCYCL DEF 8.1 Y\nTCH PROBE 444",
            "CYCLE NOT ALLOWED WITH MIRROR IMAGE OR SCALING",
        ),
    ],
)
def test_what_the_control_does_not_take(made: Plan, old: str, new: str, text: str) -> None:
    assert text in run(renumbered(changed(bare("heidenhain", made, **CYCLE), old, new)), made).why


# What is read back


def test_what_the_post_writes_passes(made: Plan) -> None:
    for options in (CYCLE, CYCLE | {"decimals": 3, "misses": 5, "shortest": False}):
        assert read_back(lines_of("heidenhain", made, **options), made, "heidenhain", **options)


@pytest.mark.few(9)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("    Q320=+0", "    Q320=+Q74", "TCH PROBE"),
        ("    Q260=+Q63", "    Q260=+Q69", "cycle 444 goes somewhere by itself"),
        ("    Q263=+Q67", "    Q263=+Q61", "cycle 444 goes somewhere by itself"),
        ("    Q581=+Q64", "    Q581=+Q65", "cycle 444 goes somewhere by itself|the normal"),
        ("Q64 = ( 0 - Q31 ) / Q34", "Q64 = ( 0 - Q31 )", "the normal of cycle 444"),
        ("Q61 = ID270 NR1", "Q61 = ID240 NR8", "cycle 444 goes somewhere by itself"),
        ('    QS400="0"', '    QS400="0.1"', "TCH PROBE"),
        ("Q115 = 99999\n", "", "stops the program though"),
        ("Q115 = 99999\nQ116", "Q115 = 20000\nQ116", "stops the program though"),
        ("Q71 = Q41 - Q115\n", "", "Q71 is read before|X .*; the machine was at"),
        ("Q42 = Q116 + Q72", "Q42 = Q116 + Q71", "stops the program though|the machine was at"),
        ("+ Q164 )", ")", "has left Q164|another contact"),
        ("FN 10: IF +Q46 NE +1 GOTO LBL 51\n", "", "left out where nothing"),
        ("FN 10: IF +Q46 NE +1 GOTO LBL 51", "FN 12: IF +Q46 LT +1 GOTO LBL 51", "left out where nothing"),
        ("CALL LBL 5\n", "CALL LBL 2\n", "a call of label 2"),
        ("Q164 = 99999\n", "", "nobody would know"),
        ("FN 18: SYSREAD Q74 = ID350 NR55 IDX2\n", "", "Q74 is read before|nothing has looked at F"),
        ("Q35 = ABS ( Q74 - 13.5000 )", "Q35 = ABS ( Q74 - 13.0000 )", "stops the program though"),
        ("Q35 = ABS ( Q74 - 8.5000 )", "Q35 = 0", "SET_UP of the probe table"),
        ("Q35 = ABS ( Q74 - 180.0000 )\nFN 11: IF +Q35 GT +0.0010 GOTO LBL 95\n", "", "F of the probe table"),
        ("Q74 = ID350 NR56 IDX2", "Q74 = ID350 NR57 IDX2", "one of the numbers that are known"),
        ("\nLBL 42\n", "\nLBL 42\nQ74 = 9\n", "Q74 is the radius of the ball"),
        ("\nLBL 42\n", "\nLBL 42\nQ71 = Q71 + 5\n", "the machine was at|stops the program though"),
        ("\nLBL 51\n", "\nLBL 51\nQ47 = 0\n", "the program goes on after 3 touches in a row"),
        ("Q47 = Q47 + 1\n", "Q47 = Q47 + 0.5\n", "the program goes on after 3 touches in a row"),
        ("MB+1.5000", "MB+500.0000", "found MB 500 after a measuring move; allowed: 1.5 mm off the facet"),
        ("GT +0.0100 GOTO LBL 93", "GT +1.0000 GOTO LBL 93", "cycle 444 has corrected its contact"),
    ],
)
def test_what_is_dangerous_is_named(made: Plan, old: str, new: str, words: str) -> None:
    told = refused(renumbered(changed(bare("heidenhain", made, **CYCLE), old, new)), "heidenhain", made, **CYCLE)
    assert re.search(words, told) and bool(told) == bool(words), told
