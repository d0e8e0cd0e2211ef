"""Obstacles out of a drawing: the convex hull of an STL is kept clear of like a box, and a bad drawing is named."""

from __future__ import annotations

import builtins
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from blockcell import block, cell, machine
from scipy.spatial import ConvexHull

from tango_cnc.check import solid
from tango_cnc.files import artefact_text, read_artefact
from tango_cnc.files.hull import read_hull
from tango_cnc.plan import plan
from tango_cnc.records import InputError, Obstacle

GOLDEN = Path(__file__).parent / "golden"
LOW, HIGH = (105.0, -60.0, 20.0), (130.0, 0.0, 60.0)  # beside facet 1 of the block


def box_points() -> tuple[tuple[float, float, float], ...]:
    return tuple((x, y, z) for x in (LOW[0], HIGH[0]) for y in (LOW[1], HIGH[1]) for z in (LOW[2], HIGH[2]))


def drawn(file: Path) -> Path:
    """A box as CAD would export it, with a hole through it that its hull does not have."""
    size, middle = np.subtract(HIGH, LOW), np.add(HIGH, LOW) / 2
    mesh = trimesh.creation.box(extents=size)
    mesh.apply_translation(middle)
    mesh.subdivide().export(file)
    return file


def obstructed(obstacle: Obstacle) -> str:
    with pytest.raises(InputError) as error:
        plan(cell(machine("wCBXfZY(S)t"), replace(block(), obstacles=(obstacle,)), [{}], facets=["1"]))
    return str(error.value)


def test_a_drawn_box_is_the_box(tmp_path: Path) -> None:
    points = read_hull(drawn(tmp_path / "clamp.stl"))
    assert sorted(points) == sorted(box_points())
    low, high = (solid(replace(block(), obstacles=(o,))) for o in (Obstacle("box", LOW, HIGH), Obstacle("hull", points=points)))
    directions = np.random.default_rng(1).normal(size=(50, 3))
    np.testing.assert_allclose(low.top(directions), high.top(directions))


def test_a_drawing_is_in_the_way_by_its_name(tmp_path: Path) -> None:
    as_box = obstructed(Obstacle("box", low=LOW, high=HIGH))
    as_hull = obstructed(Obstacle("hull", points=read_hull(drawn(tmp_path / "clamp.stl")), file="clamp.stl"))
    assert "touch 1 (facet 1, indexation 1: B 0 C 0 S 0): the stem would hit obstacle 1\n" in as_box
    assert as_hull == as_box.replace("obstacle 1", "obstacle 1 (clamp.stl)")
    assert plan(
        cell(machine("wCBXfZY(S)t"), replace(block(), obstacles=(Obstacle("hull", points=box_points()),)), [{}], facets=["2"])
    )


def test_a_travel_goes_over_a_drawing_between_two_touches() -> None:
    """A post between facets 5 and 6 of the top: 60 mm high; the tip's underside is 10 mm above it."""
    tower = Obstacle("hull", points=tuple((x, y, z) for x in (-5.0, 5.0) for y in (-100.0, 100.0) for z in (-10.0, 50.0)))
    whole = cell(machine("wCBXfZY(S)t"), replace(block(), obstacles=(tower,)), [{}], facets=["5", "6"])
    low = plan(replace(whole, artefact=block()))
    high = plan(whole)
    assert low.touches[0].leave and high.touches[0].leave
    assert high.touches[0].leave[2] == pytest.approx(50 + 10 + 3 + 300)
    assert low.touches[0].leave[2] < high.touches[0].leave[2] - 20


def test_a_hull_of_many_faces_becomes_a_body_of_few_that_holds_it() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=50.0).vertices
    few = solid(replace(block(), obstacles=(Obstacle("hull", points=tuple(map(tuple, ball.tolist()))),))).obstacles[0]
    assert len(few.normal) <= 150
    assert (ball @ few.normal.T <= few.offset + 1e-9).all()
    reach = np.linalg.norm(few.corner, axis=1).max()
    assert 50 < reach < 53
    assert len(ConvexHull(ball).simplices) > 1000


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(GOLDEN / "cell", tmp_path / "cell")
    drawn(tmp_path / "cell" / "clamp.stl")
    return tmp_path / "cell"


