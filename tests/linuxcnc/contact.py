"""Where the ball of a LinuxCNC without iron meets the table: asked with positions, answers with a plane (`table.py`).

    python contact.py FOLDER        FOLDER/cell has machine, artefact and world of the simulated machine

Every motion is a straight line, so as soon as its direction is known its first contact with the true table is too, seconds
before it happens. The plane goes through that contact, with the slope that the gap has there: the probe trips within a nanometre
of where `sim_controller` says. While the stylus is deflected the plane stays; nothing else is met before it is free again.
"""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from sim_controller import probing, surfaces
from sim_controller.effects import Disturbance
from sim_controller.probing import Rig, gap_along
from sim_controller.roots import bracketed_zero
from sim_controller.search import first_contact
from sim_controller.world import place
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Array

STILL = 1e-7  # mm or rad: less is no motion
LEAST = 1e-6  # mm or rad: less says nothing of a direction
STRAIGHT = 1e-5  # of a motion: two ways that differ by less are one
SAME = 1e-5  # mm: what is nearer to a line is on it
FREE = 0.02  # mm from the surface that was touched
AHEAD = 250.0  # mm, or deg: how far along its way a motion is looked at; longer ones are looked at again
NEAR = 1.0  # mm around the contact with the surface in which repeatability may move it


