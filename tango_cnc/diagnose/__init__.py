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
from ..model import known, linearise
from ..records import Array, Artefact, InputError, Machine, Readings, TermItem
from ..terms._shape import spec
from ..touches import Misnamed, from_readings, misnamed
from . import (
    _aliases,
    _explain,
    _gain,
    _loose,
    _moments,
    _nested,
    _rest,
    _rows,
    _scatter,
    _seen,
    _shapes,
    _spread,
    _stable,
    _suited,
    _together,
)
from ._candidates import candidate
from ._catalogue import APART, Chosen, columns_of
from ._changing import over, unsteady
from ._contest import ALONE, SURE, Outcome, contest, largest
from ._explain import Explanation
from ._field import Field
from ._look import explained, kernels, tried
from ._moments import Moment
from ._names import akin, foreign
from ._plainer import plainer
from ._records import Dropped, Finding, Remainder, Why
from ._refused import refused, shift_of
from ._richer import Richer, richer
from ._rows import Rows
from ._scatter import Scatter
from ._seen import Test
from ._size import size
from ._volume import Volume, volume

__all__ = ["Diagnosis", "Dropped", "Finding", "Moment", "Remainder", "Test", "as_term", "diagnose", "kernels"]
Verdict = Literal["adequate", "explained", "unexplained"]
EVENTS = 3  # searches, each with what the one before found to belong to one moment set aside
ROUNDING = 1e-6  # mm: positions are written with six decimals
FREE = 40  # touches beyond the unknowns: with fewer, nobody can tell one cause from another (docs/diagnose.md)
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
        found, weight, rough, scatter, field, outcome = explained(before, means, every_cause, excluded, seed, moments)
        new = [m for m in _moments.moments(means, found, outcome, weight) if m.item not in [o.item for o in moments]]
        if not new:
            break
        moments = (*moments, *new)
    say("asking touches that were not fitted")
    days = {str(shape["name"]): shape.get("learned") for shape in learned}
    what = found, weight, rough, scatter, excluded, seed, moments, field, outcome, days, degree
    told = _told(before, means, readings, terms, *what)
    findings = tuple(_remembered(f, learned) for f in told.findings)
    return replace(told, findings=findings, misnamed=elsewhere, aside=len(readings) < every)


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