def artefact_with(folder: Path, obstacle: str) -> Any:
    file = folder / "artefact.yaml"
    text = file.read_text(encoding="utf-8")
    file.write_text(f"{text}\nobstacles:\n  - {obstacle}\n", encoding="utf-8")
    return read_artefact(file)


def test_the_file_is_looked_for_beside_artefact_yaml_and_may_be_shifted(folder: Path) -> None:
    known = artefact_with(folder, "{kind: hull, file: clamp.stl, shift: [0, 0, 100]}").obstacles[0]
    assert sorted(known.points) == sorted((x, y, z + 100) for x, y, z in box_points())
    assert known.file == "clamp.stl"


def test_what_is_written_again_needs_no_drawing(folder: Path, tmp_path: Path) -> None:
    known = artefact_with(folder, "{kind: hull, file: clamp.stl}")
    (tmp_path / "again.yaml").write_text(artefact_text(known), encoding="utf-8")
    assert sorted(read_artefact(tmp_path / "again.yaml").obstacles[0].points or ()) == sorted(box_points())


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        ("{kind: hull, file: clomp.stl}", "clomp.stl: no such file; its path starts from the folder of artefact.yaml"),
        ("{kind: hull, file: clamp.step}", "found a .step file; allowed: .stl, .obj, .ply. Export the solid as STL, in mm"),
        ("{kind: hull, file: text.stl}", "text.stl: "),
        ("{kind: hull, file: flat.stl}", "flat.stl: found a flat drawing; allowed: a solid"),
        ("{kind: hull, file: metres.stl}", "found a solid of 60000 mm; allowed: up to 20000 mm. Is the drawing in mm?"),
        ("{kind: hull}", "allowed: a 'file', with a 'shift' if need be, or 'points'"),
        ("{kind: hull, points: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}", "found 3 points"),
        ("{kind: hull, file: clamp.stl, scale: 2}", "unknown key 'scale'"),
        ("{kind: cone, file: clamp.stl}", "allowed: box, cylinder, hull"),
    ],
)
def test_a_bad_drawing_is_named_with_file_and_line(folder: Path, obstacle: str, words: str) -> None:
    (folder / "text.stl").write_text("this is no drawing")
    (folder / "clamp.step").write_text("ISO-10303-21;")
    flat = trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]], [[0, 1, 2], [0, 2, 3]])
    flat.export(folder / "flat.stl")
    large = trimesh.creation.box(extents=np.subtract(HIGH, LOW) * 1000)
    large.export(folder / "metres.stl")
    with pytest.raises(InputError) as error:
        artefact_with(folder, obstacle)
    assert words in str(error.value)
    assert str(error.value).startswith(f"{folder / 'artefact.yaml'}:"), error.value


def test_without_trimesh_it_is_said_what_to_install(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name == "trimesh":
            raise ImportError(name)
        return usual(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"pip install 'tango-cnc\[cad\]', or use boxes and cylinders"):
        artefact_with(folder, "{kind: hull, file: clamp.stl}")


def test_a_spindle_nose_that_is_thicker_than_the_body_is_kept_clear_too() -> None:
    """A post 350 mm high stands 100 mm beside facet 1; the stylus is 300 mm long, the body 32 mm thick."""
    tower = Obstacle("box", low=(210.0, -60.0, -50.0), high=(230.0, 0.0, 340.0))
    whole = cell(machine("wCBXfZY(S)t"), replace(block(), obstacles=(tower,)), [{}], facets=["1"])
    assert plan(whole)
    probe = replace(whole.machine.probe, nose_radius=110.0)
    with pytest.raises(InputError, match="the spindle nose would hit obstacle 1"):
        plan(replace(whole, machine=replace(whole.machine, probe=probe)))
    assert math.isclose(probe.length, 300.0)
