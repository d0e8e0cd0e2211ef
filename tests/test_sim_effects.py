"""Effects of the simulated machine: one file a cause, pure, the same touch by touch and all at once.

What each of them does, by hand arithmetic, is in test_sim_effects_<family>.py.
"""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.effect_parts import names
from support.effectparts import CELL, EXAMPLES, MACHINE, PLAIN, STYLUS, TOUCHES, early, uses_chance, world
from support.rows import command, writing

from sim_controller import effects
from sim_controller.effects import Disturbance, History, lever
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.simulate import simulate
from tango_cnc.cli import tango
from tango_cnc.files import read_cell
from tango_cnc.records import Approach, Artefact, Facet, Indexation, InputError, Strategy, World

EVERY = names()
PARTS = ("gap", "work", "table", "facet")


def rows(known: History, count: int) -> History:
    values = {f.name: getattr(known, f.name) for f in fields(known)}
    cut = {name: value[:count] if name not in ("machine", "artefact") else value for name, value in values.items()}
    return History(**cut)


@pytest.mark.parametrize("cause", EVERY)
def test_every_effect_states_an_example_of_its_keys(cause: str) -> None:
    try:
        effects.checked(world(cause).effects)
    except InputError as error:
        pytest.fail(f"sim_controller/effects/{cause}.py: EXAMPLE has to state the keys that have no default: {error}")


def documented(root: Path) -> dict[str, set[str]]:
    """→ {effect: its keys}, of the rows of docs/effects.md."""
    found = {}
    for line in (root / "docs" / "effects.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `") and len(cells) == 3:
            found[cells[0].strip("`")] = set(re.findall(r"`(\w+)`", cells[1]))
    return found


WRITE = command("tests/test_sim_effects.py -k documented")
DESCRIBED = {cause: (keys, what) for cause, keys, what in effects.described()}
HEAD = "| cause | keys | what happens |"


def character(cause: str) -> tuple[bool, ...]:
    """effect → what it changes (gap, work, table, errors, names of facets), and whether later touches are changed otherwise."""
    slow = replace(TOUCHES, time=2 * TOUCHES.time, warm=2 * TOUCHES.warm)
    now, later = (effects.disturbance(effects.checked(world(cause).effects), history, 5) for history in (TOUCHES, slow))
    moved = [[one.gap, one.work, one.table, *(one.errors[name] for name in sorted(one.errors))] for one in (now, later)]
    timed = any(not np.allclose(a, b, atol=1e-9) for a, b in zip(*moved, strict=True))
    return (*(bool(np.any(each)) for each in moved[0][:3]), bool(now.errors), now.facet != TOUCHES.facet, timed)


def with_row(page: str, cause: str, row: str) -> str:
    """docs/effects.md, effect, its row → with that row at the end of the table most of whose effects do the same kind of thing."""
    first, *tables = page.split(HEAD)
    listed = [re.findall(r"(?m)^\| `(\w+)`", table.partition("\n\n")[0]) for table in tables]
    alike = [[character(other) == character(cause) for other in some if other in DESCRIBED] for some in listed]
    share = [sum(same) / max(1, len(same)) for same in alike]
    kept, gap, after = tables[(at := share.index(max(share)))].partition("\n\n")
    tables[at] = f"{kept}\n{row}{gap}{after}"
    return HEAD.join([first, *tables])


@pytest.mark.parametrize("cause", ["error_motion", "thermal_drift", "tip_wear"])
def test_a_new_row_comes_into_the_table_of_its_kind(cause: str, root: Path) -> None:
    """The tilt of an axis came to the drifts and events, whose effects are of the same frame."""
    page = (root / "docs" / "effects.md").read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith(f"| `{cause}` |"))
    begun = with_row(page.replace(f"{row}\n", ""), cause, row)
    assert [row in table for table in begun.split(HEAD)] == [row in table for table in page.split(HEAD)]


@pytest.mark.parametrize("cause", DESCRIBED)
def test_every_key_is_documented(cause: str, root: Path) -> None:
    keys, what = DESCRIBED[cause]
    page, found = root / "docs" / "effects.md", set(re.findall(r"\w+", keys))
    row = f"| `{cause}` | {', '.join(f'`{key}`' for key in sorted(found))} | {what} |"
    if cause not in documented(root) and writing():
        page.write_text(with_row(page.read_text(encoding="utf-8"), cause, row), encoding="utf-8")
    assert documented(root).get(cause) == found, (
        f"docs/effects.md has no row that lists exactly the keys of {cause}. {WRITE} adds the row below, if the page has none, to "
        f"the effects of its kind. Then add units and formula:\n{row}"
    )


