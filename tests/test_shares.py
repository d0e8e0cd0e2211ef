"""Who executes which tests: groups follow each other in one worker, all others are given out one by one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from support.shares import Shares, pytest_collection_modifyitems, share

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


class Worker:
    """What the scheduler asks of a worker of xdist: numbers of tests, in the order in which they were given."""

    shutting_down = False

    def __init__(self) -> None:
        self.given: list[int] = []
        self.gateway = SimpleNamespace(id="gw")

    def send_runtest_some(self, indices: list[int]) -> None:
        self.given += indices

    def shutdown(self) -> None:
        self.shutting_down = True


def test_who_has_waited_for_the_control_waits_for_the_network_and_the_others_compute(
    pytestconfig: pytest.Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = {"computes": 12, "network": 4, "linuxcnc": 5}
    tests = [f"{kind}.py::test_{n}" for kind, many in kinds.items() for n in range(many)]
    monkeypatch.setattr("support.shares.share", lambda test: test if test.startswith("computes") else test.partition(".")[0])
    monkeypatch.setattr(pytestconfig.option, "tx", ["popen"] * 3)
    monkeypatch.setattr(pytestconfig.option, "loadscopereorder", True)
    workers = [Worker() for _ in range(3)]
    scheduler = Shares(pytestconfig)
    for worker in workers:
        scheduler.add_node(worker)  # type: ignore[arg-type]
        scheduler.add_node_collection(worker, tests)  # type: ignore[arg-type]
    scheduler.schedule()
    done = [0, 0, 0]
    while sum(done) < len(tests):
        for number, worker in enumerate(workers):  # each as fast as the others
            if done[number] < len(worker.given):
                scheduler.mark_test_complete(worker, worker.given[done[number]])  # type: ignore[arg-type]
                done[number] += 1
    order = [[tests[at].partition(".")[0] for at in worker.given] for worker in workers]
    assert order == [["linuxcnc"] * 5 + ["network"] * 4, ["computes"] * 6, ["computes"] * 6]
