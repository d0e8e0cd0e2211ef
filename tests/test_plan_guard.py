"""What a plan says of the way to its first place, and of places that no axis reaches."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np

from tango_cnc.files import read_cell
from tango_cnc.plan.guard import Guard, outside, remarks

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_a_place_beyond_the_travel_of_an_axis_is_outside_and_an_axis_without_travel_never_is() -> None:
    machine = read_cell(EXAMPLES / "trunnion").machine
    low, high = machine.axis("X").travel or (0.0, 0.0)
    place = np.zeros(len(machine.names))
    for x, beyond in ((low, False), (high, False), (low - 0.01, True), (high + 0.01, True)):
        place[machine.column("X")] = x
        assert outside(machine, place) == beyond, x
    place[machine.column("X")], place[machine.column("S")] = 0.0, 100.0
    assert machine.axis("S").travel is None and not outside(machine, place)


def test_the_first_place_is_named_in_millimeters_and_degrees_where_something_may_be_met_on_the_way() -> None:
    machine = read_cell(EXAMPLES / "trunnion").machine
    met = SimpleNamespace(one=SimpleNamespace(name="spindle"), other=SimpleNamespace(name="door"))
    guard = cast(Guard, SimpleNamespace(anywhere=lambda where, first: [met]))
    place = {"X": 12.0, "Y": -3.0, "Z": 400.0, "A": np.pi / 6, "C": -np.pi / 2, "S": 0.0}
    (text,) = remarks(machine, guard, [place[name] for name in machine.names], "Z")
    assert "(X 12.0 Y -3.0 A 30.0 C -90.0)" in text and "door may be met by spindle" in text
