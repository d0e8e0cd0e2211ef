"""The same trials on a cluster of two worker processes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.records import LinkError
from tango_cnc.uncertainty.fleet import cluster

WANTED = "needs the extra 'fleet' (pip install tango-cnc[fleet])"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    distributed = pytest.importorskip("distributed", reason=WANTED)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1", silence_logs=50
        ) as own,
    ):
        yield own.scheduler_address


def call(*args: object) -> int:
    return guarded(tango.main, [str(a) for a in args], standalone_mode=False)


@pytest.mark.long
def test_two_workers_give_the_numbers_of_one_process(address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    assert call("simulate", "-C", cell) == 0
    capsys.readouterr()
    found = []
    for options in ([], ["--dask", address]):
        assert call("uncertainty", "-C", cell, "--trials", 5000, "--json", "-", *options) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert found[0]["parameters"].keys() == found[1]["parameters"].keys()
    # Another number of cores may sum a product of matrices in another order; the trials are the same.
    for name, one in found[0]["parameters"].items():
        assert found[1]["parameters"][name]["interval"] == pytest.approx(one["interval"], rel=1e-6)


@pytest.mark.long
def test_the_work_is_done_by_both_workers(address: str) -> None:
    with cluster(address) as spread:
        import os

        pids = set(spread(_where, range(40)))
        assert len(pids) == 2 and os.getpid() not in pids


def _where(_: int) -> int:
    import os
    import time

    time.sleep(0.05)
    return os.getpid()


@pytest.mark.long
def test_nobody_answers() -> None:
    pytest.importorskip("distributed", reason=WANTED)
    with pytest.raises(LinkError, match="no scheduler answers"), cluster("tcp://127.0.0.1:9", timeout=0.3):
        pass
    assert call("uncertainty", "-C", "nowhere", "--dask", "tcp://127.0.0.1:9") == 2
