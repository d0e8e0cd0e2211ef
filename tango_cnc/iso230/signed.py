"""Figures with intervals that hold for every error motion of the machine, or withheld with the reason.

What is given rests on the fit with every error motion (`whole`). A figure is given when the touches decide it. Otherwise the
error motions are named with which it is mixed, and differences of two such figures that the touches do decide are given.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ..estimate import Estimate
from ..features import bar_left_out
from ..identify import Selection
from ..records import Array, TangoError
from .also import also_held
from .doubt import ALIKE, UNDECIDED, Doubt, lengths, most, undecided, worst
from .expansion import expanded, feels, felt_by, with_column
from .interval import Spread, of_drawn, of_turned, of_volume
from .onpart import Ask, asked, minimum_zone
from .seen import Budget, root_of, seen
from .temperature import NO_CHANGE, Known, Thermal, scale, state_of
from .trajectory import Reference, reference
from .unseen import positions
from .whole import DEGREE, ORDER, Whole, foreseen, understood, whole

COVERAGE = 0.95
NOTES = {"positioning gain": "relative: as if all axes were as warm as each other", "reversal": "relative"}
DIFFER = tuple(NOTES)  # kinds of figures whose differences may be wanted


@dataclass(frozen=True)
class OnPart:
    """One figure in `unit`: value and interval, or None and the sentence that says what it is mixed with."""

    kind: str
    name: str
    unit: str
    value: float | None
    interval: tuple[float, float] | None
    range: tuple[float, float] | None
    note: str
    mixed: tuple[str, ...] = ()  # error motions that it cannot be separated from
    text: str = ""
    positions: int = 0  # distinct positions of its axis that were touched
    expands: bool = False  # whether it changes with the temperature of bar and machine
    bounds: tuple[float, float] | None = None  # of a range: it is below the first with 5 %, above the second with 5 %


@dataclass(frozen=True)
class Sheet:
    """All figures at one reference pose and tool length."""

    figures: tuple[OnPart, ...]
    reference: Reference
    sigma: float  # mm, of a touch, beside every error motion
    freedom: float
    temperature: str = "not stated"  # scales as read; or: 20 °C, as found, 20 °C, assumed
    orders: tuple[tuple[tuple[int, int], float], ...] = ()  # degree and harmonics, and what each is worth
    left_out: tuple[float, ...] = ()  # mm, of every order: by how much each touch is off what the others predict, rms
    order: tuple[int, int] = (DEGREE, ORDER)  # which was used
    thermal: Thermal | None = None
    budget: Budget | None = None  # None: the intervals have the scatter of the touches alone
    expected: float | None = None  # mm, scatter of a touch that the budget allows for
    unseen: tuple[str, ...] = ()  # sentences: which harmonics of rotary axes these touches do not tell
    whole: Whole | None = None  # the machine that decides what is withheld, budget in it, expansion not
    learned: Whole | None = None  # machines that are possible, of which values and intervals are, likewise

    @property
    def not_identifiable(self) -> tuple[str, ...]:
        """→ a sentence for every figure that is withheld."""
        return tuple(f.text for f in self.figures if f.value is None)

    @property
    def advice(self) -> tuple[str, ...]:
        """→ what to do where figures are withheld; () where none is."""
        if self.whole is None or not self.not_identifiable:
            return ()
        turns = [f for f in self.figures if f.value is None and f.kind == "volumetric" and f.unit == "µrad"]
        return ways_out(self.whole, [f.name for f in turns if not any(m in self.whole.unfelt for m in f.mixed)])


def signed(
    result: Estimate,
    length: float | None = None,
    thermal: Thermal | None = None,
    at_reference: bool = True,
    budget: Budget | None = None,
    differences: bool = False,
) -> Sheet:
    """estimate, tool length (mm; default: of the probe), temperatures, whether at 20 °C or as found, budget, whether with the
    differences of figures that are known alone, too → figures.

    Without temperatures scales are as read, in lengths of the bar as warm as it was; `ASSUMED` takes them to 20 °C. Raises
    TangoError where there are too few touches.
    """
    machine = seen(result, budget)
    wide, learned = machine.wide, machine.learned
    drawn, at = _asked(learned, length)
    asks = _fewer(drawn, learned, wide)
    usual = {(a.kind, a.name): a for a in (asks if machine.plain is wide else _fewer(drawn, learned, machine.plain))}
    owns = {(a.kind, a.name): a for a in drawn}
    pairs = [(a, owns[a.kind, a.name]) for a in asks]
    warm = NO_CHANGE if thermal is None else scale(thermal, at_reference)
    felt = felt_by(wide.touches.machine, _over(wide), at)
    doubts = [undecided(a, wide) if a.length is None else undecided(usual[a.kind, a.name], machine.plain) for a, _ in pairs]
    found = [
        told(a, own, wide, learned, felt.get((a.kind, a.name)), warm, doubt) for (a, own), doubt in zip(pairs, doubts, strict=True)
    ]
    state = state_of(thermal, at_reference)
    figures = (*found, *_relative(pairs, found, wide, learned, warm, differences))
    sigma, freedom, order = wide.sigma, wide.freedom, wide.order
    beside = machine.unseen.said(wide.touches)
    tried, by = machine.tried, machine.left_out
    both = (machine.wide, learned)
    return Sheet(figures, at, sigma, freedom, state, tried, by, order, thermal, budget, machine.expected, beside, *both)


def _asked(w: Whole, length: float | None = None) -> tuple[list[Ask], Reference]:
    """machine, tool length (mm; default: of the probe) → every figure, where the other axes stand."""
    over = _over(w)
    at = reference(w.touches.machine, over, length)
    return asked(w.touches.machine, w.coefficients, over, at), at


def _fewer(asks: list[Ask], of: Whole, w: Whole) -> list[Ask]:
    """figures, machine that they are of, one of lower order for the same touches → the same figures of that one."""
    place = {c.name: i for i, c in enumerate(of.coefficients)}
    own = [place[c.name] for c in w.coefficients]
    return [replace(a, curve=a.curve[..., own]) for a in asks]


def _over(w: Whole) -> dict[str, tuple[float, float]]:
    from . import ranges

    return ranges(w.touches)


def withheld(result: Estimate) -> tuple[str, ...]:
    """estimate → a sentence for every ISO figure that these touches do not decide; one where they are too few for any."""
    return _open(result)[0]


def withheld_and_also(result: Estimate) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]]]:
    """estimate → as `withheld`; of every parameter, the angular error motions that it may hold, as touches do not separate them."""
    texts, angular = _open(result)
    return texts, also_held(list(result.parameters), result.model.touches.machine, angular)


def _open(result: Estimate) -> tuple[tuple[str, ...], list[tuple[str, tuple[str, ...]]]]:
    """estimate → sentences on what is withheld; of every angular error motion that is, those that it is mixed with."""
    try:
        all_of_it = whole(result)
        found = [(ask, doubt) for ask in _asked(all_of_it)[0] if (doubt := undecided(ask, all_of_it))]
    except TangoError as error:
        return (str(error),), []
    return tuple(text for _, (_, text) in found), [(ask.own, mixed) for ask, (mixed, _) in found if ask.kind == "angular"]


def ways_out(w: Whole, by_length: Sequence[str] = ()) -> tuple[str, ...]:
    """machine, figures that a stylus of another length would part → how many of its numbers the touches decide, and what would
    decide more: sentences.
    """
    machine, artefact, touched = w.touches.machine, w.touches.artefact, w.touches.facet
    some, of = understood(w)
    more = "touch calibrated facets in more places of X, Y and Z (another spindle position is the same place)"
    if machine.rotary:
        more = "add indexations, with every facet that the probe reaches"
    found = [
        f"these {len(touched)} touches decide {some:.0f} of the {of} numbers that describe all error motions of this machine",
        f"to decide more, {more}; 'tango check' says which figures they will decide",
    ]
    by_bar = artefact.scale_bar is not None and bar_left_out(artefact, touched) is None
    if not by_bar and all(artefact.facets[f].uncertainty is None for f in touched):
        found.append("nothing here carries the absolute scale: touch a scale bar or calibrated facets")
    if machine.rotary and not machine.styli:
        need = f", which {' '.join(by_length)} need" if by_length else ""
        found.append(
            f"a second stylus of another length separates tilts from straightness{need}; 'tango check' says what it would add"
        )
    elif machine.rotary and len(long := lengths(w.touches)) > 1 and max(long) - min(long) < ALIKE:
        one = " and ".join(f"{length:g}" for length in long)
        found.append(f"styli of {one} mm part no tilt from straightness: 'tango check' says how much longer one has to be")
    about = [name for name, turns in w.unfelt.items() if turns]
    if about:
        summed = ", and VC contains it" if all(name[2] in "XYZ" for name in about) else ""
        found.append(
            f"{' '.join(about)}: a turn about the spindle axis leaves a stylus on that axis where it is; only a stylus beside it "
            f"would show it. It moves no tool that is on the axis{summed}"
        )
    return (*found, "until then, 'tango iso230 --fitted' shows the fitted terms alone, as if the machine had no other error motion")


def decided(selection: Selection, length: float | None = None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """selection for touches that nobody has made yet, tool length (mm) → ISO figures that they will decide, those they will not."""
    w = foreseen(selection)
    asks, _ = _asked(w, length)
    names = Counter(ask.name for ask in asks)
    known = [worst(a, w)[1] <= most(a, w) for a in asks]  # what the others are mixed with is not asked for here
    told = [(a.name if names[a.name] == 1 else f"{a.name} ({a.kind})", k) for a, k in zip(asks, known, strict=True)]
    return tuple(name for name, known in told if known), tuple(name for name, known in told if not known)


def told(
    ask: Ask, own: Ask, wide: Whole, learned: Whole, felt: Array | None = None, warm: Known = NO_CHANGE, doubt: Doubt | None = None
) -> OnPart:
    """figure as it depends on the coefficients of the first machine and of the second one, machine twice (`Seen`), what the
    figure feels of a scale of 1, what temperature adds to scales (mm/mm), why it is withheld → value, interval, or why not.

    The touches alone decide what is withheld. An expansion that nobody knows makes an interval wider, and its value no larger.
    """
    axis = ask.own[2:3] if ask.range is not None else ""
    differ = positions(wide.touches, axis) if axis in wide.touches.machine.names else 0
    expands = felt is not None and feels(ask, felt)
    if doubt is not None:
        return OnPart(ask.kind, ask.name, ask.unit, None, None, ask.range, ask.note, *doubt, differ, expands)
    found = _spread(ask, own, wide, learned)
    if felt is not None and expands and warm != NO_CHANGE:
        asks, sure = (with_column(ask, felt), with_column(own, felt)), Known(warm.value, 0.0)
        best = _spread(*asks, expanded(wide, sure), expanded(learned, sure)).best
        found = _about(_spread(*asks, expanded(wide, warm), expanded(learned, warm)), best)
    bounds = (found.least, found.most) if ask.is_range else None
    interval = found.low, found.high
    return OnPart(ask.kind, ask.name, ask.unit, found.best, interval, ask.range, ask.note, (), "", differ, expands, bounds)


def _about(s: Spread, best: float) -> Spread:
    return Spread(best, min(s.low, best), max(s.high, best), min(s.least, best), max(s.most, best))


def _spread(ask: Ask, own: Ask, wide: Whole, learned: Whole) -> Spread:
    """figure by the coefficients of both machines → value, interval and limits of one side, in its unit."""
    if not ask.is_range:
        student = [float(special.stdtrit(wide.freedom, p)) for p in (0.5 + COVERAGE / 2, COVERAGE)]
        value, std = float(own.curve @ learned.values) * own.factor, worst(own, learned)[1]
        two, one = (t * std for t in student)
        return Spread(value, value - two, value + two, value - one, value + one)
    assert learned.draws is not None and learned.free is not None
    used = np.flatnonzero(own.curve.any(axis=tuple(range(own.curve.ndim - 1))))
    drawn = own.factor * (own.curve[..., used] @ learned.draws[used])
    if own.turned:
        return of_turned(drawn)
    if own.length is not None:  # three axes say too little of each other's size: noise would count twice
        free = used[learned.free[used]]
        return of_volume(drawn, own.factor * (own.curve[..., free] @ (learned.draws[free] - learned.values[free, None])))
    curve = ask.curve * ask.factor
    wider = float(special.stdtrit(wide.freedom, 0.5 + COVERAGE / 2) / special.ndtri(0.5 + COVERAGE / 2))
    found, mean = of_drawn(drawn, curve @ wide.values, wider * root_of(curve, wide.covariance)), drawn.mean(axis=1)
    if own.zone and own.command is not None and np.ptp(mean) > 0:
        part = minimum_zone(own.command, mean) / float(np.ptp(mean))
        found = Spread(*(part * v for v in found))
    return found


def _relative(
    asks: list[tuple[Ask, Ask]], found: list[OnPart], wide: Whole, learned: Whole, warm: Known, known: bool
) -> list[OnPart]:
    """→ differences and sums of two figures of one kind where touches or temperature decide neither alone; differences of gains
    and reversals where they do, and those that stay open with the reason, too, if they are wanted (`known`).
    """
    left = [
        (*pair, f.value)
        for pair, f in zip(asks, found, strict=True)
        if not pair[0].is_range and (f.value is None or _too_warm(f, warm) or (known and f.kind in DIFFER))
    ]
    given = []
    for i, (two, own_two, second) in enumerate(left):
        for one, own_one, first in left[:i]:
            neither, wanted = first is None and second is None, known and two.kind in DIFFER
            if one.kind != two.kind or one.own == two.own or ((first is None) != (second is None) and not wanted):
                continue
            signs = ((-1.0, "−"), (1.0, "+")) if neither else ((-1.0, "−"),)
            note = "relative: neither is known alone" if neither else NOTES[two.kind]
            for sign, word in signs:
                ask = Ask(two.kind, f"{two.name} {word} {one.name}", two.unit, two.factor, two.curve + sign * one.curve, two.own)
                if worst(ask, wide)[1] <= UNDECIDED[ask.unit]:
                    own = replace(ask, curve=own_two.curve + sign * own_one.curve)
                    s = _spread(ask, own, wide, learned)
                    given.append(OnPart(ask.kind, ask.name, ask.unit, s.best, (s.low, s.high), None, note))
                elif wanted and (doubt := undecided(ask, wide)) is not None:
                    given.append(OnPart(ask.kind, ask.name, ask.unit, None, None, None, note, *doubt))
    return given


def _too_warm(f: OnPart, warm: Known) -> bool:
    """figure, what temperature adds to scales → whether it is a scale that temperature leaves undecided."""
    return f.kind == "positioning gain" and f.expands and warm.std * 1e6 > UNDECIDED["µm/m"]
