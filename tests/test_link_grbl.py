"""grbl: the simulated control keeps to the facts of its sources, and whole runs over TCP and over a serial line."""

import re
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.blockcell import NORMALS, block, machine
from support.blockcell import cell as block_cell
from support.controls import GOLDEN
from support.grbl import driven
from support.linkfaults import scene
from support.linkparts import job
from support.runs import Result, readings
from support.simulated_runs import agree, cell, controller  # noqa: F401  a fixture

from postprocessors import load, program
from sim_controller.languages.grbl import switched_on
from sim_controller.lines import Closed
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.protocols.grbl import serve
from tango_cnc.files import read_cell, read_world
from tango_cnc.link.client import Ended, Identified, Touched
from tango_cnc.link.protocols.grbl import Client
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import InputError, Obstacle, World

posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")


@pytest.fixture
def control(cell):
    parts = read_cell(cell)
    return lambda **options: switched_on(Motion(rig(parts.machine, parts.artefact, read_world(cell / "world.yaml"))), **options)


@pytest.mark.few(0)
def test_a_whole_run_over_tcp(cell):
    with controller(cell, "--protocol", "grbl", "--tcp", "127.0.0.1:0") as url:
        result = Result("run", "-C", cell, "--port", f"{url}?orient=m19", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)


@posix
@pytest.mark.long
def test_a_whole_run_over_a_serial_line(cell):
    with controller(cell, "--protocol", "grbl", "--pty") as url:
        result = Result("run", "-C", cell, "--port", f"{url}?orient=m19", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)


@pytest.mark.few(0)
def test_a_run_that_an_alarm_stops_leaves_what_was_measured(cell):
    with controller(cell, "--protocol", "grbl", "--tcp", "127.0.0.1:0", "--fault", "alarm-after=4") as url:
        result = Result("run", "-C", cell, "--port", f"{url}?orient=m19", "--timeout", "20")
    assert (result.code, "ALARM:3" in result.err) == (3, True), result.err
    assert len(readings(cell, "readings.partial.csv")) == 3


def test_a_plan_that_turns_the_spindle_needs_a_word_for_it(cell):
    result = Result("run", "-C", cell, "--port", "grbl+socket://127.0.0.1:1")
    assert result.code == 2
    assert "orient=m19" in result.err


@pytest.mark.parametrize(("port", "why"), [("?orient=m19&feed=90000", "at most 24000"), ("", "orient=m19")])
def test_what_the_driver_refuses_is_refused_before_anything_is_written(cell, port, why):
    before = sorted(cell.rglob("*"))
    result = Result("run", "-C", cell, "--port", f"grbl+socket://127.0.0.1:1{port}")
    assert result.code == 2 and why in result.err
    assert sorted(cell.rglob("*")) == before


def test_programs_that_each_have_one_angle_of_the_spindle_are_refused_where_the_run_has_two(cell):
    """--split 3: the third program is to be run with the spindle turned, and nobody would turn it."""
    result = Result("run", "-C", cell, "--port", "grbl+socket://127.0.0.1:1", "--split", "3")
    assert result.code == 2 and "orient=m19" in result.err
    assert not (cell / "program").exists()


def test_options_that_mean_nothing_are_refused():
    with pytest.raises(InputError, match="feed"):
        Client(job(), {"feed": "fast"})


def test_the_simulated_control_answers_a_miss_as_grbl_does(control):
    one = control()
    assert one.line("G38.3 X10 F100") == ["[PRB:10.000,0.000,800.000,0.000,0.000:0]", "ok"]
    assert one.line("G38.2 X20 F100") == ["ALARM:5", "[PRB:20.000,0.000,800.000,0.000,0.000:0]", "ok"]
    assert one.line("G0 X0") == ["error:9"]
    assert one.line("$X")[-1] == "ok"
    assert one.line("G0 X0") == ["ok"]


def test_the_simulated_control_answers_an_empty_line_with_an_ok_of_its_own(control):
    assert control().line("") == ["ok"]


def test_the_simulated_control_reports_inches_whatever_g21_says(control):
    one = control(inches=True)
    one.line("G21")
    assert one.line("G38.3 X25.4 F100")[0].startswith("[PRB:1.0000,")


