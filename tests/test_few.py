"""Of many cases that fail together the default run has a few, and others for each test."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from support import few
from support.few import chosen, concerns, pytest_collection_modifyitems


class Item:
    """A test as pytest has it collected, as far as choosing goes."""

    def __init__(self, nodeid: str, *marks: pytest.MarkDecorator) -> None:
        self.nodeid, self.marks = nodeid, {m.name: m.mark for m in marks}

    def get_closest_marker(self, name: str) -> pytest.Mark | None:
        return self.marks.get(name)

    def add_marker(self, name: str) -> None:
        self.marks[name] = getattr(pytest.mark, name).mark


def by_default(*items: Item) -> list[str]:
    pytest_collection_modifyitems(items)  # type: ignore[arg-type]
    return [item.nodeid for item in items if "long" not in item.marks]


def test_as_many_cases_as_stated_stay_and_lie_apart() -> None:
    for count in range(1, 15):
        kept = sorted(chosen("test_of_dialects", 14, count))
        assert len(kept) == count
        assert min((b - a) % 14 or 14 for a, b in zip(kept, [*kept[1:], kept[0]], strict=True)) >= 14 // count


def test_who_has_no_more_cases_than_that_keeps_all() -> None:
    assert chosen("test_any", 3, 3) == chosen("test_any", 3, 4) == {0, 1, 2}


def test_other_tests_of_the_same_cases_have_others() -> None:
    assert set().union(*(chosen(f"test_{i}", 14, 1) for i in range(200))) == set(range(14))


def test_what_is_not_kept_is_long_and_other_tests_stay() -> None:
    cases = [Item(f"tests/test_a.py::test_b[{i}]", pytest.mark.few(2)) for i in range(6)]
    kept = by_default(Item("tests/test_a.py::test_c"), *cases, Item("tests/test_a.py::test_d", pytest.mark.long))
    assert kept[0] == "tests/test_a.py::test_c" and len(kept) == 3
    assert by_default(Item("tests/test_a.py::test_slow", pytest.mark.few(0))) == []


def test_a_case_that_is_long_anyway_is_none_of_the_few() -> None:
    cases = [Item(f"tests/test_a.py::test_b[{i}]", pytest.mark.few(2), *[pytest.mark.long] * (i > 1)) for i in range(9)]
    assert by_default(*cases) == ["tests/test_a.py::test_b[0]", "tests/test_a.py::test_b[1]"]


def test_all_cases_of_a_plug_in_that_somebody_is_adding_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(few, "new", lambda: frozenset({"hurco"}))
    cases = [Item(f"tests/test_a.py::test_b[{name}-{i}]", pytest.mark.few(0)) for name in ("fanuc", "hurco") for i in range(3)]
    assert by_default(*cases) == [f"tests/test_a.py::test_b[hurco-{i}]" for i in range(3)]


def test_the_slow_cases_of_a_plug_in_that_somebody_is_adding_can_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """`-k facets` ran a hundred tests of others, whose names have this word."""
    monkeypatch.setattr(few, "new", lambda: frozenset({"facets"}))
    items = [Item(f"tests/test_a.py::test_of_facets[{name}-8]", pytest.mark.long) for name in ("fanuc", "facets")]
    by_default(Item("tests/test_a.py::test_facets"), *items)
    assert ["new" in item.marks for item in items] == [False, True]


@pytest.mark.parametrize(("main", "new"), [("main", {"committed", "added", "untracked"}), ("trunk", {"added", "untracked"})])
def test_a_plug_in_that_the_main_branch_has_not_is_new(tmp_path: Path, main: str, new: set[str]) -> None:
    """Who committed their post before the first default run had none of its cases there."""
    for file in ("posts/known.py", "posts/committed.py", "posts/added.py", "posts/untracked.py", "tests/test_c.py"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("", encoding="utf-8")
    who = ["-c", "user.name=a", "-c", "user.email=a@b"]
    commit = [*who, "commit", "-q", "-m", "one"]
    for command in (
        *(["init", "-q", "-b", main], ["add", "posts/known.py"], commit, ["checkout", "-q", "-b", "mine"]),
        *(["add", "posts/committed.py"], commit, ["add", "posts/added.py"]),
    ):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    assert few.new(tmp_path) == new
    assert concerns("tests/test_a.py::test_b[added-8]", few.new(tmp_path))
    assert not concerns("tests/test_a.py::test_b[known-8]", few.new(tmp_path))


TESTS = Path(__file__).parent
# Whole sessions, commands and campaigns, of which no test is quick.
WHOLE = """
    acceptance_further best_judge compensate_description compensate_program compensate_short compensate_verdicts
    compensate_walk demo design_broken_off design_full_run diagnose_blind dialects exclude_outliers
    grblhal_commission history_import hostile_texts iso230_exact iso230_reversal link_9600
    link_campaign link_dropped link_ethernet link_kills link_same_parameters linuxcnc_commission
    linuxcnc_compensated linuxcnc_kinematics linuxcnc_starved linuxcnc_whole main_job night_doubt
    night_in_control night_within nightly_refusing_disk night_scatter plan_long plausible_copied plausible_either
    plausible_midway program_stylus repeated_varies run_simulated run_stylus serve_abuse serve_attacks
    serve_browser serve_eyes_and_keys serve_routes tests_notice uncertainty_coverage
    uncertainty_fleet
"""


def test_every_file_has_a_default_test_or_is_said_to_have_none() -> None:
    """What is moved to CI leaves somebody behind, who is asked by default."""
    without = set()
    for file in TESTS.rglob("test_*.py"):
        text = file.read_text(encoding="utf-8")
        tests = re.findall(r"^((?:@.*\n(?:[ )\]].*\n)*)*)def test_", text, re.MULTILINE)
        later = [re.search(r"^@pytest\.mark\.(long|campaign|few\(0\))", marks, re.MULTILINE) for marks in tests]
        if all(later) or re.search(r"^pytestmark = .*\.(long|campaign)\b", text, re.MULTILINE):
            without.add(file.stem.removeprefix("test_"))
    assert without == set(WHOLE.split())
