"""Nominal positions → positions that bring the tip of the true machine to where the nominal one would have it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import kinematics
from ..compensate.fit import Known
from ..iso230.poses import at_poses
from ..kinematics import Chain
from ..records import Array, Machine

ROUNDS = 2  # of Newton's iteration: what a second one leaves is 1e-9 mm
AHEAD = 100.0  # mm of tool over which its direction is looked at
SINGULAR = 1e-4  # rad of direction per rad of axis, squared: less turns an axis about the tool, and is left alone


@dataclass(frozen=True)
class Machinery:
    """A machine, what is known of its errors, the length of the tool in it, and where the workpiece's zero was found.

    The zero was found on this machine: there, with all words 0, the tip is where the program means it to be.
    """

    machine: Machine
    known: Known
    length: float  # mm
    zero: Array  # (k,) mm rad, axis positions of the workpiece's zero with this tool
    came: Array | None = None  # (k,) sense of every axis' last motion, 0: the mean of both; None: of all

    @cached_property
    def chain(self) -> Chain:
        """→ the chain with this tool."""
        return self._chain(self.length)

    @cached_property
    def _longer(self) -> Chain:
        return self._chain(self.length + AHEAD)

    def _chain(self, length: float) -> Chain:
        return kinematics.chain(replace(self.machine, probe=replace(self.machine.probe, length=length)))

    def acting(self, positions: Array, values: Array | None = None) -> dict[kinematics.Slot, Array]:
        """(n, k) mm rad → errors by slot; of reversal that of `came`, or the mean of both directions."""
        return self.known.acting(at_poses(self.machine, positions, self.directions_of(positions)), values)

    def directions_of(self, positions: Array) -> Array:
        """(n, k) → (n, k) sense of every axis' last motion there."""
        return np.zeros_like(positions) if self.came is None else np.tile(self.came, (len(positions), 1))

    def meant(self, positions: Array) -> Array:
        """(n, k) mm rad → (n, 3) mm in the table frame: where the program means the tip to be."""
        return kinematics.tip(self.chain, positions) + self.found_zero

    def true(self, positions: Array) -> Array:
        """(n, k) mm rad → (n, 3) mm in the table frame: where the tip is, as far as is known."""
        return kinematics.tip(self.chain, positions, self.acting(positions))

    def deviation(self, positions: Array, values: Array | None = None) -> Array:
        """(n, k) mm rad → (n, 3) mm, tip minus where it is meant to be, for a program as it is.

        `values`: other values of the coefficients, (m, c) → (m, n, 3).
        """
        if values is None:
            return self.true(positions) - self.meant(positions)
        here = kinematics.tip(self.chain, positions, self.acting(positions, values)) - kinematics.tip(self.chain, positions)
        there = kinematics.tip(self.chain, self.zero[None], self.acting(self.zero[None], values))
        return here - (there - kinematics.tip(self.chain, self.zero[None]))

    @cached_property
    def found_zero(self) -> Array:
        """→ (3,) mm, by how much the workpiece lies elsewhere than the axis positions of its zero say."""
        at = self.zero[None]
        return np.asarray((self.true(at) - kinematics.tip(self.chain, at))[0])

    def directions(self, positions: Array) -> Array:
        """(n, k) mm rad → (n, 3) rad, direction of the tool against that at the workpiece's zero, true minus meant."""
        both = np.vstack([positions, self.zero[None]])
        acting = self.acting(both)
        long = kinematics.tip(self._longer, both, acting) - kinematics.tip(self._longer, both)
        short = kinematics.tip(self.chain, both, acting) - kinematics.tip(self.chain, both)
        found = (long - short) / AHEAD
        return np.asarray(found[:-1] - found[-1])

    def turns(self, positions: Array) -> Array:
        """(n, k) mm rad → (n, r) rad, what the rotary axes have to turn more for the tool to point where it is meant to."""
        names = self.machine.rotary
        if not names:
            return np.zeros((len(positions), 0))
        upward = kinematics.spindle_axis(self.chain, positions)
        ways = np.empty((len(positions), 3, len(names)))
        for i, name in enumerate(names):
            step = positions.copy()
            step[:, self.machine.column(name)] += 1e-4
            ways[:, :, i] = (kinematics.spindle_axis(self.chain, step) - upward) * 1e4
        # The direction of the tool from the tip to the spindle is the negative of how a longer tool moves its tip.
        wrong = -self.directions(positions)
        normal = np.einsum("nij,nik->njk", ways, ways)
        value, vector = np.linalg.eigh(normal)
        right = np.einsum("nji,nj->ni", vector, np.einsum("nij,ni->nj", ways, wrong))
        gain = np.where(value > SINGULAR, right / np.where(value > SINGULAR, value, 1.0), 0.0)
        return np.asarray(-np.einsum("nij,nj->ni", vector, gain))

    def corrected(self, positions: Array, turned: Array) -> Array:
        """(n, k) nominal mm rad, (n, r) rad that the rotary axes turn more → (n, k) with the linear axes that go with it."""
        wanted = self.meant(positions)
        result = positions.copy()
        for i, name in enumerate(self.machine.rotary):
            result[:, self.machine.column(name)] += turned[:, i]
        _, _, ways = kinematics.affine(self.chain, result)
        columns = list(self.chain.linear_columns)
        inverse = np.linalg.inv(ways)
        for _ in range(ROUNDS):
            result[:, columns] += np.einsum("nij,nj->ni", inverse, wanted - self.true(result))
        return result


def pieces(start: Array, end: Array, between: Sequence[Array], chord: float) -> Array:
    """corrections (n, m) mm at both ends and at a quarter, half, three quarters of moves → (n,) parts that keep to the chord."""
    worst = np.zeros(len(start))
    for share, at in zip((0.25, 0.5, 0.75), between, strict=True):
        straight = start + share * (end - start)
        worst = np.maximum(worst, np.linalg.norm(at - straight, axis=1))
    return np.maximum(1, np.ceil(np.sqrt(worst / chord))).astype(int)
