"""Two nights at once: the second one disturbs nothing, is on record as refused, and somebody hears who was at work."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from click.testing import CliRunner
from support.controls import GOLDEN
from support.histories import knowledge, record
from support.nights import night

from tango_cnc.cli import tango
from tango_cnc.commands import _night_world as world
from tango_cnc.files import read_cell
from tango_cnc.history import opened
from tango_cnc.nightly import Ports
from tango_cnc.nightly.dates import night_of, since
from tango_cnc.nightly.night import known_before

HOLD = """
import sys
from pathlib import Path
from tango_cnc.link.lock import holding
with holding(Path(sys.argv[1]), "tango nightly"):
    print("held", flush=True)
    sys.stdin.read()
"""
TWO = datetime(2026, 11, 23, 2, 0, 0, tzinfo=UTC)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(GOLDEN, tmp_path / "cell")
    tango_yaml = tmp_path / "cell" / "tango.yaml"
    tango_yaml.write_text(
        tango_yaml.read_text(encoding="utf-8").replace("post: fanuc", "post: fanuc, port: 'socket://127.0.0.1:9'"), encoding="utf-8"
    )
    board = f"nightly: 1\nowner: Ann Meier\nnotify: ['file://{tmp_path}/board.txt']\n"
    (tmp_path / "cell" / "nightly.yaml").write_text(board, encoding="utf-8")
    return tmp_path / "cell"


@contextmanager
def held(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """→ another program that is at work in the folder."""
    with subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stdout.readline() == b"held\n"
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.long
def test_the_second_night_is_refused_on_record_and_told(cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world, "RealClock", lambda: SimpleNamespace(now=lambda: TWO))
    own = world.RealDisk(cell)  # that of the night at work, which began in the same second
    own.begin("2026-11-23T020000Z", "2026-11-23T02:00:00Z")
    own.post("2026-11-23T020000Z", "its own message\n")
    with held(cell) as process:
        for _ in range(2):
            found = CliRunner().invoke(tango, ["nightly", "-C", str(cell)], standalone_mode=False)
            assert found.return_value == 3
    told = (tmp_path / "board.txt").read_text(encoding="utf-8")
    assert "not begun, the folder is in use (2026-11-23)" in told and f"'tango nightly' (process {process.pid}" in told
    assert "it was not disturbed" in told and "owner: Ann Meier" in told and "sends a message of its own" in told
    assert "delete" not in told and "NOT MEASURED" not in told
    with opened(cell / "history.db", create=False) as history:
        assert [(n.status, n.kind, n.verdict, n.touches) for n in history.nights()] == [("refused", "none", "not_measured", 0)] * 2
        assert history.verify() == ()
    assert [stamp for stamp, _ in own.unfinished()] == ["2026-11-23T020000Z"]  # a power cut of the other one would still show
    pages = [file.parent.name for file in cell.glob("nights/*/morning.html")]
    assert len(set(pages)) == 2 and all(re.fullmatch(r"2026-11-23T020000Z-refused-\d{6}", name) for name in pages)
    page = next(cell.glob("nights/*-refused-*/morning.html")).read_text(encoding="utf-8")
    assert "sends a message of its own" in page and "at work in this folder" in page
    assert len(list(cell.glob("nights/*-refused-*/morning.inch.html"))) == 2  # pages in inch show that one
    assert len(list((cell / "nights" / "sent").glob("*-refused-*"))) == 2


def test_a_refused_night_hides_no_measurement(tmp_path: Path) -> None:
    refused: dict[str, Any] = {"status": "refused", "kind": "none", "verdict": "not_measured", "touches": 0, "parameters": {}}
    with opened(tmp_path / "history.db") as history:
        refused |= {"start_utc": "2026-10-03T02:00:05Z", "end_utc": "2026-10-03T02:00:06Z"}
        history.add_night(record(3, headline="not begun", **refused))
        history.add_night(record(3), "touch\n1\n", knowledge(3))  # it ended later
        (standing,) = history.fleet("2026-10-03T06:00:00+00:00")
        assert standing.last is not None and standing.last.verdict == "good" and not standing.late
        assert "unmeasured" not in known_before("M", cast(Ports, SimpleNamespace(past=history)))
        assert since(history, "M", 20727.083 + 3).words == "last night"


@pytest.mark.long
def test_what_the_history_refuses_is_added_by_the_next_night_though_nothing_had_begun(cell: Path) -> None:
    (cell / "history.db").write_bytes(b"these are notes, and no database at all" * 30)
    CliRunner().invoke(tango, ["nightly", "-C", str(cell)])
    (cell / "history.db").unlink()
    CliRunner().invoke(tango, ["nightly", "-C", str(cell)])
    with opened(cell / "history.db", create=False) as history:
        assert [n.status for n in history.nights()] == ["failed", "failed"]
        assert "no database" in history.nights()[1].headline or "history.db" in history.nights()[1].headline


@pytest.mark.long
def test_a_night_that_was_neither_kept_nor_told_is_told_by_the_next_one(cell: Path, tmp_path: Path) -> None:
    """Disk full and mail down at once: only the mark is left. Where a message waits, the night was just cut off."""
    disk = world.RealDisk(cell)
    now = datetime.now(UTC)
    lost, cut_off = (now.replace(hour=2, minute=0, second=0) - timedelta(days=days) for days in (3, 2))
    for begun in (lost, cut_off):
        disk.begin(f"{begun:%Y-%m-%dT%H%M%SZ}", f"{begun:%Y-%m-%dT%H:%M:%SZ}")
    disk.write(f"{cut_off:%Y-%m-%dT%H%M%SZ}", "readings.csv", "touch\n")
    CliRunner().invoke(tango, ["nightly", "-C", str(cell)])
    told = (tmp_path / "board.txt").read_text(encoding="utf-8")
    said = f"{night_of(lost.astimezone())}: not measured: the night left neither a result nor a message that waits"
    assert said in told and "a full disk" in told
    assert f"every touch had been made and is in nights/{cut_off:%Y-%m-%dT%H%M%SZ}/readings.csv, and nothing" in told
    with opened(cell / "history.db", create=False) as history:
        assert [n.status for n in history.nights()][-2:] == ["failed", "failed"] and history.verify() == ()
    assert not disk.unfinished()


@pytest.mark.long
def test_the_page_of_a_night_that_did_not_measure_knows_the_one_before(cell: Path) -> None:
    with opened(cell / "history.db") as history:
        name = read_cell(cell).machine.name
        history.add_night(night(name, 0, **{"touches": 74}))
    CliRunner().invoke(tango, ["nightly", "-C", str(cell)])
    page = next(cell.glob("nights/*/morning.html")).read_text(encoding="utf-8")
    first = page.partition("For the engineer")[0]
    assert "Sat 24 Oct 2026" in first and "Nobody knows" in first and "never measured" not in page  # it is too long ago


def test_a_night_refused_for_its_name_is_not_kept_in_the_history_of_the_cell_that_has_the_name(tmp_path: Path) -> None:
    """The sound cell was called not measured, minutes after its own good night."""
    for name in ("one", "two"):
        shutil.copytree(GOLDEN, tmp_path / name)
        (tmp_path / name / "nightly.yaml").write_text("nightly: 1\nhistory: ../fleet.db\n", encoding="utf-8")
    own = read_cell(tmp_path / "one").machine.name
    with opened(tmp_path / "fleet.db") as history:
        history.add_night(record(1, own, cell=str(tmp_path / "one")))
        before = history.newest_hashes()
    found = CliRunner().invoke(tango, ["nightly", "-C", str(tmp_path / "two")], standalone_mode=False)
    assert found.return_value == 3 and "NOT MEASURED" in found.output and str(tmp_path / "one") in found.output
    with opened(tmp_path / "fleet.db", create=False) as history:
        assert history.newest_hashes() == before and history.verify() == ()
    assert not list((tmp_path / "two" / "nights").glob("*/unkept.json"))
