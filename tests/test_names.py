"""A public class has a name that no class of another package has: a reader who looks for it finds one thing."""

from __future__ import annotations

import re
from pathlib import Path

from support.imports import modules

TWICE = 38  # names of classes that several packages have. This number only falls.
CLASS = re.compile(r"^class ([A-Z]\w*)", re.MULTILINE)
# Files of one kind hold the same by contract, each for its own: these are no two meanings.
OF_A_KIND = (
    "postprocessors",
    "sim_controller",
    "tango_cnc.commands",
    "tango_cnc.readback.languages",
    "tango_cnc.nc.languages",
    "tango_cnc.link.protocols",
    "tango_cnc.compensate.targets",
    "tango_cnc.terms",
    "tango_cnc.plausible.mistakes",
    "tango_cnc.commission.experiments",
    "tango_cnc.uncertainty.sources",
)


def classes(root: Path) -> dict[str, dict[str, str]]:
    """→ name of a public class → package that has it → module."""
    held: dict[str, dict[str, str]] = {}
    for name, file in modules(root).items():
        if name.startswith(OF_A_KIND):
            continue
        for found in CLASS.findall(file.read_text(encoding="utf-8")):
            held.setdefault(found, {})[".".join(name.split(".")[:2])] = name
    return held


def test_a_class_has_a_name_of_its_own(root: Path) -> None:
    found = {name: list(places.values()) for name, places in classes(root).items() if len(places) > 1}
    told = "\n".join(f"{name}: {', '.join(places)}" for name, places in sorted(found.items()))
    assert len(found) <= TWICE, f"{len(found)} names of classes mean several things: give the new one a name of its own.\n{told}"
    assert len(found) == TWICE, f"TWICE is {len(found)} now"
