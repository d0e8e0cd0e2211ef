"""Cell → Plan: where every touch happens and how the probe gets there without touching anything else."""

from .build import OBSTRUCTED, USUAL, attempt, by_stylus, part, plan, reachable
from .digest import plan_hash
from .guarded import refuse
from .motion import last_motion, last_moves
from .split import can_be_cut, split
from .standing import standing

__all__ = [
    "OBSTRUCTED",
    "USUAL",
    "attempt",
    "by_stylus",
    "can_be_cut",
    "last_motion",
    "last_moves",
    "part",
    "plan",
    "plan_hash",
    "reachable",
    "refuse",
    "split",
    "standing",
]
