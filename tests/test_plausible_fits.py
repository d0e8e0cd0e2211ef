"""A mistake is said to fit only where it does; what leaves much is called that, and what leaves more is not proposed at all."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.estimated import judged, measured
from support.trust_parts import members, suspected

from sim_controller.simulate import simulate
from tango_cnc.files import read_cell, read_world
from tango_cnc.judgement import Judgement, Suspicion
from tango_cnc.plausible.fit import explain
from tango_cnc.plausible.mistakes import facet_names
from tango_cnc.plausible.mistakes._case import Case, with_axis, with_probe
from tango_cnc.plausible.search import suspects
from tango_cnc.records import Cell, Readings


def changed(readings: Readings, column: int, values: np.ndarray) -> Readings:
    position = np.array(readings.position)
    position[:, column] = values
    return replace(readings, position=position)


@pytest.fixture(scope="module")
def sound(root: Path) -> tuple[Cell, Readings]:
    return measured(root, "trunnion", 103)


def judged_on(*suspicions: Suspicion) -> Judgement:
    return Judgement("implausible", suspicions=suspicions)


def offset(root: Path) -> tuple[Cell, Readings]:
    """A trunnion machine whose lines of A and C do not meet, and its readings."""
    folder = root / "examples" / "trunnion"
    cell = read_cell(folder)
    machine = with_axis(with_axis(cell.machine, "A", point=(0.0, 15.0, 40.0)), "C", point=(25.0, -10.0, 0.0))
    return replace(cell, machine=machine), simulate(
        machine, cell.artefact, cell.strategy, read_world(folder / "world.yaml"), seed=4
    )


@pytest.mark.long
def test_points_of_two_rotary_axes_that_are_exchanged_are_named(root: Path) -> None:
    cell, readings = offset(root)
    a, c = (cell.machine.axis(name).point for name in "AC")
    first = suspects(replace(cell, machine=with_axis(with_axis(cell.machine, "A", point=c), "C", point=a)), readings)[0]
    assert (first.kind, first.key) == ("points_exchanged", "axes.A.point")
    assert first.change == "write point: [0, 15, 40] for A and point: [25, -10, 0] for C"
    assert first.fits and first.after < 2e-3


@pytest.mark.long
def test_a_table_mirrored_about_the_line_of_its_axis_is_named(root: Path) -> None:
    cell, readings = offset(root)
    facets = {
        k: replace(f, point=(50 - f.point[0], *f.point[1:]), normal=(0.0 - f.normal[0], *f.normal[1:]))
        for k, f in cell.artefact.facets.items()
    }
    balls = {k: replace(b, centre=(50 - b.centre[0], *b.centre[1:])) for k, b in cell.artefact.balls.items()}
    first = suspects(replace(cell, artefact=replace(cell.artefact, facets=facets, balls=balls)), readings)[0]
    assert (first.kind, first.fits) == ("table_placement", True)
    assert first.text == "the readings fit if x of every facet is mirrored about the line of C"


@pytest.mark.long
@pytest.mark.parametrize("gain", [1.0005, 0.998])
def test_a_gain_of_a_rotary_axis_is_named(gain: float, sound: tuple[Cell, Readings]) -> None:
    cell, readings = sound
    column = cell.machine.column("C")
    named = suspects(cell, changed(readings, column, readings.position[:, column] * gain))[0]
    assert named.kind == "rotary_gain" and named.key == "C" and named.fits
    assert f"C turns {1 / gain:.4g}" in named.text


@pytest.mark.long
def test_what_leaves_much_is_not_said_to_fit(sound: tuple[Cell, Readings]) -> None:
    cell, readings = sound
    z = cell.machine.column("Z")
    bent = readings.position[:, z] + 0.3 * np.sin(readings.touch * 1.7)  # nobody's single mistake
    turned = with_axis(cell.machine, "A", direction=tuple(-c for c in cell.machine.axis("A").direction))
    named = suspects(replace(cell, machine=turned), changed(readings, z, bent))
    assert named and named[0].fits is False and named[0].kind == "sense"
    assert named[0].text == "less is left if A turns the other way"
    lines = suspected(judged_on(*named))
    assert lines[0].startswith("no single mistake explains the readings; the one that explains most: if A turns the other way (")
    assert not any("the readings fit" in line for line in lines)
    assert members(judged_on(*named))["suspicions"][0]["evidence"]["fits"] is False


@pytest.mark.long
def test_nothing_is_proposed_that_leaves_more_than_it_began_with(sound: tuple[Cell, Readings]) -> None:
    cell, readings = sound
    rng = np.random.default_rng(5)
    for share in (0.25, 0.4):
        wrong = np.where(rng.random(len(readings)) < share, rng.uniform(0.01, 0.06, len(readings)), 0.0)
        z = cell.machine.column("Z")
        for s in suspects(cell, changed(readings, z, readings.position[:, z] + wrong)):
            assert s.after < s.before


def test_a_renumbering_gives_no_number_twice(sound: tuple[Cell, Readings]) -> None:
    cell, readings = sound
    x = cell.machine.column("X")
    given = changed(readings, x, -readings.position[:, x])  # touches of several facets are then nearest to the same one
    case = Case(cell, given, explain(cell.machine, cell.artefact, given))
    tried = [h.artefact for h in facet_names.hypotheses(case) if h.artefact is not None]
    assert tried
    for artefact in tried:
        places = [f.point for f in artefact.facets.values()]
        assert len(places) == len(set(places))


@pytest.mark.long
def test_a_stylus_that_is_clearly_not_as_long_as_stated_gets_one_remark(sound: tuple[Cell, Readings]) -> None:
    cell, readings = sound
    assert not any("length of the stylus" in text for text in judged(cell, readings).remarks)
    longer = replace(cell, machine=with_probe(cell.machine, length=cell.machine.probe.length + 0.7))
    found = judged(longer, readings)
    (said,) = (text for text in found.remarks if "length of the stylus" in text)
    assert found.verdict == "trustworthy" and "height of a pivot (axes.A.point), is off by 0.7" in said


@pytest.mark.long
@pytest.mark.parametrize("pair", ["XY", pytest.param("YZ", marks=pytest.mark.long)])
def test_two_axes_that_are_exchanged_in_a_third_of_the_rows_are_named(sound: tuple[Cell, Readings], pair: str) -> None:
    cell, readings = sound
    position = np.array(readings.position)
    one, other = (cell.machine.column(name) for name in pair)
    position[60:135, [one, other]] = position[60:135, [other, one]]
    first = suspects(cell, replace(readings, position=position))[0]
    assert (first.kind, first.key, first.fits) == ("axes_exchanged", ", ".join(pair), True)
    assert re.search(r"exchanged in 7\d rows, those of touches 6\d … 13\d", first.text)


@pytest.mark.long
def test_corners_of_the_facets_instead_of_their_centers_are_named(sound: tuple[Cell, Readings]) -> None:
    cell, readings = sound
    rng = np.random.default_rng(8)
    facets = {}
    for key, facet in cell.artefact.facets.items():
        along = np.cross(facet.normal, rng.normal(size=3))
        corner = np.array(facet.point) + (7.0 * along / np.linalg.norm(along) if facet.ball is None else 0.0)
        facets[key] = replace(facet, point=tuple(corner.tolist()))
    first = suspects(replace(cell, artefact=replace(cell.artefact, facets=facets)), readings)[0]
    assert (first.kind, first.key, first.fits) == ("facet_place", "facets", True) and "corners instead of centers" in first.text


@pytest.mark.long
def test_a_work_offset_within_the_tolerance_gets_one_remark(sound: tuple[Cell, Readings]) -> None:
    cell, readings = sound
    x = cell.machine.column("X")
    assert not any("work offset" in text for text in judged(cell, readings).remarks)
    found = judged(cell, changed(readings, x, readings.position[:, x] + 0.5))
    (said,) = (text for text in found.remarks if "work offset" in text)
    assert found.verdict == "trustworthy" and said.startswith("EX0S -0.49")
