"""Every record that crosses a stage; frozen, and without behaviour beyond looking things up.

Units inside the program are mm, rad, s, and mm/min for feeds; files and people see degrees. A position array has one
column per axis in the order of `Machine.names`: X Y Z, then the rotary letters in alphabetical order, then the spindle.
"""

from .cell import (
    Approach,
    Artefact,
    Axis,
    Ball,
    Cell,
    Controller,
    Facet,
    Find,
    Indexation,
    Machine,
    Obstacle,
    Probe,
    ScaleBar,
    Strategy,
    Surface,
    TermItem,
    World,
)
from .errors import InputError, LacksSettingError, LinkError, NothingSentError, TangoError
from .numbers import COMPONENTS, LINEAR, ROTARY, Array, Id, Vector
from .plan import OFF, Move, MoveKind, Plan, Touch, Turn
from .readings import Combination, Parameter, Readings

__all__ = [
    "COMPONENTS",
    "LINEAR",
    "OFF",
    "ROTARY",
    "Approach",
    "Array",
    "Artefact",
    "Axis",
    "Ball",
    "Cell",
    "Combination",
    "Controller",
    "Facet",
    "Find",
    "Id",
    "Indexation",
    "InputError",
    "LacksSettingError",
    "LinkError",
    "Machine",
    "Move",
    "MoveKind",
    "NothingSentError",
    "Obstacle",
    "Parameter",
    "Plan",
    "Probe",
    "Readings",
    "ScaleBar",
    "Strategy",
    "Surface",
    "TangoError",
    "TermItem",
    "Touch",
    "Turn",
    "Vector",
    "World",
]
