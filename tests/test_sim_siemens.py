"""The Siemens program on its simulated control, and the habits of that control."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support import controls
from support.controls import ACTIVE, Ran, assert_as_planned, far_away, golden, run_on, shifted, untouchable
from support.gates import ran as gated

from postprocessors import load
from postprocessors import settings as settings_of
from sim_controller.languages import siemens
from sim_controller.languages.siemens.expressions import Reader
from tango_cnc.link.client import Ended
from tango_cnc.records import Artefact, InputError, Plan


@pytest.fixture(scope="module")
def made() -> Plan:
    return golden()


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("siemens", made, **options)


def run(lines: list[str], made: Plan, artefact: Artefact | None = None, fault: str | None = None, **profile: Any) -> Ran:
    """program, true artefact, a fault, what differs from the usual profile → what came of it."""
    known = replace(siemens.default_profile(made.machine), **(ACTIVE | profile))
    return run_on(lambda motion, punch, note: siemens.Control(motion, known, punch, note), lines, made, artefact, fault=fault)


def code(made: Plan, *lines: str, **profile: Any) -> Ran:
    """Some lines, run on a machine whose table is far away."""
    return run([*lines, "M30"], made, far_away(made), **profile)


# --- the program ---------------------------------------------------------------------------------------------------------


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "profile"),
    [
        ({}, {}),
        ({}, {"transformation": True}),
        ({"rotary": "AC"}, {"rollover": ()}),
        ({"decimals": 4}, {"tool_lengths": {1: 5.0}}),
        ({"probe_state": False}, {}),
    ],
)
def test_every_touch_is_made_where_it_is_planned(made: Plan, options: dict[str, Any], profile: dict[str, Any]) -> None:
    """Frames, tool length and a transformation that are active when it starts change nothing."""
    ran = run(lines_of(made, **options), made, **profile)
    assert ran.alarm is None
    assert_as_planned(ran.records(made), made, "siemens", options)


def test_records_in_a_file_of_the_control_are_the_same_lines(made: Plan) -> None:
    """A device gets its line feeds from the program, a file from the control: neither has none or two."""
    device = run(lines_of(made), made).out.decode()
    assert device.count("\n") == len(made.touches) + 2
    ran = run(lines_of(made, output="_N_TANGO_MPF"), made)
    assert ran.out == b""
    assert ran.files["_N_TANGO_MPF"].splitlines()[1:-1] == device.splitlines()[1:-1], "but for the marks"


def test_a_surface_that_is_not_there_is_a_miss_and_one_that_comes_too_soon_is_early(made: Plan) -> None:
    assert run(lines_of(made), made, shifted(made, "4", -8.0)).flags(made) == [1, 1, 1, 1, 1, 0]
    assert run(lines_of(made), made, shifted(made, "4", 7.0)).flags(made) == [1, 1, 1, 1, 1, 2]


def test_the_header_counts_the_alarms_that_the_program_has(made: Plan) -> None:
    lines = lines_of(made)
    alarms = [int(found[1]) for line in lines if (found := re.fullmatch(r"SETAL\((\d+)\)", line))]
    assert alarms == [*range(alarms[0], alarms[0] + len(alarms))]
    said = next(line for line in lines if "SETAL ALARMS" in line)
    assert f" {alarms[0]} FIRST OF {len(alarms)} SETAL ALARMS" in said, said


@pytest.mark.parametrize("alarm", [65001, 0])
def test_something_in_the_way_stops_with_a_text(made: Plan, alarm: int) -> None:
    """The top is 12 mm higher than everybody thinks: the way down to its stand-off is a protected move."""
    ran = run(lines_of(made, alarm=alarm), made, shifted(made, "top", 12.0))
    assert ran.flags(made) == [1], "the touch before it is on record, this one is not"
    messages = [data["text"] for event, data in ran.events if event == "message"]
    assert messages[-1:] == ["TANGO PROBE MET SOMETHING ON ITS WAY OR A FRAME IS ACTIVE"]
    if alarm:
        assert ran.alarm is not None
        assert ran.alarm.code == "65002"
    else:
        assert ran.alarm is None
        assert [data["why"] for event, data in ran.events if event == "stop"] == ["M0"]
        assert not isinstance(ran.records(made)[-1], Ended)


def test_a_probe_that_never_answers_stops_the_program_at_the_third_touch(made: Plan) -> None:
    ran = run(lines_of(made), made, untouchable(made))
    assert ran.flags(made) == [0, 0]
    assert "NO CONTACT. IS THE PROBE ALIVE" in str(ran.alarm)


@pytest.mark.few(1)
@pytest.mark.parametrize("deflected", ["alarm", "ignore"])
def test_a_probe_that_stays_deflected_stops_before_the_next_move(made: Plan, deflected: str) -> None:
    """Such a probe has no edge to give: no protected move would be protected."""
    ran = run(lines_of(made), made, fault="probe-stuck-after=2", deflected=deflected)
    assert ran.flags(made) == [1, 1]
    assert "PROBE IS DEFLECTED" in str(ran.alarm)
    silent = run(lines_of(made, probe_state=False), made, fault="probe-stuck-after=2")
    assert "21700" in str(silent.alarm), "without $A_PROBE it is the control's own alarm"


def test_a_device_that_is_not_there_stops_before_anything_moves(made: Plan) -> None:
    ran = run(lines_of(made, output="/dev/ext/9"), made)
    assert "RECORD COULD NOT BE WRITTEN ERROR 16" in str(ran.alarm)
    assert not any(event in ("feed", "rapid", "skip") for event, _ in ran.events)


def test_a_file_that_is_full_stops_the_program(made: Plan) -> None:
    ran = run(lines_of(made, output="_N_TANGO_MPF"), made, room=150)
    assert "RECORD COULD NOT BE WRITTEN ERROR 10" in str(ran.alarm)


def still(ran: Ran) -> bool:
    """→ whether the program has moved no axis."""
    return not any(event in ("rapid", "feed", "skip", "touch", "miss") for event, _ in ran.events)


def test_a_transformation_that_is_not_switched_off_is_noticed_before_anything_moves(made: Plan) -> None:
    ran = run(lines_of(made, trafoof=False), made, transformation=True)
    assert still(ran) and "TRANSFORMATION WORK OFFSET OR FRAME IS ON" in str(ran.alarm)
    unasked = run(lines_of(made, trafoof=False, frame_check=False), made, transformation=True)
    assert not unasked.flags(made) and unasked.alarm is not None


LOW = {"Z": -401.0}  # mm of a basic frame: without SUPA the first move, up, goes down by it


LEFT = [
    {"basic": LOW},
    {"basic": {"X": 0.5}},
    {"basic": {"C": 30.0}},
    {"drf": LOW},
    {"inches": True},
    {"inches": True, "basic": LOW},
]


@pytest.mark.parametrize("profile", LEFT, ids=str)
@pytest.mark.parametrize("supa", [True, False])
def test_a_frame_that_is_left_and_inches_are_noticed_before_anything_moves(made: Plan, profile: dict[str, Any], supa: bool) -> None:
    """A dead probe would not stop what goes down by a frame."""
    ran = run(lines_of(made), made, supa_with_meas=supa, **profile)
    assert still(ran) and ("INCHES" if "inches" in profile else "FRAME IS ON") in str(ran.alarm)


def test_where_a_basic_frame_has_to_stay_supa_takes_it_away(made: Plan) -> None:
    stated = {"frame_check": False}
    ran = run(lines_of(made, **stated), made, basic=LOW)
    assert ran.alarm is None
    assert_as_planned(ran.records(made), made, "siemens", stated)


@pytest.mark.parametrize("off", [-401.0, -20.0, 5.0, 0.1])
def test_what_no_frame_shows_and_supa_should_take_away_is_noticed_by_the_step(made: Plan, off: float) -> None:
    """The step is slow, and a dead probe goes as far as what nobody sees: whoever stands there presses feed hold."""
    ran = run(lines_of(made), made, supa_with_meas=False, overlaid={"Z": off})
    moves = [data for event, data in ran.events if event == "block" and "MEAS=" in data["text"]]
    assert not ran.flags(made) and (ran.alarm is not None) and len(moves) == 1 and "F60." in moves[0]["text"]


def test_a_control_that_wants_names_of_machine_axes_says_so_before_anything_moves(made: Plan) -> None:
    named = {"X": "X1", "Y": "Y1", "Z": "Z1", "B": "MB", "C": "MC"}
    refused = run(lines_of(made), made, machine_axes=named)
    assert still(refused) and "12550" in str(refused.alarm) and not refused.out
    assert run(lines_of(made, machine_axes=named), made, machine_axes=named).alarm is None
    with pytest.raises(InputError, match="machine_axes: found 'Q'"):
        lines_of(made, machine_axes={"Q": "X1"})
    with pytest.raises(InputError, match="machine_axes: found 'X': 'x 1'"):
        lines_of(made, machine_axes={"X": "x 1"})
    with pytest.raises(InputError, match="machine_axes: found 'Y' for two axes"):
        lines_of(made, machine_axes={"X": "Y"})


def test_a_clamped_axis_is_noticed_by_its_encoder_and_not_by_where_it_was_sent(made: Plan) -> None:
    assert "ROTARY AXIS NOT IN PLACE" in gated("siemens", made, slack={"B": 1.0}).why
    assert "ROTARY AXIS NOT IN PLACE" not in gated("siemens", made, {"rotary_position": "$AA_IM"}, slack={"B": 1.0}).why


def test_a_state_that_is_always_1_stops_the_program_at_the_step(made: Plan) -> None:
    ran = run(lines_of(made), made, status=False)
    assert ran.flags(made) == []
    assert "CONTROL SAYS CONTACT WHERE NOTHING WAS MET" in str(ran.alarm)


def test_endless_axes_turn_the_short_way_and_others_as_planned(made: Plan) -> None:
    turns = [line for line in lines_of(made) if line.startswith("SUPA D0 G0")]
    assert turns[0].startswith("SUPA D0 G0 B=AC(")
    assert {"SUPA D0 G0 B=AC(-30.)", "SUPA D0 G0 B=AC(0.)", "SUPA D0 G0 C=DC(0.)"} <= set(turns)
    assert "SUPA D0 G0 C=DC(270.)" in turns
    assert "SUPA D0 G0 C=AC(-90.)" in lines_of(made, rotary="AC")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"output": "/dev/ext/1\nM30"}, "a device /dev/… or a file"),
        ({"output": 'x",1)'}, "a device /dev/… or a file"),
        ({"alarm": 61000}, "0, or 65000"),
        ({"clamp": {"A": "M10"}}, "a word such as M10 for B, C"),
        ({"orient": False}, "true, as this strategy turns the spindle"),
        ({"positioning_feed": 0}, "controller.positioning_feed: found .*; allowed: 1 … 1000000"),
        ({"probe_input": 3}, "1, 2"),
    ],
)
def test_options_that_do_not_fit_are_refused(made: Plan, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        lines_of(made, **options)


# --- the control ---------------------------------------------------------------------------------------------------------


def value(text: str) -> Any:
    def get(name: str, index: Any) -> Any:
        return {"TG": 2.5}[name]

    return Reader(text, get).value()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1+2*3", 7),
        ("ABS(TG-(-2.5))", 5.0),
        ("POT(3.)+TRUNC(-2.7)", 7.0),
        ("(1>2) OR (2.==2)", True),
        ("NOT (1<>1)", True),
        ('"P"<<17<<" X"<<TG', "P17 X2.5"),
        ('"A"<<"\'H0A\'"', "A\n"),
        ('SPRINT("H%D X%.4F%%",1,-0.00005)', "H1 X-0.0001%"),
        ("7 MOD 4", 3.0),
        ("1.5EX2", 150.0),
    ],
)
def test_expressions(text: str, expected: Any) -> None:
    assert value(text) == expected


@pytest.mark.parametrize(
    ("lines", "alarm"),
    [
        (["X1 Q7"], "12550"),
        (["Q1+"], "12550"),
        (["R1+"], "12080"),
        (["X"], "12080"),
        (["SETAL()"], "12090"),
        (["SUPA D0 G0 X=1.5EX99"], "10720"),
        (["DEF INT A_1", "A_1=1.5EX99"], "14051"),
        (["G1 X10."], "10860"),
        (["G777"], "12470"),
        (["D7"], "17180"),
        (["G0", "DEF INT A_1"], "12190"),
        (["DEF INT A_1", "DEF INT A_1"], "12170"),
        (["DEF INT A_1", 'A_1="X"'], "12150"),
        (["DEF INT A_1", "A_1=1/0"], "14051"),
        (["IF 1==1 GOTOF NOWHERE"], "14080"),
        (["IF 1==1", "G0"], "12640"),
        (["SUPA D0 G0 B=DC(10.)"], "16800"),
        (["SUPA D0 G0 C=DC(-10.)"], "16830"),
        (["SUPA D0 G0 X9999."], "10720"),
        (['MSG("A" "B")'], "12080"),
        (['WRITE(1,"_N_A_MPF","B")'], "12080"),
    ],
)
def test_what_the_control_does_not_take(made: Plan, lines: list[str], alarm: str) -> None:
    ran = code(made, *lines)
    assert ran.alarm is not None
    assert ran.alarm.code == alarm


def test_a_program_without_m30_does_not_end_well(made: Plan) -> None:
    assert run(["G0 X1."], made).alarm is not None


def printed(made: Plan, *lines: str, **profile: Any) -> list[str]:
    ran = code(made, "DEF INT E_1", *lines, **profile)
    assert ran.alarm is None, ran.alarm
    return ran.files["_N_A_MPF"].splitlines()


def test_supa_leaves_the_tool_length_in_and_d0_takes_it_out(made: Plan) -> None:
    show = 'WRITE(E_1,"_N_A_MPF",SPRINT("%.1F",$AA_IM[Z]))'
    where = ["SUPA G0 Z100.", "STOPRE", show, "SUPA D0 G0 Z100.", "STOPRE", show, "G0 Z100.", "STOPRE", show]
    assert printed(made, *where) == ["400.0", "100.0", "200.2"]


def test_variables_are_as_old_as_the_last_stopre(made: Plan) -> None:
    show = 'WRITE(E_1,"_N_A_MPF",SPRINT("%.1F",$AA_IM[X]))'
    assert printed(made, "SUPA D0 G0 X10.", "STOPRE", "SUPA D0 G0 X20.", show, "STOPRE", show) == ["10.0", "20.0"]


def test_a_miss_says_nothing_and_keeps_what_was_latched_before(made: Plan) -> None:
    show = 'WRITE(E_1,"_N_A_MPF",SPRINT("%D %.1F %.1F",$AC_MEA[1],$AA_MM[X],$AA_IM[X]))'
    assert printed(made, "SUPA D0 G1 MEAS=1 X10. F1000.", "STOPRE", show) == ["0 0.0 10.0"]


def test_a_whole_number_is_whole_millimetres(made: Plan) -> None:
    show = 'WRITE(E_1,"_N_A_MPF",SPRINT("%.1F",$AA_IM[X]))'
    assert printed(made, "SUPA D0 G0 X100", "STOPRE", show) == ["100.0"]


@pytest.mark.parametrize(
    ("start", "way", "moved"), [(350, "DC(10.)", 20), (10, "DC(350.)", -20), (10, "ACN(20.)", -350), (10, "ACP(0.)", 350)]
)
def test_modulo_axes_turn_the_way_they_are_told(made: Plan, start: int, way: str, moved: float) -> None:
    ran = code(made, f"SUPA D0 G0 C=DC({start}.)", f"SUPA D0 G0 C={way}")
    places = [data["position"]["C"] for event, data in ran.events if event == "rapid"]
    assert places[-1] - start == pytest.approx(moved), "the scale has rolled over after the first move"


TOUCH = ["SUPA D0 G0 X-20. Y30.", "SUPA D0 G0 Z313.", "SUPA D0 G1 MEAS=1 Z298. F180.", "STOPRE"]


def shown(made: Plan, *lines: str, **more: Any) -> list[str]:
    ran = run(["DEF INT E_1", *lines, "M30"], made, **more)
    assert ran.alarm is None, ran.alarm
    return ran.files["_N_A_MPF"].splitlines()


def test_only_axes_named_in_the_block_are_latched(made: Plan) -> None:
    show = 'WRITE(E_1,"_N_A_MPF",SPRINT("%D %.1F %.1F",$AC_MEA[1],$AA_MM[X],$AA_MM[Z]))'
    assert shown(made, *TOUCH, show) == ["1 0.0 303.0"]


def test_the_latched_position_is_there_in_machine_and_in_work_coordinates(made: Plan) -> None:
    show = 'WRITE(E_1,"_N_A_MPF",SPRINT("%.2F %.2F",$AA_MM[Z],$AA_MW[Z]))'
    assert shown(made, *TOUCH, "D1", show, g54={"Z": 100.25}) == ["303.00 -97.25"]


def test_a_probe_that_is_deflected_has_no_edge_to_give(made: Plan) -> None:
    """Where that is no alarm the move goes on to its end: nothing guards it."""
    show = 'WRITE(E_1,"_N_A_MPF",SPRINT("%D %.1F",$AC_MEA[1],$AA_IM[Z]))'
    stuck = [*TOUCH, "SUPA D0 G1 Z313. F500.", "SUPA D0 G1 MEAS=1 Z330. F180.", "STOPRE", show]
    assert shown(made, *stuck, fault="probe-stuck-after=1", deflected="ignore") == ["0 330.0"]
    alarmed = run([*stuck[:-1], "M30"], made, fault="probe-stuck-after=1")
    assert alarmed.alarm is not None and alarmed.alarm.code == "21700"


def test_write_ends_lines_of_files_and_none_of_devices(made: Plan) -> None:
    device = ["DEF INT E_1", 'EXTOPEN(E_1,"/dev/ext/1","SYN","EXCL")', *(f'WRITE(E_1,"/dev/ext/1","{c}")' for c in "AB"), "M30"]
    assert run(device, made).out == b"AB"
    assert shown(made, *(f'WRITE(E_1,"_N_A_MPF","{c}")' for c in "AB")) == ["A", "B"]


@pytest.mark.few(1)
@pytest.mark.parametrize("mirrored", [(), ("Z",), ("X", "Y")])
@pytest.mark.parametrize("holds", [True, False])
def test_where_supa_is_nothing_beside_meas_every_touch_is_where_it_is_planned(
    made: Plan, holds: bool, mirrored: tuple[str, ...]
) -> None:
    """A work offset of -500 mm sent the first move, up, down to the table; a mirror image did the same."""
    left = {"supa_with_meas": holds, "mirrored": mirrored, "g54": {"X": -250.0, "Y": -200.0, "Z": -500.0}}
    ran = run(lines_of(made), made, **left)
    assert not ran.why and ran.flags(made) == [1] * len(made.touches)


def test_the_page_of_the_control_has_every_alarm_of_the_program() -> None:
    page = (Path(__file__).parents[1] / "docs" / "controls" / "siemens.md").read_text()
    for number, text in load("siemens").alarms(settings_of(load("siemens"), {})).items():
        assert f"| {number} | {text}" in page
