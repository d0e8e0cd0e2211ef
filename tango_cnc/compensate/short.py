"""What a short check says of a compensation: kept, not as promised, undecided, no help; resting on the run it was made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..model import Model
from ..records import Array
from ..touches import Touches
from .fit import posed, rms
from .hidden import of_record, unseen
from .loop import Kept
from .outcome import HELPED, TRY_KINEMATICS, Outcome, judged, less, promises, rolled_back, said_share, spans
from .promise import DRAWS, Figure
from .shares import Before, Part, Shares, acting, apart, expected, parts_of, shares, system
from .space import Held, Poses, sample

FEW = 0.6  # of the touches that a compensation was made from: with fewer it is a short check
MATTERS = 0.1  # of the error before: a part that takes less away is not asked for by itself …
SEEN = 2.0  # … nor one that takes less away than this many standard deviations of a touch
UNTOLD = 0.3  # standard deviation of a share with all touches of the full run, beyond which a part is not asked for either
TOLD = 0.5  # standard deviations of a touch: less than that is not said to be missing
WITHIN, MISSING, FAINT = 2.5, 3.0, 4.0  # standard deviations from none; from all of it; the same of a part that hardly matters
NEAR = 0.2  # of a part: as much may be missing of one that is in the control
MISFIT = 1e-3  # p-value of touches that no share of the parts explains


@dataclass(frozen=True)
class Short:
    """A short check made ready: what was known, its touches, what the target holds, the volume."""

    kept: Kept
    before: Before
    held: Sequence[Held]
    tcp: bool  # whether the check was made with tool center point control
    first_tcp: bool  # whether the full run was

    @property
    def poses(self) -> Poses:
        """→ those of the volume of the compensation."""
        machine = self.before.result.model.touches.machine
        scale = {n: 1.0 if n in machine.linear else np.pi / 180 for n in self.kept.record["volume"]}
        return sample(machine, {n: (low * scale[n], high * scale[n]) for n, (low, high) in self.kept.record["volume"].items()})

    @property
    def parts(self) -> list[Part]:
        """→ what changed and a run like this sees."""
        return parts_of(self.held, changes(self.kept), tcp=self.tcp)

    @cached_property
    def hidden(self) -> frozenset[str]:
        """→ names of parts that not even the touches of the full run tell: others do nearly the same there."""
        touches, parts = self.before.result.model.touches, self.parts
        ready = system(self.before, touches, parts)
        std = apart(expected(ready, self.before.sigma)[-len(parts) :, -len(parts) :])
        return frozenset(part.name for part, size in zip(parts, std, strict=True) if size > UNTOLD)

    def kinematics(self, at: Poses, *, new: bool) -> Array:
        """poses → (n, 3) mm that the control's kinematics take away, with the new numbers or with those before."""
        record = self.kept.record
        present = of_record(record)
        numbers = present.numbers if new else {v["place"]: float(v["present"]) for v in record["values"]}
        sizes = unseen(self.held, numbers, present.before(self.held))
        return np.asarray(sum((h.lever(at) * v for h, v in zip(self.held, sizes, strict=True) if v), np.zeros((len(at), 3))))

    def shifted(self, touches: Touches) -> Array:
        """touches → (n,) mm by which their gaps differ as the kinematics before acted in one of both runs alone."""
        gone = np.sum(self.kinematics(Poses(touches), new=False) * touches.normal, axis=1)
        return np.asarray(gone * (float(self.tcp) - float(self.first_tcp)))


def changes(kept: Kept) -> dict[str, float]:
    """compensation → {place: by how much its number changes}."""
    return {v["place"]: v["new"] - v["present"] for v in kept.record["values"] if v["new"] != v["present"]}