def test_the_same_place_is_no_target(control):
    one = control()
    assert one.line("G38.3 X0 F100") == ["error:33"]
    assert one.line("") == ["ok"]
    assert one.line("G38.3 X1") == ["[PRB:1.000,0.000,800.000,0.000,0.000:0]", "ok"], "F stays"


CUTS = [  # how a line begins, or what is assigned two lines before one that carries out what has been confirmed
    pytest.param("plain", "G38.3 .* F180", id="in contact"),
    pytest.param("plain", "G1 .*", id="just off the facet"),
    pytest.param("confirmed", r".*#<qff>=\[180\..*", id="confirmed, in contact"),
    pytest.param("confirmed", r".*#<qgg>=\[1\..*", id="confirmed, just off the facet"),
]


def sends(sent, targets, line):
    """→ whether the last line carries out the move that this pattern finds, for the first time."""
    place = -1 if targets == "plain" else -3
    found = [i for i, one in enumerate(sent) if re.fullmatch(line, one)]
    return len(found) == 1 and found[0] == len(sent) + place


@pytest.mark.few(1)
@pytest.mark.parametrize(("targets", "cut"), CUTS)
def test_a_run_cut_off_below_an_edge_is_resumed_without_meeting_it(cell, targets, cut):
    """The table stands upright, and a nut that nobody has stated stands out by 5 mm above facet 5: who goes up at once meets it."""
    (cell / "strategy.yaml").write_text(
        "name: below an edge\napproach: {standoff: 10, search: 5, feed: 180}\n"
        "indexations:\n  - {B: 90, C: -270, S: 0, facets: ['5', '8']}\n"
    )
    parts = read_cell(cell)
    nut = Obstacle("box", low=(-265.0, -7.0, -22.0), high=(-260.0, -3.0, -18.0))
    truly = replace(parts.artefact, obstacles=(*parts.artefact.obstacles, nut))
    made, true = plan(parts), rig(parts.machine, truly, read_world(cell / "world.yaml"))
    one = switched_on(Motion(true))
    begun, _ = driven(made, one, lambda sent: sends(sent, targets, cut), targets=targets)
    assert not any(isinstance(event, Ended) for event in begun), "it was not cut off"
    events, _ = driven(made, one, targets=targets)
    assert events[-1] == Ended(2), events[-1]
    assert [event.flag for event in events if isinstance(event, Touched)] == [1, 1]


@pytest.mark.parametrize("targets", ["plain", "confirmed"])
def test_a_work_offset_of_the_control_changes_no_place_that_the_axes_go_to(cell, targets):
    """Targets go out in work coordinates, by what the control says of its offset; what comes back is in those of the machine."""
    (cell / "strategy.yaml").write_text(
        "name: two facets\napproach: {standoff: 10, search: 5, feed: 180}\n"
        "indexations:\n  - {B: 0, C: 0, S: 0, facets: ['5']}\n  - {B: 30, C: 40, S: 0, facets: ['5']}\n"
    )
    parts = read_cell(cell)
    made, touched = plan(parts), []
    shifted = {"X": 12.3456, "Y": -4.5, "Z": 107.0, "B": 3.0, "C": -21.5}
    for offset, inches in (({}, False), (shifted, False), (shifted, True)):
        one = switched_on(Motion(rig(parts.machine, parts.artefact, read_world(cell / "world.yaml"))), g54=offset, inches=inches)
        events, _ = driven(made, one, targets=targets)
        assert events[-1] == Ended(2), events[-1]
        assert ("inches, G54" if inches else "mm, G54") in next(e.text for e in events if isinstance(e, Identified))
        touched.append([event for event in events if isinstance(event, Touched)])
    for here, *others in zip(*touched, strict=True):
        for there in others:
            assert (here.number, here.flag) == (there.number, there.flag)
            assert here.position == pytest.approx(there.position, abs=0.01)