class Table:
    """Positions (k,) mm rad as they come → planes."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self._at = rig, np.full(len(rig.machine.names), np.nan)
        self._direction = np.ones(len(rig.machine.names))
        self._line: tuple[Array, Array] | None = None  # where the motion was seen first, change until the end of the look
        self._row = -1  # surface that the plane stands for
        self._trip = self._sense = np.zeros(0)  # (k,) where the probe will trip, and how every axis moved last before that
        self._way = np.zeros(len(rig.machine.names))  # of the motion from one look to the next
        self._pressed = self._known = self._astray = False
        self.contacts: list[dict[str, object]] = []

    def see(self, time: float, position: Array, on: bool) -> Array | None:
        """s, (k,) mm rad, probe signal → (k + 1,) slopes and offset of a new plane, or None when the old one stays."""
        change = position - self._at
        self._at = position
        if np.isnan(change).any():
            return self._nothing()
        moved = np.abs(change) > STILL
        self._direction = np.where(moved, np.sign(change), self._direction)
        if on and not self._known:
            self._pressed = True
            self.contacts.append({"time": time, "surface": self._name(), "at": self._trip.tolist(), "sense": self._sense.tolist()})
        self._known = on
        if self._pressed:
            # The signal is read after the position, which on a busy computer may be one of long before the contact: far from the
            # surface the stylus is free only once the signal is off. A new plane under a deflected stylus trips the probe again.
            if on or self._gaps(position)[self._row] < FREE:
                return None
            self._pressed, self._line = False, None
            if not moved.any():
                return self._nothing()
        if np.abs(change).max() < LEAST:
            return None
        before, self._way = self._way, change / np.abs(change).max()
        astray, self._astray = self._astray, not self._foreseen(position)
        if not self._astray or not astray:
            return None  # one look beside the line may have met the control between two axes
        if np.abs(self._way - before).max() < STRAIGHT:
            return self._look(position, change)
        # Between these two looks was a corner: whither it goes now is not known yet, and whither it went says nothing.
        self._line = None
        return self._nothing() if self._row >= 0 else None

    def _foreseen(self, position: Array) -> bool:
        """Whether this position lies on the line that was looked at, and not near its end."""
        if self._line is None:
            return False
        start, way = self._line
        s = float((position - start) @ way / (way @ way))
        return 0.0 <= s < 0.6 and bool(np.abs(position - start - s * way).max() < SAME)

    def _look(self, position: Array, change: Array) -> Array:
        linear = [self._rig.machine.column(name) for name in self._rig.machine.linear]
        length = max(
            float(np.linalg.norm(change[linear])), float(np.degrees(np.abs(change).max(initial=0.0, where=self._turning())))
        )
        way = change * AHEAD / length
        self._line = position, way
        met = first_contact(self._rig, position, position + way, self._direction)
        if met is None:
            return self._nothing()
        s, self._row = met
        s = self._disturbed(position, way, s)
        self._trip, self._sense = position + s * way, self._direction
        slope = self._slope(self._trip)
        return np.append(slope, -slope @ self._trip)

    def _turning(self) -> Array:
        return np.array([axis.kind != "linear" for axis in self._rig.machine.axes])

    def _disturbed(self, start: Array, way: Array, s: float) -> float:
        """→ where on the way the probe triggers, with the repeatability of the touch that this one will be."""
        if self._row >= len(self._rig.surfaces.facets) or not self._rig.noise:
            return s
        noise = probing.noise(self._rig, len(self.contacts) + 1)[-1:]
        nothing = probing.undisturbed(1)
        gap = gap_along(
            self._rig,
            start[None],
            (start + way)[None],
            self._direction[None],
            np.array([self._row]),
            Disturbance(noise, nothing.work, nothing.table, {}),
        )
        only, width = np.array([0]), NEAR / AHEAD
        low, high = np.array([max(0.0, s - width)]), np.array([s + width])
        at_low, at_high = gap(only, low), gap(only, high)
        if at_low[0] <= 0 or at_high[0] > 0:
            return s
        return float(bracketed_zero(gap, low, high, at_low, at_high)[0])

    def _slope(self, position: Array) -> Array:
        """→ (k,) mm of gap per mm or rad."""
        steps = np.where(self._turning(), 1e-5, 1e-2) * np.eye(len(position))
        both = self._gap(np.concatenate([position + steps, position - steps]))
        above, below = both[: len(position)], both[len(position) :]
        return (above - below) / (2 * np.diag(steps))

    def _gap(self, positions: Array) -> Array:
        tip = place(self._rig.true, positions, np.broadcast_to(self._direction, positions.shape)).tip
        return surfaces.gaps(self._rig.surfaces, tip)[:, self._row]

    def _gaps(self, position: Array) -> Array:
        tip = place(self._rig.true, position[None], self._direction[None]).tip
        return surfaces.gaps(self._rig.surfaces, tip)[0]

    def _name(self) -> str:
        facets = self._rig.surfaces.facets
        return facets[self._row] if self._row < len(facets) else "obstacle"

    def _nothing(self) -> Array:
        self._row = -1
        return np.append(np.zeros(len(self._rig.machine.names)), 1.0)


def main(folder: Path) -> None:
    """Folder of the control → answers on stdout until stdin ends; every contact is a line of contacts.jsonl."""
    with suppress(PermissionError):
        os.nice(-15)  # an answer that waits for its turn on a busy machine is about a line that the control has left already
    cell = read_cell(folder / "cell")
    machine = cell.machine
    world = read_world(folder / "cell" / "world.yaml")
    if world.effects:
        sys.exit("world.yaml: effects are not carried out here; allowed: errors, stylus, facets, noise, seed")
    table = Table(probing.rig(machine, cell.artefact, world))
    columns = [machine.column(name) for name in (*"XYZ", *sorted(machine.rotary), "S")]
    scale = np.array([1.0, 1.0, 1.0, *np.full(3, np.pi / 180)])
    with (folder / "contacts.jsonl").open("w", encoding="ascii") as contacts:
        for line in sys.stdin:
            time, *values, on = map(float, line.split())
            position = np.empty(len(machine.names))
            position[columns] = np.array(values) * scale
            before = len(table.contacts)
            plane = table.see(time, position, bool(on))
            for contact in table.contacts[before:]:
                contacts.write(json.dumps(contact) + "\n")
                contacts.flush()
            if plane is None:
                print(flush=True)
                continue
            slopes, offset = plane[columns] * scale, plane[-1]
            offset += slopes[5] * values[5]  # the spindle stands still while anything else moves
            print(*map(repr, map(float, (*slopes[:5], offset))), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
