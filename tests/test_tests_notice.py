"""Mistakes that `make mutants` counts apart, as they change nothing: each can be made, at one place, and has a reason."""

from __future__ import annotations

import importlib
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.long
def test_what_is_said_to_change_nothing_can_be_made_at_one_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    listed, tool = (importlib.import_module(name) for name in ("changes_nothing", "mutants"))
    files = {file for file, _, _ in listed.NOTHING}
    areas = {area: folder for area, (folder, _) in tool.AREAS.items()}
    made = Counter(
        (m.file, m.old, m.new)
        for file in files
        for area, folder in areas.items()
        if file.startswith(f"{folder}/")
        for m in tool.mutants(area, ROOT / file)
    )
    wrong = {entry: made[entry] for entry in listed.NOTHING if made[entry] != 1}
    assert not wrong, f"benchmarks/changes_nothing.py: take these away, or write the code so that each stands once: {wrong}"
    assert all(reason for reason in listed.NOTHING.values())
