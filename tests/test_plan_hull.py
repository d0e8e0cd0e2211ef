"""Obstacles out of a drawing: the convex hull of an STL is kept clear of like a box, and a bad drawing is named."""

from __future__ import annotations

import builtins
import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull
from support.blockcell import block, cell, machine

from tango_cnc.check import solid
from tango_cnc.cli import guarded, tango
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


@pytest.mark.few(5)
@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        ("{kind: hull, file: clomp.stl}", "clomp.stl: no such file; its path starts from the folder of artefact.yaml"),
        ("{kind: hull, file: clamp.step}", "found a .step file; allowed: .stl, .obj, .ply. Export the solid as STL, in mm"),
        ("{kind: hull, file: text.stl}", "text.stl: "),
        ("{kind: hull, file: flat.stl}", "flat.stl: found a flat drawing; allowed: a solid"),
        ("{kind: hull, file: thousandfold.stl}", "found a solid of 60000 mm; allowed: 1 mm up to 20000 mm. Is the drawing in mm?"),
        ("{kind: hull, file: metres.stl}", "found a solid of 0.06 mm; allowed: 1 mm up to 20000 mm. Is the drawing in mm?"),
        ("{kind: hull, file: clamp.stl, shift: [99990, 0, 0]}", "a corner at 100120 mm; allowed: up to 100000 mm from the origin"),
        ("{kind: hull, file: cut.stl}", "found 500 bytes where its own count of triangles makes "),
        ("{kind: hull, file: garbage.stl}", "It is cut off or no STL: export it again, as binary STL in mm"),
        (
            "{kind: hull, file: cut_text.stl}",
            "found 100 vertices, of which 0 can be read; allowed: a whole ASCII STL, with decimal points",
        ),
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
    large.export(folder / "thousandfold.stl")
    trimesh.creation.box(extents=np.subtract(HIGH, LOW) / 1000).export(folder / "metres.stl")
    whole = trimesh.load(folder / "clamp.stl")
    (folder / "cut.stl").write_bytes(whole.export(file_type="stl")[:500])
    (folder / "garbage.stl").write_bytes(np.random.default_rng(1).bytes(3000))
    lines = whole.export(file_type="stl_ascii").splitlines(keepends=True)
    last = [i for i, line in enumerate(lines) if "vertex" in line][100]
    (folder / "cut_text.stl").write_text("".join(lines[:last]))
    with pytest.raises(InputError) as error:
        artefact_with(folder, obstacle)
    assert words in str(error.value)
    assert str(error.value).startswith(f"{folder / 'artefact.yaml'}:"), error.value


def remarked(kind: str) -> bytes:
    """The box with a German word in Latin-1 where this kind of drawing has names or remarks."""
    mesh = trimesh.creation.box(extents=(25, 60, 40))
    if kind == "obj":
        return b"# Spannst\xfcck\n" + mesh.export(file_type="obj").encode()
    if kind == "ply":
        return bytes(mesh.export(file_type="ply").replace(b"\nelement vertex", b"\ncomment Spannst\xfcck\nelement vertex", 1))
    whole = "solid Spannstück\n" + mesh.export(file_type="stl_ascii").split("\n", 1)[1]
    binary = b"solid Spannst\xfcck" + mesh.export(file_type="stl")[16:]
    return {"text": whole.encode("latin-1"), "two solids": f"{whole}\n{whole}".encode("latin-1"), "binary": binary}[kind]


@pytest.mark.parametrize("kind", ["text", "two solids", "binary", "obj", "ply"])
def test_a_name_in_another_encoding_does_not_matter(kind: str, tmp_path: Path) -> None:
    file = tmp_path / f"clamp.{kind if kind in ('obj', 'ply') else 'stl'}"
    file.write_bytes(remarked(kind))
    assert sorted(read_hull(file)) == [(x, y, z) for x in (-12.5, 12.5) for y in (-30.0, 30.0) for z in (-20.0, 20.0)]


@pytest.mark.few(0)
@pytest.mark.parametrize("command", ["check", "plan"])
def test_the_size_of_every_drawing_is_told(command: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In inches it is neither too small nor too large, and only a person can see that it is wrong."""
    artefact_with(folder, "{kind: hull, file: clamp.stl, shift: [0, 0, -300]}")
    assert guarded(tango.main, [command, "-C", str(folder)], standalone_mode=False) in (0, 1)
    assert "drawing clamp.stl: 25 × 60 × 40 mm" in capsys.readouterr().out
    guarded(tango.main, [command, "-C", str(folder), "--json", "-"], standalone_mode=False)
    assert json.loads(capsys.readouterr().out)["drawings"] == [{"file": "clamp.stl", "size": [25.0, 60.0, 40.0]}]


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
