"""What is known before anything is measured, and what is said of a result that is compared with it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Tolerances:
    """What is known of a machine before it is measured: by how much each may differ from what machine.yaml states.

    The defaults are far beyond what machine tools in use have, and far below what a slip of the pen makes.
    """

    location: float = 1.0  # mm, of axis lines and of the spindle
    angle: float = math.radians(0.1)  # rad, squareness and parallelism of axes
    scale: float = 0.0005  # mm/mm, of a linear axis
    motion: float = 0.2  # mm, straightness and the like over what was touched
    motion_angle: float = math.radians(0.03)  # rad, error motions that turn, positioning of rotary axes
    backlash: float = 0.1  # mm
    backlash_angle: float = math.radians(0.02)  # rad
    stylus: float = 1.0  # mm, tip against the spindle line and the stated length
    scatter: float = 0.05  # mm, one standard deviation of what the model leaves of a touch
    direction: float | None = None  # mm, by which touches of one direction may read early or late; None: nobody has stated it
    step: float = 0.003  # mm, by which a linear axis may stand elsewhere beyond one place of its travel
    runout: float | None = None  # mm, of the tip in each direction, as a dial gauge shows it; None: nobody has stated it

    @property
    def usual_runout(self) -> float:
        """→ mm in each direction: as stated, else that of a stylus that was adjusted with a dial gauge."""
        return 0.005 if self.runout is None else self.runout


@dataclass(frozen=True)
class TableTolerances:
    """What is known of a table before it is measured: by how much each may differ from what artefact.yaml states."""

    facet: float = 1.0  # mm, of a facet along its normal
    common: float = 0.3  # mm, mean of all facets: what a wrong tip radius would make of them
    ball: float = 2.0  # mm, of a ball's centre in each direction
    placement: float = 2.0  # mm, of a calibrated artefact on the table
    placement_angle: float = math.radians(1.0)  # rad


Verdict = Literal["trustworthy", "doubtful", "implausible"]


@dataclass(frozen=True)
class Suspicion:
    """A single mistake that would explain the readings: where it is and what to change."""

    kind: str  # the file of `plausible/mistakes/` that thought of it
    text: str  # a sentence: the readings fit if …; less is left if … where they do not fit
    file: str  # name of the file in the cell that would have to change
    key: str  # of that file; a column of readings.csv
    change: str  # what to write instead
    line: int | None = None
    touches: tuple[int, ...] = ()  # numbers, where single touches are meant; empty: all
    before: float = 0.0  # mm, root mean square of what is left of the touches as the cell states it
    after: float = 0.0  # mm, the same with this mistake put right
    fits: bool | None = None  # whether `after` is what the stated scatter leaves; None: seen in the readings, nothing was tried
    odds: float = 0.0  # natural logarithm: how much better than the best other mistake, or than none; 0 is undecided
    equally: tuple[str, ...] = ()  # other mistakes that move every touch in the same way, in words


@dataclass(frozen=True)
class Judgement:
    """Whether a result may be believed: the worst of fit, completeness and what was known before."""

    verdict: Verdict
    reasons: tuple[str, ...] = ()  # sentences: why it is not trustworthy
    remarks: tuple[str, ...] = ()  # sentences that change no verdict
    suspicions: tuple[Suspicion, ...] = ()  # most likely first
    untrusted: tuple[str, ...] = ()  # names of parameters
    incomplete: bool = False  # so much of what was planned is missing that nobody acts on it without being told to
    nothing: bool = False  # none of the parameters is trusted, so that there is nothing to act on
    stand: tuple[str, ...] = ()  # of the untrusted: less than half of each could be what no touch shows, so it is worth acting on
    hidden: tuple[tuple[str, float], ...] = ()  # of the untrusted: by how much (mm, rad) what no touch shows may move it; no more
