"""What holds for every plan that `tango design` writes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tango_cnc.design import nested, whole, worst
from tango_cnc.files import read_cell
from tango_cnc.plan import plan


def takes_the_plan(folder: Path, strategy: Path, data: Mapping[str, Any]) -> None:
    """cell, strategy designed for five minutes, its --json → nothing; the cell has the strategy now, and it plans as told."""
    assert data["time_s"] <= 300 and 0 < data["certificate"]["efficiency"] <= 1
    assert data["certificate"]["efficiency"] < data["certificate"]["efficiency_at_these_indexations"] <= 1
    of_cell = folder / "tango.yaml"
    of_cell.write_text(of_cell.read_text(encoding="utf-8").replace("strategy.yaml", str(strategy)), encoding="utf-8")
    made = plan(read_cell(folder))
    assert len(made.touches) == data["touches"] and not made.left_out
    first, last = made.strategy.indexations[0], made.strategy.indexations[-1]
    assert first.position == last.position and set(last.facets) <= set(first.facets)


def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search with few exchanges at random, and of one part of the time beside the whole.

    Its plan is worth some percent less. What a plan promises, and what a refusal says, holds for such a plan, too.
    """
    monkeypatch.setattr(worst, "UNSTICK", 6)
    monkeypatch.setattr(worst, "LEVELS", 4)
    monkeypatch.setattr(whole, "MOST_SHAKES", whole.LEAST_SHAKES)
    monkeypatch.setattr(nested, "FRACTIONS", (0.75,))
