"""Controls and machines on which exactly one belief is wrong, and what mends it: a word of the profile, of machine.yaml, or of the
control itself (a setting that the post names).

A case is what the person at the machine has (habits of the control, wiring, brakes) and what the profile says before and after.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import yaml

from postprocessors import Post, load, program
from sim_controller.session import language
from sim_controller.world import nominal_machine, tip_in_table
from support.controls import GOLDEN, golden
from support.dialects import EVERY
from support.namedcontrols import numbered
from tango_cnc.files import read_cell
from tango_cnc.plan import plan_hash
from tango_cnc.records import Cell, InputError, Machine, Plan

BRAKE = 11
IN_MACHINE = ("klartext", "rs274", "siemens")  # languages that say machine positions, which nothing mirrors
FAR = 12_000.0  # mm
WORDS = ("G31 P1", "G31.1", "G131")  # of other skip inputs; the last one is of a builder


@dataclass(frozen=True)
class Case:
    """What is wrong, what is stated before, and what makes it right; `fails`: the belief that has to fail, or none at all."""

    fails: str | None
    wrong: Mapping[str, Any] = field(default_factory=dict)  # of `ran`: habits, how the probe is wired, brakes
    stated: Mapping[str, Any] = field(default_factory=dict)  # of the profile, before
    mended: Mapping[str, Any] | None = None  # of the profile, after, on the same wrong control
    restated: Callable[[Machine, float], Machine] | None = None  # of machine.yaml and what was found: machine.yaml after it
    stands: Callable[[Cell], Cell] = lambda cell: cell  # what cell it is
    oriented: str = ""  # the word that turns this spindle
    names: str = ""  # word that the advice has to name
    printed: Callable[[bytes], bytes] = bytes  # what the line or file makes of the records
    truly: Callable[[Machine], Machine] | None = None  # the machine that really moves
    person: bool = True  # whether the person sees what should happen
    overwrites: bool = False  # the file of the records is begun anew by each program


def turned_round(machine: Machine, name: str) -> Machine:
    """machine, letter → the same with this axis the other way round."""
    axes = tuple(
        replace(axis, direction=tuple(-v for v in axis.direction), travel=axis.travel) if axis.name == name else axis
        for axis in machine.axes
    )
    return replace(machine, axes=axes)


def reversed_axis(name: str) -> Callable[[Machine, float], Machine]:
    """letter → what is corrected in machine.yaml: its direction."""
    return lambda machine, _: turned_round(machine, name)


def nearer(machine: Machine, _: float) -> Machine:
    """machine → its C is stated to take the nearer way."""
    return replace(machine, axes=tuple(replace(axis, nearer=True) if axis.name == "C" else axis for axis in machine.axes))


def slow(machine: Machine, found: float) -> Machine:
    """machine, s a touch that were found → stated as what the control needs for itself."""
    return replace(machine, overhead=round(found, 1))


def far(cell: Cell) -> Cell:
    """cell → the same with the zero of its X scale 12 m away: a long machine, whose numbers have five digits."""
    machine, artefact = cell.machine, cell.artefact
    by = FAR * np.array(machine.axis("X").direction)
    carried = machine.workpiece_branch[machine.workpiece_branch.index("X") :] if "X" in machine.workpiece_branch else ()

    def there(point: Any) -> tuple[float, float, float]:
        x, y, z = (float(v) for v in np.array(point) + by)
        return x, y, z

    axes = []
    for axis in machine.axes:
        if axis.name == "X":
            assert axis.travel is not None
            axis = replace(axis, travel=(axis.travel[0] - FAR, axis.travel[1] - FAR))
        elif axis.name in carried:
            axis = replace(axis, point=there(axis.point))
        axes.append(axis)
    facets = {key: replace(facet, point=there(facet.point)) for key, facet in artefact.facets.items()}
    balls = {key: replace(ball, centre=there(ball.centre)) for key, ball in artefact.balls.items()}
    assert carried and not artefact.obstacles, "the golden cell has its X under the table, and nothing else on it"
    return replace(cell, machine=replace(machine, axes=tuple(axes)), artefact=replace(artefact, facets=facets, balls=balls))


def comma(text: bytes) -> bytes:
    """records → with decimal commas, as a control set to another country prints them."""
    return re.sub(rb"(?<=\d)\.(?=\d)", b",", text)


def pointless(text: bytes) -> bytes:
    """records → without their decimal points, as a control prints increments."""
    return b"\n".join(re.sub(rb"(?<=\d)\.", b"", line) if b"H" in line else line for line in text.split(b"\n"))


def narrow(text: bytes) -> bytes:
    """records → of coordinates and sum, only two digits are left before the point."""

    def cut(match: re.Match[bytes]) -> bytes:
        return match[1] + match[2] + match[3][-2:] + match[4]

    lines = text.split(b"\n")
    return b"\n".join(re.sub(rb"([XYZABCK])( *-? *)(\d+)(\.)", cut, line) if b"H" in line else line for line in lines)


def unended(text: bytes) -> bytes:
    """records → without the last line: the file was not closed."""
    return re.sub(rb"[^\r\n]*TANGO END[^\r\n]*[\r\n]*", b"", text)


def elsewhere(text: bytes) -> bytes:
    """records → positions of X in another frame, their sum with them."""

    def moved(match: re.Match[bytes]) -> bytes:
        return b"%s%.4f" % (match[1], float(match[2].replace(b" ", b"")) + 5.0)

    return b"\n".join(re.sub(rb"([XK])( *-? *\d*\.\d+)", moved, line) if b"H" in line else line for line in text.split(b"\n"))


def looks_at(spoken: str, which: int) -> object:
    """language siemens or fagor, input → the value of probe_state that goes with it."""
    return True if spoken == "siemens" else f"V.G.PRBST{which}"


def looks(post: Post) -> bool:
    """dialect → whether it looks at the probe before it moves, or refuses to: what it needs for that has a value."""
    stated = {option.name: option.default for option in post.options}
    return bool(stated.get("probe_state", True))


OPTIONS = ("skip", "axis_numbers", "probe_state", "print_format")  # whose dialects `by_option` finds by what they declare


def must(post: Post) -> bool:
    """dialect → whether its profile has to state the input of the probe."""
    return any(option.name == "probe_state" and option.must for option in post.options)


def declared(name: str) -> tuple[str, ...]:
    """dialect → which of `OPTIONS` its post declares."""
    return tuple(option.name for option in load(name).options if option.name in OPTIONS)


def by_option(name: str) -> dict[str, Case]:
    """dialect → {option that its post declares: the control on which its usual value is wrong}.

    No list of dialects: a habit is one that the simulated control of the dialect has. Without that there is no case.
    """
    known, spoken = {option.name: option for option in load(name).options}, language(EVERY[name].family)
    settings = EVERY[name].settings
    profile = spoken.default_profile(read_cell(GOLDEN).machine)
    has = {one.name for one in fields(profile)}
    found = {}
    if "skip" in known and "skip_word" in has:
        usual = str(known["skip"].default)
        other = next(word for word in WORDS if word != usual and _taken(name, {"skip": word}))
        found["skip"] = Case("alive", {"habits": {"skip_word": other}}, {}, {"skip": other}, "skip")
    if "axis_numbers" in known and "numbered" in has:  # of a builder who has X and Y the other way round
        own = known["axis_numbers"].default or {"X": 1, "Y": 2, "Z": 3, "B": 4, "C": 5}
        turned = {**own, "X": own["Y"], "Y": own["X"]}
        counted = {"habits": {"numbered": numbered(turned)}}
        found["axis_numbers"] = Case("frames", counted, {}, {"axis_numbers": turned}, "axis_numbers")
    if (state := known.get("probe_state")) is not None and state.must:
        example = yaml.safe_load(re.search(r"e\.g\. ([^;,\s]+)", state.meaning)[1])  # type: ignore[index]
        wired = {"habits": {"probe_variable": example}} if "probe_variable" in has else {}
        found["probe_state"] = Case("deflected", wired, {}, {"probe_state": example}, "probe_state")
    elif state is not None:  # the usual program looks
        off = type(state.default)()
        going_on = {"habits": {"deflected": "ignore"}} if "deflected" in has else {}
        found["probe_state"] = Case("deflected", going_on, {"probe_state": off}, {"probe_state": state.default}, "probe_state")
    if "print_format" in known and settings.get("overflow") != "expanded" and str(known["print_format"].default) < "5":
        found["print_format"] = Case("widths", {}, {}, {"print_format": "53"}, "print_format", stands=far)
    return found


def _taken(name: str, stated: Mapping[str, Any]) -> bool:
    """dialect, profile → whether its post writes a program for it."""
    made = golden()
    try:
        next(iter(program(load(name), made, stated, plan_hash(made))[2]()))
    except InputError:
        return False
    return True


def cases(name: str) -> dict[str, Case]:
    """dialect → {belief: the control on which it is wrong}."""
    post = load(name)
    spoken = post.language
    found = {
        "alive": Case("alive", {"probe": "other"}, names="cable"),
        "deflected": Case(None if looks(post) else "deflected"),
        "directions": Case(
            "directions", truly=lambda machine: turned_round(machine, "X"), names="direction", restated=reversed_axis("X")
        ),
        "frames": Case("frames", printed=elsewhere, names="position"),
        "miss": Case("miss", {"miss_stops": True}, names="parameter"),
        "rotary": Case("rotary", {"slack": {"B": 1.0}, "brake": BRAKE}, {}, {"unclamp": {"B": "M11"}}, "unclamp"),
        "sense": Case("sense", truly=lambda machine: turned_round(machine, "C"), names="direction", restated=reversed_axis("C")),
        "records": Case("records", printed=comma, names="point"),
        "orientation": Case("orientation", person=False, names="orient"),
        "override": Case("override", person=False, names="feed hold"),
        "end": Case("end", printed=unended, names="file"),
        "widths": Case("widths", printed=narrow, names="digits"),
        "pace": Case("pace", {"block_time": 4.0}, names="overhead", restated=slow),
        "feed": Case("feed", {"skip_obeys": True}, {}, {"feed_override": "acts"}, "feed_override"),
        "append": Case("append", {}, {}, {"records_file": "anew"}, "records_file", overwrites=True),
        "rollover": Case("rollover", {"short_way": ("C",)}, names="nearer", restated=nearer),
    }
    if spoken not in IN_MACHINE:
        found["mirror"] = Case("mirror", {"habits": {"scaled": {"Z": -1.0}}, "stands": {"Z": 700.0}}, names="mirror image")
    word = next((option.default for option in post.options if option.name == "orient"), False)
    if isinstance(word, str) and spoken != "grbl":
        turns = {"habits": {"orient": "P"}}
        found["orientation"] = Case("orientation", turns, {}, {"orient": "M19 P"}, "orient", person=False, oriented="M19 P")
    habits = EVERY[name].settings
    options = by_option(name)
    if must(post):  # what the profile has to say, and does not yet
        found["deflected"] = options["probe_state"]
    if "print_format" in options:
        found["widths"] = options["print_format"]
    if "axis_numbers" in options and spoken == "macro_b":
        found["frames"] = options["axis_numbers"]
    if "skip" in options:
        found["alive"] = options["skip"]
    if habits.get("macros_ahead"):
        found["frames"] = Case("frames", {}, {"wait": "G53"}, {"wait": "G103 P1"}, "wait")
    if spoken == "osp":
        found["miss"] = Case("miss", {"habits": {"miss": "alarm"}}, names="parameter")
        offset = {"contact_frame": "work", "g54": {"X": 5.0, "Y": 2.0}}
        found["frames"] = Case("frames", {"habits": offset}, names="contact")
    if spoken in ("siemens", "fagor"):
        found["alive"] = Case("alive", {"habits": {"probe_input": 2}}, {"probe_state": looks_at(spoken, 1)}, None, "probe_input")
        found["alive"] = replace(found["alive"], mended={"probe_input": 2, "probe_state": looks_at(spoken, 2)})
    if spoken == "fagor":
        found["miss"] = Case("miss", {"habits": {"miss": "alarm"}}, names="parameter")
        found["records"] = Case("records", {"habits": {"identifiers": 4}}, names="output")
    if spoken == "klartext":
        found["miss"] = Case("miss", {"habits": {"no_contact": "error"}}, names="parameter")
        found["frames"] = Case("frames", {"habits": {"rotation": {"C": 3.0}}}, names="rotation")
        found["mirror"] = Case("mirror", {"habits": {"axis_scale": {"Z": 2.0}}}, names="scaling")
    if spoken == "siemens":
        found["feed"] = Case("feed", {"skip_obeys": True}, {"feed_override": "ignored"}, {"feed_override": "acts"}, "feed_override")
        found["frames"] = Case("frames", {"habits": {"transformation": True}}, {"trafoof": False}, {"trafoof": True}, "trafoof")
    if spoken == "rs274":
        found["feed"] = Case("feed", {"skip_obeys": True}, {"feed_override": "ignored"}, {"feed_override": "acts"}, "feed_override")
        found["frames"] = Case("frames", {"habits": {"rotation": {"R": 3.0}}}, names="rotation")
        found["rotary"] = Case("rotary", {"slack": {"B": 1.0}, "brake": 64}, {}, {"unclamp": {"B": "M64 P3"}}, "unclamp")
    if spoken == "centroid":  # whose M codes are macros of the builder
        found["rotary"] = replace(found["rotary"], wrong={**found["rotary"].wrong, "habits": {"macros": ("M19", "M11")}})
    if spoken == "grbl":
        found["rotary"] = Case("rotary", {"habits": {"unclamp": {"B": 11}}}, {}, {"unclamp": {"B": "M11"}}, "unclamp")
    if spoken in ("centroid", "mach3"):
        found["frames"] = Case("frames", {"habits": {"inches": True}}, names="position")
    if spoken == "grbl":  # its driver writes the records itself
        found["miss"] = Case("miss", {"probe": "chatter"}, names="contact")
        found = {belief: case for belief, case in found.items() if belief not in ("frames", "records", "end", "widths", "append")}
    return found


def sees(
    plan: Plan, truly: Machine, questions: Mapping[str, Mapping[str, str]], attentive: bool, farthest: float = 0.0
) -> dict[str, dict[str, bool]]:
    """plan in the air, the machine that really moves, what is asked, whether all the rest is well → what the person says.

    `farthest`: deg that C really went to, on its way over 360 or not.
    Where the probe and the table go is worked out from the machine that really moves, with the simulator's own mathematics.
    """
    said: dict[str, dict[str, bool]] = {}
    for belief, each in questions.items():
        for what, text in each.items():
            if belief == "directions":
                answer = _moved(plan, truly, text)
            elif belief == "sense":
                answer = _turned(truly, what, text)
            elif belief == "rollover":
                answer = farthest < 355.0
            else:
                answer = attentive
            said.setdefault(belief, {})[what] = answer
    return said


def _moved(plan: Plan, truly: Machine, text: str) -> bool:
    number = int(re.search(r"move (\d+)", text)[1])  # type: ignore[index]
    touch = next(touch for touch in plan.touches if touch.number == number)
    nominal, still = nominal_machine(truly), np.zeros((1, len(truly.names)))
    begin, end = (tip_in_table(nominal, np.array([place]), still)[0] for place in (touch.standoff, touch.end))
    if match := re.search(r"side of facet (\S+) towards the side of facet (\S+),", text):
        facets = plan.artefact.facets
        way = np.subtract(facets[match[2]].point, facets[match[1]].point)
    else:
        centre = np.mean([facet.point for facet in plan.artefact.facets.values()], axis=0)
        way = begin - centre  # away from the table
    return float(np.dot(end - begin, way)) > 0


def _turned(truly: Machine, name: str, text: str) -> bool:
    angles = re.search(r"went (-?[\d.]+) to (-?[\d.]+)", text)
    pointing = re.search(r"where \(([^)]*)\)", text)
    assert angles is not None and pointing is not None
    seen_from = np.array([float(v) for v in pointing[1].split(",")])
    by = math.radians(float(angles[2]) - float(angles[1])) * float(np.dot(truly.axis(name).direction, seen_from))
    return (by > 0) == ("counterclockwise" in text)


def table(dialects: list[str]) -> str:
    """dialects → the table dialect × belief of docs/commissioning.md: what mended each belief after it had failed."""
    every = list(dict.fromkeys(belief for name in dialects for belief in cases(name)))
    rows = ["| dialect | " + " | ".join(every) + " |", "|---" * (len(every) + 1) + "|"]
    return "\n".join(
        [*rows, *(f"| {name} | " + " | ".join(_mended(cases(name).get(b), b) for b in every) + " |" for name in dialects)]
    )


def _mended(case: Case | None, belief: str) -> str:
    if case is None:
        return "machine" if belief == "mirror" else "driver"
    if case.fails is None:
        return "looks"
    if case.mended:
        return ", ".join(f"`{key}`" for key in case.mended if case.mended[key] != case.stated.get(key))
    return f"`{case.names}`" if case.restated else "setting"
