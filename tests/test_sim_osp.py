"""The Okuma program on its simulated control, and the habits of that control."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support import controls
from support.controls import ACTIVE, Ran, assert_as_planned, far_away, golden, run_on, shifted, untouchable

from sim_controller.languages import osp
from tango_cnc.records import Artefact, InputError, Plan


@pytest.fixture(scope="module")
def made() -> Plan:
    return golden()


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("okuma", made, **options)


def run(lines: list[str], made: Plan, artefact: Artefact | None = None, fault: str | None = None, **profile: Any) -> Ran:
    """program, true artefact, a fault, what differs from the usual profile → what came of it."""
    known = replace(osp.default_profile(made.machine), **(ACTIVE | profile))
    return run_on(lambda motion, punch, note: osp.Control(motion, known, punch, note), lines, made, artefact, fault=fault)


def code(made: Plan, *lines: str, **profile: Any) -> Ran:
    """Some lines, run on a machine whose table is far away."""
    return run(["OTEST", *lines, "M02"], made, far_away(made), **profile)


# --- the program ---------------------------------------------------------------------------------------------------------


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "profile"),
    [
        ({}, {}),
        ({}, {"miss": "end", "whole": "mm"}),
        ({"rollover": "never"}, {"rollover": ()}),
        ({"decimals": 4, "common": 192, "places": 12}, {"tool_lengths": {1: 5.0}}),
        ({"probe_state": "VDIN[11]"}, {}),
        ({"frame_check": False, "wait": "M331"}, {}),
    ],
)
def test_every_touch_is_made_where_it_is_planned(made: Plan, options: dict[str, Any], profile: dict[str, Any]) -> None:
    """Work offset and tool length that are active when it starts change nothing."""
    ran = run(lines_of(made, **options), made, **profile)
    assert ran.alarm is None
    assert_as_planned(ran.records(made), made, "okuma", options)
    assert ran.files["MD1:TANGO.TXT"].splitlines() == ran.out.decode().splitlines()


@pytest.mark.few(1)
@pytest.mark.parametrize("miss", ["keep", "end"])
def test_a_surface_that_is_not_there_is_a_miss_and_one_that_comes_too_soon_is_early(made: Plan, miss: str) -> None:
    """Whatever the contact variable holds after a move that met nothing."""
    assert run(lines_of(made), made, shifted(made, "4", -8.0), miss=miss).flags(made) == [1, 1, 1, 1, 1, 0]
    assert run(lines_of(made), made, shifted(made, "4", 7.0), miss=miss).flags(made) == [1, 1, 1, 1, 1, 2]


def test_something_in_the_way_stops_with_a_text(made: Plan) -> None:
    """The top is 12 mm higher than everybody thinks: the way down to its stand-off is a protected move."""
    ran = run(lines_of(made), made, shifted(made, "top", 12.0))
    assert ran.flags(made) == [1], "the touch before it is on record, this one is not"
    assert str(ran.alarm) == "VDOUT 992 2 CONTACT OR FRAME"


def test_a_probe_that_never_answers_stops_the_program_at_the_third_touch(made: Plan) -> None:
    ran = run(lines_of(made), made, untouchable(made))
    assert ran.flags(made) == [0, 0]
    assert "NO PROBE CONTACT" in str(ran.alarm)


def test_a_probe_that_stays_deflected_stops_the_next_move(made: Plan) -> None:
    """The skip move ends at once, which the move's own check sees; a variable of the probe, where there is one, is asked before."""
    ran = run(lines_of(made), made, fault="probe-stuck-after=2")
    assert ran.flags(made) == [1, 1]
    assert "CONTACT OR FRAME" in str(ran.alarm)
    asked = run(lines_of(made, probe_state="VDIN[11]"), made, fault="probe-stuck-after=2", deflected="ignore")
    assert asked.flags(made) == [1, 1]
    assert "PROBE DEFLECTED" in str(asked.alarm)


