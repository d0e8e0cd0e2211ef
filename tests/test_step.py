"""A step before all else: where positions come in inches, a program that takes a frame from the control goes nowhere."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import pytest
from support.controls import golden
from support.gates import NEAR, ran

from postprocessors import companions, load, names, program
from postprocessors import settings as settings_of
from tango_cnc import commission, readback
from tango_cnc.gate import STEP, step
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError

INCHES = {"centroid": {"inches": True}, "mach3": {"inches": True}} | {
    name: {"inch_positions": True} for name in names() if load(name).language in ("macro_b", "mach4", "fagor")
}
QUICK = ("fanuc", "fagor")
DIALECTS = [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in sorted(INCHES)]
MIRRORS = [*DIALECTS, pytest.param("okuma", marks=pytest.mark.long)]  # whose first move a mirror image may send down
SAID = {"okuma": "MIRROR OR SCALED"}  # sixteen characters
LOW = {"X": -250.0, "Y": -200.0, "Z": -500.0}  # mm of a usual work offset: 25.4 times too small it sends the first move down


@pytest.mark.parametrize("name", DIALECTS)
def test_where_positions_come_in_inches_nothing_moves_but_the_step_and_the_text_says_it(name: str) -> None:
    made = commission.air(golden(), 1)
    found = ran(name, made, {}, {**INCHES[name], "base_offset" if name == "fagor" else "g54": LOW})
    said = found.why or " ".join(found.stops)
    assert "POSITIONS ARE IN INCHES" in said
    z = [place["Z"] for place in found.places]
    assert z and max(z) - min(z) <= STEP and not set(NEAR) & {event for event, _ in found.events}
    (failed,) = [
        judged for judged in commission.judge(commission.Seen(made, {}, True, False, said=said)) if judged.verdict.verdict == "FAIL"
    ]
    assert failed.experiment.belief == "frames" and "in inches" in failed.experiment.advice


CONVERTED = [n for n in names() if load(n).language in ("macro_b", "mach4")]


@pytest.mark.few(0)
@pytest.mark.parametrize("name", [n if n == "fanuc" else pytest.param(n, marks=pytest.mark.long) for n in CONVERTED])
@pytest.mark.parametrize("macros", ["inline", "called"])
def test_where_positions_come_in_inches_the_profile_says_so_and_the_program_makes_mm_of_them(name: str, macros: str) -> None:
    if name == "mach4" and macros == "called":
        return
    made, stated = golden(), {"position_unit": "inch"} | ({} if name == "mach4" else {"macros": macros})
    found = ran(name, made, stated, {**INCHES[name], "g54": LOW})
    assert not found.why and not found.stops
    plain = ran(name, made, {k: v for k, v in stated.items() if k != "position_unit"}, {"g54": LOW})

    def numbers(lines: list[str]) -> list[float]:
        return [
            float(text.replace(" ", ""))
            for line in lines
            if line.lstrip().startswith("P")
            for text in re.findall(r"[XYZBC] *(-? *[\d.]+)", line)
        ]

    assert numbers(found.lines) and numbers(found.lines) == pytest.approx(numbers(plain.lines), abs=2e-4)
    lines = list(program(load(name), made, stated, plan_hash(made))[2]())
    files, whole = companions(load(name), made, stated), settings_of(load(name), stated)
    readback.check(lambda: iter(lines), made, whole, files, written_in=load(name).language)
    text = list(program(load(name), made, {**stated, "position_unit": "mm"}, plan_hash(made))[2]())
    with pytest.raises(InputError):  # a program for the other unit
        readback.check(lambda: iter(text), made, whole, files, written_in=load(name).language)
    wrong = ran(name, made, stated, {"g54": LOW})  # whose positions come in mm all the same
    assert "POSITIONS ARE IN MM" in wrong.why and max(p["Z"] for p in wrong.places) - min(p["Z"] for p in wrong.places) <= STEP


@pytest.mark.parametrize("name", ["fanuc", pytest.param("haas", marks=pytest.mark.long)])
def test_where_z_has_another_number_than_the_profile_says_nothing_moves_but_the_step(name: str) -> None:
    """The frame of Y taken for that of Z sent the first move down by the difference of the two."""
    other = {"axes": ("X", "Z", "Y", "B", "C")} if name == "fanuc" else {}
    stated = {} if name == "fanuc" else {"axis_numbers": {"X": 1, "Y": 3, "Z": 2, "B": 5, "C": 6}}
    found = ran(name, commission.air(golden(), 1), stated, {**other, "g54": LOW})
    z = [place["Z"] for place in found.places]
    assert "MET SOMETHING" in found.why and max(z) - min(z) <= STEP


@pytest.mark.parametrize("name", MIRRORS)
@pytest.mark.parametrize("factor", [-1.0, 2.0])
def test_where_z_is_mirrored_or_scaled_nothing_moves_but_the_step_and_the_text_says_it(name: str, factor: float) -> None:
    """A mirrored Z sends the first move, up, down into the table; nothing has proven the probe alive by then."""
    made = commission.air(golden(), 1)
    found = ran(name, made, {}, {"scaled": {"Z": factor}}, stands={"Z": 700.0})
    said = found.why or " ".join(found.stops)
    assert SAID.get(name, "MIRROR IMAGE OR SCALING") in said
    z = [place["Z"] for place in found.places]
    assert z and max(z) - min(z) <= 2 * STEP and not set(NEAR) & {event for event, _ in found.events}
    (failed,) = [
        judged for judged in commission.judge(commission.Seen(made, {}, True, False, said=said)) if judged.verdict.verdict == "FAIL"
    ]
    assert failed.experiment.belief == "mirror" and "mirror image" in failed.experiment.advice


@pytest.mark.parametrize("name", MIRRORS)
@pytest.mark.parametrize(("axis", "factor"), [("X", -1.0), ("Y", -1.0), ("X", 2.0)])
def test_where_another_axis_is_mirrored_or_scaled_the_first_move_of_it_stops_above_the_table(
    name: str, axis: str, factor: float
) -> None:
    made = commission.air(golden(), 1)
    found = ran(name, made, {}, {"scaled": {axis: factor}})
    assert (found.why or found.stops) and not set(NEAR) & {event for event, _ in found.events}
    assert min(place["Z"] for place in found.places) >= made.touches[0].standoff[made.machine.column("Z")] - 1e-6


@pytest.mark.parametrize("name", MIRRORS)
def test_a_probe_that_is_on_at_the_step_is_not_taken_for_inches(name: str) -> None:
    found = ran(name, golden(), probe="inverted")
    assert "INCHES" not in (found.why or " ".join(found.stops))
    assert len({place["Z"] for place in found.places}) <= 1


@pytest.mark.parametrize("name", [p for p in MIRRORS if "mach3" not in str(p)])
def test_the_read_back_asks_for_the_step(name: str) -> None:
    made, post = golden(), load(name)
    lines = list(program(post, made, {}, plan_hash(made))[2]())
    at = next(i for i, line in enumerate(lines) if "A STEP OF" in line)
    moved = next(i for i in range(at, at + 20) if "Z-0.5" in lines[i] or "Z[-0.5]" in lines[i])
    absolute = next(i for i in range(moved, moved + 3) if lines[i] == "G90")
    first, both = ("-0.25]", 2) if name == "okuma" else ("0.0197", 3)  # lines: is it an inch, or the other way, is it what was said
    judged = next(i for i in range(absolute, absolute + 8) if first in lines[i])

    def refused(text: list[str]) -> bool:
        try:
            readback.check(lambda: iter(text), made, settings_of(post, {}), companions(post, made, {}), written_in=post.language)
        except InputError:
            return True
        return False

    assert not refused(lines)
    assert refused([*lines[:absolute], *lines[absolute + 1 :]])  # everything behind it would be a distance
    assert refused([*lines[:moved], lines[moved].replace("-0.5", "-5."), *lines[moved + 1 :]])
    assert refused([*lines[:moved], lines[moved].replace("Z", "X"), *lines[moved + 1 :]])
    both = 15 if lines[judged].startswith("$IF") else both
    assert refused([*lines[:judged], *lines[judged + both :]])  # who does not look has not asked


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('Code "G90"', "Sleep 20"),
        ("#103=-0.5", "#103=-5."),
        ("#103=-0.5", "#103=0.5"),
        ("Abs(Off - Wanted) > GetVar(110)", "Abs(Off - Wanted) > 30"),
        ("M887", "M880"),
    ],
)
def test_the_read_back_asks_for_the_step_of_mach3_in_its_macro(old: str, new: str) -> None:
    made, post = golden(), load("mach3")
    lines = list(program(post, made, {}, plan_hash(made))[2]())
    files = companions(post, made, {})
    other = {name: [line.replace(old, new) for line in text] for name, text in files.items()}
    changed = [line.replace(old, new) for line in lines]
    assert (changed, other) != (lines, files)
    with pytest.raises(InputError):
        readback.check(lambda: iter(changed), made, settings_of(post, {}), other, written_in=post.language)


def test_it_goes_away_from_the_end_where_people_begin() -> None:
    name, by = step(golden())
    touch, z = golden().touches[0], golden().machine.column("Z")
    assert name == "Z" and math.copysign(1, by) == -math.copysign(1, touch.over[z] - touch.standoff[z]) and abs(by) == STEP


TURNED = {"turned_with": "C", "g54": {"X": -25.0, "Y": -20.0, "Z": -500.0}}  # G54.2 of a Fanuc or Mazak, G254 of a Haas


@pytest.mark.parametrize(
    "name", ["fanuc", pytest.param("haas", marks=pytest.mark.long), pytest.param("mazak", marks=pytest.mark.long)]
)
@pytest.mark.parametrize("macros", ["inline", pytest.param("called", marks=pytest.mark.long)])
def test_where_a_work_offset_turns_with_an_axis_the_program_stops_where_it_has_turned(name: str, macros: str) -> None:
    """Every guarded move behind the turn would be beside its place by as much, and say that it has arrived."""
    made = commission.air(golden())
    clear = max(touch.over[made.machine.column("Z")] for touch in made.touches)
    found = ran(name, made, {"macros": macros, "misses": 20}, TURNED)
    assert "WORK OFFSET CHANGED" in found.why and min(place["Z"] for place in found.places) >= clear - 1e-6
    unseen = ran(name, made, {"macros": macros, "misses": 20}, {**TURNED, "turn_shown": False})  # the variables do not know of it
    assert "MET SOMETHING" in unseen.why and not set(NEAR) & {event for event, _ in unseen.events}
    for said in (found.why, unseen.why):
        (failed,) = [j for j in commission.judge(commission.Seen(made, {}, True, False, said=said)) if j.verdict.verdict == "FAIL"]
        assert failed.experiment.belief == "frames" and "dynamic work offset" in failed.experiment.advice


@pytest.mark.parametrize("habits", [{"axis_scale": {"Z": -1.0}}, {"axis_scale": {"Z": 2.0}}], ids=str)
def test_on_a_tnc_whose_factors_nobody_asks_nothing_moves_but_the_step(habits: Mapping[str, Any]) -> None:
    """Mirrored or scaled, the first move, up, would go down into the table."""
    found = ran("heidenhain", commission.air(golden(), 1), {"scaling_check": False}, habits, stands={"Z": 700.0})
    assert "FRAME IS ROTATED MIRRORED OR SCALED" in " ".join(found.stops)
    z = [place["Z"] for place in found.places]
    assert z and max(z) - min(z) <= 2 * STEP and not set(NEAR) & {event for event, _ in found.events}
