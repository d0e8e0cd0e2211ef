"""Other machines, other tables: what S3 means for each of them, chapter 5 of the thesis, and machines without rotary axes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.machines import machine_of

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_strategy, read_world
from tango_cnc.identify import select, subset_terms
from tango_cnc.model import STYLUS, Model, linearise, setup_coefficient
from tango_cnc.records import Approach, Artefact, Ball, Cell, Facet, Indexation, Readings, ScaleBar, Strategy, World
from tango_cnc.terms import find
from tango_cnc.touches import from_readings

EXAMPLES = Path(__file__).parent.parent / "examples"
FIVE_AXES = {
    "wCBXfZY(S)t": "EC0Y EB0Z EA0Y EA0B EC0B EX0C EA0C EB0C",
    "wCAYfXZ(S)t": "EC0X EA0Z EB0Z EB0A EC0A EY0C EA0C EB0C",
    "wXYfZCA(S)t": "EC0X EA0Z EB0Z EA0C EB0C EY0A EB0A EC0A",
    "wCXfYZB(S)t": "EC0Y EB0Z EA0Z EX0C EA0C EB0C EA0B EC0B",
    "wfXYZCB(S)t": "EC0Y EB0Z EA0Z EA0C EB0C EX0B EA0B EC0B",
    "wXfYZAB(S)t": "EC0Y EB0Z EA0Z EB0A EC0A EZ0B EA0B EC0B",
    "wACXfYZ(S)t": "EC0Y EB0Z EA0Z EA0C EB0C EY0A EB0A EC0A",
    "wBfXZYA(S)t": "EB0Z EC0Y EA0Y EZ0B EA0B EC0B EB0A EC0A",
    "wABXfYZ(S)t": "EC0Y EB0Z EA0Z EA0B EC0B EZ0A EB0A EC0A",
}


def inter_axis_names(names: list[str]) -> set[str]:
    return {n for n in names if n[2] == "0" and n[3] != "S"}


@pytest.mark.parametrize("topology", FIVE_AXES)
def test_five_axes_have_eight_axis_location_errors_and_two_spindle_offsets(topology):
    """ISO 10791-6 and the thesis count eight; which eight follows from the chain alone."""
    names = [c.name for c in subset_terms(machine_of(topology), 2, 3)]
    assert inter_axis_names(names) == set(FIVE_AXES[topology].split())
    assert {"EX0S", "EY0S", "EXX1", "EYY1", "EZZ1"} <= set(names)


@pytest.mark.parametrize("name", ["hu40t", "huron", "trunnion", "fork_head", "split"])
def test_every_five_axis_cell_finds_its_own_eight(name):
    machine = read_cell(EXAMPLES / name).machine
    found = inter_axis_names([c.name for c in subset_terms(machine, 2, 3)])
    assert found == set(FIVE_AXES[machine.topology.replace("b", "f")].split())


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["huron", "trunnion", "fork_head", "split"])
def test_noise_free_readings_of_every_five_axis_cell_return_the_whole_model(name):
    """S4 on other chains: 20 µm and 60 µrad of everything at the end of the travel, back to 1e-8 mm and 1e-11 rad."""
    cell, rng = read_cell(EXAMPLES / name), np.random.default_rng(10)
    selection = select(from_readings(cell.machine, cell.artefact, readings_of(cell, cell.strategy)), ["S4"])
    names = [c.name for c in selection.model.coefficients if c.slot.axis != "t"]
    assert len(names) > 60
    position = np.abs(selection.model.touches.position).max(axis=0)
    power = {n: int(n[3]) if n[3].isdigit() and n[2] != "0" else 0 for n in names}
    reach = {n: position[cell.machine.column(n[2])] ** power[n] if power[n] else 1.0 for n in names}
    errors = {n: rng.uniform(-1, 1) * (0.02 if n[1] in "XYZ" else 6e-5) / reach[n] for n in names}
    stylus = {"EXt": 0.03, "EYt": -0.02, "EZt": 0.05}
    facets = {f.id: rng.uniform(-0.03, 0.03) for f in cell.artefact.facets.values() if f.ball is None}
    world = World(errors=errors, stylus=stylus, facets=facets)
    result = estimate(cell.machine, cell.artefact, readings_of(cell, cell.strategy, world), ["S4"])
    found = {n: result.value(n) for n in names}
    wrong = {n: abs(found[n] - errors[n]) * reach[n] for n in names}
    assert max(wrong[n] for n in names if n[1] in "XYZ") < 1e-8
    assert max(wrong[n] for n in names if n[1] in "ABC") < 1e-11
    assert max(abs(result.value(n) - stylus[n]) for n in stylus) < 1e-8


def test_inclined_axis_has_the_errors_of_table_5_1():
    huron = read_cell(EXAMPLES / "huron")
    assert max(huron.machine.axis("A").direction) == pytest.approx(0.5**0.5)
    table_5_1 = {"EY0C", "EA0C", "EB0C", "EB0A", "EC0A", "EC0X", "EA0Z", "EB0Z"}
    assert inter_axis_names([c.name for c in subset_terms(huron.machine, 2, 3)]) == table_5_1


def test_four_axes_have_five_and_three_have_their_squarenesses():
    four = [c.name for c in subset_terms(machine_of("wCXfYZ(S)t"), 2, 3)]
    assert inter_axis_names(four) == {"EC0Y", "EB0Z", "EA0Z", "EA0C", "EB0C"}
    three = [c.name for c in subset_terms(machine_of("wXYfZ(S)t"), 2, 3)]
    assert inter_axis_names(three) == {"EC0X", "EA0Z", "EB0Z"}


def pallet(bar: bool) -> Artefact:
    """Six facets around a block, and two balls 200 mm apart along X."""
    sides = {"1": (1, 0, 0), "2": (-1, 0, 0), "3": (0, 1, 0), "4": (0, -1, 0), "5": (0, 0, 1), "6": (0, 0, 1)}
    places = {
        "1": (160, 60, -50),
        "2": (-160, 60, -50),
        "3": (60, 160, -50),
        "4": (60, -160, -50),
        "5": (120, 90, 0),
        "6": (-90, -90, 0),
    }
    facets = {name: Facet(name, places[name], sides[name]) for name in sides}
    balls = {"1": Ball("1", (-100.0, 0.0, -5.0), 10.0), "2": Ball("2", (100.0, 0.0, -5.0), 10.0)}
    for ball in balls.values():
        for i, side in enumerate(((0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))):
            point = tuple(c + ball.radius * n for c, n in zip(ball.centre, side, strict=True))
            facets[f"{ball.id}ball{i}"] = Facet(f"{ball.id}ball{i}", point, side, ball=ball.id)
    if not bar:
        return Artefact("pallet", {name: facets[name] for name in sides})
    return Artefact("pallet", facets, balls, ScaleBar(("1", "2"), 200.0, 0.0005))


@pytest.mark.parametrize("bar", [True, False])
def test_a_head_with_one_axis_tells_the_scale_of_x_by_a_bar_and_else_that_of_z_against_it(bar):
    """B turns Z into X: without a bar only the difference of their scales is known. S3 once left EXX1 out without a word."""
    machine, artefact = machine_of("wXYfZB(S)t"), pallet(bar)
    turns = [0.0, -1.5, -1.0, -0.5, 0.4, 0.9, 1.4]
    indexations = [
        Indexation({"B": b, "S": 0.0}, tuple(artefact.facets) if b == 0 else ("1", "2", "3", "4", "5", "6")) for b in turns
    ]
    indexations += [Indexation({"B": 0.0, "S": s * np.pi / 2}, ("1", "2", "3", "4")) for s in range(1, 4)]
    strategy = Strategy("turns", Approach(8.0, 4.0, 180.0), tuple(indexations))
    readings = simulate(machine, artefact, strategy, World(errors={"EXX1": 15e-6, "EZZ1": -34e-6}))
    result = estimate(machine, artefact, readings, ["S3"])
    found = {name: p.value for name, p in result.parameters.items()}
    if bar:
        assert (found["EXX1"], found["EZZ1"]) == pytest.approx((15e-6, -34e-6), abs=1e-9)
    else:
        assert found["EZZ1-EXX1"] == pytest.approx(-49e-6, abs=1e-9)
        assert not {"EXX1", "EZZ1"} & set(found)
        assert "EXX1" in {c.names[0] for c in result.selection.unseen}


@pytest.mark.parametrize("touched", ["123456", "3456"])  # without 1 and 2 no touch moves with X
def test_a_table_with_one_axis_about_x_leaves_out_a_scale_and_not_a_location_of_its_axis(touched):
    """A turns Y into Z: without a bar only the difference of their scales is known. Nothing shows EXX1, for a reason of its own.

    The scale that Y and Z share moves the pivot, which is 5 mm off in Y, as EY0S does. With both scales in and EY0S left out
    30 µm of EY0A came out as 6 mm/m of scale, and with the noise of a probe as 0.6 mrad of EA0Z.
    """
    machine, artefact = machine_of("wAXfYZ(S)t"), pallet(bar=False)
    machine = replace(machine, axes=tuple(replace(a, point=(0.0, 5.0, 20.0)) if a.name == "A" else a for a in machine.axes))
    turns = [-1.3, -0.9, -0.5, 0.0, 0.4, 0.8, 1.2]
    indexations = [Indexation({"A": a, "S": 0.0}, tuple(touched)) for a in turns]
    indexations += [Indexation({"A": 0.0, "S": s * np.pi / 2}, tuple(touched)) for s in range(1, 4)]
    strategy = Strategy("turns", Approach(8.0, 4.0, 180.0), tuple(indexations))
    readings = simulate(machine, artefact, strategy, World(errors={"EY0A": 0.03, "EYY1": 15e-6, "EZZ1": -34e-6}))
    result = estimate(machine, artefact, readings, ["S3"])
    found = {name: p.value for name, p in result.parameters.items()}
    assert found["EY0S"] == pytest.approx(-0.03 + 5 * 15e-6, abs=1e-6)  # the 5 mm of the pivot in units of Y
    assert found["EZZ1-EYY1"] == pytest.approx(-49e-6, abs=1e-8)
    assert not {"EXX1", "EYY1", "EZZ1"} & set(found)
    said = {c.names[0]: c.text for c in result.selection.unseen}
    assert "only scale mismatches against Y" in said["EYY1"] and "EZZ1-EYY1" in said["EYY1"]


@pytest.fixture(scope="module")
def huron() -> Cell:
    return read_cell(EXAMPLES / "huron")


@pytest.fixture(scope="module")
def s1(huron) -> Strategy:
    return huron.strategy


@pytest.fixture(scope="module")
def s2(huron) -> Strategy:
    return read_strategy(EXAMPLES / "huron" / "strategy_s2.yaml", huron.machine, huron.artefact)


def only(strategy: Strategy, keep: Callable[[str], bool]) -> Strategy:
    indexations = [replace(i, facets=tuple(f for f in i.facets if keep(f))) for i in strategy.indexations]
    return replace(strategy, indexations=tuple(i for i in indexations if i.facets))


def readings_of(cell: Cell, strategy: Strategy, world: World | None = None) -> Readings:
    return simulate(cell.machine, cell.artefact, strategy, world or World())


def condition(cell: Cell, strategy: Strategy) -> float:
    """Raw condition number, mm and rad, of all that the cell's terms ask for but the absolute scale, as in the thesis."""
    touches = from_readings(cell.machine, cell.artefact, readings_of(cell, strategy)).nominal
    names = ["EYY1", "EZZ1", *(n for n in cell.terms if n != "S2")]
    wanted = [c for name in names for c in find(name, cell.machine)]
    model = Model(touches, (*wanted, *(setup_coefficient(name) for name in STYLUS)))
    return float(np.linalg.cond(linearise(model, np.zeros(len(model.names)))[1]))


