"""What a plan can see: computed, not listed; and what it cannot, in words that name the combination."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.machines import machine_of

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.identify import Selection, describe, independent, select, subset_terms, summary
from tango_cnc.records import Approach, Artefact, Cell, Facet, Indexation, Strategy, World
from tango_cnc.touches import from_readings

EXAMPLES = Path(__file__).parent.parent / "examples"


def cell_named(name: str) -> Cell:
    return read_cell(EXAMPLES / name)


def selected(cell: Cell, terms: list[str], degree: int = 3) -> Selection:
    readings = simulate(cell.machine, cell.artefact, cell.strategy, World())
    return select(from_readings(cell.machine, cell.artefact, readings), terms, degree)


def machine_names(selection: Selection) -> list[str]:
    return [c.name for c in selection.model.coefficients if c.slot.axis not in ("t", "w")]


@pytest.fixture(scope="module")
def hu40t() -> Cell:
    return cell_named("hu40t")


def test_s4_of_the_hu40t_is_eighty_six_names(hu40t):
    selection = selected(hu40t, ["S4"])
    assert len(machine_names(selection)) == 86
    assert not selection.unseen


@pytest.mark.few(2)
@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 6])
def test_degree_is_an_option_to_six(degree):
    names = [c.name for c in subset_terms(machine_of("wCBXfZY(S)t"), 3, degree)]
    powers = [int(n[3]) for n in names if n[3].isdigit() and n[2] != "0"]
    assert max(powers) == degree
    # Six components of five axes each, but for what only another choice of reference would call an error.
    assert powers.count(degree) == (20 if degree == 1 else 26)


def test_two_names_of_one_displacement_are_told_as_their_sum_or_difference(hu40t):
    """Asked for by name, the second of two that move every touch alike is left out and the pair is named."""
    texts = {c.names[0]: c.text for c in selected(hu40t, ["S3", "EYY0", "EC0X"]).unseen}
    assert texts["EYY0"] == "EYY0 and EY0S cannot be separated: only their sum is known"
    assert texts["EC0X"] == "EC0X and EC0Y cannot be separated: only their difference is known"


def test_a_slope_and_the_squarenesses_it_mimics_are_told_with_signs(hu40t):
    (one,) = selected(hu40t, ["S3", "EYX1"]).unseen
    assert one.text == ("EYX1 cannot be separated from EC0Y and EC0B: only EC0Y - EYX1 and EC0B - EYX1 are known") or one.text == (
        "EYX1 cannot be separated from EC0B and EC0Y: only EC0B - EYX1 and EC0Y - EYX1 are known"
    )


@pytest.mark.long
def test_what_is_said_to_be_known_is_known(hu40t):
    """Moving along the named combination changes no touch; weights are in the units of the unknowns."""
    for combination in selected(hu40t, ["S3", "EYX1", "EYY0", "EZX0"]).unseen:
        readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, World())
        step = dict(zip(combination.names, combination.weights, strict=True))
        small = {name: 1e-6 * weight for name, weight in step.items() if not name.startswith("EZf")}
        stylus = {name: value for name, value in small.items() if name.endswith("t")}
        facets = {name[3:]: 1e-6 * weight for name, weight in step.items() if name.startswith("EZf")}
        errors = {name: value for name, value in small.items() if not name.endswith("t")}
        moved = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, World(errors=errors, stylus=stylus, facets=facets))
        assert np.abs(moved.position - readings.position).max() < 1e-7, combination.text
        alone = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, World(errors={combination.names[0]: 1e-6}))
        assert np.abs(alone.position - readings.position).max() > 5e-7


def test_without_turning_the_spindle_its_offsets_are_the_stylus_own(hu40t):
    still = tuple(i for i in hu40t.strategy.indexations if not i.position.get("S"))
    cell = replace(hu40t, strategy=replace(hu40t.strategy, indexations=still))
    texts = [c.text for c in selected(cell, ["S3"]).unseen]
    assert texts == [
        "EX0S and EXt cannot be separated: only their sum is known",
        "EY0S and EYt cannot be separated: only their sum is known",
    ]


def test_a_round_table_does_not_see_its_own_axis_turn():
    """Rounded facet points let C move the touches by a ten-millionth of a radius: that is not seeing."""
    huron = cell_named("huron")
    on_the_cylinder = replace(
        huron.strategy,
        indexations=tuple(replace(i, facets=tuple(f for f in i.facets if f != "10")) for i in huron.strategy.indexations),
    )
    texts = {c.names[0]: c.text for c in selected(replace(huron, strategy=on_the_cylinder), ["S2", "ECCb", "ECC2"]).unseen}
    assert texts["ECCb"] == "ECCb moves no touch of this plan"
    assert texts["ECC2"] == "ECC2 moves no touch of this plan"


@pytest.mark.long
def test_touches_too_noisy_for_a_power_leave_it_out_and_say_by_how_much(hu40t):
    """A polynomial of degree six is there in exact arithmetic, and would be known to millimetres."""
    selection = selected(hu40t, ["S4"], 6)
    faint = {c.names[0]: c.text for c in selection.unseen if "touches that scatter by 0.7 µm" in c.text}
    assert faint and all(name[3] in "3456" and name[2] != "0" for name in faint)  # the lower powers stay
    finer = replace(hu40t, machine=replace(hu40t.machine, probe=replace(hu40t.machine.probe, repeatability=0.0001)))
    assert len(machine_names(selected(finer, ["S4"], 6))) > len(machine_names(selection))


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("name", "degree"), [("hu40t", 4), ("hu40t", 6), ("huron", 6), ("trunnion", 5), ("fork_head", 6), ("split", 4)]
)
def test_every_degree_settles_with_noise_on_every_five_axis_cell(name, degree):
    cell = cell_named(name)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, read_world(EXAMPLES / name / "world.yaml"))
    result = estimate(cell.machine, cell.artefact, readings, ["S4"], degree)
    assert 0.8 < result.sigma / 0.0007 < 1.2
    worst = max(p.std for p in result.parameters.values() if p.unit == "mm")
    assert worst < 0.5


def test_same_words_are_said_once():
    texts = [describe(name, "mm", {"EZf1": (1.0, "mm"), "EZf2": (-1.0, "mm")}).text for name in ("EXX1", "EC0X")]
    (said,) = summary(texts)
    assert said.startswith("EXX1, EC0X cannot be separated from the positions of the facets")
    others = [describe("ECCb", "rad", {}).text, describe("EYY0", "mm", {"EY0S": (1.0, "mm")}).text]
    assert summary(others) == ["ECCb moves no touch of this plan", others[1]]


def test_units_that_differ_are_said_with_a_factor():
    text = describe("EA0C", "rad", {"EY0C": (-50.0, "mm")}).text
    assert text == "EA0C and EY0C cannot be separated: only EY0C - 50 · EA0C (in mm, EA0C in rad) is known"


@pytest.mark.few(0)
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_columns_kept_span_all_and_weights_rebuild_the_rest(seed):
    rng = np.random.default_rng(seed)
    rank, count = rng.integers(1, 8), 10
    matrix = rng.normal(size=(30, rank)) @ rng.normal(size=(rank, count)) * 10.0 ** rng.uniform(-9, 9, count)
    kept, left = independent(matrix, np.linalg.norm(matrix, axis=0))
    assert len(kept) == rank
    for j, weights in left.items():
        rebuilt = matrix[:, kept[: len(weights)]] @ weights
        assert np.linalg.norm(rebuilt - matrix[:, j]) < 1e-6 * np.linalg.norm(matrix[:, j])


def test_the_first_of_equals_is_kept():
    column = np.arange(1.0, 6.0)[:, None]
    kept, left = independent(np.hstack([column, -2 * column, column**2]), np.full(3, 10.0))
    assert kept == [0, 2]
    np.testing.assert_allclose(left[1], [-2.0])


def test_where_no_touch_compares_x_with_the_others_the_place_of_the_axis_stays_and_a_gain_is_left_out():
    """The only rotary axis turns about X, 5 mm beside the origin: its place left out, 30 µm of it were 6000 µm/m of two gains."""
    machine = machine_of("wAXfYZ(S)t")
    axes = tuple(replace(axis, point=(0.0, 5.0, 20.0)) if axis.name == "A" else axis for axis in machine.axes)
    machine = replace(machine, axes=axes)
    normals = {"1": (1, 0, 0), "2": (-1, 0, 0), "3": (0, 1, 0), "4": (0, -1, 0), "5": (0, 0, 1), "6": (0, 0, 1), "7": (0, 1, 0)}
    places = {
        "1": (52, -18, 40),
        "2": (-48, 18, 40),
        "3": (30, 36, 40),
        "4": (-30, -26, 40),
        "5": (40, 25, 50),
        "6": (-36, -14, 50),
    }
    places["7"] = (-25, 36, 20)
    facets = {key: Facet(key, tuple(map(float, places[key])), tuple(map(float, n))) for key, n in normals.items()}
    turned = [(a, s) for a in (-1.6, -0.9, -0.3, 0.3, 0.9, 1.6) for s in (0.0, np.pi)]
    seen = {a: tuple(k for k, n in normals.items() if n[1] * np.sin(a) + n[2] * np.cos(a) > -0.1) for a, _ in turned}
    strategy = Strategy("block", Approach(5.0, 3.0, 100.0), tuple(Indexation({"A": a, "S": s}, seen[a]) for a, s in turned))
    artefact = Artefact("block", facets)
    readings = simulate(machine, artefact, strategy, World(errors={"EY0A": 0.03}, noise=0.0))
    result = estimate(machine, artefact, readings, ["S3"])
    found = {name: p.value for name, p in result.parameters.items()}
    assert found["EY0S"] == pytest.approx(-0.03, abs=1e-5) and abs(found["EZZ1-EYY1"]) < 1e-5 and abs(found["EA0Z"]) < 1e-5
    assert result.sigma < 1e-5 and {c.names[0] for c in result.selection.unseen} >= {"EXX1", "EYY1"}
