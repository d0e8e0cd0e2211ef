"""The Fagor program on its simulated control, and the habits of that control."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from typing import Any

import pytest
from support import controls
from support.controls import ACTIVE, Ran, assert_as_planned, far_away, golden, run_on, shifted, untouchable

from postprocessors import load, settings
from sim_controller.languages import fagor
from tango_cnc.readback import check
from tango_cnc.records import Artefact, InputError, Plan

FILE = "C:\\CNC8070\\USERS\\PRG\\TANGO.TXT"


@pytest.fixture(scope="module")
def made() -> Plan:
    return golden()


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("fagor", made, **options)


def run(lines: list[str], made: Plan, artefact: Artefact | None = None, fault: str | None = None, **profile: Any) -> Ran:
    """program, true artefact, a fault, what differs from the usual profile → what came of it."""
    known = replace(fagor.default_profile(made.machine), **(ACTIVE | profile))
    return run_on(lambda motion, punch, note: fagor.Control(motion, known, punch, note), lines, made, artefact, fault=fault)


def code(made: Plan, *lines: str, **profile: Any) -> Ran:
    """Some lines, run on a machine whose table is far away."""
    return run(["%TEST", *lines, "M30"], made, far_away(made), **profile)


# --- the program ---------------------------------------------------------------------------------------------------------


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "profile"),
    [
        ({}, {"transformation": True}),
        ({}, {"base_offset": {"X": 3.0, "Y": -7.0, "Z": 12.5}}),
        ({"contact": "V.A.MEAS", "contact_frame": "machine"}, {"base_offset": {"Z": 12.5}}),
        ({"rollover": "never", "met": ""}, {"rollover": (), "status": "never"}),
        ({"decimals": 4, "probe_state": "", "probe_input": 2}, {"deflected": "ends", "probe_input": 2}),
        ({"programmed_position": "V.A.PPOS"}, {"measured": "named"}),
    ],
)
def test_every_touch_is_made_where_it_is_planned(made: Plan, options: dict[str, Any], profile: dict[str, Any]) -> None:
    """Zero offset, tool offset, RTCP and an offset that G53 leaves in change nothing."""
    ran = run(lines_of(made, **options), made, **profile)
    assert ran.alarm is None
    assert_as_planned(ran.records(made), made, "fagor", options)
    assert ran.files[FILE].splitlines() == ran.out.decode().splitlines()


def test_positions_that_come_in_whole_thousandths_are_no_changed_work_offset(made: Plan) -> None:
    """Three differences of rounded positions are summed: each may be one count off."""
    ran = run(lines_of(made), made, rounded=Decimal("0.001"), base_offset={"X": 11.5004, "Y": -3.2496, "Z": 100.2504})
    assert ran.alarm is None and ran.flags(made) == [1] * len(made.touches)


@pytest.mark.few(1)
@pytest.mark.parametrize("status", ["tells", "never"])
def test_a_surface_that_is_not_there_is_a_miss_and_one_that_comes_too_soon_is_early(made: Plan, status: str) -> None:
    """MEASOK tells it, and the distance to the target besides."""
    options = {"met": ""} if status == "never" else {}
    assert run(lines_of(made, **options), made, shifted(made, "4", -8.0), status=status).flags(made) == [1, 1, 1, 1, 1, 0]
    assert run(lines_of(made, **options), made, shifted(made, "4", 7.0), status=status).flags(made) == [1, 1, 1, 1, 1, 2]


def test_something_in_the_way_stops_with_a_text(made: Plan) -> None:
    """The top is 12 mm higher than everybody thinks: the way down to its stand-off is a protected move."""
    ran = run(lines_of(made), made, shifted(made, "top", 12.0))
    assert ran.flags(made) == [1], "the touch before it is on record, this one is not"
    assert "TANGO PROBE MET SOMETHING ON ITS WAY" in str(ran.alarm)


def test_a_probe_that_never_answers_stops_the_program_at_the_third_touch(made: Plan) -> None:
    ran = run(lines_of(made), made, untouchable(made))
    assert ran.flags(made) == [0, 0]
    assert "NO CONTACT. IS THE PROBE ALIVE" in str(ran.alarm)


@pytest.mark.few(1)
@pytest.mark.parametrize("deflected", ["alarm", "ends", "ignore"])
def test_a_probe_that_stays_deflected_stops_before_the_next_move(made: Plan, deflected: str) -> None:
    ran = run(lines_of(made), made, fault="probe-stuck-after=2", deflected=deflected)
    assert ran.flags(made) == [1, 1]
    assert "PROBE IS DEFLECTED" in str(ran.alarm)
    if deflected != "ignore":
        silent = run(lines_of(made, probe_state=""), made, fault="probe-stuck-after=2", deflected=deflected)
        assert silent.flags(made) == [1, 1]
        assert ("deflected" if deflected == "alarm" else "MET SOMETHING") in str(silent.alarm)


@pytest.mark.parametrize(
    ("options", "profile", "text"),
    [
        ({}, {"miss": "alarm"}, "no contact"),
        ({}, {"status": "sticks"}, "CONTROL SAYS CONTACT WHERE NOTHING WAS MET"),
        ({}, {"waits": False}, "MET SOMETHING ON ITS WAY OR A FRAME IS ACTIVE"),
        ({"contact": "V.A.MEASURE"}, {}, "V.A.MEASURE.X"),
        ({"machine_position": "V.A.MPOS"}, {}, "V.A.MPOS.X"),
    ],
)
def test_a_control_that_is_another_than_thought_stops_before_a_record(
    made: Plan, options: dict[str, Any], profile: dict[str, Any], text: str
) -> None:
    ran = run(lines_of(made, **options), made, **profile)
    assert text in str(ran.alarm)
    assert ran.flags(made) == []


def test_contacts_in_another_frame_are_noticed_at_the_first_touch(made: Plan) -> None:
    ran = run(lines_of(made, contact="V.A.MEAS"), made, base_offset={"X": 3.0})
    assert ran.flags(made) == []
    assert "CONTACT DOES NOT FIT" in str(ran.alarm)


def test_a_contact_variable_of_the_named_axes_only_is_read_for_those(made: Plan) -> None:
    """X Y Z stand in every G100, so that all of them are measured."""
    assert all(set("XYZ") <= set(line) for line in lines_of(made) if line.startswith("G100") and "F180" in line)


def test_a_line_of_too_many_numbers_stops_at_the_first_record(made: Plan) -> None:
    ran = run(lines_of(made), made, identifiers=4)
    assert ran.flags(made) == []
    assert "IDENTIFIERS" in str(ran.alarm)


def test_a_write_takes_five_identifiers_and_a_record_has_no_more(made: Plan) -> None:
    six = code(made, '#OPEN ["C:\\A.TXT","A"]', "P1=1", f'#WRITE ["{"%D" * 6}"{",P1" * 6}]')
    assert "IDENTIFIERS" in str(six.alarm)
    assert {line.count("%D") for line in lines_of(made) if line.startswith('#WRITE ["P')} == {5}


def test_a_touch_that_would_write_no_line_or_two_is_refused(made: Plan) -> None:
    text = "\n".join(lines_of(made))
    for old, new in (("$IF P4==0\n#WRITE", "$IF P4==1\n#WRITE"), ("$IF P4==2\n#WRITE", "$IF P4>0\n#WRITE")):
        wrong = text.replace(old, new).splitlines()
        with pytest.raises(InputError, match=r"two lines are written of one touch"):
            check(lambda wrong=wrong: iter(wrong), made, settings(load("fagor"), {}), {})
    wrong = text.replace("$IF P4==0\n#WRITE", "$IF P4==7\n#WRITE").splitlines()
    with pytest.raises(InputError, match="is read before it has a value"):
        check(lambda: iter(wrong), made, settings(load("fagor"), {}), {})
    wrong = text.replace("H0 X", "H2 X").splitlines()
    with pytest.raises(InputError, match="the flag is 2 where"):
        check(lambda: iter(wrong), made, settings(load("fagor"), {}), {})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"contact": "V.A.MEAS.X"}, "without its letter"),
        ({"met": "MEASOK"}, "without its letter"),
        ({"probe_state": "V.G.PRBST1]"}, "a variable such as V.G.PRBST1"),
        ({"output": 'C:\\A"]'}, "a file such as"),
        ({"conversion": "F4"}, "a letter, or .4F"),
        ({"clamp": {"A": "M10"}}, "a word such as M10 for B, C"),
        ({"orient": ""}, "as this strategy turns the spindle"),
        ({"positioning_feed": 0}, "controller.positioning_feed: found .*; allowed: 1 … 1000000"),
        ({"contact_frame": "work"}, "programmed, machine"),
    ],
)
def test_options_that_do_not_fit_are_refused(made: Plan, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        lines_of(made, **options)


# --- the control ---------------------------------------------------------------------------------------------------------


def printed(made: Plan, *lines: str, **profile: Any) -> list[str]:
    ran = code(made, '#OPEN ["C:\\A.TXT","A"]', *lines, **profile)
    assert ran.alarm is None, ran.alarm
    return ran.files["C:\\A.TXT"].splitlines()


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("1+2*3", 7),
        ("[1+2]*3", 9),
        ("ABS[-2.5]-SQRT[4]", 0.5),
        ("FIX[-2.7]+ROUND[2.5]", 1),
        ("-2*3", -6),
        ("[1<2]&[2!=3]", 1),
        ("P[1+1]", 5),
    ],
)
def test_expressions(made: Plan, expression: str, expected: float) -> None:
    assert float(printed(made, "P2=5", f"P3={expression}", '#WRITE ["%D",P3]')[0]) == expected


@pytest.mark.parametrize(
    ("lines", "kind"),
    [
        (["P1=1/0"], "ARITHMETIC"),
        (["P1=P2+1"], "EMPTY"),
        (["P26=1"], "PARAMETER"),
        (["P1=V.A.POS.Q"], "VARIABLE"),
        (["P1=[1+2"], "SYNTAX"),
        (["$IF 1==1"], "STRUCTURE"),
        (["$ENDIF"], "STRUCTURE"),
        (["$GOTO 1"], "STRUCTURE"),
        (['#WRITE ["A"]'], "FILE"),
        (['#OPEN ["C:\\A.TXT"]', '#WRITE ["%D"]'], "FORMAT"),
        (["#TCP OFF"], "STATEMENT"),
        (["G1 X1."], "FEED"),
        (["G777"], "G-CODE"),
        (["G70"], "G-CODE"),
        (["D7"], "OFFSET"),
        (["X1. Q3."], "AXIS"),
        (["X"], "SYNTAX"),
        (["G53", "D0", "G0 X99999."], "OVERTRAVEL"),
    ],
)
def test_what_the_control_does_not_take(made: Plan, lines: list[str], kind: str) -> None:
    ran = code(made, *lines)
    assert ran.alarm is not None
    assert ran.alarm.code == f"CNC-{kind}"


def test_a_program_without_header_or_end_is_an_alarm(made: Plan) -> None:
    for lines in (["G0", "M30"], ["%TEST", "G0"]):
        assert run(lines, made).alarm is not None


def test_g53_takes_the_zero_offset_out_and_d0_the_tool(made: Plan) -> None:
    show = '#WRITE ["%D",V.A.POS.Z]'
    lines = ["G0 Z50.", show, "G53", "G0 Z50.", show, "D0", "G0 Z50.", show, "G54", "G0 Z50.", show]
    assert [float(line) for line in printed(made, *lines)] == [450.25, 350, 50, 150.25]


def test_mcs_is_for_one_block_and_mcs_on_for_all(made: Plan) -> None:
    show = '#WRITE ["%D",V.A.POS.X]'
    lines = ["#MCS G0 X50.", show, "G0 X50.", show, "#MCS ON", "G0 X50.", show, "#MCS OFF", "G0 X50.", show]
    assert [float(line) for line in printed(made, *lines)] == [50, 61.5, 50, 61.5]


def test_a_miss_says_nothing_but_measok(made: Plan) -> None:
    show = '#WRITE ["%D %D",V.A.MEASOK.X,V.A.MEAS.X]'
    assert printed(made, "G53", "D0", "G100 X10. F1000.", show) == ["0.0000 0.0000"]


def test_a_whole_number_is_whole_millimetres_and_brackets_hold_expressions(made: Plan) -> None:
    show = '#WRITE ["%D %D",V.A.POS.X,V.A.POS.Y]'
    assert printed(made, "G53", "D0", "P1=5", "G0 X100 Y[-P1*2]", show) == ["100.0000 -10.0000"]


@pytest.mark.parametrize(("signed", "moved"), [(False, -20.0), (True, 340.0)])
def test_axes_that_roll_over_turn_the_short_way_or_that_of_the_sign(made: Plan, signed: bool, moved: float) -> None:
    ran = code(made, "#MCS G0 C10.", "#MCS G0 C350.", signed_direction=signed)
    places = [data["position"]["C"] for event, data in ran.events if event == "rapid"]
    assert places[-1] - 10 == pytest.approx(moved)
