"""The Fanuc program on the simulated control, which knows nothing of posts: what it moves, prints and refuses."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from support import controls
from support.controls import ACTIVE, GOLDEN, assert_as_planned, shifted

from postprocessors import number, rolled
from sim_controller.languages import Alarm
from sim_controller.languages.macro_b import Control, default_profile
from sim_controller.motion import Motion
from sim_controller.probing import rig
from tango_cnc.files import read_cell
from tango_cnc.link.client import Begun, Touched
from tango_cnc.link.words import record
from tango_cnc.plan import last_motion, part, plan
from tango_cnc.records import Artefact, Cell, Find, InputError, Plan, World


@pytest.fixture(scope="module")
def cell() -> Cell:
    return read_cell(GOLDEN)


@pytest.fixture(scope="module")
def made(cell: Cell) -> Plan:
    return plan(cell)


DRIP = {"alarm": "at once"}  # a program that is drip-fed cannot jump


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("fanuc", made, **options)


def test_a_drip_fed_control_that_refuses_jumps_stops_before_anything_moves(made: Plan) -> None:
    (why,) = run(lines_of(made), made, streamed=True)
    assert why == "PS0123 ILLEGAL MODE FOR GOTO/WHILE/DO (GOTO8999)"


def run(lines: list[str], made: Plan, streamed: bool = False, artefact: Artefact | None = None, **profile: Any) -> list[Any]:
    """program, plan, profile of the control → what the reader of the line makes of all it printed; an alarm is the last item."""
    printed: list[bytes] = []
    motion = Motion(rig(made.machine, artefact or made.artefact, World()))
    known = replace(default_profile(made.machine), **(ACTIVE | profile))
    control = Control(motion, known, printed.append, lambda event, **data: None)
    ended: list[Any] = []
    try:
        control.run(iter(lines[1:-1]), streamed)
    except Alarm as alarm:
        ended.append(str(alarm))
    text = b"".join(printed).decode("ascii").replace("\x12", "").replace("\x14", "")
    return [record(line, made.machine.names) for line in text.splitlines()] + ended


def flags(events: list[Any]) -> list[int]:
    return [event.flag for event in events if isinstance(event, Touched)]


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "streamed", "profile"),
    [
        (DRIP, True, {}),
        ({}, False, {"read_ahead": True}),
        ({"macros": "called"}, False, {}),
        ({"macros": "called"}, False, {"reading_stops": True}),  # what stands behind M30 never arrives (3201#6)
        ({"rollover": "never"} | DRIP, True, {}),
        (DRIP, True, {"rollover": ("C",)}),
        (DRIP, True, {"rollover": ("C",), "signed_direction": True}),
        ({"rollover": "signed"} | DRIP, True, {"rollover": ("C",), "signed_direction": True}),
        ({"decimals": 4, "print_format": "44"} | DRIP, True, {"padding": "none", "line_end": "crlf"}),
        ({"probe_state": 1004} | DRIP, True, {"probe_variable": 1004, "read_ahead": True}),
        ({"probe_state": 1004, "macros": "called"}, False, {"probe_variable": 1004}),
        (DRIP, True, {"counts": True}),
    ],
)
def test_every_touch_is_made_where_it_is_planned(
    made: Plan, options: dict[str, Any], streamed: bool, profile: dict[str, Any]
) -> None:
    """Whatever work offsets, look-ahead, roll-over and print format the control has, its records are machine coordinates."""
    assert_as_planned(run(lines_of(made, **options), made, streamed, **profile), made, "fanuc", options)


def macros_and_main(made: Plan, **options: Any) -> tuple[list[str], list[str]]:
    """plan, profile → the macros of a program with called ones, and its main program without them."""
    lines = lines_of(made, macros="called", **options)
    main = next(i for i, line in enumerate(lines) if line.startswith("O7700"))
    return lines[1:main], lines[main:-1]


@pytest.mark.parametrize(
    ("stored", "text"),
    [
        (["O7701", "M99", "O7702", "M99", "O7703", "M99", "O7704", "M99"], "ANOTHER PROGRAM WAS CALLED"),
        ([], "PROGRAM NOT FOUND"),
        (None, "MACROS OF ANOTHER PROGRAM"),
    ],
)
def test_somebody_elses_macros_of_the_same_numbers_stop_the_program_at_the_first_call(
    made: Plan, stored: list[str] | None, text: str
) -> None:
    """Where the control has not read the macros in front of the main program, or keeps older ones of these numbers."""
    _, main = macros_and_main(made)
    library = macros_and_main(made, tolerance=0.05)[0] if stored is None else stored
    motion = Motion(rig(made.machine, made.artefact, World()))
    control = Control(motion, default_profile(made.machine), lambda data: None, lambda event, **data: None, library)
    with pytest.raises(Alarm, match=text):
        control.run(iter(main), False)
    assert motion.position[made.machine.column("Z")] >= 799.0  # the first step, and nothing else


def test_a_surface_that_is_not_there_is_a_miss_and_one_that_comes_too_soon_is_early(made: Plan) -> None:
    assert flags(run(lines_of(made), made, artefact=shifted(made, "4", -8.0))) == [1, 1, 1, 1, 1, 0]
    assert flags(run(lines_of(made), made, artefact=shifted(made, "4", 7.0))) == [1, 1, 1, 1, 1, 2]


def test_something_in_the_way_is_an_alarm_not_a_touch(made: Plan) -> None:
    """The top is 12 mm higher than everybody thinks: the way down to its stand-off is a protected move."""
    events = run(lines_of(made), made, artefact=shifted(made, "top", 12.0))
    assert [type(e) for e in events] == [Begun, Touched, str], "the touch before it is on record, this one is not"
    assert "PROBE ON OR MET SOMETHING" in events[-1]


def test_a_probe_that_is_deflected_is_named_before_anything_moves(made: Plan) -> None:
    """Where the profile knows the variable that tells; without it the first G31 ends at once."""
    known = replace(default_profile(made.machine), **(ACTIVE | {"probe_variable": 1004}))
    ran = controls.run_on(
        lambda motion, punch, note: Control(motion, known, punch, note), lines_of(made, probe_state=1004)[1:-1], made, stuck=True
    )
    assert "MC3087 PROBE IS DEFLECTED" in ran.why
    assert not ran.moves


def test_a_probe_that_never_answers_stops_the_program_at_the_third_touch(made: Plan) -> None:
    away = {key: replace(f, point=(0.0, 0.0, -500.0), ball=None) for key, f in made.artefact.facets.items()}
    events = run(lines_of(made), made, artefact=replace(made.artefact, facets=away, balls={}))
    assert flags(events) == [0, 0]
    assert "NO CONTACT. CHECK PROBE" in events[-1]


def test_a_work_offset_changed_on_the_way_is_an_alarm(made: Plan) -> None:
    lines = lines_of(made)
    at = next(i for i, line in enumerate(lines) if line.startswith("N3("))
    events = run([*lines[:at], "#5221=11.9", *lines[at:]], made)
    assert flags(events) == [1, 1]
    assert "WORK OFFSET CHANGED" in events[-1]


def test_a_tool_length_that_is_on_is_an_alarm_before_anything_moves(made: Plan) -> None:
    """With G49 by itself this control would send Z down by the length, and nothing guards that."""
    lines = [*lines_of(made)[:2], "G0 G43 H1 Z400.", *lines_of(made)[2:]]
    length: dict[str, Any] = {"tool_lengths": {1: 250.0}, "length_moves": True}
    assert run(lines, made, **length) == ["MC3085 CANCEL TOOL LENGTH FIRST"]
    assert flags(run([line for line in lines if "#4008" not in line], made, tool_lengths={1: 250.0})) == [1] * 6, "without a move"


@pytest.mark.few(2)
@pytest.mark.parametrize(("group", "code"), [(11, 51), (17, 16), (22, 51.1)])
def test_scaling_polar_coordinates_and_mirror_images_are_alarms_before_anything_moves(made: Plan, group: int, code: float) -> None:
    lines = lines_of(made)
    assert run(lines, made, left_on={group: code}) == [f"MC3086 CANCEL G{code} FIRST"]
    assert flags(run(lines_of(made, must_be_off={}), made, left_on={group: code})) == [1] * 6, "this one does not ask"


def test_the_first_retract_names_its_axis_alone(made: Plan) -> None:
    """Whatever the control thinks of the others, they stay where they are."""
    first = next(line for line in lines_of(made) if line.startswith("G31"))
    assert first.split()[:2] == ["G31", "Z#33"] and first.split()[2].startswith("F")


@pytest.mark.parametrize("macros", ["inline", "called"])
def test_alarms_are_short_enough_for_the_screen_of_an_old_control(made: Plan, macros: str) -> None:
    texts = {line.rpartition("(")[2].rstrip(")") for line in lines_of(made, macros=macros) if "#3000=" in line}
    assert len(texts) == (13 if macros == "called" else 11) and max(map(len, texts)) <= 26


def test_a_rotary_axis_that_went_elsewhere_is_an_alarm_before_anything_is_touched(made: Plan) -> None:
    """A control that takes the sign for the direction turns C -5 to +5, at the stop before the first indexation already."""
    events = run(lines_of(made, rollover="never"), made, rollover=("C",), signed_direction=True)
    assert flags(events) == []
    assert "ROTARY AXIS NOT IN PLACE" in events[-1]


def test_the_rest_of_a_run_is_a_program_of_its_own(made: Plan) -> None:
    rest = part(made, [3, 5, 6])
    begun, *touched, _ = run(lines_of(rest), rest)
    assert begun.count == 3
    assert [(t.number, t.flag) for t in touched] == [(3, 1), (5, 1), (6, 1)]


def test_angles_are_0_to_360_for_an_endless_axis_only(made: Plan) -> None:
    """C of this cell turns without limits, B does not."""

    def turns(**options: str) -> list[str]:
        return [line for line in lines_of(made, **options) if line.startswith("G90 G53 G0")]

    moved = ["B-5.", "C355.", "B0.", "C0.", "B-30.", "C270.", "B0.", "C265.", "C270."]
    assert turns() == [f"G90 G53 G0 {word}" for word in moved]
    assert "G90 G53 G0 C-90." in turns(rollover="never")
    assert "G90 G53 G0 B-30." in turns(rollover="always")


def senses(made: Plan, rule: str, signed: bool) -> list[float]:
    """option, 1008#1 RAB → the sense of the last turn of C at every touch."""
    found: list[float] = []
    last = {"C": 0.0, "sense": 0.0}

    def note(event: str, **data: Any) -> None:
        if event == "rapid" and (change := data["position"]["C"] - last["C"]):
            last.update(C=data["position"]["C"] % 360, sense=math.copysign(1, change))
        elif event == "contact":
            found.append(last["sense"])

    motion = Motion(rig(made.machine, made.artefact, World()), note)
    profile = replace(default_profile(made.machine), rollover=("C",), signed_direction=signed)
    Control(motion, profile, lambda data: None, lambda event, **data: None).run(lines_of(made, rollover=rule)[1:-1], False)
    return found