def short_outcome(asked: Short, touches: Touches) -> Outcome:
    """short check, its touches → what became of the promise."""
    kept, parts = asked.kept, asked.parts
    before, promised = promises(kept.record)
    if not parts:
        text = (
            "nothing that these touches could see was changed: kinematics act with tool center point control only. Measure with it "
            "on, and state --tcp, or by hand, as steps.txt says (--turned)"
        )
        return Outcome(before, promised, before, "undecided", text)
    found = shares(asked.before, touches, parts, asked.shifted(touches))
    at = asked.poses
    model = asked.before.result.model
    own = [j for j, c in enumerate(model.coefficients) if posed(c, at.touches)]
    levers = levers_of(model, own, at)
    moved = np.stack([part.moved(at).ravel() for part in parts], axis=1)
    told = np.zeros(3 * len(at)) if asked.tcp else asked.kinematics(at, new=True).ravel()
    if asked.tcp and not asked.first_tcp:
        told = asked.kinematics(at, new=False).ravel()
    if not asked.tcp and asked.first_tcp:
        told = told - asked.kinematics(at, new=False).ravel()
    levers, moved, told = at.free(levers), at.free(moved), at.free(told[:, None])[:, 0]
    sizes = [rms(column) for column in moved.T]
    parts_by = Sorted.of(asked, found, sizes)
    certain = {*parts_by.within, *parts_by.small}
    still = shares(replace(asked.before, moves=0.0), touches, parts, asked.shifted(touches), certain)
    as_it_was = levers @ asked.before.result.values[own] - told
    whole = moved.sum(axis=1)

    def drawn(told_by: Shares) -> tuple[Array, Array]:
        change, share = told_by.draws(DRAWS)
        left = as_it_was[:, None] + levers @ change[own] - moved @ share
        return 1.0 - whole @ left / float(whole @ whole), np.sqrt(np.sum(left**2, axis=0) / len(at)) * 1e3

    gone, size = drawn(found)
    helped, most, least = _interval(gone), _interval(size), _interval(drawn(still)[1])
    # What might have moved, and what might be missing unseen, make an error look larger than it is: the lower end is without.
    measured = Figure((most.value + least.value) / 2, min(least.low, most.low), most.high)
    return _said(asked, found, parts_by, before, promised, measured, helped, 0.0 if asked.tcp else rms(told))


def levers_of(model: Model, own: Sequence[int], at: Poses) -> Array:
    """model, which of its coefficients, poses → (3n, c) mm per unit of each."""
    coefficients = [model.coefficients[j] for j in own]
    return np.stack([(at.slots[c.slot] * c.regressor(at.touches)[:, None]).ravel() for c in coefficients], axis=1)


def _interval(draws: Array) -> Figure:
    low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975])
    return Figure(float(middle), float(low), float(high))


def asked_for(size: float, before: Figure, sigma: float) -> bool:
    """µm rms that a part takes away, µm before, mm of a touch → whether a short check is to show that this part acts."""
    return size >= max(MATTERS * before.value, SEEN * 1e3 * sigma)


@dataclass(frozen=True)
class Sorted:
    """Names of parts by what the touches say of them."""

    within: list[str]
    missing: list[str]
    unsure: list[str]
    small: list[str]  # takes too little away to be asked for

    @classmethod
    def of(cls, job: Short, found: Shares, sizes: Sequence[float], faint: float = FAINT) -> Sorted:
        """short check, shares, µm rms that each part takes away → the parts, sorted.

        `faint`: standard deviations from all of it by which a part that hardly matters is missing.
        """
        result = cls([], [], [], [])
        before, sigma = promises(job.kept.record)[0], job.before.sigma
        asked = [i for i, size in enumerate(sizes) if asked_for(size, before, sigma) and found.names[i] not in job.hidden]
        acts = dict(zip(asked, acting(found.share[asked], found.covariance[np.ix_(asked, asked)], WITHIN**2), strict=True))
        for i, (name, share, std, size) in enumerate(zip(found.names, found.share, found.std, sizes, strict=True)):
            small = i not in acts
            lacks = abs(share - 1)
            if lacks > max((faint if small else MISSING) * std, NEAR) and lacks * size > TOLD * 1e3 * sigma:
                result.missing.append(f"{name} ({_how(share, std)})")
            elif acts.get(i, share > max(WITHIN * std, HELPED)):
                result.within.append(name)
            elif acts.get(i) is False:
                result.missing.append(name)
            else:
                (result.small if small else result.unsure).append(name)
        return result


def _how(share: float, std: float) -> str:
    """share of a part, its standard deviation → how it acts, for people."""
    if share + FAINT * std < 0:
        return f"it acts the wrong way round, by {-100 * share:.0f} ± {200 * std:.0f} %: do a sign trial"
    return f"{max(100 * share, 0.0):.0f} ± {200 * std:.0f} % of it acts"


