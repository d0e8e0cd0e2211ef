"""Readings and a budget → estimates with their uncertainties: everything that `tango uncertainty` prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..estimate import Estimate, estimate
from ..identify import Selection
from ..records import Array, Artefact, InputError, Machine, Readings, TermItem
from . import coverage, pooled, process, trials
from .inputs import BudgetLine, Part, Scene, parts, stated
from .repetitions import Repetitions, repetitions
from .scatter import reached, with_rest
from .study import Study, study
from .trials import Mapper


@dataclass(frozen=True)
class Options:
    """What the user may choose."""

    pool: str = "auto"  # auto | none | cycles | days
    trials: int = 10_000
    adaptive: bool = False
    most: int = 1_000_000  # trials at which the adaptive procedure gives up
    digits: int = 1
    probability: float = 0.95
    seed: int = 1
    full: bool = False  # every trial by the full iteration
    mapper: Mapper = map


@dataclass(frozen=True)
class Analysis:
    """Arrays are in the order of `study.names`: machine coefficients, stylus, placement."""

    selection: Selection
    study: Study
    pool: str  # none | cycles | days
    values: Array  # (q,) the estimate, mean of all cycles where there are several
    std_by: dict[str, Array]  # cycles | days | budget → (q,)
    std_of_mean: Array | None  # (q,) from the means of the days
    repeated: pooled.Repeated | None
    run: trials.Trials
    accuracy: trials.Accuracy
    validation: coverage.Validation
    low: Array  # (q,) ends of the probabilistically symmetric intervals of the trials
    high: Array
    shortest: tuple[Array, Array]
    joint: dict[str, float | None]
    blocks: int  # of the adaptive procedure, 0 without it
    stable: bool
    probability: float
    digits: int
    four: Repetitions | None = None  # mean, of the mean, one run, prediction: of repeated runs, (q,) each

    @property
    def std(self) -> Array:
        """→ (q,) propagated standard uncertainties."""
        return np.asarray(self.study.std[self.study.outputs])

    def samples(self, place: int) -> Array:
        """place of an output → (T,) Monte Carlo values of it."""
        return np.asarray(self.values[place] + self.run.deviation[:, place].astype(float) * self.std[place])


def prepare(
    machine: Machine,
    artefact: Artefact,
    readings: Readings,
    terms: Sequence[TermItem],
    degree: int,
    lines: Sequence[BudgetLine] | None,
    robust: Estimate | None = None,
) -> tuple[Estimate, tuple[Part, ...]]:
    """cell, readings of one run, budget (None: what the cell states) → its estimate and the parts of the budget.

    `robust`: the estimate whose outliers have no weight here either.
    """
    found = estimate(machine, artefact, reached(readings, robust), terms, degree)
    scene = Scene(found.model, found.values)
    return found, parts(scene, stated(scene) if lines is None else tuple(lines))


def analyse(
    machine: Machine,
    artefact: Artefact,
    readings: Readings,
    terms: Sequence[TermItem],
    degree: int = 3,
    lines: Sequence[BudgetLine] | None = None,
    options: Options | None = None,
    robust: Estimate | None = None,
) -> Analysis:
    """cell, readings, budget (None: what the cell states) → uncertainties by both methods.

    `robust` is the estimate by the noise that the residuals show: its outliers have no weight here either, and scatter that the
    budget leaves out is added to it. None: all touches count, and the budget is taken as it is.

    Without repetitions the budget makes the covariance of the readings. With repetitions they do, pooled by cycles (default
    with several days) or by days, and of the budget only what no repetition shows is added: form, lobing, bar.
    Raises InputError for a pooling that the readings do not allow, TangoError for what cannot be determined.
    """
    options = options or Options()
    readings = reached(readings, robust)
    kept, days, cycles, _ = pooled.split(readings)
    pool = _pool(options.pool, len(days), len(cycles))
    found, own = prepare(machine, artefact, readings if pool == "none" else kept[0], terms, degree, lines)
    if not any(np.any(part.factor) for part in own):
        raise InputError("budget: found no source of uncertainty; allowed: at least one contribution greater than zero")
    if pool == "none":
        own = with_rest(found, robust, own)
        base = study(found.model, found.values, found.sigma, own)
        return _finish(found, base, "none", base.values, {"budget": base.std}, None, None, options)
    several = pooled.repeated(machine, artefact, readings, found.model, found.values, found.sigma)
    constant = tuple(part for part in own if not part.repeats)
    known = len(found.model.calibrated) + (found.model.bar is not None)
    both: tuple[pooled.Pool, ...] = ("cycles", "days")
    pools = {str(k): pooled.pooled_part(several, k, known) for k in both if _allows(k, len(days), len(cycles))}
    constant = with_rest(found, robust, (pools[pool], *constant))[1:]
    studies = {kind: study(found.model, found.values, found.sigma, (part, *constant)) for kind, part in pools.items()}
    alone = study(found.model, found.values, found.sigma, own)
    std_by = {kind: s.std for kind, s in studies.items()} | {"budget": alone.std}
    fixed = replace(alone, parts=constant).std if constant else np.zeros(len(several.mean))
    outputs = studies[pool].outputs
    four = repetitions(several.values[:, :, outputs], fixed[outputs], options.probability)
    result = _finish(found, studies[pool], pool, several.mean, std_by, None, several, options)
    return replace(result, std_of_mean=four.of_mean.std if len(days) > 1 else None, four=four)


def _allows(kind: str, days: int, cycles: int) -> bool:
    return (days if kind == "cycles" else cycles) > 1


def _pool(wanted: str, days: int, cycles: int) -> str:
    if wanted == "auto":
        return "cycles" if days > 1 else "days" if cycles > 1 else "none"
    if wanted == "none" and days * cycles > 1:
        raise InputError(
            f"--pool none: found {days} day(s) of {cycles} cycle(s); allowed: cycles or days, or the readings of a single cycle"
        )
    if wanted != "none" and not _allows(wanted, days, cycles):
        needed = "two days" if wanted == "cycles" else "two cycles a day"
        raise InputError(f"--pool {wanted}: found {days} day(s) of {cycles} cycle(s); allowed: at least {needed}")
    return wanted


def _finish(
    found: Estimate,
    base: Study,
    pool: str,
    values: Array,
    std_by: dict[str, Array],
    of_mean: Array | None,
    several: pooled.Repeated | None,
    options: Options,
) -> Analysis:
    outputs, p = base.outputs, options.probability
    std = base.std[outputs]
    run, blocks, stable = _run(base, options)
    low, high = coverage.symmetric(run.deviation, p)
    short = coverage.shortest(run.deviation, p)
    centre = values[outputs]
    return Analysis(
        found.selection,
        base,
        pool,
        centre,
        {key: s[outputs] for key, s in std_by.items()},
        None if of_mean is None else of_mean[outputs],
        several,
        run,
        trials.accuracy(base, seed=options.seed),
        coverage.validate(std, run.deviation, p, options.digits, base.dof),
        centre + low * std,
        centre + high * std,
        (centre + short[0] * std, centre + short[1] * std),
        _joint(base, run, p),
        blocks,
        stable,
        p,
        options.digits,
    )


def _run(base: Study, options: Options) -> tuple[trials.Trials, int, bool]:
    if not options.adaptive:
        return trials.run(base, options.trials, options.seed, 0, options.mapper, options.full), 0, True
    size = coverage.block_size(options.probability)
    chunks = -(-size // trials.CHUNK)

    def more(block: int) -> trials.Trials:
        return trials.run(base, size, options.seed, block * chunks, options.mapper, options.full)

    std = base.std[base.outputs]
    done = coverage.adaptive(
        more, std, options.probability, options.digits, max(2, options.most // size), [int(i) for i in base.machine] or None
    )
    return done.trials, done.blocks, done.stable


def _joint(base: Study, run: trials.Trials, p: float) -> dict[str, float | None]:
    """Coverage factors of the machine's coefficients together."""
    own = base.machine
    if not len(own):
        return {}
    matrix = base.correlation[np.ix_(own, own)]
    dof = float(base.dof[own].min())
    return {
        "rectangle": coverage.rectangle_factor(matrix, p, dof),
        "rectangle_monte_carlo": coverage.rectangle_of(run.deviation[:, own], p),
        "rectangle_independent": coverage.independent_factor(len(own), p),
        "ellipsoid": coverage.ellipsoid_factor(len(own), p),
        "ellipsoid_monte_carlo": coverage.ellipsoid_of(run.deviation[:, own], p),
    }


