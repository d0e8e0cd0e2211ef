"""Terms of a cell → the model that its touches support."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .. import kinematics
from ..model import PLACEMENT, STYLUS, Model, setup_coefficient, setup_names
from ..records import Array, Artefact, Ball, Combination, Facet, Machine, ScaleBar, TermItem
from ..terms import SCALES, Coefficient, backlash, error_motion, find, inter_axis
from ..texts import say
from ..touches import Touches, of_facets
from .rank import TOLERANCE, blurred, columns, independent
from .words import describe

SUBSETS = ("S1", "S2", "S3", "S4")


@dataclass(frozen=True)
class Selection:
    """The model that a plan supports, and what was asked for but cannot be seen."""

    model: Model
    unseen: tuple[Combination, ...]
    relative: frozenset[str] = frozenset()  # gains that are known only as differences to that of `reference`
    reference: str = "EXX1"

    @property
    def mismatch(self) -> bool:
        """→ whether the touches show gains only as differences to that of one axis: nothing shows the absolute scale."""
        return bool(self.relative)

    def label(self, name: str) -> str:
        """coefficient → the name under which its value may be reported."""
        return f"{name}-{self.reference}" if name in self.relative else name

    def without_machine(self, command: str, so: str) -> str:
        """command, what follows → the sentence for a model without an error of the machine: not asked for, or not seen."""
        todo = "its terms ask for none: ask for some (--terms S3)"
        if self.unseen:
            todo = "these touches determine none that its terms ask for: 'tango check' says why"
        return f"{command}: the estimate contains no error of the machine, so {so}; {todo}"


def select(touches: Touches, terms: Sequence[TermItem], degree: int = 3) -> Selection:
    """touches, terms of a cell → the model they support. Raises InputError for a term that nothing knows."""
    machine = touches.machine
    wanted = _wanted(machine, terms, degree)
    calibrated = any(f.uncertainty is not None for f in touches.artefact.facets.values())
    setup = [setup_coefficient(name) for name in setup_names(touches, calibrated)]
    found = _visible(touches.nominal, setup, wanted)
    kept, left, matrix, could = _with_gauge(touches.nominal, setup, wanted, found)
    noisy = blurred(Model(touches.nominal, tuple(kept)), matrix, could, {c.name for c in wanted})
    kept, left = [c for c in kept if c.name not in noisy], left | noisy
    names = {c.name for c in kept}
    model = Model(touches, (*(c for c in wanted if c.name in names), *(c for c in setup if c.name in names)))
    asked = {*(c.name for c in wanted), *STYLUS}
    unseen = tuple(c for name, c in left.items() if name in asked)
    for reference in ("EXX1", "EYY1", "EZZ1"):
        if reference in {*left} & asked and (relative := _relative_to(left[reference], names, reference in noisy)):
            return Selection(model, unseen, relative, reference)
    return Selection(model, unseen)


def _relative_to(scale: Combination, fitted: set[str], faint: bool) -> frozenset[str]:
    """combination that moves the touches as a gain does, fitted coefficients, whether that gain was left out as too faint beside
    them → gains that are known only as differences to it.
    """
    gains = {*SCALES} & fitted
    known = dict(zip(scale.names[1:], scale.weights[1:], strict=True))
    return frozenset(name for name in gains if faint or abs(known.get(name, 0.0) - 1) < 0.01)


Visible = tuple[list[Coefficient], dict[str, Combination], Array, Array]


def _with_gauge(touches: Touches, setup: list[Coefficient], wanted: list[Coefficient], found: Visible) -> Visible:
    """touches, coefficients, what `_visible` found → the same with the gain of another axis left out where X gives no scale.

    Where the only rotary axis turns about X, no touch compares X with the other axes, and their common scale is left over. It
    moves the touches as a place of the rotary axis does, a few mm from the origin: without that place, 30 µm of it would become
    a scale of thousands of µm/m. So of both the one is left out whose usual size changes the others less.
    """
    left, sizes = found[1], touches.machine.tolerances
    if "EXX1" not in left or {*SCALES} & {*left["EXX1"].names[1:]}:
        return found
    names = {c.name: c.unit for c in wanted}
    for combination in (left[name] for name in left if name in names and name not in SCALES):
        weights = dict(zip(combination.names, combination.weights, strict=True))
        for reference in (name for name in ("EYY1", "EZZ1") if name in weights):
            own = sizes.location if names[combination.names[0]] == "mm" else sizes.angle
            if abs(weights[reference]) * own <= sizes.scale:  # it changes the gain by less than a gain usually is
                continue
            again = _visible(touches, setup, sorted(wanted, key=lambda c: (c.name == "EXX1", c.name == reference)))
            if {*again[1]} == {*left} - {combination.names[0]} | {reference}:
                return again
    return found


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
    # The isotropic scale goes last, so that where it cannot be seen it is EXX1 that is left out (else: `_with_gauge`).
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
    kept = _visible(touches, setup, candidates)[0]
    # A bar lies along one axis only, and on few chains another one shows as much: which scales are seen depends on the plan.
    names = {*(c.name for c in kept), *(c.name for c in error_motion.scales(machine))}
    return tuple(c for c in candidates if c.name in names)


def never_seen(machine: Machine, fitted: Sequence[str]) -> list[str]:
    """machine, names of the fitted coefficients → a sentence for every linear backlash that S3 leaves out on this topology, where
    others are fitted.
    """
    backlashes = {a: f"E{a}{a}b" for a in machine.linear}
    if not set(backlashes.values()) & set(fitted):
        return []
    told = {c.name for c in subset_terms(machine, 2, 3)}
    left = {a: name for a, name in backlashes.items() if name not in fitted and name not in told}
    return [say("unseen_said.backlash_of_no_plan", name=name, axis=axis) for axis, name in left.items()]


def _visible(touches: Touches, setup: list[Coefficient], wanted: list[Coefficient]) -> Visible:
    """→ coefficients kept; what is left out, in words; `columns` of the model of those kept.

    Facets and balls come first, then the setup, then the machine.
    """
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
    visible = set(names)
    seen = [j for j, c in enumerate(model.coefficients) if c.name in visible]
    stay = [*seen, *range(count, matrix.shape[1])]
    return [model.coefficients[j] for j in seen], combinations, matrix[:, stay], could[stay]


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
