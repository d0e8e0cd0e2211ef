"""What targets can hold, told from the formulas of the controls themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.compensated import example, proposed

from tango_cnc.compensate import targets
from tango_cnc.compensate.space import Poses
from tango_cnc.iso230.poses import at_poses
from tango_cnc.records import Array, InputError, Machine


def head() -> Machine:
    """A fork head with C and B that 5axiskins is for: both axes meet, B turns the tool towards +x."""
    machine = example("fork_head")[0].machine
    b = replace(machine.axis("A"), name="B", direction=(0.0, -1.0, 0.0), point=(0.0, 0.0, 0.0))
    c = replace(machine.axis("C"), point=(0.0, 0.0, 0.0))
    linear = {"X": (-1.0, 0.0, 0.0), "Y": (0.0, -1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
    axes = tuple({"A": b, "C": c}.get(a.name, a) for a in machine.axes)
    axes = tuple(replace(a, direction=linear[a.name]) if a.name in linear else a for a in axes)
    branch = tuple({"A": "B"}.get(name, name) for name in machine.tool_branch)
    return replace(machine, topology=machine.topology.replace("A", "B"), axes=axes, tool_branch=branch)


def pivot(machine: Machine, position: Array) -> Array:
    """machine, (n, k) → (n, 3): tip against the joints for a pivot of 1 mm, as 5axiskins.c has it."""
    b, c = (position[:, machine.column(name)] for name in "BC")
    return np.stack([np.sin(b) * np.cos(c), np.sin(b) * np.sin(c), 1 - np.cos(b)], axis=1)


@pytest.mark.few(0)
@pytest.mark.parametrize("target", ["fanuc", "siemens", "heidenhain", "value_sheet", "isg_csv", "etalon"])
@pytest.mark.parametrize("name", ["split", "trunnion", pytest.param("hu40t", marks=pytest.mark.long)])
def test_a_constant_is_in_a_center_and_not_in_a_table(name: str, target: str) -> None:
    """A control that counts pitch errors from its reference point would lose it, and with it most of what the center is for."""
    made = proposed(name, target)
    held, values = made.fit.held, made.fit.change
    tables: dict[tuple[str, int], list[tuple[float, float]]] = {}
    for h, value in zip(held, values, strict=True):
        if h.at is not None and h.kind == "length":
            tables.setdefault((h.table, h.sense), []).append((h.at, value))
    at_zero = [np.interp(0.0, *zip(*sorted(points), strict=True)) for points in tables.values()]
    step = max(h.increment / h.factor for h in held if h.at is not None and h.kind == "length")
    assert tables and max(map(abs, at_zero)) <= 2 * step
    centers = [abs(v) for h, v in zip(held, values, strict=True) if (h.tcp or h.table == "axis locations") and h.kind == "length"]
    assert max(centers) > 0.01  # mm, of which tables used to have a part


@pytest.fixture
def poses() -> Poses:
    machine = head()
    position = np.random.default_rng(3).uniform(-1.2, 1.2, (400, len(machine.names)))
    for name in "XYZ":
        position[:, machine.column(name)] *= 150
    return Poses(at_poses(machine, position, np.zeros_like(position)))


def test_the_machine_moves_as_5axiskins_has_it(poses: Poses) -> None:
    machine, position = poses.machine, poses.touches.position
    reach = machine.probe.length - machine.spindle.point[2]
    joints = position[:, [machine.column(name) for name in "XYZ"]]
    away = poses.nominal - joints - reach * pivot(machine, position)
    assert np.ptp(away, axis=0) == pytest.approx(0, abs=1e-9)


def test_a_pivot_of_5axiskins_is_what_a_set_up_takes_out(poses: Poses) -> None:
    lever = pivot(poses.machine, poses.touches.position).reshape(-1, 1)
    assert np.sqrt(3 * np.mean(lever**2)) > 0.3
    assert np.abs(poses.free(lever)).max() < 1e-12


@pytest.mark.parametrize(
    ("target", "setting"),
    [
        ("haas", "increment=0"),
        ("haas", "increment=5"),
        ("value_sheet", "increment=nan"),
        ("fagor", "max_offset=nan"),
        ("fagor", "max_offset=-1"),
        ("fagor", "first=-5"),
        ("fagor", "kin=0"),
        ("siemens", "carrier=0"),
    ],
)
def test_a_setting_outside_its_limits_is_refused(target: str, setting: str) -> None:
    with pytest.raises(InputError, match=rf"--set: {setting.partition('=')[0]}: found '.*'; allowed: .* to "):
        targets.options(targets.load(target), [setting])


def test_haas_has_one_point_for_both_axes_so_they_have_to_meet() -> None:
    machine = example("trunnion")[0].machine

    def with_table(**more: tuple[float, float, float]) -> targets.Request:
        axes = tuple(replace(a, **more) if a.name == "C" else a for a in machine.axes)
        return targets.Request(replace(machine, axes=axes), {}, {})

    haas = targets.load("haas")
    haas.check(with_table())
    x, y, z = machine.axis("C").point
    with pytest.raises(InputError, match="axes A and C that miss each other by 35 mm; allowed: axes that meet"):
        haas.check(with_table(point=(x, y + 35, z)))
