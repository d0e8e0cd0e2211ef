"""Killed at every statement and around every commit, and a disk that is full: what was acknowledged is there, nothing is half."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import event, text
from support.histories import EVENTS, knowledge, record

from tango_cnc.history import Decision, History, add_compensations, compensations, opened
from tango_cnc.records import LinkError

pytestmark = pytest.mark.skipif(os.name != "posix", reason="SIGKILL and fork")
Step = Callable[[History], Any]
ALARM = {"id": "2026-10-02-1", "cause": "axis_location", "parameter": "EX0C"}
NOTHING: dict[str, Any] = {"kind": "none", "verdict": "not_measured", "touches": 0, "parameters": {}}
STEPS: tuple[Step, ...] = (
    lambda h: h.add_night(record(1), "touch\n1\n", knowledge(1)),
    lambda h: h.add_night(record(2, alarms=[ALARM], verdict="changed"), "touch\n2\n", knowledge(2)),
    lambda h: h.decide("M", Decision("2026-10-02-1", "acknowledge", "Ann", utc="2026-10-02T08:00:00Z")),
    lambda h: add_compensations(h, "M", "/cells/m", EVENTS[:1]),
    lambda h: h.add_night(record(3, status="missed", headline="no measurement: no night began", **NOTHING)),
    lambda h: h.add_night(record(4, status="refused", headline="not begun", **NOTHING)),
)


def there(history: History) -> int:
    """history → how many of the steps are in it; each is whole or not there."""
    if "M" not in history.machines():
        return 0
    nights = {n.night: n for n in history.nights("M")}
    if "2026-10-02" in nights:
        stored = history.night(nights["2026-10-02"].entry)
        assert stored.readings == "touch\n2\n" and stored.knowledge is not None and history.alarmed("M")
    return len(nights) + len(history.decisions("M")) + len(compensations(history, "M"))


def killed(place: str | Path, first: int, at: int) -> tuple[int, bool]:
    """place, first step, moment → steps that were acknowledged before the process was killed there; whether it lived to the end."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            moments = iter(range(10_000))

            def moment(*_: Any) -> None:
                if next(moments) == at:
                    os.kill(os.getpid(), signal.SIGKILL)

            with opened(place) as history:
                event.listen(history.engine, "before_cursor_execute", moment)
                event.listen(history.engine, "commit", moment)
                event.listen(history.engine, "checkin", moment)  # after the commit
                for step in STEPS[first:]:
                    step(history)
                    os.write(write, b".")
        finally:
            os._exit(0)
    os.close(write)
    done = 0
    while data := os.read(read, 100):
        done += len(data)
    os.close(read)
    return done, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.long
def test_killed_at_every_moment_nothing_acknowledged_is_lost_and_nothing_is_half(history_place: Callable[[], str | Path]) -> None:
    for_all: list[int] = []
    place, done, at, kills = history_place(), 0, 0, 0
    with opened(place):
        pass  # the schema is there before the first night
    while done < len(STEPS):
        told, lived = killed(place, done, at)
        with opened(place) as history:
            assert history.verify() == ()
            found = there(history)
        assert done + told <= found <= done + told + 1  # the last one may have been committed and not acknowledged
        for_all.append(found)
        kills += not lived
        # The same step again, killed a moment later, until it is through; then the next one from its first moment.
        at, done = (0, found) if found > done or lived else (at + 1, done)
    with opened(place) as history:
        assert there(history) == len(STEPS) and len(history.open_alarms("M")) == 0
        assert [n.status for n in history.nights("M")] == ["refused", "missed", "complete", "complete"]
    assert kills >= 5 * len(STEPS)  # every step has several statements, a commit, and what comes after it


def test_what_does_not_fit_on_a_full_disk_is_refused_whole(tmp_path: Path) -> None:
    """max_page_count: SQLite says that the disk is full as it does when the disk is."""
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(1), "touch\n1\n", knowledge(1))

        def full(connection: Any, *_: Any) -> None:
            pages = connection.execute("PRAGMA page_count").fetchone()[0]
            connection.execute(f"PRAGMA max_page_count={pages}")

        event.listen(history.engine, "checkout", full)
        many = "".join(f"{os.urandom(8).hex()}\n" for _ in range(4000))
        with pytest.raises(LinkError, match="full"):
            history.add_night(record(2), many, knowledge(2))
        event.remove(history.engine, "checkout", full)
        with history.engine.connect() as connection:
            connection.execute(text("PRAGMA max_page_count=1000000"))
        assert history.verify() == () and len(history.nights("M")) == 1
        history.add_night(record(2), many, knowledge(2))  # there is room again
        assert history.verify() == () and len(history.nights("M")) == 2


@pytest.mark.long
def test_alarms_missed_and_refused_nights_are_told_alike(history_place: Callable[[], str | Path]) -> None:
    with opened(history_place()) as history:
        told: list[Sequence[Any]] = []
        for step in STEPS:
            step(history)
            told.append(history.open_alarms("M"))
        assert [len(alarms) for alarms in told] == [0, 1, 0, 0, 0, 0]  # from its night until somebody has decided
        assert [(s.night.night, s.record["alarms"]) for s in history.alarmed("M")] == [("2026-10-02", [ALARM])]
        assert [(n.status, n.alarms, n.touches) for n in history.nights("M")] == [
            *[("refused", 0, 0), ("missed", 0, 0)],
            *[("complete", 1, 74), ("complete", 0, 74)],
        ]
        (standing,) = history.fleet("2026-10-04T06:00:00+00:00")
        assert (standing.alarms_open, standing.late, standing.nights) == (0, True, 4)
        found = history.latest_knowledge("M")
        assert found is not None and found[0].night == "2026-10-02"
        assert [r["status"] for r in history.records("M", last=2)] == ["refused", "missed"]


@pytest.mark.long
@pytest.mark.system("unshare", "mount", "pg_lsclusters")
@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_nights_on_a_real_disk_that_fills_up_say_so_and_go_on_when_there_is_room(tmp_path: Path, root: Path, database: str) -> None:
    """A file system of 70 MB; PostgreSQL refuses root, so the nights run as another user of a namespace within."""
    small = tmp_path / "small"
    small.mkdir()
    as_user = (
        f"exec unshare --user --map-user=1000 --map-group=1000 {sys.executable} -m support.fullhistory {root} {small} {database}"
    )
    command = [
        "unshare",
        "--user",
        "--map-root-user",
        "--mount",
        "sh",
        "-ec",
        f"mount -t tmpfs -o size=70m none {small}; {as_user}",
    ]
    path = os.pathsep.join([str(root / "tests"), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    before, full, still, after, kept = map(json.loads, done.stdout.splitlines())
    assert before["trouble"] is None and before["touches"]
    assert full["touches"], "the machine measured while the disk filled up"
    for told in (full, still):
        said = " ".join([told["why"], *(told["trouble"] or ())])
        assert all("No space left on device" in text or "disk is full" in text for text in (said, told["message"])), told
        assert "never measured" not in told["message"]
    assert after["status"] == "complete" and after["trouble"] is None and "is in the history now" in after["message"]
    assert kept["verify"] == [] and kept["nights"] == [told["start"] for told in (before, full, still, after)]
    assert [w for w, told in zip(kept["whole"][::-1], (before, full, still, after), strict=True) if told["touches"]].count(
        False
    ) == 0
