"""Probing capability: what a touch is worth on this machine, measured by the machine itself (thesis sections 4.6 and 7.3).

Every kind has a program (`program`: the cell's artefact and a strategy of its own) and an analysis of its readings. The
numbers feed the budget of `tango uncertainty` and the simulated world; a touch's value is the height of the surface above
its nominal place along the facet normal, at the nominal machine.
"""

from .analysis import budget_lines, directions, drift, grid, heights, lobing, repeatability, wetness, world_effects
from .probing import Environment, Probing, changed, environment, probing
from .programs import KINDS, REPETITIONS, CapabilitySettings, Kind, program

__all__ = [
    "KINDS",
    "REPETITIONS",
    "CapabilitySettings",
    "Environment",
    "Kind",
    "Probing",
    "budget_lines",
    "changed",
    "directions",
    "drift",
    "environment",
    "grid",
    "heights",
    "lobing",
    "probing",
    "program",
    "repeatability",
    "wetness",
    "world_effects",
]