@pytest.mark.few(0)
def test_endless_axes_turn_in_the_sense_that_the_readings_will_say(made: Plan) -> None:
    """The short way, or where the sign is the direction the sense of the plan: backlash depends on it."""
    wanted = last_motion(made)[:, made.machine.column("C")].tolist()
    assert set(wanted) == {-1.0, 1.0}
    assert senses(made, "auto", False) == senses(made, "signed", True) == wanted
    assert senses(made, "auto", True) != wanted


def test_clamps_stand_around_the_move_of_their_axis(made: Plan) -> None:
    lines = lines_of(made, unclamp={"B": "M11"}, clamp={"B": "M10"})
    at = lines.index("G90 G53 G0 B-30.")
    assert lines[at - 1 : at + 3] == ["M11", "G90 G53 G0 B-30.", "M10", "G90 G53 G0 C270."]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"axis_numbers": {"X": 1, "Y": 2}}, "a number 1 … 8 of its own for each of X, Y, Z, B, C"),
        *(
            ({"axis_numbers": {"X": 1, "Y": 2, "Z": 3, "B": 4, **further}}, "a number 1 … 8 of its own")
            for further in ({"C": 4}, {"C": 0}, {"C": 9}, {"C": 5.0}, {"Y": True, "X": 2, "C": 5}, {"C": 5, "Q": 6})
        ),
        ({"clamp": {"A": "M10"}}, "a word such as M10 for B, C"),
        ({"clamp": {"B": "M10\nM30"}}, "a word such as M10 for B, C"),
        *(
            ({"clamp": {"B": word}, "unclamp": {"B": "M11"}}, "a word such as M10")
            for word in ("M3", "M06", "M30", "M98 P9000", "M0")
        ),
        ({"clamp": {"B": "M10"}}, "controller.clamp: found a word for B and none under unclamp; allowed: both for an axis"),
        ({"probe_on": "M3 S4000"}, "controller.probe_on: found 'M3 S4000'; allowed: no M3, after which .* the spindle turns"),
        ({"probe_off": "M99"}, "controller.probe_off: found 'M99'; allowed: no M99"),
        ({"probe_state": 5021}, "controller.probe_state: found 5021; allowed: none, 1000 … 1063"),
        ({"must_be_off": {5021: 51}}, "controller.must_be_off: found 5021: 51; allowed: 4001 … 4022 and a G code"),
        ({"must_be_off": {4011: "G51"}}, "controller.must_be_off: found 4011: 'G51'"),
        ({"program_number": 12345}, "allowed: 1 … 9995"),
        ({"orient": ""}, "the word that orients the spindle"),
        ({"orient": "M19"}, "end with the letter of the angle"),  # M19 and 0 degrees would be M190
        ({"orient": "G0 Z"}, "move no axis"),
        ({"probe_on": "G0 Z-500"}, "move no axis"),
        ({"probe_on": "M17G00Z - .5"}, "move no axis"),
        ({"probe_on": "M17G91"}, "no G91, which may change what a move means"),
        ({"clamp": {"B": "G91"}}, "a word such as M10"),
        ({"probe_off": "G91 G28"}, "move no axis"),
        ({"positioning_feed": 1e9}, "controller.positioning_feed: found .*; allowed: 1 … 1000000"),
        ({"tolerance": 2.0}, "controller.tolerance: found 2; allowed: 0.001 … 1"),
        ({"positioning_feed": 0}, "controller.positioning_feed: found .*; allowed: 1 … 1000000"),
        ({"macros": "nested"}, "inline, called"),
    ],
)
def test_options_that_do_not_fit_are_refused(made: Plan, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        lines_of(made, **options)


@pytest.mark.parametrize(
    ("options", "approach", "where"),
    [
        ({"positioning_feed": 3000.0}, {}, "controller.positioning_feed: found 3000"),
        ({}, {"feed": 2600.0}, "approach.feed: found 2600"),
        ({}, {"find": Find(feed=2501.0, retreat=6.0)}, "approach.find.feed: found 2501"),
    ],
)
def test_g31_is_no_faster_than_a_haas_can(made: Plan, options: dict[str, Any], approach: dict[str, Any], where: str) -> None:
    strategy = replace(made.strategy, approach=replace(made.strategy.approach, **approach))
    with pytest.raises(InputError, match=f"{where} mm/min; allowed: at most 2500 for a G31 of this control"):
        controls.lines_of("haas", replace(made, strategy=strategy), **options)


def test_axes_are_read_by_the_numbers_of_the_profile(made: Plan) -> None:
    order = ("Z", "X", "Y", "C", "B")
    numbers = {name: i for i, name in enumerate(order, 1)}
    assert flags(run(lines_of(made, axis_numbers=numbers), made, axes=order)) == [1] * len(made.touches)
    assert lines_of(made, axis_numbers={"X": 8, "Y": 7, "Z": 6, "B": 5, "C": 1, "A": 2}), "from the first number to the last"
    assert flags(run(lines_of(made), made, axes=order)) == [], "with the numbers of another control nothing is touched at all"


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [(1.0, 3, "1."), (-0.0, 3, "0."), (-0.0004, 3, "0."), (1e-9, 4, "0."), (-90.5, 3, "-90.5"), (9999.9999, 4, "9999.9999")],
)
def test_numbers_are_spelt_as_controls_read_them(value: float, decimals: int, text: str) -> None:
    assert number(value, decimals) == text


@pytest.mark.parametrize(("angle", "same"), [(-90, 270), (360, 0), (359.99999, 0), (-0.00001, 0), (720.5, 0.5), (-620, 100)])
def test_angles_roll_over(angle: float, same: float) -> None:
    assert rolled(angle, 3) == pytest.approx(same, abs=1e-9)
    assert 0 <= float(number(rolled(angle, 3), 3)) < 360