@pytest.mark.parametrize(("line", "goes_on"), [(r"\$I", True), ("G38.3 X.* Y.* Z.*", False), ("G38.3 .* F180", False)])
def test_a_control_that_is_switched_on_is_greeted_and_one_that_resets_is_left(cell, line, goes_on):
    """Before anything is set its greeting is the answer of a control that has just started; later what was set is lost."""
    (cell / "strategy.yaml").write_text(
        "name: one facet\napproach: {standoff: 10, search: 5, feed: 180}\nindexations:\n  - {B: 0, C: 0, S: 0, facets: ['5']}\n"
    )
    parts = read_cell(cell)
    made, true = plan(parts), rig(parts.machine, parts.artefact, read_world(cell / "world.yaml"))
    one = switched_on(Motion(true))
    driven(made, one, lambda sent: re.fullmatch("G38.3 .* F180", sent[-1]), targets="plain")  # in contact: it has to go back first
    greeted = []

    def greets(sent):
        if greeted or not re.fullmatch(line, sent[-1]):
            return ()
        greeted.append(sent[-1])
        return ("Grbl 1.1h ['$' for help]",)

    events, _ = driven(made, one, before=greets, targets="plain")
    assert greeted
    assert isinstance(events[-1], Ended) if goes_on else "the control has been reset: Grbl 1.1h" in events[-1].why


@pytest.mark.parametrize(("targets", "said"), [("plain", "ALARM"), ("confirmed", "says [MSG:")])
def test_a_digit_lost_in_the_height_of_an_approach_drives_nothing_into_the_table(targets, said):
    """The stylus is beside the table and meets nothing: the body of the probe does, when the control is not asked first."""
    _, made, truth = scene(turning=False)
    height = "321.8535"
    assert any(f"{move.target.get('Z'):.4f}" == height for move in made.moves if move.kind == "approach")
    met = []
    one = switched_on(Motion(truth, lambda event, **data: met.append(event)))
    events, sent = driven(made, one, arrives=lambda line: line.replace(height, height[1:]), targets=targets)
    assert ("collision" in met) == (targets == "plain")
    assert said in events[-1].why
    assert any(height in line for line in sent), "or it has not been tried"


def test_three_touches_in_a_row_without_contact_end_the_run(cell):
    parts = read_cell(cell)
    made = plan(parts)
    world = World(facets=dict.fromkeys(parts.artefact.facets, -30.0))
    events, _ = driven(made, switched_on(Motion(rig(parts.machine, parts.artefact, world))))
    assert [event.flag for event in events if isinstance(event, Touched)] == [0, 0, 0]
    assert "3 touches in a row without contact" in events[-1].why


class Misread:
    """A control that reports each contact at another place."""

    def __init__(self, one, place):
        self._one, self._place = one, ",".join(f"{value:.3f}" for value in place)

    def report(self):
        return self._one.report()

    def line(self, text):
        return [re.sub(r"(?<=\[PRB:)[^,]+,[^,]+,[^,:]+", self._place, line) for line in self._one.line(text)]


@pytest.mark.parametrize(
    ("along", "aside", "on_it"),
    [(0.0, 0.45, True), (0.0, 0.55, False), (-0.45, 0.0, True), (-0.55, 0.0, False), (1.45, 0.0, True), (1.55, 0.0, False)],
)
def test_a_contact_anywhere_but_on_the_line_of_its_measuring_move_ends_the_run(cell, along, aside, on_it):
    """Up to half a millimetre before its begin, beyond its end (1 + mm) and beside it."""
    parts = read_cell(cell)
    made = plan(parts)
    begin, end = (
        np.array([p[made.machine.column(name)] for name in "XYZ"]) for p in (made.touches[0].standoff, made.touches[0].end)
    )
    ahead = (end - begin) / np.linalg.norm(end - begin)
    across = np.cross(ahead, np.roll(ahead, 1))
    place = (end + (along - 1) * ahead if along > 0 else begin + along * ahead) + aside * across / np.linalg.norm(across)
    one = Misread(switched_on(Motion(rig(parts.machine, parts.artefact, read_world(cell / "world.yaml")))), place)
    events, _ = driven(made, one)
    assert any(isinstance(event, Touched) for event in events)
    said = f"is not on the line of the measuring move of touch {made.touches[0].number}: "
    assert (said in events[-1].why) is not on_it, events[-1].why  # what it then does there is another question


@pytest.mark.parametrize(
    ("firmware", "able"), [("grblHAL", {}), ("FluidNC", {}), ("grblHAL", {"expressions": False}), ("grbl", {})]
)
def test_what_cannot_confirm_targets_is_refused_before_anything_moves(firmware, able):
    """Of FluidNC, grbl 1.1 and a grblHAL built without expressions, the last two; the plan needs no rotary axis."""
    places = {name: np.zeros(3) for name in NORMALS}
    made = plan(block_cell(machine("wXYfZ(S)t"), block((0.0, 0.0, 0.0), places), [{"S": 0.0}]), "leave-out")
    one = switched_on(Motion(rig(made.machine, made.artefact, World())), firmware=firmware, **able)
    here = one.motion.position
    events, _ = driven(made, one, orient="refuse")
    if firmware != "grbl" and not able:
        assert events[-1] == Ended(len(made.touches))
        return
    assert "targets=plain" in events[-1].why
    assert (one.motion.position == here).all()
    if firmware != "grbl":
        return
    events, _ = driven(made, one, targets="plain", orient="refuse")
    assert events[-1] == Ended(len(made.touches))


