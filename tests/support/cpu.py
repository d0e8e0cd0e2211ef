"""Which tests cost: `pytest --cpu` prints the processor seconds of the dearest tests and the sum of each file.

Fixtures count for the test that asked first; child processes count once they have been waited for.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Generator

import pytest

SHOWN = 100


def spent() -> float:
    """→ processor seconds of this process and of the children it has waited for."""
    return sum(os.times()[:4])


class Cpu:
    """Seconds by test; workers of xdist send theirs home when they end."""

    def __init__(self) -> None:
        self.started = spent()
        self.seconds: Counter[str] = Counter()

    @pytest.hookimpl(wrapper=True)
    def pytest_collection(self) -> Generator[None, object, object]:
        before = spent()
        result = yield
        self.seconds["(collection)"] += spent() - before
        self.seconds["(start)"] += before - self.started
        return result

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        before = spent()
        result = yield
        self.seconds[item.nodeid] += spent() - before
        return result

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        output = getattr(session.config, "workeroutput", None)  # what xdist gives to a worker, and to nobody else
        if output is not None:
            output["cpu"] = dict(self.seconds)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: object) -> None:
        self.seconds.update(getattr(node, "workeroutput", {}).get("cpu", {}))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        files: Counter[str] = Counter()
        for test, seconds in self.seconds.items():
            files[test.partition("::")[0]] += seconds  # type: ignore[assignment]
        for title, table, shown in ((f"the {SHOWN} dearest tests", self.seconds, SHOWN), ("files", files, None)):
            terminalreporter.section(f"processor seconds: {title}")
            for name, seconds in table.most_common(shown):
                terminalreporter.write_line(f"{seconds:8.2f}  {name}")
        terminalreporter.write_line(f"{sum(self.seconds.values()):8.2f}  in all")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--cpu", action="store_true", help="print which tests and files cost the most processor seconds")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--cpu"):
        config.pluginmanager.register(Cpu(), "cpu")
