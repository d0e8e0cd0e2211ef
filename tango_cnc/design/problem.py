"""What decides the choice of a plan, and the plan that was chosen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Cell, Plan
from .candidates import Candidates
from .criterion import Criterion
from .relaxed import Relaxed
from .senses import Senses, ordered
from .ways import Ways
from .worst import FEWER

SHORT = 200.0  # s; a check that is no longer is over before anything has drifted
AGAIN = 4  # facets of the first indexation that are touched once more at the end


@dataclass(frozen=True)
class Problem:
    """Everything that decides the choice."""

    choice: Candidates
    criterion: Criterion
    seconds: float
    feed: float | None  # mm/min of protected moves
    begin: Array  # (p, p) what is known of a machine whose errors are as usual: it decides the order
    repeats: int = AGAIN
    times: int = 1  # touches in a row at each facet
    senses: Senses | None = None  # how the rows depend on from where rotary axes came
    gate: str = "none"  # what proves the probe alive before the first touch: as the profile says
    ways: Ways = field(default_factory=Ways)  # that are not safe; learned while plans are made
    # first plans, none of which is made twice, and what each was made of
    quickly: dict[tuple[float, ...], tuple[Chosen, Relaxed, Candidates, Criterion]] = field(default_factory=dict)
    say: Callable[[str], None] = lambda text: None  # hears what the search is doing: it may take a minute

    @property
    def held(self) -> Array:
        """→ (p, p) what is known without a touch, per squared scatter of a touch."""
        return self.choice.held

    @property
    def barred(self) -> NDArray[np.bool_]:
        """→ (n,) whether a touch is left out, as no safe way was found to it."""
        return self.ways.barred(self.choice.pose, self.choice.facet)

    def of_time(self, seconds: float) -> Problem:
        """s of the whole run → the same problem in that time. A short run has no time for its first indexation once more."""
        short = 0 if self.choice.twice else 2
        return replace(self, seconds=seconds, repeats=AGAIN if seconds > SHORT else short)

    def in_a_row(self, times: int) -> Problem:
        """how often each facet is touched before the next one → the same problem; a row stands for all of them."""
        more = (times / self.times) ** 0.5
        senses = None if self.senses is None else replace(self.senses, by=self.senses.by * more)
        return replace(self, choice=replace(self.choice, rows=self.choice.rows * more), senses=senses, times=times)

    def ordered(self, visits: Sequence[int]) -> Problem:
        """indexations in their order → the same problem with rows there as that order makes them."""
        return self if self.senses is None else replace(self, choice=ordered(self.choice, self.senses, visits))


@dataclass(frozen=True)
class Chosen:
    """The plan, and what is known of it before anything moves."""

    problem: Problem
    cell: Cell  # with the strategy that was chosen
    plan: Plan
    seconds: float
    information: Array  # (p, p) with the last motions of the plan
    value: float  # φ
    bound: float  # on φ of any plan whose touches and turns cost what they cost in this one
    efficiency: float
    costs: tuple[float, float]  # s of a touch with its way, s of coming to an indexation
    time: Array  # (n,) s at which each touch is done
    rows: Array  # (n, p) of the touches in their order
    here: float = -np.inf  # bound on φ of any touches at the indexations of this plan
    designed: Mapping[float, float] = field(default_factory=dict)  # parts of the time: φ of a plan of each, where there is one


def lighter(problem: Problem) -> Problem:
    """problem → the same; of a check nearly the same, with fewer unknowns, which is lighter to search in. What is left out tells
    nothing.

    Of a check the changes stay unknowns. What the full run leaves uncertain does so in the combinations that all touches feel most,
    `FEWER` unknowns in all: touches that the same error spoils do not help each other. The rest counts as scatter of each touch.
    """
    if (barred := problem.barred).any():
        problem = replace(problem, choice=replace(problem.choice, rows=np.where(barred[:, None], 0.0, problem.choice.rows)))
    choice = problem.choice
    if not choice.twice:
        return problem
    q = len(choice.twice)
    p = len(choice.scale) - q
    most = max(min(FEWER - q, p), 0)
    felt = _felt(choice.rows[:, :p], problem.held[:p, :p])
    old = choice.rows[:, :p] @ felt
    size = 1 / np.sqrt(1 + np.einsum("ij,ij->i", old[:, most:], old[:, most:]))[:, None]
    rows = np.hstack([old[:, :most], choice.rows[:, p:]]) * size
    scale = np.concatenate([np.ones(most), choice.scale[p:]])
    few = replace(choice, rows=rows, scale=scale, held=_beside(most, problem.held[p:, p:]), twice=())
    assert problem.criterion.worst is not None
    criterion = replace(
        problem.criterion, worst=np.hstack([np.zeros((len(problem.criterion.worst), most)), problem.criterion.worst[:, p:]])
    )
    senses = problem.senses
    if senses is not None:
        senses = replace(senses, by=np.concatenate([senses.by[:, :, :p] @ felt[:, :most], senses.by[:, :, p:]], axis=2) * size)
    return replace(problem, choice=few, criterion=criterion, begin=_beside(most, problem.begin[p:, p:]), senses=senses)


def _felt(rows: Array, held: Array) -> Array:
    """(n, p) touches, (p, p) information of the full run → (p, p) combinations that it leaves uncertain by one each, independently.

    Those come first that the touches feel most.
    """
    root = np.linalg.inv(np.linalg.cholesky(held)).T  # root rootᵀ is the covariance
    return np.asarray(root @ np.linalg.eigh(root.T @ (rows.T @ rows) @ root)[1][:, ::-1])


def _beside(count: int, held: Array) -> Array:
    """how many unknowns of unit variance, (q, q) information of the others → that of all."""
    found = np.eye(count + len(held))
    found[count:, count:] = held
    return found
