"""Which unknowns a plan can see, which it cannot, and which combination that is, in words.

Columns of the Jacobian at the nominal contacts are taken in order of preference; one that lies in the span of those before
it moves every touch exactly as they do and is left out. What a subset word such as S3 means for a topology is decided the
same way on a rich plan: random poses over the whole travel, every direction, a scale bar.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import linalg

from . import kinematics
from .kinematics import Slot
from .model import PLACEMENT, STYLUS, Model, known, linearise, setup_coefficient
from .records import Array, Artefact, Ball, Combination, Facet, Machine, ScaleBar, TermItem
from .terms import Coefficient, backlash, error_motion, find, inter_axis
from .touches import Touches, of_facets

# The faintest real coefficients of all example cells, to degree 6, keep 7e-4 of what they could amount to; dependent ones 1e-15, or
# 5e-7 where points are given to 1e-6 mm. At 2e-5 a touch of 0.7 µm would leave more than a millimetre undecided.
TOLERANCE = 2e-5
NOISE = 1e-11  # of the column itself: less is rounding
# mm at the longest lever: what would be known to no better than this is not seen. The model is curved; a standard deviation of
# half a millimetre on a machine of 300 mm already bends by as much as a touch scatters.
BLURRED = 0.5
FINEST = 1e-4  # mm: no touch is taken to be better than this
SUBSETS = ("S1", "S2", "S3", "S4")


@dataclass(frozen=True)
class Selection:
    """The model that a plan supports, and what was asked for but cannot be seen."""

    model: Model
    unseen: tuple[Combination, ...]
    mismatch: bool  # absolute scale unseen: the gains of Y and Z are told against X

    def label(self, name: str) -> str:
        """coefficient → the name under which its value may be reported."""
        return f"{name}-EXX1" if self.mismatch and name in ("EYY1", "EZZ1") else name


def columns(model: Model) -> tuple[Array, Array]:
    """model → Jacobian at its touches without errors (n + m, p), known distances included; what a column could amount to (p,).

    A shift could move every touch by itself, a turn by the longest lever, and of a power x³ only that part counts which
    x², x and a constant do not make as well. A column is faint by this measure, not by its own size: a round table does not
    see C turn, but for the rounding of its facets.
    """
    start = np.zeros(len(model.names))
    _, jacobian = linearise(model, start)
    _, rows, _ = known(model, start)
    touches = model.touches
    levers = kinematics.sensitivity(touches.chain, kinematics.trace(touches.chain, touches.position), touches.normal).slots
    turns = [lever for slot, lever in levers.items() if _turns(slot, touches.machine)]
    longest = max(float(np.max(np.abs(lever))) for lever in turns)
    could = np.full(len(model.names), math.sqrt(len(touches)))
    for j, c in enumerate(model.coefficients):
        size = float(np.linalg.norm(_own_shape(c, model.regressors[j], touches)))
        could[j] = size * (longest if _turns(c.slot, touches.machine) else 1.0)
    return np.vstack([jacobian, rows]), np.where(could > 0, could, 1.0)


def _turns(slot: Slot, machine: Machine) -> bool:
    return slot.axis in machine.rotary if slot.stage == "motion" else slot.component >= 3


def _own_shape(c: Coefficient, regressor: Array, touches: Touches) -> Array:
    """→ (n,) what the lower powers of the same axis leave of a power; any other regressor as it is."""
    match = error_motion.PATTERN.fullmatch(c.name)
    if match is None or match[3] == "0":
        return regressor
    x = touches.axis(match[2])
    x = (x - x.mean()) / (np.ptp(x) or 1.0)
    lower = np.linalg.qr(np.vander(x, int(match[3])))[0]
    rest: Array = regressor - lower @ (lower.T @ regressor)
    return rest


def independent(matrix: Array, could: Array, tolerance: float = TOLERANCE) -> tuple[list[int], dict[int, Array]]:
    """(m, p) columns in order of preference, (p,) their possible sizes → indices kept; for each left out, weights over those kept.

    Gram–Schmidt with one re-orthogonalisation (Giraud et al. 2005): unpivoted QR would let the rounding noise of a
    dependent column push out the columns behind it.
    """
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    reduced: Array = matrix / scale
    if matrix.shape[0] > matrix.shape[1]:
        reduced = np.asarray(np.linalg.qr(reduced, mode="r"))
    count = reduced.shape[1]
    basis = np.empty((count, reduced.shape[0]))
    triangle = np.zeros((count, count))
    kept: list[int] = []
    left: dict[int, Array] = {}
    for j in range(count):
        column, k = reduced[:, j], len(kept)
        weights = basis[:k] @ column
        rest = column - weights @ basis[:k]
        again = basis[:k] @ rest
        rest -= again @ basis[:k]
        weights += again
        size = math.sqrt(rest @ rest)
        if size * scale[j] > tolerance * could[j] and size > NOISE:
            triangle[:k, k] = weights
            triangle[k, k] = size
            np.divide(rest, size, out=basis[k])
            kept.append(j)
        else:
            left[j] = linalg.solve_triangular(triangle[:k, :k], weights) * scale[j] / scale[kept] if k else np.empty(0)
    return kept, left


def select(touches: Touches, terms: Sequence[TermItem], degree: int = 3) -> Selection:
    """touches, terms of a cell → the model they support. Raises InputError for a term that nothing knows."""
    machine = touches.machine
    wanted = _wanted(machine, terms, degree)
    calibrated = any(f.uncertainty is not None for f in touches.artefact.facets.values())
    setup = [setup_coefficient(name) for name in (*STYLUS, *(PLACEMENT if calibrated else ()))]
    kept, left = _visible(touches.nominal, setup, wanted)
    blurred = _blurred(Model(touches.nominal, tuple(kept)), {c.name for c in wanted})
    kept, left = [c for c in kept if c.name not in blurred], left | blurred
    names = {c.name for c in kept}
    model = Model(touches, (*(c for c in wanted if c.name in names), *(c for c in setup if c.name in names)))
    mismatch = "EXX1" in left and any(c.name == "EXX1" for c in wanted) and {"EYY1", "EZZ1"} <= names
    asked = {*(c.name for c in wanted), *STYLUS}
    unseen = tuple(c for name, c in left.items() if name in asked)
    return Selection(model, unseen, mismatch)


def _wanted(machine: Machine, terms: Sequence[TermItem], degree: int) -> list[Coefficient]:
    subset = 0
    explicit: list[Coefficient] = []
    for item in terms:
        if isinstance(item, str) and item in SUBSETS:
            subset = max(subset, SUBSETS.index(item))
        else:
            explicit.extend(find(item, machine))
    result = list(subset_terms(machine, subset, degree)) if subset else []
    names = {c.name for c in result}
    for c in explicit:
        if c.name in names:
            continue
        names.add(c.name)
        result.append(c)
    # The isotropic scale goes last, so that where it cannot be seen it is EXX1 that is left out.
    result.sort(key=lambda c: c.name == "EXX1")
    return result


@lru_cache(maxsize=32)
def subset_terms(machine: Machine, subset: int, degree: int) -> tuple[Coefficient, ...]:
    """machine, 1–3 for S2–S4, degree → coefficients that a rich plan on this topology tells apart (thesis Table 4-1)."""
    candidates = error_motion.scales(machine)
    if subset >= 2:
        candidates = [*candidates, *inter_axis.coefficients(machine, degree), *backlash.coefficients(machine, degree)]
    if subset >= 3:
        names = {c.name for c in candidates}
        candidates = [*candidates, *(c for c in error_motion.coefficients(machine, degree) if c.name not in names)]
    candidates.sort(key=lambda c: c.name == "EXX1")
    touches = rich_plan(machine)
    setup = [setup_coefficient(name) for name in (*STYLUS, *(() if machine.rotary else PLACEMENT))]
    kept, _ = _visible(touches, setup, candidates)
    names = {c.name for c in kept}
    return tuple(c for c in candidates if c.name in names)


def _visible(
    touches: Touches, setup: list[Coefficient], wanted: list[Coefficient]
) -> tuple[list[Coefficient], dict[str, Combination]]:
    """Facets and balls come first, then the setup, then the machine."""
    model = Model(touches, (*setup, *wanted))
    matrix, could = columns(model)
    count = len(model.coefficients)
    order = [*range(count, matrix.shape[1]), *range(count)]
    kept, left = independent(matrix[:, order], could[order])
    names = [model.names[order[j]] for j in kept]
    norm = np.linalg.norm(matrix, axis=0)
    units = [*(c.unit for c in model.coefficients), *["mm"] * (len(model.names) - count)]
    combinations = {}
    for j, weights in left.items():
        at = order[j]
        faint = norm[at] <= TOLERANCE * could[at]
        share = (
            np.array([abs(w) * norm[order[i]] / norm[at] for i, w in zip(kept, weights, strict=False)])
            if not faint
            else np.empty(0)
        )
        strong = [int(i) for i in np.argsort(-share) if share[i] > 0.02]
        partners = {names[i]: (float(weights[i]), units[order[kept[i]]]) for i in strong}
        combinations[model.names[at]] = describe(model.names[at], units[at], partners)
    return [c for c in model.coefficients if c.name in set(names)], combinations


def _blurred(model: Model, wanted: set[str]) -> dict[str, Combination]:
    """model of independent columns, names that may be left out → those that touches so noisy would not settle, in words.

    One by one, the highest power first: what is left may then be seen well.
    """
    matrix, could = columns(model)
    sigma = max(model.touches.machine.probe.repeatability, FINEST)
    count = len(model.touches)
    matrix[count:] *= (sigma / known(model, np.zeros(len(model.names)))[2])[:, None]
    scale = np.linalg.norm(matrix, axis=0)
    root = np.asarray(np.linalg.qr(matrix / scale, mode="r"))
    reach = sigma * could / math.sqrt(count) / scale
    power = [int(m[3]) if (m := error_motion.PATTERN.fullmatch(name)) else 0 for name in model.names]
    left: dict[str, Combination] = {}
    stay = list(range(len(model.names)))
    while stay:
        if left:
            root = np.asarray(np.linalg.qr(root, mode="r"))
        amount = np.linalg.norm(linalg.solve_triangular(root, np.eye(len(stay))), axis=1) * reach[stay]
        bad = [i for i, j in enumerate(stay) if amount[i] > BLURRED and model.names[j] in wanted]
        if not bad:
            break
        worst = max(bad, key=lambda i: (power[stay[i]], amount[i]))
        name = model.names[stay[worst]]
        text = (
            f"{name} is too faint: touches that scatter by {sigma * 1e3:.2g} µm would leave {amount[worst]:.2g} mm of it undecided"
        )
        left[name] = Combination((name,), (1.0,), text)
        root = np.delete(root, worst, axis=1)
        del stay[worst]
    return left


def describe(name: str, unit: str, partners: Mapping[str, tuple[float, str]]) -> Combination:
    """name left out, its unit, what moves the touches as it does by name: (factor, unit) → combination, in words for people."""
    table = [p for p in partners if p.startswith(("EZf", "EXball", "EYball", "EZball"))]
    said = [p for p in partners if p not in table]
    if name == "EXX1" and {"EYY1", "EZZ1"} <= set(said):
        text = (
            "the absolute scale cannot be seen, only scale mismatches against X: touch a scale bar or a calibrated facet, "
            "or read EYY1 and EZZ1 as EYY1-EXX1 and EZZ1-EXX1 and lengths, EZt among them, in units of X"
        )
    elif not partners:
        text = f"{name} moves no touch of this plan"
    elif not said:
        text = (
            f"{name} moves the touches just as a table of another shape would: only calibrated facets, or "
            "the same facets met in more poses, could tell"
        )
    elif len(said) <= 3 and not table:
        sums = [_sum(name, unit, p, *partners[p]) for p in said]
        if len(said) == 1:
            same = {f"{said[0]} + {name}": "their sum", f"{said[0]} - {name}": "their difference"}
            text = f"{name} and {said[0]} move every touch alike: only {same.get(sums[0], sums[0])} is known"
        else:
            text = f"{name} moves the touches just as {_list(said)} do together: only {_list(sums)} are known"
    else:
        listed = [*said[:5], *(["others"] if len(said) > 5 else []), *(["the facet offsets"] if table else [])]
        text = f"{name} moves the touches just as a combination of {_list(listed)} does: it cannot be told from them"
    return Combination((name, *partners), (1.0, *(-factor for factor, _ in partners.values())), text)


def _sum(name: str, unit: str, partner: str, factor: float, other: str) -> str:
    sign = "+" if factor > 0 else "-"
    alike = unit == other or {unit, other} == {"rad", "mm/mm"}
    if alike and abs(abs(factor) - 1) < 0.01:
        return f"{partner} {sign} {name}"
    return f"{partner} {sign} {abs(factor):.4g} · {name} (in {other}, {name} in {unit})"


def _list(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def summary(unseen: Sequence[Combination]) -> list[str]:
    """combinations → sentences, one for all of which the same is to be said."""
    groups: dict[str, list[str]] = {}
    for c in unseen:
        same = c.text.removeprefix(f"{c.names[0]} moves ")
        groups.setdefault(c.text if same == c.text else same, []).append(c.names[0])
    said = []
    for text, names in groups.items():
        one = len(names) == 1 and text.startswith((names[0], "the absolute"))
        said.append(text if one else f"{', '.join(names)} {'moves' if len(names) == 1 else 'each move'} {text}")
    return said


def rich_plan(machine: Machine, count: int = 700) -> Touches:
    """machine → touches in random poses over its whole travel: what this topology can ever tell apart.

    Facets point in every direction that the spindle can reach; every rotary axis turns anywhere in its travel, the spindle
    to quarters; the last motion of each linear axis is the approach or, where that is across, the plunge along the spindle.
    """
    rng = np.random.default_rng(20)
    size = 30 if machine.rotary else 250  # without rotary axes a facet is seen from one side only
    normals = rng.normal(size=(size, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = 120 * normals + rng.uniform(-60, 60, size=(size, 3))
    certain = None if machine.rotary else 0.001
    facets = {
        f"{i}": Facet(f"{i}", tuple(p), tuple(n), uncertainty=certain) for i, (p, n) in enumerate(zip(points, normals, strict=True))
    }
    balls = {"1": Ball("1", (-150.0, 20.0, 90.0), 12.0), "2": Ball("2", (150.0, -40.0, 70.0), 12.0)}
    directions = np.vstack([np.eye(3), -np.eye(3)])
    for b in balls.values():
        for i, d in enumerate(directions):
            key = f"{b.id}ball{i}"
            facets[key] = Facet(key, tuple(np.array(b.centre) + b.radius * d), tuple(d), ball=b.id)
    artefact = Artefact("rich", facets, balls, ScaleBar(("1", "2"), 306.6, 0.001))
    keys = list(facets)
    chosen = [keys[i] for i in rng.integers(0, len(keys), count)]
    position = np.zeros((count, len(machine.names)))
    for name in machine.rotary:
        low, high = machine.axis(name).travel or (-np.pi, np.pi)
        position[:, machine.column(name)] = rng.uniform(max(low, -2 * np.pi), min(high, 2 * np.pi), count)
    position[:, machine.column("S")] = rng.integers(0, 4, count) * np.pi / 2
    touches = of_facets(machine, artefact, chosen, position, np.zeros_like(position)).nominal
    upward = kinematics.spindle_axis(touches.chain, touches.position)
    across = np.sum(upward * touches.normal, axis=1)
    reachable = across >= 0
    step = 0.5
    tip = touches.point + machine.probe.tip_radius * touches.normal
    approach = kinematics.inverse(touches.chain, touches.position, tip) - kinematics.inverse(
        touches.chain, touches.position, tip + step * touches.normal
    )
    plunge = touches.position - kinematics.inverse(touches.chain, touches.position, tip + step * upward)
    direction = np.where(
        np.abs(approach) > 1e-3 * step, np.sign(approach), np.sign(np.where(np.abs(plunge) > 1e-3 * step, plunge, 0.0))
    )
    turning = [machine.column(name) for name in (*machine.rotary, "S")]
    direction[:, turning] = rng.choice([-1.0, 1.0], size=(count, len(turning)))
    across_both = direction == 0
    direction[across_both] = rng.choice([-1.0, 1.0], size=int(across_both.sum()))
    keep = np.flatnonzero(reachable)
    return of_facets(machine, artefact, [chosen[i] for i in keep], touches.position[keep], direction[keep])
