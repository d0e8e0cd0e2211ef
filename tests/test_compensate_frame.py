"""A control knows its own axes alone: however machine.yaml is turned, or if it is a mirror image, the same files come out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.compensated import example, truth, write
from support.few import every

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from tango_cnc.compensate import Proposal, as_json, propose, targets
from tango_cnc.compensate.frame import along_the_drawing, as_controlled, said
from tango_cnc.compensate.space import sample
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.records import Array, Axis, Cell, InputError
from tango_cnc.terms import find

FRAMES = {
    "behind": np.diag([-1.0, -1.0, 1.0]),  # as somebody draws it who stands behind the machine
    "quarter": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "mirror": np.diag([-1.0, 1.0, 1.0]),  # as somebody draws it who follows the table of X
}
OWN = ("iso230",)  # says in its file in which frame it is


AWAY = np.array([300.0, -200.0, 500.0])  # mm by which the frame of machine.yaml is elsewhere


def moved(cell: Cell, way: Array) -> Cell:
    """cell, mm → the same machine and artefact in a frame whose zero is elsewhere."""

    def there(point: tuple[float, float, float]) -> tuple[float, float, float]:
        return vector(np.array(point) + way)

    axes = tuple(a if a.kind == "linear" else replace(a, point=there(a.point)) for a in cell.machine.axes)
    facets = {k: replace(f, point=there(f.point)) for k, f in cell.artefact.facets.items()}
    balls = {k: replace(b, centre=there(b.centre)) for k, b in cell.artefact.balls.items()}
    artefact = replace(cell.artefact, facets=facets, balls=balls)
    return replace(cell, machine=replace(cell.machine, axes=axes), artefact=artefact)


def vector(way: Array) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in np.round(way, 12) + 0.0)
    return x, y, z


def seen(name: str, turn: Array) -> Cell:
    """Example, frame → the same cell as it is described in that frame; places of facets too. Its readings stay what they are."""
    cell, _ = example(name)
    sense = round(float(np.linalg.det(turn)))

    def axis(a: Axis) -> Axis:
        way = turn @ np.array(a.direction) * (sense if a.kind == "rotary" else 1)
        return replace(a, direction=vector(way), point=vector(turn @ np.array(a.point)))

    facets = {
        k: replace(f, point=vector(turn @ np.array(f.point)), normal=vector(turn @ np.array(f.normal)))
        for k, f in cell.artefact.facets.items()
    }
    balls = {k: replace(b, centre=vector(turn @ np.array(b.centre))) for k, b in cell.artefact.balls.items()}
    machine = replace(cell.machine, axes=tuple(axis(a) for a in cell.machine.axes))
    return replace(cell, machine=machine, artefact=replace(cell.artefact, facets=facets, balls=balls))


@cache
def shown(name: str, frame: str) -> Estimate:
    """Example, frame → estimate of its touches without scatter; the touches are those of the example in any frame.

    In a mirror the spindle turns the other way.
    """
    cell, world = example(name)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, replace(world, noise=0.0))
    there = cell if frame == "own" else seen(name, FRAMES[frame])
    if frame == "mirror":
        one = np.where(np.array(readings.axes) == "S", -1.0, 1.0)
        readings = replace(readings, position=readings.position * one, direction=readings.direction * one)
    return estimate(there.machine, there.artefact, readings, cell.terms)


@cache
def made(name: str, frame: str, target: str, settings: tuple[str, ...] = ()) -> Proposal:
    return propose(shown(name, frame), target, settings, poses=256)


CASES = [
    *(("trunnion", frame, target) for frame in FRAMES for target in ("siemens", "heidenhain", "haas", "isg_csv")),
    *(("trunnion", "behind", target) for target in ("fanuc", "fagor", "grblhal", "linuxcnc", "value_sheet", "etalon", "centroid")),
    *(("hu40t", "mirror", target) for target in ("siemens", "heidenhain", "fanuc", "isg_csv")),
    *(("split", frame, target) for frame in ("behind", "mirror") for target in ("siemens", "fanuc")),
    *(("huron", "behind", target) for target in ("siemens", "heidenhain")),
]
SHORT = {
    ("trunnion", "behind", "haas"),
    ("trunnion", "quarter", "isg_csv"),
    ("trunnion", "mirror", "siemens"),
    ("hu40t", "mirror", "fanuc"),
}


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("name", "frame", "target"), [pytest.param(*c, marks=() if c in SHORT else pytest.mark.long) for c in CASES]
)
def test_the_same_machine_in_another_frame_gets_the_same_files(name: str, frame: str, target: str, tmp_path: Path) -> None:
    one, other = made(name, "own", target), made(name, frame, target)
    assert other.files == one.files and other.undo == one.undo
    cell, world = example(name)
    control = read(write(other, tmp_path), cell.machine)
    left, before = truth(cell, world, other, control), truth(cell, world, other, None)
    beside = 1.0  # µm: what the terms of an example do not have
    assert left < other.fit.rms_after.high + beside < before


def test_a_person_reads_where_the_tool_goes() -> None:
    assert said(example("trunnion")[0].machine) == ""
    behind = said(seen("trunnion", FRAMES["behind"]).machine)
    assert behind == "the tool goes for +X along -x, +Y along -y, +Z along +z of machine.yaml"
    assert said(example("hu40t")[0].machine).endswith("of machine.yaml: its mirror image")


def test_axes_that_are_not_at_right_angles_hold_tables_alone() -> None:
    machine = example("trunnion")[0].machine
    slanted = replace(machine, axes=tuple(replace(a, direction=(0.0, -0.6, 0.8)) if a.name == "Y" else a for a in machine.axes))
    assert as_controlled(slanted) is slanted
    request = targets.Request(slanted, {name: (-1.0, 1.0) for name in slanted.names}, {"points": 3, "sign": -1, "increment": 1e-4})
    assert targets.load("centroid").held(request)
    with pytest.raises(InputError, match=r"--target: found linear axes that are not at right angles in machine\.yaml; allowed: "):
        targets.load("haas").held(request)


def test_a_program_gets_as_many_significant_digits_as_are_asked_for() -> None:
    """Angles of degree 3 are some 1e-13 rad/mm³, and a micrometer at the end of a travel."""
    (h,) = targets.load("iso230").held(
        targets.Request(
            example("trunnion")[0].machine,
            {"X": (-400.0, 400.0), "Y": (-1.0, 1.0), "Z": (-1.0, 1.0), "A": (-1.0, 1.0), "C": (-1.0, 1.0)},
            {"digits": 6},
            tuple(find("EAX3", example("trunnion")[0].machine)),
        )
    )
    assert h.number(-3.21456789e-13) == -3.21457e-13 and h.number(0.0) == 0.0


def test_what_an_earlier_version_wrote_along_the_axes_of_machine_yaml_is_named() -> None:
    here = example("trunnion")[0].machine
    behind = seen("trunnion", FRAMES["behind"]).machine
    record = as_json(made("trunnion", "behind", "haas"))
    older = {key: value for key, value in record.items() if key != "along"}
    assert record["along"] == said(behind) and not along_the_drawing(record, behind)
    assert along_the_drawing(older, behind) == said(behind)
    assert not along_the_drawing(older, here) and "along" not in as_json(made("trunnion", "own", "haas"))
    assert "along" not in as_json(made("trunnion", "behind", "centroid"))


@pytest.mark.parametrize(
    ("name", "target"),
    every([*(("trunnion", t) for t in ("fanuc", "value_sheet", "haas", "grblhal")), ("fork_head", "fanuc"), ("split", "fanuc")], 6),
)
def test_centers_are_what_the_axes_show_wherever_the_zero_of_the_drawing_is(name: str, target: str, tmp_path: Path) -> None:
    cell, world = example(name)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, replace(world, noise=0.0))
    there = moved(cell, AWAY)
    proposal = propose(estimate(there.machine, there.artefact, readings, cell.terms), target, poses=256)
    own = made(name, "own", target)
    assert proposal.numbers == pytest.approx(own.numbers, abs=1e-3)  # mm, deg; errors of second order, and a digit
    control = read(write(proposal, tmp_path / "c", proposal.undo), there.machine)
    at = sample(there.machine, proposal.request.limits, 64).touches
    assert control(at.position, at.direction) == pytest.approx(at.position, abs=1e-9)  # nothing is corrected, nothing is moved