@pytest.mark.parametrize(
    ("profile", "text"),
    [
        ({"miss": "alarm"}, "no contact"),
        ({"wait": False}, "CONTACT OR FRAME"),
        ({"restart": True}, "START AT THE TOP"),
    ],
)
def test_a_control_that_is_another_than_thought_stops_at_once(made: Plan, profile: dict[str, Any], text: str) -> None:
    ran = run(lines_of(made, wait="M331"), made, **profile)
    assert text in str(ran.alarm)
    assert ran.flags(made) == []


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"contact": "VSKP?"}, "NO SUCH VARIABLE (VSKPX)"),
        ({"contact": "VSAP?"}, "NO SUCH VARIABLE (VSAPX)"),
        ({"position": "VAPB?"}, "NO SUCH VARIABLE (VAPBZ)"),
        ({"machine_frame": "G15 H1"}, "NOT IN FRAME H0"),
        ({"machine_frame": "G15 H1", "frame_check": False}, "CONTACT OR FRAME"),
        ({"reset": "G17 G21 G40 G69 G80 G90 G94"}, "CONTACT OR FRAME"),
    ],
)
def test_what_the_profile_has_wrong_is_noticed_high_above_the_table(made: Plan, options: dict[str, Any], text: str) -> None:
    ran = run(lines_of(made, **options), made, tool_lengths={1: 30.0})
    assert text in str(ran.alarm)
    assert ran.flags(made) == []
    assert sum(event == "skip" for event, _ in ran.events) <= 2, "the step, and the first protected move is the last one"


def test_contacts_in_another_frame_are_noticed_at_the_first_touch(made: Plan) -> None:
    ran = run(lines_of(made), made, contact_frame="work")
    assert ran.flags(made) == []
    assert "CONTACT MISFITS" in str(ran.alarm)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"contact": "VSAPX"}, "is the axis letter"),
        ({"position": "#5021"}, "is the axis letter"),
        ({"probe_state": "VDIN[11]]"}, "a variable such as VDIN"),
        ({"probe_state": "VDIN[1001]"}, "a timer of the control; allowed: an input"),
        ({"output": "MD1:X;A'"}, "a file such as MD1:TANGO.TXT"),
        ({"common": 195}, "1 … 192"),
        ({"skip": ""}, "a word such as G31"),
        ({"skip": "G0"}, "a word such as G31"),
        ({"skip": "G28"}, "a word such as G31"),
        ({"skip": "G91"}, "a word such as G31"),
        ({"wait": ""}, "words of the control"),
        ({"wait": "G0 Z-500"}, "move no axis"),
        ({"wait": "M30"}, "no M30, after which the program is over"),
        ({"machine_frame": "G15 H0 M2"}, "no M2, after which the program is over"),
        ({"machine_frame": "G15 H0 G0 X0"}, "move no axis"),
        ({"clamp": {"A": "M10"}}, "a word such as M10 for B, C"),
        ({"orient": ""}, "as this strategy turns the spindle"),
        ({"positioning_feed": 0}, "controller.positioning_feed: found .*; allowed: 1 … 1000000"),
        ({"alarm": 1}, "990, 991, 992, 993"),
    ],
)
def test_options_that_do_not_fit_are_refused(made: Plan, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        lines_of(made, **options)


# --- the control ---------------------------------------------------------------------------------------------------------


def printed(made: Plan, *lines: str, **profile: Any) -> list[str]:
    ran = code(made, "FWRITC MD1:A.TXT;A", *lines, **profile)
    assert ran.alarm is None, ran.alarm
    return ran.files["MD1:A.TXT"].splitlines()


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("1+2*3", 7),
        ("[1+2]*3", 9),
        ("ABS[-2.5]-SQRT[4]", 0.5),
        ("FIX[-2.7]+ROUND[2.5]", 1),
        ("-2*3", -6),
        ("1 LT 2 AND 2 NE 3", 1),
        ("VZOFX[1]", 11.5),
        ("VC50 EQ EMPTY", 1),
    ],
)
def test_expressions(made: Plan, expression: str, expected: float) -> None:
    assert float(printed(made, f"PUT {expression},12", "WRITE C")[0]) == expected