def by_part(asked: Short, touches: Touches) -> Sorted | None:
    """a run made ready, all its touches → its parts, sorted; None where the touches fit no share of them.

    By table and group first; where all of these may act, by single numbers: a reversal value of one axis was lost among all.
    """
    at, result = asked.poses, None
    for singly in (False, True):
        parts = parts_of(asked.held, changes(asked.kept), tcp=asked.tcp, singly=singly)
        if not parts:
            return None
        found = shares(asked.before, touches, parts, asked.shifted(touches))
        if found.p_value < MISFIT:
            return None
        sizes = [rms(at.free(part.moved(at).reshape(-1, 1))[:, 0]) for part in parts]
        result = Sorted.of(asked, found, sizes, MISSING)
        if result.missing:
            break
    return result


def not_all(found: Outcome, parts: Sorted | None, kept: Kept) -> Outcome:
    """outcome of a run that determines everything, its parts, compensation → the same; not as promised where one does not act.

    What centers take away may hide what a table leaves.
    """
    if found.verdict != "kept" or parts is None or not parts.missing:
        return found
    text = (
        f"{found.measured.value:.2f} µm ({found.measured.low:.2f} to {found.measured.high:.2f}) are left of "
        f"{found.before.value:.2f} µm, which is near the promise; but not everything acts as it was written: "
        f"{_some(parts.missing)}. Look whether its file was loaded; to go back, load the files of {kept.folder / 'undo'}"
    )
    return replace(found, verdict="not as promised", text=text)


def _said(
    asked: Short,
    found: Shares,
    parts: Sorted,
    before: Figure,
    promised: Figure,
    measured: Figure,
    helped: Figure,
    calculated: float,
) -> Outcome:
    """short check, shares, parts, figures, µm that are taken off by calculation → the verdict with its text."""
    verdict = _verdict(parts, before, promised, measured, helped)
    undo = f"load the files of {asked.kept.folder / 'undo'}"
    left = f"{measured.value:.2f} µm ({measured.low:.2f} to {measured.high:.2f}) are left of {before.value:.2f} µm"
    gone = f"{said_share(helped)}. A short check, which rests on the run that the compensation was made from"
    if calculated:
        gone += f"; what the kinematics hold ({calculated:.2f} µm) is taken off by calculation, this run could not see it"
    if parts.small:
        gone += f". Of parts that take little away, or that look like others, it says nothing by itself: {_some(parts.small)}"
    if found.p_value < MISFIT:
        number, off = found.off[0]
        text = (
            f"the touches fit no share of what was written (p = {found.p_value:.1g}; touch {number} by {off:.0f} standard "
            "deviations): a chip, something that moved during the check, or a machine that is another one since the full run. "
            "Clean the facets and repeat the check; if that says the same, measure with the whole strategy"
        )
        return Outcome(before, promised, measured, "undecided", text)
    if verdict == "no help":
        text = (
            f"{left}: it has not helped; {gone}. Now {undo}, and note it: {rolled_back(asked.kept)}. "
            "The files were not loaded, or a sign is wrong, or the control does not use what was written: do a "
            "sign trial"
        )
    elif verdict == "kept":
        text = f"{left}, and {promised.low:.2f} to {promised.high:.2f} µm were promised: they agree; {gone}"
        if calculated:
            text = f"as far as this run could see. {text[0].upper()}{text[1:]}. {TRY_KINEMATICS}"
    elif verdict == "not as promised":
        what = (
            f"this does not act as it was written: {_some(parts.missing)}"
            if parts.missing
            else "look for what else has changed since"
        )
        text = f"{left}, but no more than {promised.high:.2f} µm were promised; {what}; {gone}. To go back, {undo}"
    else:
        what = f"whether {_some(parts.unsure)} is in the control" if parts.unsure else "whether it has helped"
        text = (
            f"{left}; these touches cannot tell {what}; {gone}. Make the touches that 'tango compensate --short-check "
            f"{asked.kept.number}' chooses, or the whole strategy"
        )
    return Outcome(before, promised, measured, verdict, text)


def _verdict(parts: Sorted, before: Figure, promised: Figure, measured: Figure, helped: Figure) -> str:
    """parts by what is known of them, figures → the verdict.

    Less than half is gone and some of it is in the control all the same: then it is in part, unless more is left than before.
    """
    found = judged(before, promised, measured, helped)
    if found == "no help" and parts.within and less(measured, before):
        return "not as promised"
    if found == "no help" or spans(helped):
        return found
    if parts.missing and not parts.within and not parts.unsure and helped.value < HELPED:
        return "no help"
    if parts.missing:
        return "not as promised"
    if parts.unsure:
        return "undecided"
    return found


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
