"""A worker tells the process that hands the tests out what somebody looks at: how each test ended, and what took long or failed.

Of five messages a test four say that nothing is the matter; who hands out spent a tenth of all processor time on them.
"""

from __future__ import annotations

from typing import Any

import pytest

LONG = 0.1  # s: a setup or teardown that may be among the slowest
SILENT = ("logstart", "logfinish")  # that a test begins and is over; what it was comes with its report


def said(name: str, message: dict[str, Any]) -> bool:
    """name of a message of xdist, what it holds → whether it is sent: how every test ended is, and all that is no plain pass."""
    if name in SILENT:
        return False
    if name != "testreport":
        return True
    report = message["data"]
    plain = report["outcome"] == "passed" and not report["sections"] and report["duration"] < LONG
    return report["when"] == "call" or not plain


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """In a worker, unless somebody wants to see every step (`-v`)."""
    if not hasattr(config, "workerinput") or config.option.verbose > 0:
        return
    (worker,) = (plugin for plugin in config.pluginmanager.get_plugins() if type(plugin).__name__ == "WorkerInteractor")
    send = worker.sendevent

    def sent(name: str, **message: Any) -> None:
        if said(name, message):
            send(name, **message)

    worker.sendevent = sent
