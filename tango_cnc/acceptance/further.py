"""Parameters of the fit and features of a part as figures that a limit can be put on, with the whole budget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from ..compensate.fit import Known
from ..estimate import Estimate
from ..iso230.doubt import lengths
from ..iso230.expansion import stretches
from ..iso230.poses import all_steady, at_poses
from ..iso230.signed import OnPart, Sheet
from ..iso230.temperature import NO_CHANGE, scale
from ..iso230.temperature import Known as Warmth
from ..iso230.whole import Whole
from ..kinematics import Slot
from ..nc import features
from ..nc.features import Tool
from ..nc.follow import Motion, Setup
from ..nc.predict import touched_of
from ..records import Array, InputError, Machine, TangoError
from ..terms import Coefficient
from ..touches import Touches
from .open_features import COVERAGE, MEASURED, Left, reasons

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


def known_of(sheet: Sheet, setup: Setup, wide: bool = False, tool: Tool | None = None, expanding: bool = True) -> Known:
    """figures, set-up of a part, whether under the wide sizes, its tool, whether with what temperature adds to scales → every
    error motion of the machine, budget in it.

    Under the wide sizes it tells what the touches leave open; otherwise the machines that they leave possible are drawn.
    """
    whole = sheet.whole if wide else sheet.learned
    if whole is None:
        raise TangoError("accept: the figures were made without the machine behind them, so no part can be predicted")
    if not expanding or sheet.thermal is None or sheet.temperature == "not stated":
        return possible(whole, setup.machine, tool=tool)
    return possible(whole, setup.machine, scale(sheet.thermal, sheet.temperature.startswith("20 °C")), tool)


def possible(whole: Whole, machine: Machine, more: Warmth | None = None, tool: Tool | None = None) -> Known:
    """every error motion as the touches leave it, machine, what temperature adds to scales (mm/mm), what is stated of the tool
    → what acts at a pose.

    A tool that was measured against the probe is off its length by as much as the tip of the probe is, and what the measurement
    of it adds. Without a statement its length is taken as exact, which no touch has told.
    """
    own, _ = all_steady(whole.coefficients, _some(whole.touches))
    coefficients = tuple(whole.coefficients[i] for i in own)
    values, covariance = whole.values[own], whole.covariance[np.ix_(own, own)]
    drawn = None if whole.draws is None else whole.draws[own] - values[:, None]
    tip = whole.tip
    if tool is not None and tip is not None:
        covariance = np.block([[covariance, tip.across[own, None]], [tip.across[None, own], np.array([[tip.variance]])]])
        coefficients, values = (*coefficients, tip.coefficient), np.append(values, tip.value)
        drawn = None if drawn is None or tip.draws is None else np.vstack([drawn, tip.draws - tip.value])
    known = Known(coefficients, values, covariance, drawn=drawn)
    if tool is not None:
        for i, std in enumerate((tool.eccentricity, tool.eccentricity, tool.length)):
            known = _with(known, (_along(i),), 0.0, std, 2310 + i)
    return known if more is None else _with(known, stretches(machine), more.value, more.std, 2309)


def _along(component: int) -> Coefficient:
    """x, y or z → how far the tip of the tool that cuts is elsewhere than stated, mm."""
    return Coefficient(f"tool {'xyz'[component]}", "mm", Slot("t", "stylus", component), lambda touches: np.ones(len(touches)))


def _with(known: Known, more: tuple[Coefficient, ...], value: float, std: float, seed: int) -> Known:
    """what acts, coefficients that are one and the same unknown, its value and standard deviation → all of it."""
    p, k = len(known.values), len(more)
    covariance = np.zeros((p + k, p + k))
    covariance[:p, :p], covariance[p:, p:] = known.covariance, std**2
    drawn = known.drawn
    if drawn is not None:
        one = std * np.random.default_rng(seed).standard_normal(drawn.shape[1])
        drawn = np.vstack([drawn, np.tile(one, (k, 1))])
    coefficients, values = (*known.coefficients, *more), np.append(known.values, np.full(k, value))
    return replace(known, coefficients=coefficients, values=values, covariance=covariance, drawn=drawn)


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
    touches, tool = sheet.whole.touches, wanted.tool
    wide, cold = (known_of(sheet, setup, True, tool, expanding) for expanding in (True, False))
    left = Left(wide, cold, known_of(sheet, setup, True, MEASURED, False), lengths(touches))
    found, note = [], "" if tool is None else features.stated(tool)
    for f, why, _ in decided(wanted, setup, known, left, labels, touched_of(touches)):
        expands = f.kind in ("distance", "position")
        figure = OnPart(PART, f.name, "µm", f.value, (f.low, f.high), None, note, bounds=f.bounds, expands=expands)
        if not why and expands and sheet.temperature == "not stated":
            why = "the temperatures of bar and machine are not stated; write temperature.yaml"
        found.append(replace(figure, value=None, interval=None, text=why) if why else figure)
    return tuple(found)


def decided(
    wanted: features.Wanted,
    setup: Setup,
    known: Known,
    left: Left,
    labels: Mapping[str, Sequence[Motion]],
    touched: Mapping[str, tuple[float, float]],
) -> list[tuple[features.Predicted, str, tuple[str, ...]]]:
    """features, set-up, machines that are possible, what the touches leave open, motions by block, touched ranges → each feature,
    why it is withheld ('' where it is not), and the error motions that are mixed there.

    Raises InputError for blocks that the program does not have.
    """
    found = features.predict(wanted, setup, known, labels, touched)
    return [(f, why, mixed) for f, (why, mixed) in zip(found, reasons(wanted, found, setup, left, labels, touched), strict=True)]
