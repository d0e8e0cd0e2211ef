"""What several tests share of nc compensate."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from sim_controller.world import nominal_machine, tip_in_table, true_machine
from support.compensated import example, measured
from tango_cnc.compensate.fit import Known, known
from tango_cnc.compensate.space import limits_of, sample
from tango_cnc.nc.blocks import language
from tango_cnc.nc.follow import Setup
from tango_cnc.nc.program import Account, RewriteSettings, compensated, mark_text, tools_of
from tango_cnc.records import Array, Machine, World

LENGTH, ZERO = 150.0, {"X": 3.0, "Y": -4.0, "Z": 60.0, "A": 0.0, "C": 0.0}
CHORD, DECIMALS = 0.001, 4


@pytest.fixture(scope="module")
def knowledge() -> Known:
    """Errors of the trunnion as they truly are: without scatter, and without reversal, which no word can hold."""
    cell, world = example("trunnion")
    quiet = replace(world, noise=0.0, errors={k: v for k, v in world.errors.items() if not k.endswith("b")})
    found = measured(cell, quiet)
    touches = found.model.touches
    return known(found, sample(cell.machine, limits_of(cell.machine, touches, "probed", {}), 40))


def winding(machine: Machine) -> Machine:
    """machine → the same, whose C turns as often as a program asks."""
    axes = tuple(replace(a, travel=(-1e3 * np.pi, 1e3 * np.pi)) if a.name == "C" else a for a in machine.axes)
    return replace(machine, axes=axes)


def rewritten(text: str, found: Known, name: str = "rs274", **more: object) -> tuple[list[str], Account]:
    setup = Setup(winding(example("trunnion")[0].machine), ZERO, LENGTH, settled=bool(more.pop("settled", False)))
    account = Account()
    settings = RewriteSettings(**({"chord": CHORD, "decimals": DECIMALS} | more))  # type: ignore[arg-type]
    mark = mark_text("0123", ZERO, tools_of(setup))
    lines = list(compensated(io.StringIO(text), language(name), setup, found, settings, account, mark))
    return lines, account


def away(machine: Machine, world: World, positions: Array, meant: Array) -> Array:
    """(n, k) where axes go, (n, k) where the program meant them → (n,) mm, by the simulator alone; zero as it was found."""
    tool = replace(machine, probe=replace(machine.probe, length=LENGTH))
    zero = np.zeros((1, len(machine.names)))
    for name, value in ZERO.items():
        zero[0, machine.column(name)] = (value + (LENGTH if name == "Z" else 0.0)) * (1 if name in machine.linear else np.pi / 180)
    still = np.zeros_like(positions)
    nominal, true = nominal_machine(tool), true_machine(tool, replace(world, stylus={}))
    shift = tip_in_table(true, zero, zero * 0) - tip_in_table(nominal, zero, zero * 0)
    return np.linalg.norm(tip_in_table(true, positions, still) - tip_in_table(nominal, meant, still) - shift, axis=1)
