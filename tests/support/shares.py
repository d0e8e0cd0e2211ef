"""Which tests one worker of xdist executes one after the other: those of a file with `xdist_group`, and all that need the one
LinuxCNC of this computer.

xdist's own groups ask pytest to rename a test, which pytest 9.2 no longer lets it do: they are passed over without a word.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadGroupScheduling, Scheduling

ROOT = Path(__file__).parents[2]
ONE_CONTROL = "from support.realcontrol import"  # who starts a LinuxCNC has this
GROUP = re.compile(r"^(?:pytestmark|@).*xdist_group\(\"(\w+)\"\)", re.MULTILINE)


@cache
def _of(file: Path) -> str:
    """File of tests → the share that all its tests have; none: each is one of its own."""
    text = file.read_text(encoding="utf-8") if file.exists() else ""
    found = GROUP.search(text)
    return "linuxcnc" if ONE_CONTROL in text else found[1] if found else ""


def share(test: str) -> str:
    """Test as pytest names it → what it is executed with: tests of the same share follow each other in one worker."""
    return _of(ROOT / test.partition("::")[0]) or test


class Shares(LoadGroupScheduling):
    """Tests are given out one by one, the largest share first: no other worker waits for the LinuxCNC, and it for none of them."""

    def _split_scope(self, nodeid: str) -> str:
        return share(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Scheduling | None:
    """→ the scheduler of `--dist loadgroup`; of other ways to share, xdist's own."""
    return Shares(config, log) if config.getoption("dist") == "loadgroup" else None
