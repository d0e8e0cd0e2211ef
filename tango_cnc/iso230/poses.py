"""Poses that nobody touched: the machine's own errors there, at the start of a test, whatever came before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..kinematics import Slot
from ..records import Array, Artefact, Facet, Machine
from ..terms import Coefficient
from ..touches import Touches, of_facets

NOWHERE = Artefact("poses", {"0": Facet("0", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))})


def at_poses(machine: Machine, position: Array, direction: Array) -> Touches:
    """machine, (n, k) mm rad, (n, k) −1 0 1 → poses at which coefficients can be evaluated; time 0."""
    touches = of_facets(machine, NOWHERE, ["0"] * len(position), position, direction)
    return replace(touches, time=np.zeros(len(position)))


def is_setup(slot: Slot) -> bool:
    """slot → whether it belongs to stylus or table placement and not to the machine."""
    return slot.stage in ("stylus", "table")


def steady(coefficient: Coefficient, poses: Touches) -> bool:
    """coefficient, poses → whether it is an error of the machine that depends on the pose and not on what came before it.

    What drifts is zero at time 0 and stays; what remembers the last move gives other values for the same poses backwards.
    """
    return bool(all_steady([coefficient], poses)[0])


def all_steady(coefficients: Sequence[Coefficient], poses: Touches) -> tuple[list[int], Array]:
    """coefficients, n poses → places of the q that are `steady`, and their values (q, n); poses are turned round once for all."""
    backwards = at_poses(poses.machine, poses.position[::-1], poses.direction[::-1])
    own = [j for j, c in enumerate(coefficients) if c.slot.axis and not is_setup(c.slot)]
    there, back = (np.array([coefficients[j].regressor(at) for j in own]) for at in (poses, backwards))
    there, back = there.reshape(len(own), len(poses)), back.reshape(len(own), len(poses))[:, ::-1]
    same = np.flatnonzero((np.abs(there - back) <= 1e-12 * np.abs(back)).all(axis=1))
    return [own[i] for i in same.tolist()], there[same]