def _told(
    before: Estimate,
    means: Rows,
    readings: Readings,
    terms: Sequence[TermItem],
    found: Explanation,
    weight: Array,
    rough: list[_explain.Rough],
    scatter: Scatter,
    excluded: Collection[str],
    seed: int,
    moments: Sequence[Moment],
    field: Field,
    outcome: Outcome,
    days: Mapping[str, str | None],
    degree: int,
) -> Diagnosis:
    touches, seen = means.whole, means.seen
    n = len(seen)
    lonely = [c for c in found.chosen if c.candidate.cause == "outlier"]
    single = [int(c.candidate.setting["touch"]) for c in lonely]
    keep = ~np.isin(np.arange(n), single)
    schemes = {
        "indexations": seen.indexation,
        "facets": _gain.groups_of(seen.facet),
        "time": _gain.blocks(n),
        "scattered": _gain.scattered(n),
    }
    gaps, jacobian = (means.of(x) for x in linearise(before.model, before.values))
    distances, rows, uncertainty = known(before.model, before.values)
    data = np.concatenate([gaps, distances * before.sigma / uncertainty])
    base = np.vstack([jacobian, rows * (before.sigma / uncertainty)[:, None]])
    base = np.hstack([base, *(np.pad(means.of(m.columns), ((0, len(base) - n), (0, 0))) for m in moments)])
    raw = {id(c): c.candidate.columns / weight[:, None] for c in found.chosen}

    def padded(columns: Array) -> Array:
        return np.vstack([columns, np.zeros((len(base) - n, columns.shape[1]))])

    whole = found
    sizes = size(whole, means, weight)
    # What stands is judged without what did not.
    stand = [c for c in whole.chosen if not c.candidate.named or any(c is o for o in outcome.named)]
    stand = [c for c in stand if c.candidate.cause] if outcome.named else stand
    if outcome.named and len(stand) < len(whole.chosen):
        found = replace(whole, chosen=tuple(stand), named=outcome.named)
        sizes |= size(found, means, weight)

    def among(c: Chosen) -> Explanation:
        return found if any(c is o for o in found.chosen) else whole

    gains: dict[int, _gain.Gain] = {}
    for c in whole.chosen:
        if c.candidate.cause == "outlier":
            continue
        others = [padded(raw[id(o)]) for o in among(c).chosen if o is not c]
        rng = np.random.default_rng([seed, n])
        gains[id(c)] = _gain.measure(np.hstack([base, *others]), data, raw[id(c)], schemes, keep, rng)
    certain = np.concatenate([weight, np.ones(len(base) - n)])
    back = _stable.stability(found, field, outcome, seen, weight, data * certain, base * certain[:, None])
    folds = _nested.Folds(found, weight, base, data)
    inside = {id(c): folds.nested(c, schemes, keep) for c in outcome.named}
    gains |= {key: _gain.nested(gains[key], one.schemes) for key, one in inside.items()}
    back = {key: _stable.worse(once, inside[key].selected) for key, once in back.items()}
    few = found.place.m < FREE
    alone = [c for c in found.chosen if c.candidate.cause == "outlier"]

    def tested(names: Sequence[Chosen]) -> tuple[Test, ...]:
        return _seen.tests(np.hstack([base, *(padded(raw[id(c)]) for c in (*alone, *names))]), data, seen, keep, certain)

    def resting(names: Sequence[Chosen], o: Outcome, anything: bool = True) -> list[Remainder]:
        """names that stay, what stands → what the rest follows all the same."""
        if o.shapes or o.events:
            return []
        left = _seen.left_over(tested(names), anything, {over(c.candidate) for c in names}) if not o.picked else []
        return left or _rest.rest(field, o, found.place.y, [*alone, *names], anything, seed)

    why: dict[int, Why | None] = {
        id(c): refused(c, sizes[id(c)], gains[id(c)], back[id(c)], inside[id(c)].gains, few) for c in outcome.named
    }
    accepted = [c for c in outcome.named if why[id(c)] is None]
    if len(accepted) < len(outcome.named):  # what they explained is there all the same
        lost = outcome.resembled
        outcome = contest(field.plain(), found.place.y, alone, accepted)
        outcome = replace(outcome, resembled=(*lost, *outcome.resembled))
        accepted = [c for c in accepted if any(c is o for o in outcome.named)]
    weak = [c for c in accepted if outcome.above.get(id(c), np.inf) < SURE and not c.candidate.learned]
    left = [p.kernel.covariate for p in outcome.shapes]
    if weak and len(accepted) > 1:  # one of them may follow what another one leaves; of one alone, the verdict tells
        left = left or [r.covariate for r in resting(accepted, outcome)]
    weak = [c for c in weak if any(akin(c.candidate, covariate) for covariate in left)]
    if weak:
        why |= {id(c): "rest" for c in weak}
        lost = outcome.resembled
        outcome = contest(field, found.place.y, alone, [c for c in accepted if c not in weak])
        outcome = replace(outcome, resembled=(*lost, *outcome.resembled))
        accepted = [c for c in accepted if any(c is o for o in outcome.named)]
    suited = _suited.suited(field, found.place.y, alone, accepted, outcome)
    beaten = next((one for one in suited if one.lost), None)
    if beaten is not None:
        why |= {id(c): "shape" for c in beaten.names}
        lost = outcome.resembled
        still = [c for c in accepted if not any(c is o for o in beaten.names)]
        outcome = contest(field.plain().more(beaten.kernels), found.place.y, alone, still)
        outcome = replace(outcome, resembled=(*lost, *outcome.resembled))
        accepted = [c for c in accepted if any(c is o for o in outcome.named)]
    noises_beside = [p for p in outcome.picked if p.kernel.noise]
    suited += (both_ways := _suited.turned(field, found.place.y, alone, accepted, noises_beside))
    outcome = _suited.nearer(outcome, [one for one in suited if all(any(c is o for o in accepted) for c in one.names)])
    named_items = [{"cause": c.candidate.cause, **c.candidate.setting} for c in accepted]
    extended = (*terms, *(m.item for m in moments), *named_items)
    machine = before.model.touches.machine
    after = estimate(machine, touches.artefact, readings, extended, degree) if len(extended) > len(terms) else before

    def finding(
        c: Chosen,
        like: Sequence[tuple[Chosen, float]],
        shift: Mapping[str, tuple[float, float, float]],
        other: Sequence[tuple[Chosen, float]] = (),
    ) -> Finding:
        s = sizes[id(c)]
        telling = _seen.separate(found, touches, c, [o for o, _ in like])
        return Finding(
            c.candidate.cause,
            c.candidate.setting,
            s.detail,
            s,
            _explain.significance(among(c), c),
            gains[id(c)],
            shift,
            tuple((o.candidate.cause, o.candidate.setting, behind) for o, behind in like),
            (*telling, *_aliases.where(found, touches, c, [o for o, _ in other]), *_suited.telling(both_ways, c)),
            s.effect,
            raw[id(c)] @ s.values if means.all else candidate(touches, c.candidate.cause, c.candidate.setting).columns @ s.values,
            tuple((o.candidate.setting, behind) for o, behind in other),
            back.get(id(c)),
            near if (near := (outcome.nearest.get(id(c), ""), outcome.above.get(id(c), np.inf)))[1] < SURE else None,
        )

    moved = shift_of(before, after)
    findings = [finding(c, _explain.alternatives(found, c), moved, _aliases.aliases(found, c)) for c in accepted]
    outcome = replace(outcome, picked=plainer(field, found.place.y, columns_of(found.place, [*alone, *accepted]), outcome.picked))
    remains = _shapes.remainders(found, outcome, means, weight, accepted, base, data, schemes, keep, days)
    noises = {p.kernel.kind for p in outcome.picked if p.kernel.noise}
    told_beside = excluded, remains, "seat" in noises, largest(outcome.picked), bool(moments)
    spreads = _spread.findings(whole, seen, rough, *told_beside)
    scattering = [r for r in rough if any(r.key in f.setting.get("facets", ()) for f in spreads)]
    stood = np.hstack([base, *(padded(raw[id(c)]) for c in (*alone, *accepted))])
    follows = _loose.loose(means, weight, stood, data, outcome.picked, scattering)
    scattering, loose = _loose.parted(scattering, follows)
    if loose:
        remains += loose
        spreads = _spread.findings(whole, seen, scattering, *told_beside)
    findings += [replace(_loose.beside(f, follows), pattern=np.zeros(len(touches))) for f in spreads if not few]
    dropped = [
        Dropped(finding(c, (), {}), why.get(id(c)) or ("shape" if c in outcome.resembled else "beside a shape"))
        for c in whole.chosen
        if c.candidate.named and c not in accepted and not c.candidate.learned
    ]
    if "walk" in noises or not outcome.picked:
        remains += _spread.wandering(whole, seen)
    if not remains and not findings:  # names that did not stand had taken what is there all the same
        picked = [p for p in outcome.picked if p.kernel.kind in ("walk", "seat")]
        remains += [_shapes.unnamed(p.kernel.kind, found.sigma * float(np.sqrt(p.tau)), n) for p in picked]
    remains += _moments.left(means, found, outcome, weight, moments)
    told = _scatter.remembering(_scatter.EVEN if any(r.form for r in remains) else scatter, outcome)
    if not remains:  # as a walk of the machine, this is more than scatter
        like = [p for p in outcome.picked if p.kernel.kind == "memory" and p.score > _scatter.CLEAR]
        remains += [Remainder("order", "none", "memory", found.sigma * float(np.sqrt(p.tau)), 0.0, np.zeros(n)) for p in like[:1]]
    tests_after = tested(accepted)
    if not remains:
        refusals = [(c, sizes[id(c)].amplitude) for c, w in ((c, why.get(id(c))) for c in whole.chosen) if w is not None]
        remains += _shapes.refused(found, refusals, n)
    if not remains:
        remains += resting(accepted, outcome, bool(findings or moments))
    if means.all:
        remains += _together.together(seen, {int(c.candidate.setting["touch"]): sizes[id(c)].amplitude for c in lonely})
    if accepted and not remains and _scatter.uneven(scatter):
        remains.append(Remainder(str(scatter.by), "none", "uneven", found.sigma, 0.0, np.zeros(n)))
    if not remains:
        remains += _undecided(
            findings,
            n,
            [
                any(o is not c and akin(c.candidate, over(o.candidate)) for o in accepted)
                or (len(accepted) > 1 and foreign(c.candidate, outcome.nearest.get(id(c), "")))
                for c in accepted
            ],
        )
    if not remains:
        for c, covariate in unsteady(field, found.place.y, alone, accepted, outcome.picked):
            about = sizes[id(c)].amplitude, 0.0, np.zeros(n)
            remains.append(Remainder(covariate, "none", "near", *about, confirm=c.candidate.cause))
    verdict: Verdict = "unexplained" if remains else "explained" if findings or moments else "adequate"
    return Diagnosis(
        verdict,
        tuple(findings),
        tuple(remains),
        dict(sorted(found.visibility.items())),
        _seen.tests(base, data, seen, keep),
        tests_after,
        before,
        after,
        extended,
        tuple(sorted({*(int(seen.number[i]) for i in single if means.count[i] == 1), *map(int, touches.number[means.wild])})),
        found.sigma,
        found,
        volume(before, after, {c.name for c in before.model.coefficients}),
        _richer(after, readings, terms, extended, remains, degree) if verdict != "adequate" else None,
        tuple(dropped),
        tuple(moments),
        outcome,
        told,
        means,
    )


def _undecided(findings: Sequence[Finding], n: int, akin_to: Sequence[bool] = ()) -> list[Remainder]:
    """what is named, number of rows, whether another name follows what the first of them do → of which of these another cause, or
    a shape, does nearly as well: that one of them is there explains the touches, and not what it is.

    A name may follow what another one leaves that only resembles what is there: names of one covariate have to be sure, and
    so has one of several where the shape follows something that the name does not.
    """
    found = []
    for i, f in enumerate(findings):
        near = tuple(dict.fromkeys(cause for cause, _, behind in f.alternatives if behind <= APART))
        if near:
            found.append(Remainder("", "none", "undecided", f.size.amplitude, 0.0, np.zeros(n), rivals=near, confirm=f.cause))
        if f.nearest is not None and f.nearest[1] < (SURE if any(akin_to[i : i + 1]) else ALONE):
            found.append(Remainder(f.nearest[0], "none", "near", f.size.amplitude, 0.0, np.zeros(n), confirm=f.cause))
    return found


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