def test_strategies_are_those_of_chapter_five(s1, s2):
    for strategy, touches, facets in ((s1, 156, 10), (s2, 118, 8)):
        assert sum(len(i.facets) for i in strategy.indexations) == touches
        assert len({f for i in strategy.indexations for f in i.facets}) == facets
        assert len(strategy.indexations) == 23
    combinations = np.array([[i.position["A"], i.position["C"]] for i in s1.indexations])
    assert len({tuple(row) for row in combinations.tolist()}) == 23
    assert abs(np.corrcoef(combinations.T)[0, 1]) < 0.5  # no line through them


@pytest.mark.few(0)
def test_facets_of_a_single_section_leave_the_model_singular_and_the_message_says_why(huron, s1, s2):
    """One ring of facets: tilting the table about its own section is the same as shifting it."""
    for strategy, ring, height in ((s1, "1 2 3 4 5 6", 50), (s2, "22 24 26 28", 50), (s2, "21 23 25 27", 30)):
        section = only(strategy, lambda f, ring=ring: f in ring.split())
        assert condition(huron, section) > 1e9
        touches = from_readings(huron.machine, huron.artefact, readings_of(huron, section))
        texts = {c.names[0]: c.text for c in select(touches, huron.terms).unseen}
        assert set(texts) == {"EA0C", "EB0C", "EXX1"}
        assert f"only EY0C - {height} · EA0C" in texts["EA0C"]
        assert "cannot be separated from" in texts["EB0C"] and "EXt" in texts["EB0C"] and "EZt" in texts["EB0C"]


