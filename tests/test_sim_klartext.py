"""The Klartext program on its simulated control, and the habits of that control."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support import controls
from support.controls import ACTIVE, Ran, assert_as_planned, far_away, golden, run_on, shifted, untouchable

from postprocessors.heidenhain import mask
from sim_controller.languages import Alarm, klartext
from sim_controller.languages.klartext.expressions import formula, text_of
from tango_cnc import commission
from tango_cnc.link.client import Ended
from tango_cnc.records import Artefact, InputError, Plan

MASK = ("TNC:\\TANGO.A", *mask())


@pytest.fixture(scope="module")
def made() -> Plan:
    return golden()


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("heidenhain", made, **options)


def run(
    lines: list[str],
    made: Plan,
    artefact: Artefact | None = None,
    fault: str | None = None,
    library: tuple[str, ...] = MASK,
    **profile: Any,
) -> Ran:
    """program, true artefact, a fault, masks on the control, what differs from the usual profile → what came of it."""
    known = replace(klartext.default_profile(made.machine), **(ACTIVE | profile))
    return run_on(
        lambda motion, punch, note: klartext.Control(motion, known, punch, note, library), lines, made, artefact, fault=fault
    )


def code(made: Plan, *blocks: str, **profile: Any) -> Ran:
    """Some blocks, run on a machine whose table is far away; Q9 and the like are printed by `show`."""
    lines = ["BEGIN PGM A MM", *blocks, "M30", "END PGM A MM"]
    return run([f"{i} {line}" for i, line in enumerate(lines)], made, far_away(made), **profile)


def show(*parameters: str) -> list[str]:
    shown = " || QS9 || ".join(f"TOCHAR ( DAT+{p} DECIMALS1 )" for p in parameters)
    return ['DECLARE STRING QS9 = " "', f"QS1 = {shown}", "FN 16: F-PRINT TNC:\\TANGO.A / TNC:\\OUT.TXT"]


# --- the program ---------------------------------------------------------------------------------------------------------


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("options", "profile"),
    [
        ({}, {}),
        ({"shortest": False}, {"rollover": ()}),
        ({"decimals": 3}, {"tool_lengths": {1: 5.0}}),
        ({}, {"mirrored": ("X", "Z"), "scale": 1.5}),
    ],
)
def test_every_touch_is_made_where_it_is_planned(made: Plan, options: dict[str, Any], profile: dict[str, Any]) -> None:
    """A datum, a tool length, and what a program before has left mirrored and scaled change nothing."""
    ran = run(lines_of(made, **options), made, **profile)
    assert ran.alarm is None, ran.alarm
    assert not ran.stops
    assert_as_planned(ran.records(made), made, "heidenhain", options)


def test_a_surface_that_is_not_there_is_a_miss_and_one_that_comes_too_soon_is_early(made: Plan) -> None:
    assert run(lines_of(made), made, shifted(made, "4", -8.0)).flags(made) == [1, 1, 1, 1, 1, 0]
    assert run(lines_of(made), made, shifted(made, "4", 7.0)).flags(made) == [1, 1, 1, 1, 1, 2]


def test_something_in_the_way_stops_with_a_text(made: Plan) -> None:
    """The top is 12 mm higher than everybody thinks: the way down to its stand-off is a guarded move."""
    ran = run(lines_of(made), made, shifted(made, "top", 12.0))
    assert ran.flags(made) == [1], "the touch before it is on record, this one is not"
    assert ran.stops == ["PROBE MET SOMETHING OR A FRAME IS ROTATED MIRRORED OR SCALED"]
    assert not isinstance(ran.records(made)[-1], Ended)


def test_a_probe_that_never_answers_stops_the_program_at_the_third_touch(made: Plan) -> None:
    ran = run(lines_of(made), made, untouchable(made))
    assert ran.flags(made) == [0, 0]
    assert ran.stops == ["NO CONTACT. IS THE PROBE ALIVE"]


def test_a_control_that_says_contact_where_there_was_none_is_found_by_the_step(made: Plan) -> None:
    ran = run(lines_of(made), made, no_contact="contact")
    assert ran.stops == ["CONTROL SAYS CONTACT WHERE NOTHING WAS MET"] and not ran.flags(made)
    judged = commission.judge(commission.Seen(made, {}, True, False, said=ran.stops[0]))
    blamed = [one for one in judged if one.verdict.verdict == "FAIL"]
    assert [one.experiment.belief for one in blamed] == ["miss"]


def test_a_control_that_makes_an_error_of_no_contact_stops_at_the_first_guarded_move(made: Plan) -> None:
    """Nothing is measured then, and nothing false either."""
    ran = run(lines_of(made), made, no_contact="error")
    assert "TOUCH POINT INACCESSIBLE" in str(ran.alarm)
    assert ran.flags(made) == []


def test_a_probe_that_stays_deflected_stops_before_the_next_move(made: Plan) -> None:
    ran = run(lines_of(made), made, fault="probe-stuck-after=2")
    assert ran.flags(made)[:1] == [1]
    assert "TOUCH PROBE IS DEFLECTED" in str(ran.alarm)


def test_a_basic_rotation_is_noticed_high_above_the_table(made: Plan) -> None:
    ran = run(lines_of(made), made, rotation={"C": 3.0})
    assert ran.flags(made) == []
    assert ran.stops == ["PROBE MET SOMETHING OR A FRAME IS ROTATED MIRRORED OR SCALED"]
    heights = [data["position"]["Z"] for event, data in ran.events if event == "skip"]
    assert min(heights) > 400


@pytest.mark.parametrize(
    ("cycle", "left"), [("8.1", {"mirrored": ("X",)}), ("8.1", {"mirrored": ("Z",)}), ("11.1", {"scale": 1.5})]
)
def test_without_its_cycle_what_is_left_is_noticed_before_anything_moves(made: Plan, cycle: str, left: dict[str, Any]) -> None:
    """As a control would do that reads cycle 8 or 11 otherwise than is assumed; a mirrored Z would go down in place of up."""
    ran = run([f"{line.split()[0]} ; AWAY" if f"DEF {cycle}" in line else line for line in lines_of(made)], made, **left)
    assert ran.stops == ["A SCALING OR MIRROR IMAGE IS ON. CYCLE 8 11 OR 26"]
    assert ran.flags(made) == [] and not ran.moves


def test_cycles_shift_mirror_turn_and_scale(made: Plan) -> None:
    read = ["FN 20: WAIT FOR SYNC", "FN 18: SYSREAD Q9 = ID240 NR8 IDX1", *show("Q9")]
    cycles = ["7.0 DATUM SHIFT", "7.1 X-50", "8.0 MIRROR IMAGE", "8.1 X", "11.0 SCALING", "11.1 SCL 2"]
    ran = code(made, *(f"CYCL DEF {cycle}" for cycle in cycles), "L X+10 Z+220 FMAX", *read, g54={}, tool_lengths={1: 0.0})
    assert ran.out == b"-70.0\r\n", ran.why


def test_results_in_another_frame_are_noticed_at_the_first_touch(made: Plan) -> None:
    work = [line.replace("REFERENCE SYSTEM: 1", "REFERENCE SYSTEM: 0") for line in lines_of(made)]
    ran = run(work, made)
    assert ran.flags(made) == []
    assert ran.stops == ["RESULT IS NOT IN MACHINE COORDINATES"]


def test_a_missing_mask_stops_before_anything_moves(made: Plan) -> None:
    ran = run(lines_of(made), made, library=())
    assert "FILE NOT FOUND" in str(ran.alarm)
    assert not ran.moves


@pytest.mark.few(0)
def test_the_short_way_needs_m126(made: Plan) -> None:
    """Whoever takes M126 out gets the same touches, the long way round."""
    long_way = [line.replace("M126", "M127") for line in lines_of(made)]
    assert run(long_way, made).flags(made) == run(lines_of(made), made).flags(made)


def test_blocks_are_numbered_from_0(made: Plan) -> None:
    lines = lines_of(made)
    assert [line.split(" ")[0] for line in lines] == [str(i) for i in range(len(lines))]
    assert lines[0] == "0 BEGIN PGM TANGO MM"
    assert lines[-1] == f"{len(lines) - 1} END PGM TANGO MM"


def test_angles_are_0_to_360_for_an_endless_axis_only(made: Plan) -> None:
    def turns(**options: Any) -> set[str]:
        return {line.partition(" ")[2] for line in lines_of(made, **options) if "FMAX M91" in line}

    assert {"L B-30.0000 R0 FMAX M91", "L C+270.0000 R0 FMAX M91"} <= turns()
    assert "L C-90.0000 R0 FMAX M91" in turns(shortest=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"output": "TNC:\\A.TXT\nM30"}, "a file such as"),
        ({"mask": "C:\\A.A"}, r"a file such as TNC:\\TANGO\.A"),
        ({"mask": "TNC:\\TANGO.H"}, r"controller\.mask: found .*; allowed: a file that ends in \.A"),
        ({"mask": "TNC:\\PLAN.CSV"}, r"controller\.mask: found .*; allowed: a file that ends in \.A"),
        ({"output": "TNC:\\tango.a"}, r"controller\.output: found .*; allowed: a file that is no mask"),
        ({"output": "TNC:\\TANGO.H"}, r"controller\.output: found .*; allowed: a file that is no mask"),
        ({"axis_numbers": {"X": 1}}, "a number 1 … 9 of its own"),
        ({"axis_numbers": {"X": 1, "Y": 2, "Z": 3, "B": 4, "C": 4}}, "a number 1 … 9 of its own"),
        ({"clamp": {"A": "M10"}}, "a word such as M10 for B, C"),
        ({"orient": False}, "true, as this strategy turns the spindle"),
        ({"positioning_feed": 0}, "controller.positioning_feed: found .*; allowed: 1 … 1000000"),
    ],
)
def test_options_that_do_not_fit_are_refused(made: Plan, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        lines_of(made, **options)


# --- the control ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3", 7),
        ("SQRT ( Q1 ^ 2 + Q2 ^ 2 )", 5),
        ("ABS ( Q1 - 10 )", 7),
        ("- Q1 + 5", 2),
        ("360 * INT ( 1.9 )", 360),
        ("( Q1 - +1.5 ) / 0.5", 3),
    ],
)
def test_formulas(text: str, value: float) -> None:
    assert formula(text, {1: 3.0, 2: 4.0}) == pytest.approx(value)


@pytest.mark.parametrize("text", ["", "1 +", "( 1", "Q7", "1 / 0", "SQRT - 1", "1 2", "1 ; 2", "( - 1 ) ^ 0.5"])
def test_what_is_no_formula(text: str) -> None:
    with pytest.raises(Alarm):
        formula(text, {})


def test_texts_are_joined() -> None:
    assert text_of("QS1 || TOCHAR ( DAT+Q1 DECIMALS0 ) || QS2", {1: 17.0}, {1: "P", 2: " X"}) == "P17 X"
    with pytest.raises(Alarm, match="NC BLOCK FAULTY"):  # characters stand in DECLARE STRING
        text_of('"P" || QS2', {}, {2: " X"})
    with pytest.raises(Alarm, match="STRING TOO LONG"):
        text_of("QS2 || QS2", {}, {2: "x" * 200})


@pytest.mark.parametrize(
    ("blocks", "text"),
    [
        (["X+10"], "NC BLOCK FAULTY"),
        (["L X+10.0"], "FEED RATE IS MISSING"),
        (["L A+10.0 FMAX"], "AXIS NOT THERE"),
        (["L X+9999.0 FMAX M91"], "LIMIT SWITCH"),
        (["CALL LBL 7"], "LABEL NUMBER NOT FOUND"),
        (["LBL 7", "LBL 7"], "LABEL NUMBER ALLOCATED TWICE"),
        (["LBL 7", "CALL LBL 7"], "TOO MANY SUBPROGRAMS"),
        (["FN 11: IF +1 LT +2 GOTO LBL 7"], "NC BLOCK FAULTY"),
        (["FN 18: SYSREAD Q1 = ID999 NR1 IDX1"], "SYSTEM DATUM NOT THERE"),
        (["TCH PROBE 4.0 MEASURING IN 3-D", "M19"], "NC BLOCK FAULTY"),
    ],
)
def test_what_the_control_does_not_take(made: Plan, blocks: list[str], text: str) -> None:
    assert text in str(code(made, *blocks).alarm)


@pytest.mark.parametrize("lines", [["1 BEGIN PGM A MM"], ["0 BEGIN PGM A MM", "1 END PGM B MM"], ["0 L X+1"], ["BEGIN PGM A MM"]])
def test_a_program_that_is_not_whole_is_not_begun(made: Plan, lines: list[str]) -> None:
    ran = run(lines, made)
    assert ran.alarm is not None
    assert not ran.moves


def test_system_data_are_as_old_as_the_last_sync(made: Plan) -> None:
    read = ["FN 18: SYSREAD Q9 = ID240 NR8 IDX1", *show("Q9")]
    home = code(made, *read).out
    moved = code(made, "L X+10.0 FMAX M91", *read, "FN 20: WAIT FOR SYNC", *read).out.splitlines()
    assert moved == [home.strip(), b"10.0"]


def test_machine_positions_need_m91(made: Plan) -> None:
    read = ["FN 20: WAIT FOR SYNC", "FN 18: SYSREAD Q9 = ID240 NR8 IDX3", "FN 18: SYSREAD Q8 = ID270 NR1 IDX3", *show("Q9", "Q8")]
    ran = code(made, "L Z+50.0 FMAX M91", *read, "L Z+50.0 FMAX", *read)
    assert ran.out.split() == [b"50.0", b"-350.2", b"450.2", b"50.0"]


@pytest.mark.parametrize(
    ("start", "target", "code_word", "moved"),
    [(350, 10, "M126", 20), (10, 340, "M126", -30), (350, 10, "M127", -340), (10, 340, "M127", 330)],
)
def test_the_manuals_example_of_m126(made: Plan, start: int, target: int, code_word: str, moved: float) -> None:
    ran = code(made, "M127", f"L C+{start}.0 FMAX M91", code_word, f"L C+{target}.0 FMAX M91")
    places = [data["position"]["C"] for event, data in ran.events if event == "rapid"]
    assert places[-1] - start == pytest.approx(moved)


def towards(way: str, system: int = 1) -> list[str]:
    """The four blocks of a probing move 15 mm along Z, results in Q41 …"""
    moved = f"TCH PROBE 4.2 IX+0 IY+0 IZ{way}"
    return [
        "TCH PROBE 4.0 MEASURING IN 3-D",
        "TCH PROBE 4.1 Q41",
        moved,
        f"TCH PROBE 4.3 DIST+15 F180 MB+0 REFERENCE SYSTEM: {system}",
    ]


def test_a_miss_is_minus_one_in_the_fourth_and_leaves_the_others_as_they_were(made: Plan) -> None:
    assert code(made, "Q41 = 7", *towards("-1"), *show("Q41", "Q44")).out.split() == [b"7.0", b"-1.0"]


@pytest.mark.parametrize(("system", "z"), [(1, b"303.0"), (0, b"-97.2")])
def test_a_contact_is_told_in_machine_or_in_work_coordinates(made: Plan, system: int, z: bytes) -> None:
    there = ["L X-20.0 Y+30.0 FMAX M91", "L Z+313.0 FMAX M91", *towards("-1", system), *show("Q43", "Q44")]
    blocks = ["BEGIN PGM A MM", *there, "M30", "END PGM A MM"]
    assert run([f"{i} {block}" for i, block in enumerate(blocks)], made).out.split() == [z, b"0.0"]


def test_a_whole_number_is_whole_millimetres(made: Plan) -> None:
    read = ["FN 20: WAIT FOR SYNC", "FN 18: SYSREAD Q9 = ID240 NR8 IDX1", *show("Q9")]
    assert code(made, "L X+10 FMAX M91", *read).out.split() == [b"10.0"]
