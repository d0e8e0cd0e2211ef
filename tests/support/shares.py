"""Which tests one worker of xdist executes one after the other: those of a file with `xdist_group`, those that share what their
file has made once (a fixture of the module), and all that need the one LinuxCNC of this computer.

xdist's own groups ask pytest to rename a test, which pytest 9.2 no longer lets it do: they are passed over without a word.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadGroupScheduling, Scheduling
from xdist.workermanage import WorkerController

ROOT = Path(__file__).parents[2]
ONE_CONTROL = "from support.realcontrol import"  # who starts a LinuxCNC has this
ONCE = 'scope="module"'  # given out one by one, its tests would make every worker make it
CONTROL = "linuxcnc"
NETWORK = "network"  # sessions over real servers, which wait most of their time: beside them there is work for two cores
GROUP = re.compile(r"^(?:pytestmark|@).*xdist_group\(\"(\w+)\"\)", re.MULTILINE)


@cache
def _of(file: Path) -> str:
    """File of tests → the share that all its tests have; none: each is one of its own."""
    text = file.read_text(encoding="utf-8") if file.exists() else ""
    found = GROUP.search(text)
    if ONE_CONTROL in text:
        return CONTROL
    return found[1] if found else file.stem if ONCE in text else ""


def share(test: str) -> str:
    """Test as pytest names it → what it is executed with: tests of the same share follow each other in one worker."""
    return _of(ROOT / test.partition("::")[0]) or test


class Shares(LoadGroupScheduling):
    """First the LinuxCNC, which takes its time whatever the computer does, and behind it the network; then the largest share, in
    the end single tests.

    So nobody waits at the end for a share that has just begun. One worker waits, for the control first and for the network then,
    as long as there is something to compute for the others: two that wait at a time leave a core idle.
    Of the single tests the long ones come first: in the end there are many short ones to share, those of which the default run has
    few among them.
    """

    def _split_scope(self, nodeid: str) -> str:
        return share(nodeid)

    def mark_test_complete(self, node: WorkerController, item_index: int, duration: float = 0) -> None:
        """As xdist does, which goes through all that a worker was ever given after each test of thousands: what is done goes."""
        given = self.assigned_work[node]
        test = self.registered_collections[node][item_index]
        super().mark_test_complete(node, item_index, duration)
        if all(given[share(test)].values()):
            del given[share(test)]

    def _assign_work_unit(self, node: WorkerController) -> None:
        elsewhere = any(CONTROL in given for other, given in self.assigned_work.items() if other is not node)
        for first, last in ((NETWORK, elsewhere), (CONTROL, False)):
            if first in self.workqueue:
                self.workqueue.move_to_end(first, last=last)
        super()._assign_work_unit(node)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Scheduling | None:
    """→ the scheduler of `--dist loadgroup`; of other ways to share, xdist's own."""
    return Shares(config, log) if config.getoption("dist") == "loadgroup" else None


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The long tests first, where shares are given out one after the other."""
    if getattr(config.option, "loadgroup", False):  # what xdist tells its workers
        items.sort(key=lambda item: item.get_closest_marker("long") is None or item.get_closest_marker("few") is not None)