@pytest.mark.few(0)
def test_top_points_condition_better_than_two_sections_and_those_better_than_anything_less(huron, s1, s2):
    without_top = only(s1, lambda f: f not in ("7", "8", "9"))
    single = only(s1, lambda f: f in ("1", "2", "3", "4", "5", "6"))
    numbers = [condition(huron, strategy) for strategy in (s1, s2, without_top, single)]
    assert numbers == sorted(numbers)
    assert numbers[1] < 0.5 * numbers[2] < 1e-3 * numbers[3]


@pytest.mark.long
def test_both_strategies_find_the_machine_and_the_top_points_help(huron, s1, s2):
    """Table 5-2: without points on the top the rotary axes' orientation suffers."""
    world = read_world(EXAMPLES / "huron" / "world.yaml")
    std = {}
    for name, strategy in (("S1", s1), ("S2", s2)):
        result = estimate(huron.machine, huron.artefact, readings_of(huron, strategy, world), huron.terms)
        for label, p in result.parameters.items():
            one, _, other = label.partition("-")
            assert abs(p.value - world.errors[one] + world.errors.get(other, 0.0)) < 4 * p.std, label
        std[name] = {label: p.std for label, p in result.parameters.items()}
    assert all(std["S1"][name] < std["S2"][name] for name in ("EA0C", "EB0C"))