@pytest.mark.parametrize(
    ("lines", "kind"),
    [
        (["TGA=1/0"], "ARITHMETIC"),
        (["TGA=TGB+1"], "EMPTY"),
        (["TGA=VC201"], "VARIABLE"),
        (["TGA=VABC"], "VARIABLE"),
        (["VTOOL=1"], "VARIABLE"),
        (["TGA=[1+2"], "SYNTAX"),
        (["GOTO NX1"], "NAME"),
        (["CALL ONONE"], "NAME"),
        (["RTS"], "END"),
        (["PUT 'A'"], "FILE"),
        (["VUACM[1]='SEVENTEEN LETTERS'"], "TEXT"),
        (["G1 X1."], "FEED"),
        (["G777"], "G-CODE"),
        (["G20"], "UNIT"),
        (["G15 H9"], "OFFSET"),
        (["X1. Q3."], "WORD"),
        (["X"], "SYNTAX"),
        (["IF[1 EQ 1] THEN X1."], "SYNTAX"),
        (["G15 H0", "G53", "G0 X99999."], "OVERTRAVEL"),
    ],
)
def test_what_the_control_does_not_take(made: Plan, lines: list[str], kind: str) -> None:
    ran = code(made, *lines)
    assert ran.alarm is not None
    assert ran.alarm.code == f"OSP-{kind}"


def test_a_program_without_its_end_is_an_alarm_and_so_is_a_name_that_stands_twice(made: Plan) -> None:
    for lines in (
        ["OTEST", "NA", "GOTO NA"],
        ["OTEST", "G0"],
        ["OTEST", "NA", "NA", "M02"],
        ["OTEST", "M02", "OTEST", "RTS"],
        ["G0"],
    ):
        assert run(lines, made).alarm is not None


def test_variables_are_as_old_as_the_last_wait(made: Plan) -> None:
    show = ["PUT VAPAX,8", "WRITE C"]
    lines = ["G15 H0", "G0 X10.", "M331", "G0 X20.", *show, "M331", *show]
    assert [float(line) for line in printed(made, *lines)] == [10, 20]
    assert float(printed(made, "G15 H0", "G0 X10.", "M331", *show, wait=False)[0]) != 10


def test_h0_leaves_the_tool_length_in_and_g53_takes_it_out(made: Plan) -> None:
    show = ["M331", "PUT VAPAZ,8", "WRITE C"]
    lines = ["G15 H0", "G0 Z100.", *show, "G53", "G0 Z100.", *show, "G15 H1", "G0 Z100.", *show, "G16 H0 Z100.", *show]
    assert [float(line) for line in printed(made, *lines)] == [400, 100, 200.25, 100]


def test_a_whole_number_is_thousandths_unless_the_control_is_set_otherwise(made: Plan) -> None:
    lines = ["G15 H0", "G0 X100", "M331", "PUT VAPAX,8", "WRITE C"]
    assert float(printed(made, *lines)[0]) == 0.1
    assert float(printed(made, *lines, whole="mm")[0]) == 100


def test_digits_without_a_place_are_lost_without_a_word(made: Plan) -> None:
    assert printed(made, "PUT 12345.678,3", "PUT ,2", "PUT -1.5,8", "WRITE C") == ["346   -1.5000"]


def test_a_subprogram_has_variables_of_its_own(made: Plan) -> None:
    call = ["TGA=1", "CALL OSUB PX=TGA+4", "FWRITC MD1:A.TXT;A", "PUT TGA,1", "PUT VC1,2", "WRITE C", "M02"]
    ran = run(["OTEST", *call, "OSUB", "TGA=PX", "VC1=TGA", "RTS"], made)
    assert ran.files["MD1:A.TXT"] == "1 5\r\n"


@pytest.mark.parametrize(("signed", "moved"), [(False, -20.0), (True, 340.0)])
def test_axes_that_roll_over_turn_the_short_way_or_that_of_the_sign(made: Plan, signed: bool, moved: float) -> None:
    ran = code(made, "G15 H0", "G0 C10.", "G0 C350.", signed_direction=signed)
    places = [data["position"]["C"] for event, data in ran.events if event == "rapid"]
    assert places[-1] - 10 == pytest.approx(moved)
