"""What the model gets wrong: shown, named, put into the model, and its gain measured; or admitted.

    readings ──estimate──▶ residuals ──explain──▶ chosen causes ──extend──▶ estimate with them ──▶ Diagnosis

Everything is judged outside the space that the fitted model already explains (`_space`), against noise that is estimated and
may wander; every term that is not in the model is a candidate, and so are shapes without a name (`_candidates`). `_search`
selects, `_gain` asks touches that were not fitted, `table` does the same for measured data from elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..estimate import Estimate, estimate, tips, without
from ..records import Array, Artefact, InputError, Machine, Readings, TermItem
from ..terms._shape import spec
from ..touches import Misnamed, from_readings, misnamed
from . import _gain, _moments, _rows, _scatter, _seen
from ._catalogue import columns_of
from ._contest import Outcome
from ._explain import Explanation
from ._findings import dropped, findings
from ._grounds import grounds, outliers, rows_of
from ._look import Searched, explained, kernels, tried
from ._moments import Moment
from ._plainer import plainer
from ._records import FREE, Dropped, Finding, Remainder
from ._remaining import remaining
from ._richer import Richer, richer
from ._rows import Rows
from ._scatter import Scatter
from ._seen import Test
from ._standing import standing
from ._volume import Volume, volume

__all__ = ["FREE", "Diagnosis", "Dropped", "Finding", "Moment", "Remainder", "Test", "as_term", "diagnose", "kernels"]
Verdict = Literal["adequate", "explained", "unexplained"]
EVENTS = 3  # searches, each with what the one before found to belong to one moment set aside
ROUNDING = 1e-6  # mm: positions are written with six decimals
SLIPS = 0.05  # of the touches: so many records may be of another facet before it is no slip of single ones


@dataclass(frozen=True)
class Diagnosis:
    """Everything a report needs."""

    verdict: Verdict
    findings: tuple[Finding, ...]
    unexplained: tuple[Remainder, ...]
    visibility: Mapping[str, float]
    tests: tuple[Test, ...]  # of every covariate, before any cause
    tests_after: tuple[Test, ...]
    before: Estimate
    after: Estimate
    terms: tuple[TermItem, ...]  # the extended model
    outliers: tuple[int, ...]  # touch numbers that nothing explains
    noise: float  # mm, white noise of a touch that is left
    explanation: Explanation
    volume: Volume  # predicted error of the tip, before and after
    richer: Richer | None = None  # the whole model where it does clearly better than what was found
    dropped: tuple[Dropped, ...] = ()  # fits, and is not named
    events: tuple[Moment, ...] = ()  # what belongs to one moment or one pose, set aside before the search
    outcome: Outcome | None = None  # names against shapes
    scatter: Scatter = _scatter.EVEN  # what the size of the noise depends on
    rows: Rows | None = None  # what was searched: touches, or means of touches that were made alike
    misnamed: tuple[Misnamed, ...] = ()  # records of another facet, or of the touch before
    aside: bool = True  # whether these were set aside: they are when they are few

    @property
    def few(self) -> int | None:
        """→ touches beyond the unknowns where they are too few to name a cause; None where they are enough."""
        return self.explanation.place.m if self.explanation.place.m < FREE else None

    def searched(self, values: Array) -> Array:
        """(n,) of touches → (r,) of the rows that were searched: the touches, or means of them."""
        return values if self.rows is None else self.rows.of(values)

    @property
    def terms_text(self) -> str:
        """→ the extended model as it is written into tango.yaml."""
        return "[" + ", ".join(_flow(t) for t in self.terms) + "]"


def _flow(item: TermItem) -> str:
    if isinstance(item, str):
        return item
    if item["cause"] == "learned":  # its numbers are in its file
        item = {key: item[key] for key in ("cause", "name")}
    return "{" + ", ".join(f"{k}: {_value(v)}" for k, v in item.items() if v is not None) + "}"


def _value(v: object) -> str:
    if isinstance(v, (list, tuple)):
        return "[" + ", ".join(map(str, v)) + "]"
    return f"{v:.6g}" if isinstance(v, float) else str(v)


@dataclass(frozen=True)
class _Asked:
    """What is asked of a diagnosis beside the readings, and what was set aside before it."""

    excluded: Collection[str]  # causes that are not tried
    seed: int
    moments: tuple[Moment, ...]
    days: Mapping[str, str | None]  # by name of a learned shape, when it was learned
    degree: int  # the highest of the polynomials of S4


def diagnose(
    machine: Machine,
    artefact: Artefact,
    readings: Readings,
    terms: Sequence[TermItem],
    excluded: Collection[str] = (),
    seed: int = 0,
    learned: Sequence[Mapping[str, Any]] = (),
    say: Callable[[str], None] = lambda text: None,
    degree: int = 3,
) -> Diagnosis:
    """readings and the terms of the present model → diagnosis. `excluded` causes are not tried; shapes that were `learned`
    (name, factors, weight, values) are tried as names. `say` hears what is being done, as it begins.
    `degree`: the highest of the polynomials of S4.

    Raises InputError and TangoError as `estimate`, and InputError for touches without any noise.
    """
    every = len(readings)
    elsewhere, readings = _aside(machine, artefact, readings)
    before = estimate(machine, artefact, readings, terms, degree)
    if (left := _gain.rms(before.residuals)) < ROUNDING:
        raise InputError(
            f"readings: found touches that the model explains to {left * 1e6:.2g} nm, less than files are written with; allowed: "
            "touches that scatter, as measured ones do. There is nothing to explain, and no noise to compare a cause with"
        )
    means = _rows.rows(replace(before.model.touches, tip=tips(before)), before.residuals)
    every_cause = tried(before, means, excluded, learned)
    moments: tuple[Moment, ...] = ()
    for _ in range(EVENTS):
        say(
            f"searching causes and shapes in {len(means.seen)} rows"
            + (f", again without {len(moments)} moments" if moments else "")
        )
        search = explained(before, means, every_cause, excluded, seed, moments)
        once = _moments.moments(means, search.found, search.outcome, search.weight)
        new = [m for m in once if m.item not in [o.item for o in moments]]
        if not new:
            break
        moments = (*moments, *new)
    say("asking touches that were not fitted")
    days = {str(shape["name"]): shape.get("learned") for shape in learned}
    found = _concluded(before, means, readings, terms, search, _Asked(excluded, seed, moments, days, degree))
    named = tuple(_remembered(f, learned) for f in found.findings)
    return replace(found, findings=named, misnamed=elsewhere, aside=len(readings) < every)


def _remembered(f: Finding, learned: Sequence[Mapping[str, Any]]) -> Finding:
    """finding, learned shapes → the finding, with the day and the words that the file of a learned shape has."""
    if "name" not in f.setting or "values" not in f.setting:
        return f
    own = next((shape for shape in learned if shape["name"] == f.setting["name"]), {})
    return replace(f, detail={**f.detail, **{key: str(own[key]) for key in ("learned", "text") if own.get(key)}})


def _aside(machine: Machine, artefact: Artefact, readings: Readings) -> tuple[tuple[Misnamed, ...], Readings]:
    """Records of another facet or of the touch before, and the readings without them; many are no slips of single ones."""
    touches = from_readings(machine, artefact, readings)
    found = misnamed(touches)
    if len(found) > SLIPS * len(touches):
        return found, readings
    pairs = {(m.facet, m.near) for m in found}
    slips = tuple(m for m in found if (m.near, m.facet) not in pairs)  # two facets exchanged are a cause with a name
    return slips, without(readings, touches, np.isin(np.arange(len(touches)), [m.row for m in slips])) if slips else readings


def as_term(r: Remainder) -> dict[str, Any]:
    """a shape without a name → factors, weight and values of a `learned` term. Raises ValueError for what is no shape.

    Where a formula does as well, these are its values: it has nothing beside it that terms of the machine make, too.
    """
    if r.form is None:
        raise ValueError(f"{r.covariate}: no shape")
    values = r.weights if r.plain is None else np.where(np.abs(r.plain) > 1e-9 * np.abs(r.plain).max(), r.plain, 0.0)
    return {**spec(r.form), "values": [float(f"{w:.9g}") for w in values]}


def _concluded(
    before: Estimate, means: Rows, readings: Readings, terms: Sequence[TermItem], search: Searched, about: _Asked
) -> Diagnosis:
    """present model, rows, readings, its terms, what the search found → diagnosis."""
    g = grounds(before, means, search, about.moments, about.seed)
    stand = standing(g, about.seed)
    machine, artefact = before.model.touches.machine, before.model.touches.artefact
    extended = (
        *terms,
        *(m.item for m in about.moments),
        *({"cause": c.candidate.cause, **c.candidate.setting} for c in stand.accepted),
    )
    after = estimate(machine, artefact, readings, extended, about.degree) if len(extended) > len(terms) else before
    named = findings(g, stand, before, after)
    space = columns_of(g.found.place, [*g.alone, *stand.accepted])
    stand = replace(stand, outcome=replace(stand.outcome, picked=plainer(search.field, g.y, space, stand.outcome.picked)))
    rest = remaining(g, stand, named, about.moments, about.excluded, about.days, about.seed)
    every = (*named, *rest.spreads)
    verdict: Verdict = "unexplained" if rest.remains else "explained" if every or about.moments else "adequate"
    return Diagnosis(
        verdict,
        every,
        tuple(rest.remains),
        dict(sorted(g.found.visibility.items())),
        _seen.tests(g.design.columns, g.design.data, means.seen, g.design.keep),
        g.tests(stand.accepted),
        before,
        after,
        extended,
        _numbers(means, rows_of(outliers(g.whole))),
        g.found.sigma,
        g.found,
        volume(before, after, {c.name for c in before.model.coefficients}),
        _richer(after, readings, terms, extended, rest.remains, about.degree) if verdict != "adequate" else None,
        dropped(g, stand),
        about.moments,
        stand.outcome,
        rest.scatter,
        means,
    )


def _numbers(means: Rows, single: Sequence[int]) -> tuple[int, ...]:
    """rows, those that are single touches → the numbers of the touches that nothing explains."""
    alone = {int(means.seen.number[i]) for i in single if means.count[i] == 1}
    return tuple(sorted({*alone, *map(int, means.whole.number[means.wild])}))


def _richer(
    after: Estimate,
    readings: Readings,
    terms: Sequence[TermItem],
    extended: Sequence[TermItem],
    remains: Sequence[Remainder],
    degree: int,
) -> Richer | None:
    """S4 where it does better than everything that was found: the shapes without a name stand beside it as terms."""
    shapes = [{"cause": "learned", "name": f"{i}", **as_term(r)} for i, r in enumerate(remains) if r.form is not None]
    if shapes:
        machine, artefact = after.model.touches.machine, after.model.touches.artefact
        after = estimate(machine, artefact, readings, (*extended, *shapes), degree)
    found = richer(after, readings, (*terms, *shapes), (*extended, *shapes), degree)
    return None if found is None else replace(found, terms=tuple(t for t in found.terms if t not in shapes))
