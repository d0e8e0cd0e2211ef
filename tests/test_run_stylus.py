"""A measurement with a change of stylus in the middle: two programs, two runs, one estimate, against the simulated control."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.runs import Result, readings
from support.simulated_runs import cell, controller  # noqa: F401  a fixture

LONGER = 60.0


def with_two_styli(folder: Path) -> None:
    """folder of a cell → a longer stylus beside the first, and every indexation again with it."""
    machine, strategy = folder / "machine.yaml", folder / "strategy.yaml"
    data = yaml.safe_load(machine.read_text(encoding="utf-8"))
    data["styli"] = [{"length": data["probe"]["length"] + LONGER}]
    machine.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    data = yaml.safe_load(strategy.read_text(encoding="utf-8"))
    data["indexations"] += [{**i, "stylus": 2} for i in data["indexations"]]
    strategy.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")


@pytest.mark.long
def test_the_stylus_is_changed_between_two_programs_and_what_was_measured_stays(cell: Path) -> None:
    with_two_styli(cell)
    with controller(cell, "--tcp", "127.0.0.1:0", "--stylus", "1") as url:
        first = Result("run", "-C", cell, "--port", url, "--timeout", "10")
    assert first.code == 0, first.err
    assert re.search(rf"tango run -C {cell} .*--stylus 2", first.err), "what comes next, after the first stylus"
    before = (cell / "readings.csv").read_bytes()
    with controller(cell, "--tcp", "127.0.0.1:0", "--stylus", "1") as url:
        forgotten = Result("run", "-C", cell, "--stylus", "2", "--port", url, "--timeout", "3")
    assert forgotten.code != 0, "the first stylus is still in the spindle, and meets nothing"
    assert not (cell / "readings.stylus2.csv").exists()
    with controller(cell, "--tcp", "127.0.0.1:0", "--stylus", "2") as url:
        second = Result("run", "-C", cell, "--stylus", "2", "--port", url, "--timeout", "10")
    assert second.code == 0, second.err
    assert (cell / "readings.csv").read_bytes() == before
    one, two = readings(cell), readings(cell, "readings.stylus2.csv")
    assert len(one) == 14 and set(one.status) == {"ok"}, "both files are read as one"
    assert one.stylus is not None and list(one.stylus) == [1] * 7 + [2] * 7
    assert list(one.touch) == list(range(1, 15))
    height = np.abs(two.position[:, 2] - one.position[:7, 2] - LONGER)
    assert height.max() < 0.5, "Z stands higher by what the stylus is longer"
    run = json.loads((cell / "readings.stylus2.json").read_text(encoding="utf-8"))
    assert run["missing"] == []
