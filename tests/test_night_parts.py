"""What a change of the machine does to a part, reckoned by hand: its zero is found at 0 of the rotary axes, then they turn."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from support.nights import night

from tango_cnc.files import read_cell
from tango_cnc.nightly.alarms import Known, alarms_of, effect_of, said_of
from tango_cnc.nightly.back import went_back
from tango_cnc.nightly.dates import Since
from tango_cnc.nightly.mail import _about, message
from tango_cnc.nightly.parts import as_warm
from tango_cnc.nightly.words import changed, headline, sizes_of
from tango_cnc.plan import plan
from tango_cnc.records import Cell
from tango_cnc.report.faults import faults
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.state import State, frame
from tango_cnc.state.effect import alike
from tango_cnc.state.naming import Hypothesis, Named
from tango_cnc.texts import carried, revived
from tango_cnc.touches import of_facets

UM = 1e-3


def effect(cell: Cell, parameter: str, size: float, unit: str = "mm") -> tuple[float, str]:
    told = effect_of(
        Known(cell, cast(Any, None), cast(Any, None)), "axis_location", parameter, size, unit, cast(Any, None), "2026-11-27"
    )
    return told[0], told[1]


@pytest.mark.parametrize("parameter", ["EX0C", "EY0C", "EX0S"])
def test_a_hole_on_the_other_side_of_the_table_is_off_by_twice_the_offset_whatever_it_is_called(root: Path, parameter: str) -> None:
    """15 µm between table and spindle: the hole at C 0 sets the zero, that at C 180 sees it from the other side."""
    um, text = effect(read_cell(root / "examples" / "trunnion"), parameter, 15.0 * UM)
    assert um == pytest.approx(30.0, abs=0.01)
    assert "zero was found at C 0" in text and "30.0 µm" in text and "C is turned by 180°" in text


def test_an_offset_across_a_cradle_is_as_large_as_the_turn_makes_it(root: Path) -> None:
    """The cradle A turns by 120° at most and takes the pivot with it: the chord 2 sin(120°/2). With the table turned, too, the two
    ends of a way across may lie opposite each other."""
    cell = read_cell(root / "examples" / "trunnion")
    um, text = effect(cell, "EZ0A", 10.0 * UM)
    chord = 10.0 * 2 * math.sin(math.radians(60))
    assert um == pytest.approx(chord, abs=0.05) and "A is turned by" in text and "C is" not in text


def test_a_tilt_of_the_table_grows_with_the_part(root: Path) -> None:
    """Turned by 180° a tilt lies the other way: twice the tilt over the arm from the pivot to the farthest point of the part."""
    cell = read_cell(root / "examples" / "trunnion")
    um, text = effect(cell, "EA0C", 20e-6, "rad")
    arm = max(math.hypot(*facet.point) for facet in cell.artefact.facets.values())
    assert 20e-3 * 50 < um <= 2 * 20e-3 * arm + 0.01 and "C axis" in text


@pytest.mark.few(1)
@pytest.mark.parametrize("machine", ["trunnion", "hu40t", "fork_head"])
def test_what_a_change_does_is_in_proportion_to_its_size(root: Path, machine: str) -> None:
    cell = read_cell(root / "examples" / machine)
    for parameter in ("EX0S", "EY0S"):
        one, two = effect(cell, parameter, 10 * UM)[0], effect(cell, parameter, -20 * UM)[0]
        assert two == pytest.approx(2 * one, rel=1e-3) and one == pytest.approx(20.0, abs=0.01)


def test_a_fork_that_sits_elsewhere_as_a_whole_does_nothing_once_the_zero_is_found(root: Path) -> None:
    """All that turns goes along with it, and so does the probe that finds the zero."""
    um, text = effect(read_cell(root / "examples" / "fork_head"), "EX0C", 15 * UM)
    assert um < 0.01 and "0.0 µm" in text and "turned" not in text


def test_a_message_names_the_axis_that_may_be_meant_instead() -> None:
    cause = {"text": "", "on_part": "", "do": "", "instead": ["EX0C", "stylus"]}
    names = _about(cause, "Ann", texts(), {"verdict": "changed"})
    assert any("C axis off in X (EX0C), stylus" in line for line in names)


def test_locations_that_no_touch_tells_apart_are_named_for_each_other(root: Path) -> None:
    """wCAYfXZ: C and spindle along X are one distance between the two. Along Y the cradle lies between them and tells C from S."""
    machine = read_cell(root / "examples" / "trunnion").machine
    assert "EX0C" in alike(machine, "EX0S") and "EX0S" in alike(machine, "EX0C")
    assert "EY0C" not in alike(machine, "EY0S") and "EY0S" not in alike(machine, "EY0C")
    assert not alike(machine, "EX0S-of-nothing") and not alike(machine, "EXX1")


def alarm_of(cell: Cell, parameter: str, size: float, std: float, since: str) -> dict[str, Any]:
    h = Hypothesis("axis_location", parameter, np.eye(1), "mm", (parameter[-1],))
    named = Named(h, np.array([size]), np.array([std]), 1600.0, 1600.0, 1.0, ())
    known = Known(cell, cast(Any, SimpleNamespace(names=(parameter,))), np.zeros((1, 3, 1)))
    tonight = cast(Any, SimpleNamespace(statistic=1600.0, scale=1.0, dof=1, p_noise=0.5, p_machine=1e-9, noise=(0.0, 0), wider=1.0))
    (alarm,) = alarms_of(known, Since(since, "last night"), cast(Any, None), tonight, named)
    return alarm


LIKE = "EX0S", "EX0A", "EX0C", "EB0S"  # one distance between spindle and table of a trunnion, and the tilt of one stylus


@pytest.mark.parametrize(
    ("parameter", "first", "other"),
    [
        ("EX0S", "spindle", "A axis or C axis"),
        ("EX0C", "C axis or A axis", "spindle"),
        ("EX0A", "A axis or C axis", "spindle"),
    ],
)
def test_the_sentence_names_every_axis_that_no_touch_tells_from_the_first(
    root: Path, parameter: str, first: str, other: str
) -> None:
    alarm = alarm_of(read_cell(root / "examples" / "trunnion"), parameter, 20 * UM, 0.5 * UM, "2026-11-27")
    text = alarm["text"]
    assert text.startswith(first) and all(text.count(name) == 1 for name in ("spindle", "A axis", "C axis"))
    assert f"has moved along X by +20.0 ± 0.5 µm, or {other} by -20.0 ± 0.5 µm (no touch tells which) since last night" in text
    assert text.endswith(f"since last night ({parameter})") and set(alarm["alike"]) == set(LIKE) - {parameter}
    back = went_back(alarm, cast(Any, Back()), 20 * UM)[0]
    assert f"has gone back along X by -20.0 µm ({parameter}), or {other} by +20.0 µm (no touch tells which): " in back


def test_another_location_has_its_own_size(root: Path) -> None:
    """What the axis does to the tip is reckoned by the kinematics: 1 mm of a spindle that is off to the right is 1 mm of a table to
    the left, and on an inclined axis (huron, 45°) 1.4 mm."""
    assert alike(read_cell(root / "examples" / "fork_head").machine, "EX0S")["EX0A"] == 1.0
    trunnion, huron = (read_cell(root / "examples" / name).machine for name in ("trunnion", "huron"))
    assert {n: by for n, by in alike(trunnion, "EX0S").items() if n != "EB0S"} == {"EX0A": -1.0, "EX0C": -1.0}
    assert alike(huron, "EX0C")["EX0A"] == pytest.approx(math.sqrt(2), abs=1e-5)
    told = changed("EX0C", "+10 µm", "Sunday", ["EX0S", "EX0A"], sizes_of({"EX0S": -1.0, "EX0A": math.sqrt(2)}, 10 * UM))
    assert told.startswith(
        "C axis has moved along X by +10 µm, or spindle by -10.0 µm or A axis by +14.1 µm (no touch tells which) "
    )


@pytest.mark.few(1)
def test_every_page_names_an_axis_with_its_own_sign(root: Path) -> None:
    """The C axis had moved by +40 µm, and "spindle or A axis or C axis … by −39.9 µm" would have doubled that."""
    cell, size = read_cell(root / "examples" / "trunnion"), -39.9 * UM
    before, now = night("M", 1), night("M", 2, "changed")
    now["alarms"] = [
        alarm_of(cell, "EX0S", size, 0.6 * UM, before["night"])
        | {"id": f"{now['night']}-020000-1", "owner": None, "decision": None}
    ]
    now["parameters"]["EX0S"] = {"value": -29.8 * UM, "unit": "mm", "std": 0.3 * UM, "change": size}
    wanted = "Spindle has moved along X by −40 µm, or A axis or C axis by +40 µm (no touch tells which) since "
    for again in (now, revived(json.loads(json.dumps(carried(now))))):
        (fault,) = faults(again, (), {}, Units(), texts(), cell.machine, before)
        assert fault["text"].startswith(wanted)
        assert "Where it is entered elsewhere: A axis or C axis by +30 µm." in fault["whole"]
    now["headline"] = headline(now)
    assert "by -39.9 ± 0.6 µm, or A axis or C axis by +39.9 ± 0.6 µm (no" in message(now, (), ())[1]


def test_an_axis_that_touches_tell_from_all_others_is_named_alone(root: Path) -> None:
    assert alike(read_cell(root / "examples" / "trunnion").machine, "EY0C") == {}
    assert changed("EY0C", "+20 µm") == "C axis has moved along Y by +20 µm since last night (EY0C)"
    assert "spindle tilted about Y or spindle off in X (no" in changed("EB0S", "+9 µrad", alike=("EX0S",))
    assert "C axis or spindle tilted about Y (no touch" in changed("EX0C", "+9 µm", alike=("EB0S",))


class Back:
    """A move of 20 µm of which nothing is left."""

    then, unit = (20 * UM,), "mm"

    def along(self) -> tuple[float, float, float]:
        return 20 * UM, 0.0, 0.3 * UM

    def least(self) -> float:
        return UM

    def seen(self) -> bool:
        return False


def test_a_pivot_whose_height_has_changed_is_not_told_as_a_stylus_alone(root: Path) -> None:
    """A probe 15 µm longer and a cradle 15 µm lower touch alike; only one of them spoils parts, by the chord of 120°."""
    cell = read_cell(root / "examples" / "trunnion")
    directions = np.eye(3)
    longer = Hypothesis("stylus", "stylus", directions, "mm", ("X", "Y", "Z"))
    named = Named(longer, np.array([0.0, 0.0, 15 * UM]), np.full(3, 0.3 * UM), 900.0, 900.0, 1.0, ())
    known = Known(cell, cast(Any, SimpleNamespace(names=("EXt", "EYt", "EZt"))), np.zeros((1, 3, 3)))
    tonight = cast(Any, SimpleNamespace(statistic=900.0, scale=1.0, dof=3, p_noise=0.5, p_machine=1e-9, noise=(0.0, 0), wider=1.0))
    (alarm,) = alarms_of(known, Since("2026-11-27", "2026-11-27"), cast(Any, None), tonight, named)
    assert alarm["cause"] == "stylus" and alarm["instead"] == ["EZ0A"]
    assert alarm["on_part_um"] == pytest.approx(15 * 2 * math.sin(math.radians(60)), abs=0.05)
    assert "where it is the stylus" in alarm["on_part"] and "A is turned by 120°" in alarm["on_part"] and "A axis" in alarm["do"]
    aside = replace(named, size=np.array([15 * UM, 0.0, 0.0]))  # no pivot does that
    assert alarms_of(known, Since("2026-11-27", "2026-11-27"), cast(Any, None), tonight, aside)[0]["instead"] == []


def test_what_is_farther_off_than_anything_that_is_touched_has_no_size(root: Path) -> None:
    """A radius that somebody edited made a ball move by 61 m: no number of it is worth telling."""
    cell = read_cell(root / "examples" / "trunnion")
    known = Known(cell, cast(Any, SimpleNamespace(names=("a", "b", "c"))), np.zeros((1, 3, 3)))
    for size, told in (
        (2.0, "by 3464.1 µm"),
        (60_000.0, "more than 5 mm from where it was since last night: nothing moves so far"),
    ):
        h = Hypothesis("ball", "ball 1", np.eye(3), "mm", ("X", "Y", "Z"))
        named = Named(h, np.full(3, size), np.full(3, 0.01), 99.0, 0.0, 1.0, ())
        assert told in said_of(known, Since("2026-10-01", "last night"), named)[2]


@pytest.mark.few(0)
def test_a_machine_is_judged_at_the_temperature_of_its_night(root: Path) -> None:
    """One that is 6 K warmer than ever was within its limit: as it had been at the temperature of its first night."""
    cell = read_cell(root / "examples" / "trunnion")
    made = plan(cell)
    position = np.array([touch.contact for touch in made.touches])
    followed = frame(
        of_facets(cell.machine, cell.artefact, [touch.facet for touch in made.touches], position, np.ones_like(position)),
        cell.terms,
    )
    first, count = len(followed.model.names), len(followed.names)
    i, k = followed.place["EY0C"], followed.place["EY0C/K"]
    mean, root_ = np.zeros(count), 1e-4 * np.eye(count)
    mean[i], mean[k] = 24e-3, 1.5e-3
    state = State(followed.names, mean, root_, 0.0, np.zeros(count), 1e-3, 20.0)
    hot = as_warm(followed, state, 6.0)
    assert hot.mean[i] == pytest.approx(33e-3) and hot.std[i] == pytest.approx(1e-4 * math.hypot(1.0, 6.0))
    others = np.delete(np.arange(first), [i])
    assert not hot.mean[others].any() and hot.mean[k] == mean[k]
    assert as_warm(followed, state, None) is state
