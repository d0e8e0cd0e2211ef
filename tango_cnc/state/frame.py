"""What is followed on one machine with one table, and what a set of touches says about it.

The unknowns are those of the model of the whole strategy, so a short check does not change what is followed. Besides them:

    EX0C/K   how an error of the machine changes with temperature, mm or rad per K
    bar      by how much the scale bar is longer than its certificate says, mm; facet3: the same of a calibrated facet

The last never change: what is not known of a certificate is not known better after a hundred nights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..identify import Selection, select
from ..model import Model, known, linearise
from ..records import Array, Readings, TermItem
from ..touches import Touches, from_readings

# Standard deviation by which an unknown wanders in one day, before a history has taught better; mm, rad or mm/mm.
WANDER = {"location": 5e-4, "angle": 1e-6, "gain": 5e-7, "backlash": 1e-4, "stylus": 5e-4, "table": 1e-4, "fixed": 0.0}
# Standard deviation before anything was ever touched.
WIDE = {"location": 1.0, "angle": 3e-3, "gain": 1e-3, "backlash": 0.1, "stylus": 3.0, "table": 1.0, "fixed": 0.0}
WARM = {"mm": 3e-3, "rad": 3e-6, "": 1e-5}  # per K, once a change with temperature has been named
PRETRAVEL = "pretravel"  # mm that the probe travels on more than machine.yaml has it: of every touch, balls too
CLOSED = 1e-9  # of an unknown that is not followed yet: too little to matter, enough to have an inverse
EXACT = 1e-5  # mm: what is added to a certificate's own uncertainty


@dataclass(frozen=True)
class Frame:
    """p followed unknowns: those of the model, then temperature coefficients, certificates, and the pretravel of the probe."""

    selection: Selection
    names: tuple[str, ...]  # (p,)
    units: tuple[str, ...]  # (p,) mm, rad, mm/mm …
    families: tuple[str, ...]  # (p,) keys of `WANDER`
    warm: NDArray[np.int64]  # (q,) which unknowns of the model the temperature coefficients belong to
    certificates: Mapping[str, float]  # name: uncertainty, mm

    @property
    def model(self) -> Model:
        """→ the model of the whole strategy."""
        return self.selection.model

    @cached_property
    def place(self) -> dict[str, int]:
        """→ {name: its place among the p}."""
        return {name: i for i, name in enumerate(self.names)}

    @cached_property
    def wander(self) -> Array:
        """→ (p,) variance a day before a history has taught better."""
        return np.array([WANDER[f] ** 2 for f in self.families])

    @cached_property
    def points(self) -> NDArray[np.int64]:
        """→ places of what is known of facets and balls: they lie where they were, unless somebody moves them."""
        return np.array([i for i, f in enumerate(self.families) if f == "table"], dtype=np.int64)

    @cached_property
    def machine(self) -> NDArray[np.int64]:
        """→ places of the errors of the machine itself."""
        own = [i for i, c in enumerate(self.model.coefficients) if c.slot.axis not in ("t", "w")]
        return np.array(own, dtype=np.int64)


@dataclass(frozen=True)
class Seen:
    """What n touches of one night say: rows @ unknowns = value, each with standard deviation of one touch."""

    rows: Array  # (n, p)
    value: Array  # (n,) mm
    touch: NDArray[np.int64]  # (n,) numbers; 0 for a certificate
    temperature: float | None  # °C, mean

    def without(self, touches: Sequence[int]) -> Seen:
        """numbers of touches → what the others say."""
        keep = ~np.isin(self.touch, list(touches))
        return Seen(self.rows[keep], self.value[keep], self.touch[keep], self.temperature)

    def wider(self, times: float) -> Seen:
        """times as much as stated that touches scatter → the same, so that they count for so much less; certificates as before."""
        if times == 1:
            return self
        weight = np.where(self.touch > 0, 1.0 / times, 1.0)
        return Seen(self.rows * weight[:, None], self.value * weight, self.touch, self.temperature)


def frame(touches: Touches, terms: Sequence[TermItem], degree: int = 3, warm: bool = True) -> Frame:
    """touches of the whole strategy, terms, whether temperatures are read → what is followed. Raises InputError."""
    selection = select(touches, terms, degree)
    model = selection.model
    count = len(model.coefficients)
    families = [family(c.slot.axis, c.name, c.unit) for c in model.coefficients]
    families += ["table"] * (len(model.names) - count)
    units = [*(c.unit for c in model.coefficients), *["mm"] * (len(model.names) - count)]
    moved = [i for i in range(count) if families[i] in ("location", "angle", "gain")] if warm else []
    certificates = {f"facet{model.touches.facets[i]}": u for i, u in model.calibrated}
    if model.bar is not None and touches.artefact.scale_bar is not None:
        certificates["bar"] = touches.artefact.scale_bar.uncertainty
    return Frame(
        selection,
        (*model.names, *(f"{model.names[i]}/K" for i in moved), *certificates, PRETRAVEL),
        (*units, *(f"{units[i]}/K" for i in moved), *["mm"] * (len(certificates) + 1)),
        (*families, *["fixed"] * (len(moved) + len(certificates) + 1)),
        np.array(moved, dtype=np.int64),
        certificates,
    )


def family(axis: str, name: str, unit: str) -> str:
    """axis of a slot, name and unit of an unknown → key of `WANDER`."""
    if axis in ("t", "w"):
        return "stylus"
    if name.endswith("b"):
        return "backlash" if unit == "mm" else "angle"
    return {"mm": "location", "rad": "angle"}.get(unit, "gain")


def seen(followed: Frame, readings: Readings, mean: Array, reference: float | None = None, sensor: str | None = None) -> Seen:
    """frame, readings of a night, (p,) unknowns to linearise at, °C that count as zero, sensor → what the touches say."""
    model = followed.model
    touches = from_readings(model.touches.machine, model.touches.artefact, readings)
    tonight = Model(touches, model.coefficients)
    places = [followed.place[name] for name in tonight.names]
    warmth = _temperature(touches, sensor)
    change = np.zeros(len(touches)) if warmth is None or reference is None else warmth - reference
    base, q = len(model.names), len(followed.warm)
    at = mean[places].copy()
    average = float(np.mean(change)) if len(change) else 0.0
    count = len(model.coefficients)
    warming = np.zeros(base)
    warming[followed.warm] = mean[base : base + q] * average
    at[:count] += warming[:count]
    gaps, jacobian = linearise(tonight, at)
    rows = np.zeros((len(touches), len(followed.names)))
    rows[:, places] = jacobian
    rows[:, followed.place[PRETRAVEL]] = 1.0
    rows[:, base : base + q] = rows[:, followed.warm] * change[:, None]
    value = jacobian @ at - gaps
    number = touches.number
    offsets, own, _ = known(tonight, at)
    if len(offsets):
        found = [f"facet{touches.facets[i]}" for i, _ in tonight.calibrated] + (["bar"] if tonight.bar is not None else [])
        extra = np.zeros((len(offsets), len(followed.names)))
        extra[:, places] = own
        extra[np.arange(len(found)), [followed.place[name] for name in found]] = -1.0
        sigma = model.touches.machine.probe.repeatability or EXACT
        scale = sigma / EXACT  # a certificate holds exactly but for its own error, which is an unknown
        rows = np.vstack([rows, extra * scale])
        value = np.concatenate([value, (own @ at - offsets) * scale])
        number = np.concatenate([number, np.zeros(len(offsets), dtype=np.int64)])
    return Seen(rows, value, number, None if warmth is None else float(np.mean(warmth)))


def _temperature(touches: Touches, sensor: str | None) -> Array | None:
    found = touches.temperatures
    if sensor is not None and sensor in found:
        return np.asarray(found[sensor])
    return np.mean(list(found.values()), axis=0) if found else None


def on(followed: Frame, touches: Touches) -> Frame:
    """frame, other touches of the same cell → the same unknowns over these."""
    selection = replace(followed.selection, model=Model(touches, followed.model.coefficients))
    return replace(followed, selection=selection)