def compare_subsets(
    machine: Machine,
    artefact: Artefact,
    readings: Readings,
    terms: Sequence[TermItem],
    degree: int,
    lines: Sequence[BudgetLine] | None,
    choices: Mapping[str, Sequence[int]],
    robust: Estimate | None = None,
) -> tuple[process.Comparison, list[float]]:
    """cell, readings, subsets of the indexations by label → their comparison (thesis Table 8-5) and condition numbers (8-4).

    With several cycles the estimates of every subset are averaged over them. Touches on balls belong to every subset.
    """
    kept, _, _, _ = pooled.split(reached(readings, robust))
    found, own = prepare(machine, artefact, kept[0], terms, degree, lines)
    own = with_rest(found, robust, own)
    full = found.model.touches
    on_ball = full.ball_index >= 0
    rows_of = {
        number: np.flatnonzero((full.indexation == i) & ~on_ball)
        for number, i in enumerate(np.unique(full.indexation[~on_ball]), start=1)
    }
    chosen = process.subsets(choices, rows_of)
    groups, condition = [], []
    count = len(full)
    for label, picked in chosen.items():
        rows = np.sort(np.concatenate([picked, np.flatnonzero(on_ball)]))
        estimates = [estimate(machine, artefact, cycle.rows(rows), terms, degree) for cycle in kept]
        first = estimates[0]
        places = np.concatenate([rows, np.arange(count, len(own[0].factor))])
        parts_here = tuple(replace(part, factor=part.factor[places]) for part in own)
        here = study(first.model, first.values, first.sigma, parts_here)
        missing = set(found.parameters) - set(first.parameters)
        if missing:
            raise InputError(
                f"--subset {label}: its touches cannot determine {', '.join(sorted(missing))}; add indexations or use fewer terms"
            )
        place = np.array([first.model.names.index(name) for name in _measurands(found)])
        one = process.group(label, here, place, "run")
        groups.append(replace(one, values=np.mean([e.values[place] for e in estimates], axis=0)))
        condition.append(first.condition_number)
    return process.compare([found.selection.label(n) for n in _measurands(found)], groups), condition


