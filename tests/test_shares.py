"""Who executes which tests: groups follow each other in one worker, all others are given out one by one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from support.shares import pytest_collection_modifyitems, share

TESTS = Path(__file__).parent


def test_tests_that_start_a_linuxcnc_are_one_share() -> None:
    starting = [f for f in TESTS.glob("test_*.py") if f != Path(__file__) and "with linuxcnc(" in f.read_text(encoding="utf-8")]
    assert len(starting) > 4
    assert {share(f"tests/{file.name}::test_of_it[a/b-1]") for file in starting} == {"linuxcnc"}


def test_a_file_with_a_group_is_one_share() -> None:
    grouped = [
        f for f in TESTS.glob("test_*.py") if "pytest.mark.xdist_group(" in f.read_text(encoding="utf-8") and f != Path(__file__)
    ]
    shares = {file.name: share(f"tests/{file.name}::test_of_it") for file in grouped}
    assert shares and not any("::" in each for each in shares.values()), shares


def test_tests_that_share_what_their_file_makes_once_are_one_share() -> None:
    assert (
        share("tests/test_demo.py::test_the_true_machine_is_found") == share("tests/test_demo.py::test_another[a]") == "test_demo"
    )


def test_any_other_test_is_a_share_of_its_own() -> None:
    for test in ("tests/test_link.py::test_any[a]", "tests/test_link_file.py::test_some[linuxcnc]", "tests/gone.py::test_a"):
        assert share(test) == test


def test_long_tests_come_first_and_keep_their_order_where_shares_are_given_out() -> None:
    class Item:
        def __init__(self, name: str) -> None:
            self.name = name

        def get_closest_marker(self, mark: str) -> str | None:
            return mark if self.name in {"long": "bde", "few": "ae"}[mark] else None

    for shared, order in ((True, "bdace"), (False, "abcde")):
        items = [Item(name) for name in "abcde"]
        pytest_collection_modifyitems(SimpleNamespace(option=SimpleNamespace(loadgroup=shared)), items)  # type: ignore[arg-type]
        assert "".join(item.name for item in items) == order
