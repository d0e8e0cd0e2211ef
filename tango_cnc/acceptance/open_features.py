"""Why the touches leave a feature of a part open, and what would close it: its tool, a stylus of its length, temperatures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ..compensate.fit import Known
from ..iso230.doubt import UNDECIDED, VOLUME, listed, nearest, strongest
from ..iso230.whole import blocks_of, motion_of
from ..kinematics import slot_name
from ..nc import features
from ..nc.features import Tool
from ..nc.follow import Motion, Setup
from ..records import Array

COVERAGE = 0.95
NORMAL = float(special.ndtri(0.5 + COVERAGE / 2))
MEASURED = Tool(1e-3)  # for what would help: a length that is known to 1 µm
BEYOND = "an axis is beyond what was touched, so the machine was not measured there ({where} of the machine)"
NOT_MEASURED = (
    "; with a tool whose length was measured against the probe it would be {std:.1f} µm. State that under 'tool' in the features "
    "file (docs/compensate.md)"
)
TOO_UNSURE = (
    "the touches decide it, and what is stated of the tool does not: with that its standard deviation would be {std:.0f} µm; "
    "measure the tool against the probe with a smaller uncertainty"
)
UNSURE = (
    "the touches decide it, and the temperatures do not: with them its standard deviation would be {std:.0f} µm; measure bar and "
    "machine, and state their temperatures and expansions in temperature.yaml with smaller uncertainties"
)
LENGTH = (
    "; the length of the tool is why: it is {by:.0f} mm {than} than the stylus and shows {motions} in another way than the touches "
    "did. As long as the stylus ({stylus:g} mm){measured} it would leave {std:.1f} µm. Touch again with a second stylus about as "
    "long as the tool (docs/verify.md, A second stylus){state}"
)
MIXED = "; these touches cannot separate {motions} from each other"


@dataclass(frozen=True)
class Left:
    """What the touches leave open, under sizes wider than those of any machine."""

    stated: Known  # with what is stated of the tool, temperature in it
    cold: Known | None = None  # the same without temperature
    measured: Known | None = None  # with a tool that was measured well against the probe, without temperature
    lengths: tuple[float, ...] = ()  # mm, of the styli that touched


def undecided_by(std: float, most: float = UNDECIDED["µm"]) -> str:
    """standard deviation that the touches leave open, and that a figure may have, µm → why it is withheld; '' where it is not."""
    return f"these touches do not decide it: its standard deviation would be {std:.0f} µm" if std > most else ""


def reasons(
    wanted: features.Wanted,
    found: Sequence[features.Predicted],
    setup: Setup,
    left: Left,
    labels: Mapping[str, Sequence[Motion]],
    touched: Mapping[str, tuple[float, float]],
) -> list[tuple[str, tuple[str, ...]]]:
    """checks, their features, set-up, what is left open, motions by block, touched ranges → why each is withheld ('' where it is
    not), and the error motions that the touches do not tell from each other there.

    Where rotary axes turn between its places, the errors of all axes sum up in a feature, and it may be as uncertain as a volume.
    """
    stds = _stds(wanted, setup, left.stated, labels, touched, wanted.tool)
    wholly = [(VOLUME if f.turned else 1.0) * UNDECIDED["µm"] for f in found]
    if not any(std > most for std, most in zip(stds, wholly, strict=True)):
        return [(_beyond(f), ()) for f in found]
    cold, best = (
        _stds(wanted, setup, known, labels, touched, tool) for known, tool in ((left.cold, wanted.tool), (left.measured, MEASURED))
    )
    own = features.lengths_of(wanted, setup, labels)
    at_stylus = _at_stylus(wanted, setup, left, labels, touched, own)
    known = left.measured or left.stated
    ways = features.weights(replace(wanted, tool=MEASURED if left.measured else wanted.tool), setup, known, labels)
    result: list[tuple[str, tuple[str, ...]]] = []
    for i, f in enumerate(found):
        std, most = stds[i], wholly[i]
        why, mixed = undecided_by(std, most), tuple[str, ...]()
        if f.extrapolated:
            why = _beyond(f)
        elif why and cold[i] <= most:
            why = UNSURE.format(std=std)
        elif why and best[i] <= most:
            why = why + NOT_MEASURED.format(std=best[i]) if wanted.tool is None else TOO_UNSURE.format(std=std)
        elif why:
            mixed = _mixed(known, ways[i])
            why += _by_length(own[i], left, at_stylus[i], most, mixed, wanted.tool is not None)
        result.append((why, mixed))
    return result


def _beyond(f: features.Predicted) -> str:
    return BEYOND.format(where="; ".join(f.outside)) if f.extrapolated else ""


def _stds(
    wanted: features.Wanted,
    setup: Setup,
    known: Known | None,
    labels: Mapping[str, Sequence[Motion]],
    touched: Mapping[str, tuple[float, float]],
    tool: Tool | None,
    length: float | None = None,
) -> list[float]:
    """→ µm, standard deviation of each feature that is left open; endless where nothing is known. `length`: of another tool."""
    if known is None:
        return [math.inf] * sum(3 if check.kind == "position" else 1 for check in wanted.checks)
    found = features.predict(replace(wanted, tool=tool), setup, known, labels, touched, length)
    return [(f.high - f.low) / 2 / NORMAL for f in found]


def _at_stylus(
    wanted: features.Wanted,
    setup: Setup,
    left: Left,
    labels: Mapping[str, Sequence[Motion]],
    touched: Mapping[str, tuple[float, float]],
    own: Sequence[float],
) -> list[tuple[float, float]]:
    """→ µm, what is left open of each feature with a tool as long as the nearest stylus: as it is stated, and measured well."""
    result = [(math.inf, math.inf)] * len(own)
    beyond = {length: near for length in set(own) if (near := nearest(length, left.lengths)) is not None}
    for near in set(beyond.values()):
        plain = _stds(wanted, setup, left.cold or left.stated, labels, touched, wanted.tool, near)
        well = _stds(wanted, setup, left.measured, labels, touched, MEASURED, near)
        for i, length in enumerate(own):
            if beyond.get(length) == near:
                result[i] = plain[i], well[i]
    return result


def _by_length(length: float, left: Left, at_stylus: tuple[float, float], most: float, mixed: tuple[str, ...], stated: bool) -> str:
    """→ how the length of the tool is why a feature is open; where it is not, which error motions are mixed."""
    near, (plain, well) = nearest(length, left.lengths), at_stylus
    if near is None or (plain if stated else min(plain, well)) > most:
        return MIXED.format(motions=listed(mixed)) if len(mixed) > 1 else ""
    needs = plain > most and not stated  # its length against the probe, too
    return LENGTH.format(
        by=abs(length - near),
        than="longer" if length > near else "shorter",
        motions=listed(mixed) or "tilts of the axes",
        stylus=near,
        std=well if needs else plain,
        measured=" and measured against the probe" if needs else "",
        state=", and state under 'tool' how the tool was measured against the probe (docs/compensate.md)" if needs else "",
    )


def _mixed(known: Known, way: Array) -> tuple[str, ...]:
    """what is left open, (p,) weights of a feature → error motions of the machine that explain most of it."""
    motions = [motion_of(c) if c.slot.stage != "stylus" else slot_name(c.slot) for c in known.coefficients]
    blocks = blocks_of(motions, np.asarray(known.covariance))
    own = {motion_of(c) for c in known.coefficients if c.slot.stage not in ("stylus", "table")}
    return strongest([b for b in blocks if b[0] in own], known.covariance, way)