def compare_runs(
    machine: Machine,
    artefact: Artefact,
    runs: dict[str, Readings],
    terms: Sequence[TermItem],
    degree: int,
    lines: Sequence[BudgetLine] | None,
) -> list[process.Comparison]:
    """cell, readings by label (strategies, before and after a remount) → comparisons (thesis Tables 8-2 and 8-3).

    By the budget always; by the scatter of repeated cycles too where there are any. Parameters that all runs determine.
    """
    prepared = {label: _prepare_run(machine, artefact, r, terms, degree, lines) for label, r in runs.items()}
    names = [
        n
        for n in next(iter(prepared.values()))[2]
        if all(n in names and n in found.model.names for found, _, names, _ in prepared.values())
    ]
    if not names:
        raise InputError("--compare: found no parameter that all runs determine; allowed: runs of the same machine and terms")
    groups, repeats = [], []
    for label, (found, own, _, values) in prepared.items():
        place = np.array([found.model.names.index(name) for name in names])
        here = study(found.model, found.values, found.sigma, own)
        one = process.group(label, here, place, label)
        # The mean of r cycles has a smaller part from what every cycle draws anew.
        shrink = {k: m / np.sqrt(len(values)) if here.parts[i].repeats else m for i, (k, m) in enumerate(one.moved.items())}
        groups.append(replace(one, values=values[:, place].mean(axis=0), moved=shrink))
        repeats.append(values[:, place])
    shown = [next(iter(prepared.values()))[0].selection.label(n) for n in names]
    found_all = [process.compare(shown, groups)]
    if sum(len(r) for r in repeats) > len(repeats):
        found_all.append(process.one_way(shown, list(runs), repeats))
    return found_all


def _prepare_run(
    machine: Machine,
    artefact: Artefact,
    readings: Readings,
    terms: Sequence[TermItem],
    degree: int,
    lines: Sequence[BudgetLine] | None,
) -> tuple[Estimate, tuple[Part, ...], list[str], Array]:
    kept, _, _, _ = pooled.split(readings)
    found, own = prepare(machine, artefact, kept[0], terms, degree, lines)
    several = pooled.repeated(machine, artefact, readings, found.model, found.values, found.sigma)
    return found, own, _measurands(found), several.values.reshape(-1, several.values.shape[-1])


def _measurands(found: Estimate) -> list[str]:
    return [c.name for c in found.model.coefficients if c.slot.axis not in ("t", "w")]
