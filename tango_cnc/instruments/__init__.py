"""Tests that other instruments make: what ball bar, R-test and laser should show, and whether they did.

A test is a path of commands and the directions in which an instrument looks. Everything it shows is linear in the error motions
of the machine, and so is what setting it up takes out (where its ball or its reflector was put). The intervals are those of the
fit with every error motion of the topology.
"""

from .foretell import Foretold, Row, foretell
from .measured import Agreement, Compared, Measured, compare, read_measured
from .path import INSTRUMENTS, Path, Wanted, commanded, names_of, path_of

__all__ = [
    "INSTRUMENTS",
    "Agreement",
    "Compared",
    "Foretold",
    "Measured",
    "Path",
    "Row",
    "Wanted",
    "commanded",
    "compare",
    "foretell",
    "names_of",
    "path_of",
    "read_measured",
]