def test_a_control_that_does_not_report_contacts_is_told_which_setting_does(cell, control):
    events, _ = driven(plan(read_cell(cell)), control(probe_reports=False))
    assert "$10 lacks the 128" in events[-1].why


# What the firmwares do differently: gnea/grbl 1.1h, grblHAL core of 2026, FluidNC


def test_a_failed_search_with_alarm_shows_the_contact_before_it_except_on_grblhal(control):
    for firmware, shown in (("grbl", "10.000,0.000,800.000:0"), ("FluidNC", "10.000,0.000,800.000,0.000,0.000:0")):
        one = control(firmware=firmware)
        one.line("G38.3 X10 F100")
        assert one.line("G38.2 X20") == ["ALARM:5", f"[PRB:{shown}]", "ok"]
    one = control()
    assert one.line("G38.2 X20 F100")[1].startswith("[PRB:20.000,")


def test_a_search_that_begins_with_the_probe_on_is_alarm_4_without_prb(control):
    one = control()
    one.motion._stuck = True
    assert one.line("G38.3 X10 F100") == ["ALARM:4", "ok"]
    assert one.report()[0].startswith("<Alarm|")
    assert one.line("G0 X0") == ["error:9"]
    assert "Pn:P" in one.report()[0]


def test_grbl_1_1_has_three_axes_and_short_lines(control):
    one = control(firmware="grbl")
    assert one.line("$I") == ["[VER:1.1h.20190825:]", "[OPT:VNMSL,100,1024]", "ok"]
    assert one.line("G0 B10") == ["error:20"]
    assert one.line("M19 R90") == ["error:20"]
    assert one.line("G0 X1 (" + "long " * 40 + ")") == ["ok"], "comments and blanks are not counted"
    assert one.line("G0 " + "X1.0000000000" * 8) == ["error:11"]


def test_grblhal_counts_comments_and_repeats_an_error_until_it_is_asked_something(control):
    one = control()
    assert one.line("G0 X1 (" + "long " * 60 + ")") == ["error:11"]
    assert one.line("G0 X1") == ["error:11"], "not executed"
    assert one.line("") == ["ok"]
    assert one.line("G0 X1") == ["ok"]
    other = control(firmware="FluidNC")
    assert (other.line("G31 X1"), other.line("G0 X1")) == (["error:20"], ["ok"])


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("G38.3 X0 F100", "error:33"),
        ("G38.3 X1", "error:22"),
        ("G38.3 F100", "error:26"),
        ("G38.3 X F100", "error:2"),
        ("38 X1", "error:1"),
        ("G53 G38.3 X1 F100", "error:30"),
        ("G0 G38.3 X1 F100", "error:24"),
        ("G0 X1 X2", "error:25"),
        ("O100", "error:20"),
        ("G31 X1", "error:20"),
        ("$unknown", "error:3"),
        ("(only a remark)", "ok"),
    ],
)
def test_what_is_refused_with_which_number(control, line, answer):
    assert control(expressions=False).line(line)[-1] == answer


class Typed:
    """A line on which somebody types, and reads until the answer to $I is complete."""

    def __init__(self, typed):
        self.typed, self.said = [typed], b""

    def receive(self, timeout):
        if b"[OPT" in self.said:
            raise Closed
        time.sleep(0.001)
        return self.typed.pop() if self.typed else b""

    def send(self, data):
        self.said += data


@pytest.mark.parametrize(("firmware", "wanted"), [("grblHAL", 1), ("FluidNC", 2), ("grbl", 2)])
def test_cr_lf_is_one_end_of_a_line_for_grblhal_only(control, firmware, wanted):
    """Two answers to one line are what a host counts wrongly."""
    line = Typed(b"G21\r\n$I\n")
    session = SimpleNamespace(device=control(firmware=firmware), received=lambda count: None)
    with pytest.raises(Closed):
        serve(line, session, True)
    assert line.said.partition(b"[VER")[0].count(b"ok") == wanted


