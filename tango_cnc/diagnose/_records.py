"""What a diagnosis finds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..records import Array, TermItem
from ..terms._shape import Form
from ._gain import Gain

Why = Literal["few", "one touch", "rest", "no gain", "beside a shape", "shape", "unstable", "size"]
FREE = 40  # touches beyond the unknowns: with fewer, nobody can tell one cause from another (docs/diagnose.md)
SUBSETS = 5  # of the indexations, each without a fifth of them
ALONE = 0.4  # part of a pattern in touches that are left out, above which the others cannot know of it


@dataclass(frozen=True)
class Stability:
    """How often a name came back when a part of the indexations was left out; what hardly shows it without them is no trial."""

    times: int
    of: int  # subsets in which enough of its pattern is left; at most SUBSETS


@dataclass(frozen=True)
class Size:
    """Values of the columns of one cause, their covariance, and one number for their size."""

    values: Array  # (k,) unit of the coefficients
    std: Array  # (k,)
    amplitude: float  # mm; of an angle or a slope: the largest effect on a touch
    amplitude_std: float
    detail: Mapping[str, Any]
    effect: Mapping[str, Any]  # entry of world.yaml's effects


@dataclass(frozen=True)
class Finding:
    """One named cause; lengths mm."""

    cause: str
    setting: Mapping[str, Any]  # of the term
    detail: Mapping[str, Any]  # for people and files
    size: Size
    p_value: float
    gain: Gain | None
    shift: Mapping[str, tuple[float, float, float]]  # parameter: before, after, in standard deviations
    alternatives: tuple[tuple[str, Mapping[str, Any], float], ...]  # cause, setting, how much worse its score
    separate_with: tuple[str, ...]
    effect: Mapping[str, Any]  # entry of world.yaml's effects
    pattern: Array  # (n,) what it does to every touch
    aliases: tuple[tuple[Mapping[str, Any], float], ...] = ()  # other settings of the cause, how much worse their score
    stability: Stability | None = None
    nearest: tuple[str, float] | None = None  # covariates of a shape that comes near in its place, and its evidence less

    @property
    def item(self) -> TermItem:
        """→ the entry of a list of terms."""
        return {"cause": self.cause, **self.setting}


@dataclass(frozen=True)
class Dropped:
    """A cause that fits, and is not named."""

    finding: Finding  # as it would have been told; its alternatives were not looked for
    why: Why


@dataclass(frozen=True)
class Again:
    """A shape that was learned before and is part of what a shape without a name is now."""

    name: str
    times: float  # as large as it was when it was learned
    agreement: float  # correlation of the two at these touches, as the model leaves them
    learned: str | None  # the day


@dataclass(frozen=True)
class Remainder:
    """Structure without a name; mm."""

    covariate: str
    frame: str
    shape: str
    amplitude: float
    heldout_r2: float
    pattern: Array  # (n,) what the present model cannot absorb of it
    std: float = 0.0  # mm, of the amplitude
    form: Form | None = None  # None for a random walk
    weights: Array = field(default_factory=lambda: np.empty(0))  # (k,) of its functions
    touch: int = 0  # row that feels it most
    closed: str | None = None  # a formula that does as well
    confirm: str = ""  # where it would show again
    again: Again | None = None  # what it was when it was learned
    rivals: tuple[str, ...] = ()  # covariates that it may follow instead: these touches cannot tell
    plain: Array | None = None  # (k,) weights that make `closed`, where that is kept in place of `weights`
