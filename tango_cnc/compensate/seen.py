"""Which parts of a compensation act, by what touches say of their shares: those that do, do not, may or may not, and are not seen.

A part is a table, the centers, the directions; what one file holds is judged together as well, as a file is loaded or not.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..records import Array
from ..touches import Touches
from .fit import rms
from .outcome import HELPED
from .promise import Figure
from .shares import Before, Part, Shares, acting, apart, foreseen, shares
from .space import Poses

MATTERS = 0.1  # of the error before: a part that takes less away leaves nothing undecided …
SEEN = 2.0  # … nor one that takes less away than this many standard deviations of a touch
TOLD = 0.5  # standard deviations of a touch: less than that is not said to be missing
WITHIN, MISSING, FAINT = 2.5, 3.0, 4.0  # standard deviations from none; from all of it; the same of a part that hardly matters
NEAR = 0.2  # of a part: as much may be missing of one that is in the control
MISFIT = 1e-3  # p-value of touches that no share of the parts explains


def asked_for(size: float, before: Figure, sigma: float) -> bool:
    """µm rms that a part takes away, µm before, mm of a touch → whether a short check is to show that this part acts."""
    return size >= max(MATTERS * before.value, SEEN * 1e3 * sigma)


@dataclass(frozen=True)
class Sorted:
    """Names of parts by what touches say of them."""

    within: list[str]
    missing: list[str]
    unsure: list[str]
    small: list[str]  # not decided, and takes little away
    how: dict[str, str]  # of those that are missing: how much of each acts, where that is known

    @classmethod
    def of(
        cls, found: Shares, sizes: Sequence[float], before: Figure, sigma: float, faint: float = FAINT, *, files: bool = False
    ) -> Sorted:
        """shares, µm rms that each part takes away, µm before, mm of a touch → the parts, sorted.

        `faint`: standard deviations from all of it by which a part that hardly matters is missing. `files`: parts are files; each
        is loaded whole or not at all, so the states decide on those that hardly matter, too.
        """
        result = cls([], [], [], [], {})
        asked = [i for i, size in enumerate(sizes) if asked_for(size, before, sigma)]
        acts = dict(zip(asked, acting(found.share[asked], found.covariance[np.ix_(asked, asked)], WITHIN**2), strict=True))
        loaded = acting(found.share, found.covariance, WITHIN**2) if files else [None] * len(sizes)
        for i, (name, share, std, size) in enumerate(zip(found.names, found.share, found.std, sizes, strict=True)):
            small = i not in acts
            lacks = abs(share - 1)
            if lacks > max((faint if small else MISSING) * std, NEAR) and lacks * size > TOLD * 1e3 * sigma:
                result.missing.append(name)
                result.how[name] = f"{name} ({_how(share, std)})"
            elif acts.get(i, share > max(WITHIN * std, HELPED) or loaded[i]):
                result.within.append(name)
            elif acts.get(i) is False:
                result.missing.append(name)
            else:
                (result.small if small else result.unsure).append(name)
        return result


def _how(share: float, std: float) -> str:
    """share of a part, its standard deviation → how it acts, for people."""
    if share + WITHIN * std < 0:
        return f"it acts the wrong way round, by {-100 * share:.0f} ± {200 * std:.0f} %: do a sign trial"
    most = 100 * share + 200 * std
    return f"{100 * share:.0f} ± {200 * std:.0f} % of it acts" if share > 0 else f"at most {max(most, 0.0):.0f} % of it acts"


@dataclass(frozen=True)
class Seen:
    """What touches say of all parts: in the words that a person reads, files where these tell more, and as names of parts."""

    missing: tuple[str, ...]
    unsure: tuple[str, ...]  # may be in the control or not, and the whole strategy would decide it
    unseen: tuple[str, ...]  # may be in the control or not: takes little away, or no touch decides it
    files: bool  # whether there is a file among the unseen ones
    acting: tuple[str, ...]  # parts that act
    hidden: tuple[str, ...]  # parts that the unseen ones consist of


def seen(
    tables: Sorted, parts: Sequence[Part], files: Sorted | None, held_in: Mapping[str, str], never: Collection[str] = ()
) -> Seen:
    """tables sorted, as parts, files sorted, {place: its file}, names that no touch of the strategy decides → what is known of all.

    A file of which one table acts is loaded. A file that is not loaded is named, and not each of its tables. Where files are not
    known, every table is one by itself.
    """
    of = {part.name: {held_in.get(h.place, part.name) for h in part.held} if files else {part.name} for part in parts}
    files = files or tables
    loaded = {*files.within, *(f for name in tables.within if len(of[name]) == 1 for f in of[name])}
    lost = [f for f in files.missing if f not in loaded or not any(f in of[name] for name in tables.missing)]
    unsure = [f for f in files.unsure if f not in {*loaded, *never}]
    faint = [f for f in (*files.small, *files.unsure) if f not in {*loaded, *unsure}]
    told = {*lost, *unsure, *faint}
    rest = {kind: [n for n in getattr(tables, kind) if not of[n] <= told] for kind in ("missing", "unsure", "small")}
    doubtful = [name for name in rest["unsure"] if name not in never]
    dim = [*rest["small"], *(name for name in rest["unsure"] if name in never)]
    hidden = [name for name in of if name in dim or (of[name] & {*faint} and name not in tables.within)]
    known = {*hidden, *doubtful, *rest["missing"], *(name for name in of if of[name] & {*lost, *unsure})}
    return Seen(
        (*(files.how.get(f, f) for f in lost), *(tables.how.get(name, name) for name in rest["missing"])),
        (*unsure, *doubtful),
        (*faint, *dim),
        bool(faint),
        tuple(name for name in of if name not in known),
        tuple(hidden),
    )


@dataclass(frozen=True)
class Question:
    """What a check asks: what was known before it, its parts, what each file holds (none: not known), the volume, µm before."""

    before: Before
    parts: Sequence[Part]
    loads: Sequence[Part]
    held_in: Mapping[str, str]
    at: Poses
    figure: Figure

    def sizes(self, parts: Sequence[Part]) -> list[float]:
        """→ µm rms that each takes away."""
        return [rms(self.at.free(part.moved(self.at).reshape(-1, 1))[:, 0]) for part in parts]

    def answer(self, found: Shares, touches: Touches, shifted: Array | None = None, faint: float = FAINT) -> Seen:
        """shares of the parts, touches, (n,) mm that gaps differ by for certain → what is known of all."""
        tables = Sorted.of(found, self.sizes(self.parts), self.figure, self.before.sigma, faint)
        files = None
        if self.loads:
            loaded = shares(self.before, touches, self.loads, shifted)
            files = Sorted.of(loaded, self.sizes(self.loads), self.figure, self.before.sigma, faint, files=True)
            if loaded.p_value < MISFIT:  # no file acts as a whole, or not at all: then each table speaks for itself
                files = Sorted([], [], [], list(loaded.names), {})
        return seen(tables, self.parts, files, self.held_in, (*self.beyond(self.parts), *self.beyond(self.loads)))

    def beyond(self, parts: Sequence[Part]) -> list[str]:
        """parts → names of those that the whole strategy does not decide either, though the stylus stays the same."""
        if not parts:
            return []
        covariance = foreseen(replace(self.before, same_stylus=True), self.before.result.model.touches, parts)
        return [part.name for part, std in zip(parts, apart(covariance), strict=True) if std > 1 / WITHIN]
