"""Parameters of the fit and features of a part as figures that a limit can be put on, with the whole budget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from ..compensate.fit import Known
from ..estimate import Estimate
from ..iso230.doubt import UNDECIDED
from ..iso230.expansion import stretches
from ..iso230.poses import all_steady, at_poses
from ..iso230.signed import OnPart, Sheet
from ..iso230.temperature import NO_CHANGE, scale
from ..iso230.temperature import Known as Warmth
from ..iso230.whole import Whole
from ..nc import features
from ..nc.follow import Motion, Setup
from ..nc.predict import touched_of
from ..records import Array, InputError, Machine, TangoError
from ..touches import Touches

COVERAGE = 0.95
PARAMETER, PART = "parameter", "part"
UNITS = {"mm": ("µm", 1e3), "rad": ("µrad", 1e6), "mm/mm": ("µm/m", 1e6), "rad/rad": ("µrad/rad", 1e6)}


def parameters(result: Estimate, names: Sequence[str], sheet: Sheet, file: str = "acceptance.yaml") -> tuple[OnPart, ...]:
    """estimate, names of its parameters, figures with their budget, order → each in µm, µrad or µm/m with its 95 % interval.

    What of the budget the scatter does not contain moves the fit linearly. Raises InputError for names that it does not hold,
    and for those that are polynomials of an error motion: straightness and its like are figures of their own.
    Source: JCGM 102:2011, 6.2 (linear propagation).
    """
    own = {c.name: i for i, c in enumerate(result.model.coefficients) if c.slot.stage not in ("stylus", "table")}
    given = [name for name in own if result.model.coefficients[own[name]].unit in UNITS]
    for name in names:
        if name not in given:
            raise InputError(f"{file}: limits: found '{PARAMETER} {name}'; allowed: {PARAMETER} and one of {', '.join(given)}")
    covariance = result.covariance + _beside(result, sheet)
    student = float(special.stdtrit(sheet.freedom, 0.5 + COVERAGE / 2))
    found = []
    for name in names:
        i = own[name]
        unit, factor = UNITS[result.model.coefficients[i].unit]
        c, warm = result.model.coefficients[i], NO_CHANGE
        expands = c.slot.stage == "motion" and c.unit == "mm/mm"
        if expands and sheet.thermal is not None:
            warm = scale(sheet.thermal, sheet.temperature.startswith("20 °C"))
        value = (float(result.values[i]) + warm.value) * factor
        wide = student * float(covariance[i, i] + warm.std**2) ** 0.5 * factor
        note = "of the fitted terms: what they leave out of the machine may be in it"
        found.append(OnPart(PARAMETER, name, unit, value, (value - wide, value + wide), None, note, expands=expands))
    return tuple(found)


def _beside(result: Estimate, sheet: Sheet) -> Array:
    """estimate, figures with their budget → (p, p) covariance that the scatter of the touches does not contain."""
    p, n = len(result.values), len(result.residuals)
    if sheet.budget is None:
        return np.zeros((p, p))
    weights = np.concatenate([np.ones(n), result.known_weights])
    weights[:n][result.unused] = 0.0
    solve = np.linalg.pinv(result.jacobian * weights[:, None], rcond=1e-13) * weights
    moved = [solve @ factor for factor in sheet.budget.beside_scatter]
    return np.asarray(sum((m @ m.T for m in moved), np.zeros((p, p))))


def known_of(sheet: Sheet, setup: Setup, wide: bool = False) -> Known:
    """figures, set-up of a part, whether under the wide sizes → every error motion of the machine, budget and expansion in it.

    Under the wide sizes it tells what the touches leave open; otherwise the machines that they leave possible are drawn.
    """
    whole = sheet.whole if wide else sheet.learned
    if whole is None:
        raise TangoError("accept: the figures were made without the machine behind them, so no part can be predicted")
    if sheet.thermal is None or sheet.temperature == "not stated":
        return possible(whole, setup.machine)
    return possible(whole, setup.machine, scale(sheet.thermal, sheet.temperature.startswith("20 °C")))


def possible(whole: Whole, machine: Machine, more: Warmth | None = None) -> Known:
    """every error motion as the touches leave it, machine, what temperature adds to scales (mm/mm) → what acts at a pose."""
    own, _ = all_steady(whole.coefficients, _some(whole.touches))
    coefficients = tuple(whole.coefficients[i] for i in own)
    values, covariance = whole.values[own], whole.covariance[np.ix_(own, own)]
    drawn = None if whole.draws is None else whole.draws[own] - values[:, None]
    if more is not None:
        axes = machine.linear
        p, k = len(values), len(axes)
        stretched = np.zeros((p + k, p + k))
        stretched[:p, :p], stretched[p:, p:] = covariance, more.std**2  # one and the same expansion stretches every axis
        coefficients, covariance = coefficients + stretches(machine), stretched
        values = np.concatenate([values, np.full(k, more.value)])
        if drawn is not None:
            both = more.std * np.random.default_rng(2309).standard_normal(drawn.shape[1])
            drawn = np.vstack([drawn, np.tile(both, (k, 1))])
    return Known(coefficients, values, covariance, drawn=drawn)


def _some(touches: Touches) -> Touches:
    """touches → the same poses without facets, in a random order: what depends on the history is different there."""
    some = np.random.default_rng(3).permutation(len(touches))[:40]
    return at_poses(touches.machine, touches.position[some], touches.direction[some])


def of_part(
    wanted: features.Wanted, setup: Setup, known: Known, labels: Mapping[str, Sequence[Motion]], sheet: Sheet
) -> tuple[OnPart, ...]:
    """features, set-up, machine, motions by block, figures → each feature in µm with its 95 % interval, or withheld and why.

    Raises InputError for blocks that the program does not have.
    """
    assert sheet.whole is not None
    touched, wide = touched_of(sheet.whole.touches), known_of(sheet, setup, wide=True)
    found = []
    for f, why in decided(wanted, setup, known, wide, labels, touched):
        figure = OnPart(PART, f.name, "µm", f.value, (f.low, f.high), None, f.kind, bounds=f.bounds)
        if not why and f.kind in ("distance", "position") and sheet.temperature == "not stated":
            why = "the temperatures of bar and machine are not stated; write temperature.yaml"
        found.append(replace(figure, value=None, interval=None, text=f"{f.name}: {why}") if why else figure)
    return tuple(found)


def decided(
    wanted: features.Wanted,
    setup: Setup,
    known: Known,
    wide: Known,
    labels: Mapping[str, Sequence[Motion]],
    touched: Mapping[str, tuple[float, float]],
) -> list[tuple[features.Predicted, str]]:
    """features, set-up, machines that are possible, what the touches leave open, motions by block, touched ranges → each feature,
    and why it is withheld ('' where it is not).

    Raises InputError for blocks that the program does not have.
    """
    normal, found = float(special.ndtri(0.5 + COVERAGE / 2)), []
    left = features.predict(wanted, setup, wide, labels, touched)
    for f, open_to in zip(features.predict(wanted, setup, known, labels, touched), left, strict=True):
        std = (open_to.high - open_to.low) / 2 / normal
        why = "an axis is beyond what was touched, so the machine was not measured there" if f.extrapolated else ""
        found.append((f, why or undecided_by(std)))
    return found


def undecided_by(std: float, most: float = UNDECIDED["µm"]) -> str:
    """standard deviation that the touches leave open, and that a figure may have, µm → why it is withheld; '' where it is not."""
    return f"these touches do not decide it: its standard deviation would be {std:.0f} µm" if std > most else ""