def test_no_row_is_of_an_effect_that_is_gone(root: Path) -> None:
    gone = set(documented(root)) - set(DESCRIBED)
    assert not gone, (
        f"docs/effects.md: take away the rows of {', '.join(sorted(gone))}: no file of sim_controller/effects/ has them"
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("cause", [c for c in EVERY if c != "swapped_facets"])
def test_an_effect_does_something_and_it_is_micrometres(cause: str) -> None:
    beside = World({"EX0C": -0.4}, STYLUS)  # a touch that misses its point, a stylus that is off its axis
    effect = replace(world(cause), errors=beside.errors, stylus=beside.stylus)
    plain, changed = (simulate(MACHINE, CELL.artefact, CELL.strategy, w).position for w in (beside, effect))
    found = np.abs(early(changed, plain)).max()
    assert 0.0003 < found < 0.06, (
        f"sim_controller/effects/{cause}.py: its EXAMPLE moves the touches by {1000 * found:.2f} µm at most; allowed: 0.3 … 60 µm"
    )


@pytest.mark.few(12)
@pytest.mark.parametrize("cause", EVERY)
@pytest.mark.parametrize("count", [1, 40, 200])
def test_an_effect_knows_nothing_of_later_touches(cause: str, count: int) -> None:
    chosen = effects.checked(world(cause).effects)
    whole = effects.disturbance(chosen, TOUCHES, 5)
    part = effects.disturbance(chosen, rows(TOUCHES, count), 5)
    for name in PARTS:
        assert np.array_equal(getattr(whole, name)[:count], getattr(part, name))
    assert all(np.array_equal(whole.errors[name][:count], value) for name, value in part.errors.items())


@pytest.mark.few(8)
@pytest.mark.parametrize("cause", EVERY)
def test_an_effect_is_decided_by_the_seed(cause: str) -> None:
    chosen = effects.checked(world(cause).effects)
    one, again, other = (effects.disturbance(chosen, TOUCHES, seed) for seed in (5, 5, 6))
    assert same(one, again)
    assert same(one, other) == (not uses_chance(cause))


def same(one: Disturbance, other: Disturbance) -> bool:
    errors = all(np.array_equal(value, other.errors[name]) for name, value in one.errors.items())
    return errors and all(np.array_equal(getattr(one, name), getattr(other, name)) for name in PARTS)


TOPS = {
    name: Facet(name, (x, y, 0.0), (0.0, 0.0, 1.0)) for name, x, y in (("a", 90.0, 0.0), ("b", -60.0, 70.0), ("c", 0.0, -120.0))
}
EVENTS = {
    "chip": {"facet": "b", "at": 4},
    "encoder_harmonic": {"axis": "B"},
    "error_motion": {"name": "EAY"},
    "rotary_backlash": {"axis": "B"},
    "spindle_orientation": {"order": 1},
    "cyclic_error": {"axis": "Z"},
    "step": {"at": 7},
}


def of_time(cause: str) -> bool:
    """effect → whether it depends on when a touch is made; so does one without an example."""
    try:
        chosen = effects.checked(world(cause).effects)
    except InputError:
        return True
    later = replace(TOUCHES, time=2 * TOUCHES.time, warm=2 * TOUCHES.warm)
    return not same(effects.disturbance(chosen, TOUCHES, 5), effects.disturbance(chosen, later, 5))


@pytest.mark.few(0)
@pytest.mark.parametrize("cause", [c for c in EVERY if c != "swapped_facets" and not of_time(c)])
def test_touch_by_touch_an_effect_is_the_same_as_all_at_once(cause: str) -> None:
    """A program that returns to a safe height takes its own time, so effects of time are left out."""
    table = Artefact("three tops", TOPS)
    indexations = [Indexation({"B": 0.0, "C": np.radians(40.0 * i), "S": np.radians(120.0 * i)}, ("a", "b", "c")) for i in range(3)]
    strategy = Strategy("tops", Approach(10, 5, 180), tuple(indexations))
    true = replace(world(cause, **EVENTS.get(cause, {})), errors={"EXB2": 1e-3}, stylus=STYLUS)
    if cause == "cylinder_cosine":
        true = replace(true, effects=({"cause": cause, "radius": 200, "axis": [1, 0, 0]},))
    wanted = simulate(MACHINE, table, strategy, true).position
    nominal = simulate(MACHINE, table, strategy, World()).position
    motion = Motion(rig(MACHINE, table, true))
    for i, contact in enumerate(nominal):
        there = dict(zip(MACHINE.names, contact, strict=True))
        motion.rapid({"Z": 600.0})
        motion.rapid({name: there[name] for name in "BCS"})
        motion.rapid({name: there[name] for name in "XY"})
        motion.rapid({"Z": there["Z"] + 10})
        hit = motion.skip({"Z": there["Z"] - 5}, 180)
        assert hit.position == pytest.approx(wanted[i], abs=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("example", sorted(folder.name for folder in EXAMPLES.iterdir()))
def test_effects_work_on_every_machine_that_has_the_axes_for_them(example: str) -> None:
    cell = read_cell(EXAMPLES / example)
    rotary, facets = cell.machine.rotary, list(cell.artefact.facets)
    own = {"chip": {"facet": facets[0]}, "swapped_facets": {"facets": facets[:2]}}
    own["axis_location"] = {"name": "EB0Z", "amplitude": 2e-5}
    chosen = []
    for cause in EVERY:
        keys = {**effects.example(cause), **own.get(cause, {})}
        if keys.get("axis") in ("B", "C"):
            if not rotary:
                continue
            keys["axis"] = rotary[-1]
            direction = np.zeros(3)
            direction["ABC".index(rotary[-1]) - 1] = 1.0
            keys |= {"direction": direction.tolist()} if "direction" in keys else {}
        chosen.append({"cause": cause, **keys})
    plain = simulate(cell.machine, cell.artefact, cell.strategy, World(stylus=STYLUS))
    changed = simulate(cell.machine, cell.artefact, cell.strategy, World(stylus=STYLUS, effects=tuple(chosen)))
    assert set(changed.status) == {"ok"}
    moved = np.abs(changed.position - plain.position).max(axis=1)
    assert 0.005 < moved.max() < 0.3 and np.median(moved) > 0.002


@pytest.mark.few(0)
def test_effects_add_up() -> None:
    both = World(effects=world("step").effects + world("chip").effects, seed=5)
    alone = [simulate(MACHINE, CELL.artefact, CELL.strategy, world(cause)).position - PLAIN.position for cause in ("step", "chip")]
    together = simulate(MACHINE, CELL.artefact, CELL.strategy, both).position - PLAIN.position
    assert together == pytest.approx(alone[0] + alone[1], abs=1e-11)


@pytest.mark.parametrize("letter", ["B", "C"])
def test_the_lever_of_a_rotary_axis_is_what_a_wrong_angle_does(letter: str) -> None:
    wrong = 1e-6
    turned = simulate(MACHINE, CELL.artefact, CELL.strategy, World({f"E{letter}{letter}0": wrong}))
    assert early(turned.position, PLAIN.position) == pytest.approx(wrong * lever(TOUCHES, letter), abs=1e-9)


@pytest.mark.parametrize(
    ("effect", "complaint"),
    [
        ({"cause": "thermal_drfit"}, r"effects\[0\]\.cause: found 'thermal_drfit'.*Did you mean 'thermal_drift'"),
        ({"cause": "Thermal_Drift"}, r"effects\[0\]\.cause: found 'Thermal_Drift'.*Did you mean 'thermal_drift'"),
        ({"cause": "step", "AMPLITUDE": 1}, r"effects\[0\]: found the unknown key 'AMPLITUDE'.*Did you mean 'amplitude'"),
        ({"cause": "step", "amplitud": 1}, r"effects\[0\]: found the unknown key 'amplitud'.*Did you mean 'amplitude'"),
        ({"cause": "step", "amplitude": 0.1, "at": 3}, "found no key 'direction'; step requires it"),
        ({"cause": "step", "amplitude": "big", "at": 3, "direction": [0, 0, 1]}, "found 'big'; allowed: a finite number"),
        ({"cause": "step", "amplitude": 0.1, "at": 2.5, "direction": [0, 0, 1]}, "found 2.5; allowed: a whole number"),
        ({"cause": "step", "amplitude": 0.1, "at": 2, "direction": [0, 0, 0]}, "three numbers, not all zero"),
        ({"cause": "backlash", "amplitude": 0.1, "axis": "B"}, "found 'B'; allowed: X, Y, Z"),
        ({"cause": "surface_form", "amplitude": 0.1, "facets": 16}, "found 16; allowed: a list of names"),
        (
            {"cause": "thermal_drift", "amplitude": 0.1, "tau": 0, "direction": [1, 0, 0]},
            r"\.tau: found 0; allowed: a positive number",
        ),
        ({"cause": "encoder_harmonic", "amplitude": 1e-5, "axis": "X"}, "found 'X'; allowed: B, C"),
        ({"cause": "encoder_harmonic", "amplitude": 1e-5, "axis": "A"}, "found 'A'; allowed: B, C"),
        ({"cause": "encoder_harmonic", "amplitude": 1e-5, "axis": "B", "order": 0}, "found 0; allowed: a whole number from 1"),
        ({"cause": "table_growth", "amplitude": 1e-5, "tau": 9, "centre": [0, 0]}, "allowed: a list of three numbers"),
        ({"cause": "chip", "amplitude": 0.1, "facet": 99}, "found 99; allowed: facets of artefact .*: 3, 4"),
        ({"cause": "chip", "amplitude": 0.1, "facet": [16]}, "allowed: a name or whole number"),
        ({"cause": "error_motion", "amplitude": 0.1, "name": "EYA"}, "found 'EYA'; allowed: EXX, EYX"),
        ({"cause": "error_motion", "amplitude": 0.1, "name": "EYS"}, r"effects\[0\]: found no key 'span'.*axis S has no travel"),
        ({"cause": "error_motion", "amplitude": 0.1, "name": "EYX", "degree": 10}, "degree: found 10; allowed: 1 to 9"),
        ({"cause": "axis_location", "amplitude": 0.1, "name": "EYC"}, "found 'EYC'; allowed: EX0X"),
        ({"cause": "moving_mass", "amplitude": 1e-5, "name": "EXZ", "by": "Y"}, "found EXZ by Y; allowed: an angle"),
        ({"cause": "moving_mass", "amplitude": 1e-5, "name": "EAY", "by": "Y"}, "found EAY by Y; allowed: .* another axis than Y"),
        (
            {"cause": "rotary_radial", "amplitude": 0.01, "axis": "B", "direction": [0, -2, 0]},
            r"direction: found \[0.0, -2.0, 0.0\], which is along B",
        ),
        ({"cause": "compensation_kink", "axis": "X", "nodes": [0, 0], "values": [1, 2]}, "nodes: .* each greater"),
        ({"cause": "compensation_kink", "axis": "X", "nodes": [0, 1], "values": [1]}, "values: found 1 for 2 nodes"),
        ({"cause": "compensation_kink", "axis": "X", "nodes": [0, "a"], "values": [1, 2]}, "allowed: a list of numbers"),
        ({"cause": "swapped_facets", "facets": [16]}, "facets: found 16; allowed: two different facets"),
        ({"cause": "swapped_facets", "facets": [16, 16]}, "facets: found 16, 16; allowed: two different facets"),
        ({"cause": "cylinder_cosine", "radius": 200, "facets": [16, 3]}, r"facets: found 16; allowed: flat facets whose normal"),
        ({"cause": "outliers", "amplitude": 0.1, "rate": 2}, "rate: found 2.0; allowed: a share"),
        ({"cause": "spindle_orientation", "amplitude": 0.1, "order": -1}, "order: found -1; allowed: 0"),
    ],
)
def test_a_wrong_effect_is_refused(effect: dict, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        rig(MACHINE, CELL.artefact, World(effects=(effect,)))


def test_a_disturbance_without_anything_changes_nothing() -> None:
    nothing = effects.disturbance((), TOUCHES, 5)
    assert isinstance(nothing, Disturbance)
    assert not np.any(nothing.gap) and not np.any(nothing.work) and not np.any(nothing.table) and not nothing.errors


def test_what_can_be_hidden_is_listed(tmp_path: Path) -> None:
    result = CliRunner().invoke(tango, ["simulate", "--list-effects", "-C", str(tmp_path)])
    assert result.exit_code == 0
    assert "thermal_drift: amplitude, direction, tau, [shape]\n    The machine warms up" in result.output
    assert not list(tmp_path.iterdir())
