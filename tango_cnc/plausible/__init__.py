"""Whether a result may be believed: what came out is compared with what was known before, and a mistake is looked for.

The verdict is the worst of four: the fit (parameters, facets and scatter against their tolerances), the readings (what is
missing, copied, rounded), touches that were made elsewhere, and outliers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..estimate import Estimate
from ..judgement import Judgement, Suspicion, Verdict
from ..records import Cell, Readings
from ..texts import joined, say
from ..touches import FAR, Touches, from_readings, misnamed
from .backlashes import alike as alike_backlashes
from .backlashes import by_direction
from .bounds import Bound, bounds, is_backlash
from .creeps import creeps
from .data import Remark, coarse, listed, remarks
from .directions import approaches, turns
from .either import AGREED as BETTER
from .either import AS_WELL, drift_of, either
from .few_terms import few_terms
from .groups import common
from .halves import halves
from .lacking import AGREED, LEVEL, lacking
from .late import late
from .learned import learned
from .planned import hidden
from .program import another_program
from .search import less, place, suspects
from .setup import offset, stylus
from .spare import spare
from .spindle import one_orientation, still
from .words import beyond_text

ORDER: tuple[Verdict, ...] = ("trustworthy", "doubtful", "implausible")
TINY = 0.01  # of what was left before: a mistake that leaves no more of all touches explains every one of them
EXPLAINED = 0.1  # mm: a mistake that leaves less explains the readings
GROSS = 5.0  # mm, root mean square of all touches as the cell states it, beyond which the whole cell is wrong
NOISY = 4.0  # times the stated repeatability that a touch may scatter before the result is doubtful
DIRECT = ("another_program", "copied_positions", "constant_column", "row_order")  # seen in the readings without any fit
MIDWAY = ("column_wrong", "zero_since", "unit_since", "lost_sign")  # one axis from a touch on
BESIDE = 8  # touches between two moments that are one
STRUCTURED = 3.0  # times the white scatter that a walk or seating may have before the result is doubtful
SWAMPED = 3.0  # times what white noise would make of it that the standard deviation of a trusted parameter may be
SINGLE = 3  # touches made elsewhere that may be slips in single rows
HALF = 0.5  # of its value that what no touch shows may be of a parameter that is worth acting on
NAMED = 6  # quantities beyond their tolerance that are named one by one


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """verdicts → the worst of them; none is trustworthy."""
    return ORDER[max((ORDER.index(v) for v in verdicts), default=0)]


def judge(
    cell: Cell,
    readings: Readings,
    result: Estimate | None,
    *,
    search: bool = True,
    run: Mapping[str, Any] | None = None,
    alone: bool = True,
    agrees: bool = False,
    explain: bool = True,
) -> Judgement:
    """cell, readings, their estimate (None: there is no fit) → whether it may be believed, and what most likely went wrong.

    `search`: look for the mistake where the verdict is not trustworthy. `run`: readings.json, which says
    what the plan left out, so that nobody misses it. `alone`: the estimate rests on these readings only, not on earlier nights.
    `agrees`: these touches are where earlier nights predicted them, so that a pattern in their residuals has to be surer.
    `explain`: name the mistake, which takes most of the time and decides nothing of the verdict.
    """
    touches = from_readings(cell.machine, cell.artefact, readings)
    found = _rows(cell, readings, touches, run)
    untrusted: list[str] = []
    labels: list[str] = []
    stand: tuple[str, ...] = ()
    hidden: dict[str, float] = {}
    nothing = result is None
    if result is None:
        found.append(Remark("implausible", say("plausible.judge.there_no_fit")))
    else:
        told = list(bounds(result))
        lost = sum(len(r.touches) for r in found if r.lost)
        few = [*few_terms(cell, readings, result, NOISY * max(cell.machine.probe.repeatability, 1e-4))] if search else []
        found += [*few, *_fit(cell, result, told, agrees, patterns=not few)]
        moved = {n for r in found if r.kind == "step" and r.sure and r.moves for n in r.touches if result.rejected is not None}
        moved &= {int(n) for n in touches.number[result.unused]}  # what moved says already that these are far off
        found += [r for r in spare(result, lost, alone) if not r.touches or not set(r.touches) <= moved]
        labels = [result.selection.label(c.name) for c in result.model.coefficients]
        bad = {name for b in told if b.beyond or b.undecided for name in b.names} | set(swamped(result))
        bad |= {name for r in found for name in r.moves if name not in dict(r.hidden)}
        if any(r.kind == "rounded_positions" for r in found):  # touches on one facet err alike: no scatter shows it
            bad |= {c.name for c in result.model.coefficients}
        if any(r.kind in ("another_program", "column_wrong") and "S" in r.key.split(", ") for r in found):
            bad |= {c.name for c in result.model.coefficients if c.slot.axis in ("S", "t")}  # what only turning the spindle tells
        away = {axis for r in found if r.kind == "directions" for axis in r.key.replace("d", "").split(", ")}
        bad |= {c.name for c in result.model.coefficients if is_backlash(c) and c.slot.axis in away}
        some = {name: max(dict(r.hidden).get(name, 0.0) for r in found) for r in found for name, _ in r.hidden}
        named = [
            (c.name, label, float(value)) for c, label, value in zip(result.model.coefficients, labels, result.values, strict=False)
        ]
        untrusted = [label for name, label, _ in named if name in bad or name in some]
        hidden = {label: some[name] for name, label, _ in named if name in some and name not in bad}
        stand = tuple(label for _, label, value in named if label in hidden and hidden[label] < HALF * abs(value))
        nothing = bool(result.parameters) and set(result.parameters) <= set(untrusted)
    found += _elsewhere(touches)
    verdict = worst([r.verdict for r in found])
    suspicions: tuple[Suspicion, ...] = ()
    if search and explain and verdict != "trustworthy":
        suspicions = _suspicions(cell, readings, found)
    if result is not None and not nothing and (lost := len(set(result.parameters) & set(untrusted))) > len(result.parameters) / 2:
        found.append(Remark("doubtful", say("plausible.judge.most_untrusted", count=lost, all=len(result.parameters))))
        verdict = worst([verdict, "doubtful"])  # no mistake is looked for: why they are untrusted is said already
    if verdict == "implausible" and result is not None:  # whoever reads the names alone takes none of them
        untrusted, nothing, stand, hidden = labels, bool(result.parameters), (), {}
    return Judgement(
        verdict,
        tuple(r.text for r in found if r.verdict != "trustworthy"),
        tuple(r.text for r in found if r.verdict == "trustworthy"),
        suspicions,
        tuple(untrusted),
        any(r.incomplete for r in found),
        nothing,
        stand,
        tuple(hidden.items()),
    )


def without_fit(cell: Cell, readings: Readings, run: Mapping[str, Any] | None = None) -> Judgement:
    """cell, readings, readings.json → what is wrong with them that is seen without any fit: missing, copied, made elsewhere."""
    touches = from_readings(cell.machine, cell.artefact, readings)
    found = [*_rows(cell, readings, touches, run), *_elsewhere(touches)]
    wrong = [r for r in found if r.verdict != "trustworthy"]
    return Judgement(
        worst([r.verdict for r in found]),
        tuple(r.text for r in wrong),
        tuple(r.text for r in found if r.verdict == "trustworthy"),
        tuple(_own(cell, r) for r in wrong if r.kind),
        incomplete=any(r.incomplete for r in found),
    )


def _rows(cell: Cell, readings: Readings, touches: Touches, run: Mapping[str, Any] | None) -> list[Remark]:
    return [
        *remarks(cell, readings, run),
        *another_program(cell, readings, run),
        *approaches(touches, readings.derived),
        *turns(touches),
    ]


def _suspicions(cell: Cell, readings: Readings, found: Sequence[Remark]) -> tuple[Suspicion, ...]:
    """→ mistakes with the readings and mistakes of the cell: first what explains the fit where the fit is bad."""
    own = tuple(_own(cell, r) for r in found if r.kind and r.verdict != "trustworthy")
    tried = suspects(cell, readings)
    # Where every touch is centimetres off, or another mistake explains a bar, that is a symptom like any other.
    gross = bool(tried) and tried[0].before > GROSS
    other = bool(tried) and tried[0].kind != "scale_bar" and tried[0].fits is not False
    # One mistake that leaves nothing of all touches explains what a step or late touches explain of a part of them.
    whole = bool(tried) and tried[0].fits is not False and tried[0].after < min(TINY * tried[0].before, EXPLAINED)
    sure = {r.text for r in found if r.sure and not gross and not whole and not (other and r.kind == "scale_bar")}
    direct = [s for s in own if s.kind in DIRECT and (not s.touches or len(s.touches) > len(readings) / 2)]
    alike = len(readings) > 1 and not np.ptp(readings.position, axis=0).any()  # such readings fit anything
    rounded: list[Suspicion] = []
    if coarse(readings) and (not tried or tried[0].before < coarse(readings)):  # no more is to be explained than the rounding makes
        first = rounded = [s for s in own if s.kind == "rounded_positions"]
    elif not tried or alike or (direct and tried[0].after > EXPLAINED):
        first = direct
    else:
        first = []
    # Positions that no probe made: that a spindle seems to stand still, or a table to have moved, follows from it.
    copied = [s for s in own if s.kind in ("copied_positions", "constant_column") and not s.touches]
    first = [
        *copied,
        *rounded,
        *(s for s in own if s.text in sure and s not in copied),
        *(s for s in first if s.text not in sure and s not in copied and s not in rounded),
    ]
    kinds = {s.kind for s in first if s.text in sure}
    rest = [s for s in tried if s.kind not in kinds]
    if tried and not copied and _one_number(tried[0], own, NOISY * max(cell.machine.probe.repeatability, 1e-4)):
        # It does what a displacement needs three for, or touches of which each is wrong by itself.
        first = [tried[0], *(s for s in first if s.kind != tried[0].kind)]
        rest = [s for s in rest if s is not tried[0]]
    lost = any(s.kind == "missing_touches" for s in own)  # where none is, a wrong cell can leave too few that fit it
    if any(r.incomplete for r in found) and (lost or not whole):  # so few fit many mistakes; those that are missing say the most
        first += [s for s in own if s.kind == "missing_touches" and s not in first]
        rest = [less(s) for s in rest]
    named = {(s.kind, s.touches) for s in (*first[:1], *rest)}
    return (*first, *rest, *(s for s in own if s not in first and (s.kind, s.touches) not in named))


def _one_number(tried: Suspicion, own: Sequence[Suspicion], near: float) -> bool:
    """the mistake that explains most, what the readings show by themselves, mm → whether one number explains every touch: an axis
    from a touch on, or late touches that leave no more than that, and not as a tip that was changed at the same touch does."""
    if tried.fits is False or ", " in tried.key:
        return False
    if tried.kind != "late_touches":
        return tried.kind in MIDWAY
    steps = [s.touches[0] for s in own if s.kind == "step" and s.touches]
    return tried.after < near and all(abs(at - tried.touches[0]) > BESIDE for at in steps)


def _fit(cell: Cell, result: Estimate, told: Sequence[Bound], agrees: bool, patterns: bool) -> list[Remark]:
    """`patterns`: look in the residuals for something that moves parameters; where terms are missing, that is these terms."""
    found: list[Remark] = []
    beyond = sorted((b for b in told if b.beyond), key=lambda b: -abs(b.value) / b.tolerance)
    found += [Remark("implausible", beyond_text(b)) for b in beyond[:NAMED]]
    if len(beyond) > NAMED:
        found.append(Remark("implausible", say("plausible.judge.more_quantities_beyond_what_plausible", count=len(beyond) - NAMED)))
    stated, allowed = cell.machine.probe.repeatability, cell.machine.tolerances.scatter
    by_chance = 0.0 if result.noise is None else result.noise.chance  # a drift that nobody can tell from none
    scatter = say("plausible.judge.one_touch_scatters", sigma=f"{result.sigma * 1000.0:.4g}")
    if result.sigma > allowed:
        found.append(
            Remark(
                "implausible",
                say("plausible.judge.at_most_plausible_machine_yaml", scatter=scatter, allowed=f"{allowed * 1000.0:g}"),
            )
        )
    elif result.sigma**2 - by_chance**2 > (NOISY * max(stated, 1e-4)) ** 2:
        # Touches that scatter by that much, drift and seating set apart, err by something that the terms lack: not each for itself.
        unknown = result.noise is None or result.noise.white > NOISY * max(stated, 1e-4)
        found.append(
            Remark(
                "doubtful",
                say("plausible.judge.machine_yaml_states_tango_diagnose", scatter=scatter, stated=f"{stated * 1000.0:.4g}"),
                moves=tuple(c.name for c in result.model.coefficients) if unknown else (),
            )
        )
    found += _noise(result)
    found += [
        *late(result),
        *common(result, agrees),
        *halves(result),
        *still(result),
        *one_orientation(result),
        *alike_backlashes(result),
        *by_direction(result),
    ]
    if patterns:
        found += lacking(result, AGREED if agrees else LEVEL)
        if (drift := drift_of(result)) is not None:
            behind = BETTER if agrees else AS_WELL
            found += [*either(result, drift, behind), *creeps(result, drift, behind)]
    return [
        *found,
        *hidden(result),
        *learned(result),
        *stylus(cell, told),
        *offset(told),
    ]


def _noise(result: Estimate) -> list[Remark]:
    noise = result.noise
    if noise is None:
        return []
    found = []
    for size, what in (
        (noise.walk, say("plausible.judge.machine_wandered_during_run_warm")),
        (noise.seating, say("plausible.judge.every_indexation_sits_elsewhere_clamps")),
    ):
        if size:
            text = say(
                "plausible.judge.beside_scatter_standard_deviations_contain",
                what=what,
                size=f"{size * 1000.0:.2g}",
                white=f"{noise.white * 1000.0:.2g}",
            )
            far = size > STRUCTURED * noise.white
            hint = say("plausible.judge.tango_diagnose_looks_for_cause") if far else ""
            found.append(Remark("doubtful" if far else "trustworthy", joined("", (text, hint))))
    if noise.undecided:
        text = say("plausible.judge.touches_have_no_weight_others", numbers=listed(list(noise.undecided)))
        found.append(Remark("trustworthy", say("plausible.judge.nobody_can_tell_which_wrong", text=text)))
    if noise.facets:
        listed_facets = ", ".join(f"{f} ({size * 1e3:.2g} µm)" for f, size in noise.facets.items())
        found.append(Remark("trustworthy", say("plausible.judge.facets_scatter_more_than_others", listed_facets=listed_facets)))
    return found


def swamped(result: Estimate) -> tuple[str, ...]:
    """estimate with its noise → names of coefficients whose standard deviation is mostly what drift and seating may have made."""
    noise = result.noise
    if noise is None or not (noise.walk or noise.seating):
        return ()
    weights = np.concatenate([np.ones(len(result.residuals)), result.known_weights])
    weighted = result.jacobian * weights[:, None]
    scale = np.linalg.norm(weighted, axis=0)
    root = np.linalg.qr(weighted / scale, mode="r")
    white = noise.white * np.linalg.norm(np.linalg.inv(root), axis=1) / scale
    return tuple(n for n, s, w in zip(result.model.names, result.std, white, strict=True) if s > SWAMPED * w)


def _elsewhere(touches: Touches) -> list[Remark]:
    away = misnamed(touches)
    if not away:
        return []
    m = away[0]
    text = say(
        f"plausible.judge.made_elsewhere_{'many' if len(away) > 1 else 'one'}",
        count=len(away),
        far=f"{FAR:g}",
        number=m.number,
        facet=m.facet,
        away=f"{m.away:.1f}",
        near="" if m.near == m.facet else say("plausible.judge.nearer", beside=f"{m.beside:.1f}", near=m.near),
    )
    numbers = tuple(m.number for m in away)
    if len(away) > SINGLE:
        return [Remark("implausible", text, numbers)]
    # A touch beside its place on the same plane leaves no gap: no mistake that is tried explains it.
    change = say("mistake.single_touches.look_for_chips_there_for")
    return [Remark("implausible", text, numbers, "single_touches", "touch", change)]


def _own(cell: Cell, remark: Remark) -> Suspicion:
    file, line = place(cell.folder, remark.file, remark.key)
    return Suspicion(remark.kind, remark.text, file, remark.key, remark.change, line, remark.touches)
