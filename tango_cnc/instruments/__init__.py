"""Tests that other instruments make: what ball bar, R-test and laser should show, and whether they did.

A test is a path of commands and the directions in which an instrument looks. Everything it shows is linear in the error motions
of the machine, and so is what setting it up takes out (where its ball or its reflector was put). The intervals are those of the
fit with every error motion of the topology.
"""

from .chance import RARE
from .measured import Agreement, Compared, InstrumentReadings, compare, read_measured
from .path import INSTRUMENTS, Path, Wanted, commanded, names_of, path_of
from .predict import Predicted, Row, predict

__all__ = [
    "INSTRUMENTS",
    "RARE",
    "Agreement",
    "Compared",
    "InstrumentReadings",
    "Path",
    "Predicted",
    "Row",
    "Wanted",
    "commanded",
    "compare",
    "names_of",
    "path_of",
    "predict",
    "read_measured",
]