def test_an_alarm_is_said_before_a_question_is_answered_with_its_state(control):
    """Whoever asks while the line that ends in an alarm is executed would otherwise never hear which alarm it is."""
    line = Typed(b"G38.2 X1 F100\n")
    session = SimpleNamespace(device=control(), received=lambda count: None)
    executed = session.device.line

    def slow(text):
        answers = executed(text)
        if text.startswith("G38"):  # the alarm stands, and has not been said
            line.typed.extend(bytes([byte]) for byte in b"\nI$?")  # taken from the end
            time.sleep(0.2)
        return answers

    session.device.line = slow
    with pytest.raises(Closed):
        serve(line, session, True)
    assert line.said.startswith(b"ALARM:5") and line.said.count(b"<Alarm") == 1


@pytest.mark.parametrize(("firmware", "axes"), [("grbl", "X Y Z"), ("FluidNC", None)])
def test_a_control_that_does_not_name_its_axes_has_as_many_as_it_lists(cell, control, firmware, axes):
    """FluidNC lists X Y Z A B C in this order: five numbers are X Y Z A B, and the plan turns C."""
    events, _ = driven(plan(read_cell(cell)), control(firmware=firmware))
    assert f"the control has the axes {axes or 'X Y Z A B'}; the plan moves" in events[-1].why


def test_grbl_1_1_measures_where_three_axes_suffice():
    """The post for it takes the machine without rotary axes, its lines fit, and its driver has every touch."""
    places = {name: np.zeros(3) for name in NORMALS}
    made = plan(block_cell(machine("wXYfZ(S)t"), block((0.0, 0.0, 0.0), places), [{"S": 0.0}]), "leave-out")
    lines = list(program(load("grbl"), made, {"control": "grbl"}, plan_hash(made))[2]())
    one = switched_on(Motion(rig(made.machine, made.artefact, World())), firmware="grbl")
    assert len(made.touches) >= 3
    assert {one.line(line)[-1] for line in lines if not line.startswith("M19")} == {"ok"}
    with pytest.raises(InputError, match="grbl, which has X Y Z only"):
        turned = plan(block_cell(machine("wCXYfZ(S)t"), block((0.0, 0.0, 0.0), places), [{"S": 0.0, "C": 0.0}]), "leave-out")
        program(load("grbl"), turned, {"control": "grbl"}, "P")


# Clamps: words of the profile, on a control whose axes are held when it is switched on

UNCLAMP, CLAMP = {"B": 11, "C": 13}, {"B": 10, "C": 12}


@pytest.fixture(scope="module")
def turning():
    """→ a plan that turns both axes, and the machine"""
    parts = read_cell(GOLDEN)
    return plan(parts), rig(parts.machine, parts.artefact, World())


def clamped(turning, arrives=lambda line: line, stated=True, **options):
    """plan and machine, what arrives of a line, whether the profile states the words → last event, what happened, what was sent."""
    made, truth = turning
    profile = {k: {n: f"M{v}" for n, v in words.items()} for k, words in (("unclamp", UNCLAMP), ("clamp", CLAMP))} if stated else {}
    profile["gate"] = "none"  # the lines of the gate are not what these tests read
    happened = []
    motion = Motion(truth, lambda event, **data: happened.append((event, data)))
    one = switched_on(motion, lambda event, **data: happened.append((event, data)), unclamp=UNCLAMP, clamp=CLAMP)
    text = "\n".join(program(load("grbl"), made, profile, plan_hash(made))[2]())
    events, sent = driven(made, one, arrives=arrives, text=text, **options)
    return events[-1], happened, sent


@pytest.mark.parametrize(("targets", "times"), [("plain", 1), ("confirmed", 2)])
def test_each_rotary_axis_turns_alone_between_the_words_that_free_and_hold_it(turning, targets, times):
    made, _ = turning
    last, happened, sent = clamped(turning, targets=targets)
    assert last == Ended(len(made.touches))
    assert not [data for event, data in happened if event == "unsafe"]
    turns = [name for move in made.moves if move.kind == "index" for name in "BC" if name in move.target]
    switched = [data["word"] for event, data in happened if event == "switched"]
    assert switched == [word for name in turns for word in [UNCLAMP[name]] * times + [CLAMP[name]] * times]
    assert {len(data["held"]) for event, data in happened if event == "switched"} == {1, 2}, "one is loose at most"
    assert targets == "plain" or not [line for line in sent if re.search(r"M\d", line)], "no word in bare digits"


