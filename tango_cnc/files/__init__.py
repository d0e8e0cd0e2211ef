"""Records ↔ YAML, CSV, JSON. Every complaint names file, line, key, what was found and what is allowed."""

from .artefact import read_artefact
from .cell import read_cell, read_machine, read_terms, read_world
from .checked import blamed_on
from .hull import drawn_lines, drawn_sizes
from .readings import degrees_of, joined, last_direction, later, of_stylus, read_readings, read_readings_text, readings_text
from .strategy import read_strategy
from .write import artefact_text, machine_text, strategy_text, world_text, write_text

__all__ = [
    "artefact_text",
    "blamed_on",
    "degrees_of",
    "drawn_lines",
    "drawn_sizes",
    "joined",
    "last_direction",
    "later",
    "machine_text",
    "of_stylus",
    "read_artefact",
    "read_cell",
    "read_machine",
    "read_readings",
    "read_readings_text",
    "read_strategy",
    "read_terms",
    "read_world",
    "readings_text",
    "strategy_text",
    "world_text",
    "write_text",
]