def test_three_axes_on_their_own_table_tell_nothing_but_the_stylus():
    cell = read_cell(EXAMPLES / "three_axis")
    selection = select(from_readings(cell.machine, cell.artefact, readings_of(cell, cell.strategy)), cell.terms)
    assert [c.name for c in selection.model.coefficients] == ["EXt", "EYt"]
    unseen = {c.names[0]: c.text for c in selection.unseen}
    assert {"EXX1", "EYY1", "EZZ1", "EC0X", "EA0Z", "EB0Z", "EXXb", "EYYb", "EZt"} == set(unseen)
    assert all("cannot be separated from the positions of the facets" in text for text in unseen.values())


def test_three_axes_on_a_calibrated_block_get_scale_and_squareness():
    cell = read_cell(EXAMPLES / "three_axis_calibrated")
    world = read_world(EXAMPLES / "three_axis_calibrated" / "world.yaml")
    result = estimate(cell.machine, cell.artefact, readings_of(cell, cell.strategy, world), cell.terms)
    assert set(result.parameters) == {"EXX1", "EYY1", "EZZ1", "EC0X", "EA0Z", "EB0Z", "EXXb", "EYYb"}
    assert not result.selection.unseen
    assert {n: p for n, p in result.parameters.items() if abs(p.value - world.errors[n]) > 4 * p.std} == {}
    assert max(result.parameters[n].std for n in ("EXX1", "EYY1", "EZZ1", "EC0X", "EA0Z", "EB0Z")) < 6e-6


def test_a_block_laid_on_crookedly_gives_the_same_machine():
    """Placement: the artefact shifted by 0.2 mm and turned by 0.3 mrad is found, and the machine's errors stay what they were."""
    cell = read_cell(EXAMPLES / "three_axis_calibrated")
    world = replace(read_world(EXAMPLES / "three_axis_calibrated" / "world.yaml"), noise=0.0)
    shift, angle = np.array([0.2, -0.1, 0.0]), np.array([2e-4, -1e-4, 3e-4])
    offsets = {}
    for facet in cell.artefact.facets.values():
        point, normal = np.array(facet.point), np.array(facet.normal)
        offsets[facet.id] = float(normal @ (shift + np.cross(angle, point)))
    straight = estimate(cell.machine, cell.artefact, readings_of(cell, cell.strategy, world), cell.terms)
    crooked = estimate(cell.machine, cell.artefact, readings_of(cell, cell.strategy, replace(world, facets=offsets)), cell.terms)
    placed = np.array([crooked.value(n) - straight.value(n) for n in ("EXw", "EYw", "EAw", "EBw", "ECw")])
    np.testing.assert_allclose(placed[:2], shift[:2], atol=2e-4)
    np.testing.assert_allclose(placed[2:], angle, atol=2e-6)
    for name, p in straight.parameters.items():
        assert crooked.parameters[name].value == pytest.approx(p.value, abs=p.std)


def test_a_wrong_certificate_shows():
    """One facet is 20 µm from what its certificate says with 0.5 µm: every touch on it is flagged, whatever else is suspected."""
    cell = read_cell(EXAMPLES / "three_axis_calibrated")
    world = read_world(EXAMPLES / "three_axis_calibrated" / "world.yaml")
    readings = readings_of(cell, cell.strategy, replace(world, facets={"5": 0.02}))
    result = estimate(cell.machine, cell.artefact, readings, cell.terms)
    on_it = {int(touch) for touch, facet in zip(readings.touch, readings.facet, strict=True) if facet == "5"}
    assert len(on_it) == 4
    assert on_it <= set(result.outliers.tolist())
    assert result.sigma > 2 * world.noise