@pytest.mark.parametrize("targets", ["plain", "confirmed"])
def test_turning_without_the_words_is_an_alarm(turning, targets):
    last, happened, _ = clamped(turning, stated=False, targets=targets)
    assert "ALARM:17 (motor fault)" in last.why
    assert {"B is clamped", "C is clamped"} & {data.get("text") for _, data in happened}


def test_a_word_whose_letter_is_spoilt_is_heard_the_second_time(turning):
    seen = []

    def arrives(line):
        if "M#<qmm>" in line and "R#" not in line:
            seen.append(line)
            return line.replace("M#", "N#") if len(seen) % 2 else line
        return line

    last, happened, _ = clamped(turning, arrives)
    assert isinstance(last, Ended) and seen
    assert len([event for event, _ in happened if event == "switched"]) == len(seen) / 2


@pytest.mark.parametrize("targets", ["plain", "confirmed"])
def test_a_clamp_that_a_run_cut_off_has_left_open_is_closed_by_the_next(cell, targets):
    """Both axes stand where the plan wants them, so that nothing would have to turn."""
    (cell / "strategy.yaml").write_text(
        "name: one\napproach: {standoff: 10, search: 5, feed: 180}\nindexations:\n  - {B: 90, C: -270, S: 0, facets: ['5']}\n"
    )
    parts = read_cell(cell)
    made, switched = plan(parts), []
    made = replace(made, turns=tuple(replace(turn, preload=None) for turn in made.turns))
    truth = rig(parts.machine, parts.artefact, read_world(cell / "world.yaml"))
    one = switched_on(Motion(truth), lambda event, **data: switched.append(data.get("held")), unclamp=UNCLAMP, clamp=CLAMP)
    text = "(UNCLAMP B M11)\n(UNCLAMP C M13)\n(CLAMP B M10)\n(CLAMP C M12)\n"
    options = {"text": text, "targets": targets, "orient": "refuse"}
    driven(made, one, lambda sent: one._held == {"B"} and abs(one._place()["C"] + 270) < 0.1, **options)
    assert one._held == {"B"}, "C was turned and is loose"
    events, _ = driven(made, one, **options)
    assert events[-1] == Ended(1) and switched[-1] == "BC"


# The program is what the driver sends


def words(line):
    return [(letter, float(value)) for letter, value in re.findall(r"([A-Z])(-?\d+\.?\d*)", line)]


def test_the_driver_sends_the_lines_of_the_program(cell):
    made = plan(read_cell(cell))
    lines = list(program(load("grbl"), made, {"gate": "none"}, plan_hash(made))[2]())
    motion = Motion(rig(made.machine, made.artefact, World()))
    motion.rapid({"X": 1.0, "Y": 1.0, "B": 0.1, "C": 0.1, "S": 0.1})
    _, sent = driven(made, switched_on(motion), targets="plain")
    told = [words(line) for line in sent if line[0] not in "$?" and not line.startswith("G4")][1:]
    written = [words(line) for line in lines if not line.startswith("(")][1:]
    same(told, written)


def test_the_driver_sends_the_words_of_clamps_where_the_program_has_them(turning):
    made, _ = turning
    profile = {"gate": "none", "unclamp": {"B": "M11", "C": "M13"}, "clamp": {"B": "M10", "C": "M12"}}
    written = [words(line) for line in program(load("grbl"), made, profile, plan_hash(made))[2]() if not line.startswith("(")][1:]
    _, _, sent = clamped(turning, targets="plain")
    told = [words(line) for line in sent if line[0] not in "$?" and not line.startswith("G4")][1:]
    first = next(i for i, line in enumerate(written) if line[0][0] == "M")
    assert first and [("M", 11.0)] in told
    same([line for line in told if line[0][0] == "M"], [line for line in written if line[0][0] == "M"])
    same(told[-len(written) + first :], written[first:])


def same(told, written):
    assert [[letter for letter, _ in line] for line in told] == [[letter for letter, _ in line] for line in written]
    for a, b in zip(told, written, strict=True):
        assert [value for _, value in a] == pytest.approx([value for _, value in b], abs=1e-3)
