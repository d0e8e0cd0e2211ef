"""A mistake in the cell is found at night: somebody hears of it, it is on record, and what waits is sent all the same."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from click.testing import CliRunner
from support.controls import GOLDEN
from support.histories import knowledge, record
from support.nights_parts import Nobody, RealDisk, Time, machine_of, settings_of

from tango_cnc.cli import tango
from tango_cnc.files import read_cell
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import History, opened
from tango_cnc.nightly import Measured, Ports, PreflightPoint, night
from tango_cnc.nightly.notify import Notifier
from tango_cnc.nightly.ports import Busy
from tango_cnc.records import LinkError, Readings

SETTINGS = "nightly: 1\nowner: Ann Meier\nnotify: ['file://{board}', mailto:ann@shop.example?smtp=127.0.0.1:9]\n"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(GOLDEN, tmp_path / "cell")
    (tmp_path / "cell" / "nightly.yaml").write_text(SETTINGS.format(board=tmp_path / "board.txt"), encoding="utf-8")
    return tmp_path / "cell"


def spoil(cell: Path, name: str, old: str, new: str) -> None:
    file = cell / name
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("machine.yaml", "tip_radius", "tip_radios"), ("nightly.yaml", "owner: Ann Meier", "owner: Ann Meier\nlimit: 3")],
)
def test_somebody_hears_of_a_mistake_in_the_cell_and_the_night_is_on_record(
    cell: Path, tmp_path: Path, name: str, old: str, new: str
) -> None:
    spoil(cell, name, old, new)
    found = CliRunner().invoke(tango, ["nightly", "-C", str(cell)])
    assert found.exit_code != 0
    told = (tmp_path / "board.txt").read_text(encoding="utf-8")
    assert "NOT MEASURED" in told and name in told and new.split("\n")[-1].split(":")[0] in told and "owner: Ann Meier" in told
    with opened(cell / "history.db", create=False) as history:
        (night,) = history.nights()
        assert (night.status, night.verdict) == ("failed", "not_measured") and name in night.headline
        assert history.verify() == ()
    (waiting,) = (cell / "nights" / "outbox").glob("*.txt")  # nobody answers at port 9
    tell = CliRunner().invoke(tango, ["nightly", "-C", str(cell), "--tell"], standalone_mode=False)
    assert tell.return_value == 3 and "not sent" in tell.output and waiting.exists()
    status = CliRunner().invoke(tango, ["nightly", "-C", str(cell), "--status"], standalone_mode=False)
    assert status.return_value == 1 and "no night can begin" in status.output and "not sent yet" in status.output


def test_a_cell_that_cannot_be_read_leaves_no_night_among_those_of_another_machine(cell: Path, tmp_path: Path) -> None:
    """Two folders with one name in one history: the message is sent, and the history of the other machine stays as it is."""
    shared = SETTINGS.format(board=tmp_path / "board.txt") + "history: ../fleet.db\n"
    (cell / "nightly.yaml").write_text(shared, encoding="utf-8")
    other = tmp_path / "other"
    shutil.copytree(cell, other)
    spoil(cell, "machine.yaml", "tip_radius", "tip_radios")
    name = read_cell(other).machine.name
    with opened(tmp_path / "fleet.db") as history:
        history.add_night(record(1, name, cell=str(other)))
        assert CliRunner().invoke(tango, ["nightly", "-C", str(cell)]).exit_code != 0
        assert len(history.nights(name)) == 1
    told = (tmp_path / "board.txt").read_text(encoding="utf-8")
    assert "tip_radios" in told and "not in the history" in told and str(other) in told


def test_a_night_says_that_the_triggers_of_its_history_are_gone(cell: Path, tmp_path: Path) -> None:
    spoil(cell, "machine.yaml", "tip_radius", "tip_radios")
    with opened(cell / "history.db"):
        pass
    with closing(sqlite3.connect(cell / "history.db")) as plain:
        plain.execute("DROP TRIGGER night_no_delete")
        plain.commit()
    CliRunner().invoke(tango, ["nightly", "-C", str(cell)])
    told = (tmp_path / "board.txt").read_text(encoding="utf-8")
    assert "what it holds of night: somebody has taken its triggers out" in told


def test_a_history_that_cannot_be_opened_is_told(cell: Path, tmp_path: Path) -> None:
    (cell / "history.db").write_bytes(b"these are notes, and no database at all" * 30)
    CliRunner().invoke(tango, ["nightly", "-C", str(cell)])
    told = (tmp_path / "board.txt").read_text(encoding="utf-8")
    assert "NOT MEASURED" in told and "history.db" in told


def test_a_folder_that_is_no_cell_is_left_alone(tmp_path: Path) -> None:
    assert CliRunner().invoke(tango, ["nightly", "-C", str(tmp_path)]).exit_code != 0
    assert list(tmp_path.iterdir()) == []


def test_what_can_be_read_of_a_spoilt_nightly_yaml_is_who_is_told(tmp_path: Path) -> None:
    (tmp_path / "nightly.yaml").write_text(
        "nightly: 1\nowner: 'Ann'\nnotify:\n  - mailto:ann@x?smtp=y:25\n  - https://hooks.x/m  # ours\n"
        "# - mqtt://old/one\nlimits: {volume: }}\n",
        encoding="utf-8",
    )
    settings, wrong = settings_of(tmp_path)
    assert wrong is not None and settings.owner == "Ann"
    assert settings.notify == ("mailto:ann@x?smtp=y:25", "https://hooks.x/m")
    (tmp_path / "machine.yaml").write_text("machine: 1\nname: Mill 7 # the old one\naxes: [\n", encoding="utf-8")
    assert machine_of(tmp_path, ("Mill 7", "Mill 8")) == "Mill 7" and machine_of(tmp_path, ("Mill 9",)) == "Mill 9"


class ReadOnly(History):
    """A history on a disk that may be read and not be written."""

    def add_night(self, record: Any, readings: Any = None, knowledge: Any = None) -> int:
        """Raises LinkError."""
        raise LinkError("history: it could not be written (attempt to write a readonly database)")


@dataclass(frozen=True)
class Four:
    """Four touches, and an analysis that believes them."""

    def preflight(self, kind: str, touches: Any) -> Any:
        """→ all is well."""
        return (PreflightPoint("control", True, "idle"),)

    def measure(self, kind: str, touches: Any) -> Measured:
        """→ four touches."""
        return Measured(cast(Readings, range(4)), "touch\n1\n2\n3\n4\n", 4, 20.0)

    def choice(self, past: Any, day: float) -> Any:
        """→ a check."""
        return "check", "nothing is too uncertain", ()

    def analysed(self, past: Any, day: float, kind: str, measured: Measured) -> Any:
        """→ a good night."""
        parameters = {"EX0C": {"value": 0.001, "std": 0.0002, "unit": "mm"}}
        return {"verdict": "good", "alarms": [], "parameters": parameters}, knowledge(3), {}


def test_a_night_that_the_history_did_not_take_is_added_by_the_next_one(tmp_path: Path) -> None:
    disk, four = RealDisk(tmp_path), Four()

    def one(day: int, history: History) -> dict[str, Any]:
        clock = Time(datetime(2026, 10, day, 2, tzinfo=UTC))
        return night("M", str(tmp_path), Nightly(), Ports(clock, disk, four, Nobody(), history, four, nullcontext()))

    with opened(tmp_path / "history.db") as history:
        one(1, history)
        refused = one(2, ReadOnly(history.engine))
        assert "the next night adds it" in refused["trouble"][0] and len(history.nights("M")) == 1
        assert "unmeasured" not in one(3, history)
        assert [(n.night, n.status, n.touches) for n in history.nights("M")] == [
            ("2026-10-03", "complete", 4),
            ("2026-10-02", "complete", 4),
            ("2026-10-01", "complete", 4),
        ]
        stored = history.night(history.nights("M")[1].entry)
        assert stored.readings == "touch\n1\n2\n3\n4\n" and stored.knowledge is not None
        assert (stored.knowledge.covariance == knowledge(3).covariance).all()
        assert history.verify() == () and not list((tmp_path / "nights" / "begun").iterdir())


class Mistaken(Four):
    """An analysis with a mistake in it."""

    def analysed(self, past: Any, day: float, kind: str, measured: Measured) -> Any:
        """Raises what nobody expects."""
        return np.linalg.cholesky(-np.eye(2)), None, {}


class Lost(Four):
    """A machine whose driver has a mistake in it."""

    def measure(self, kind: str, touches: Any) -> Measured:
        """Raises what nobody expects."""
        raise ZeroDivisionError("division by zero")


@pytest.mark.few(1)
@pytest.mark.parametrize(("four", "verdict", "touches"), [(Mistaken(), "doubtful", 4), (Lost(), "not_measured", 0)])
def test_a_mistake_of_the_program_loses_no_readings_and_no_message(tmp_path: Path, four: Four, verdict: str, touches: int) -> None:
    disk, board = RealDisk(tmp_path), tmp_path / "board.txt"
    with opened(tmp_path / "history.db") as history:
        clock, mail = Time(datetime(2026, 10, 1, 2, tzinfo=UTC)), Notifier((f"file://{board}",))
        record = night("M", str(tmp_path), Nightly(), Ports(clock, disk, four, mail, history, four, nullcontext()))
        (kept,) = history.nights("M")
        assert (kept.verdict, kept.touches, record["verdict"]) == (verdict, touches, verdict)
        assert (history.night(kept.entry).readings is not None) == bool(touches) and history.verify() == ()
    said = board.read_text(encoding="utf-8")
    assert "a mistake of this program stopped it" in said and "please report it" in said


def test_a_mistake_before_the_night_has_begun_is_told_too(cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tango_yaml = cell / "tango.yaml"
    tango_yaml.write_text(
        tango_yaml.read_text(encoding="utf-8").replace("post: fanuc", "post: fanuc, port: 'socket://127.0.0.1:9'")
    )
    monkeypatch.setattr("tango_cnc.commands._cell_nights.timed", lambda made: 1 / 0)
    assert isinstance(CliRunner().invoke(tango, ["nightly", "-C", str(cell)]).exception, ZeroDivisionError)
    assert "ZeroDivisionError" in (tmp_path / "board.txt").read_text(encoding="utf-8")


@dataclass(frozen=True)
class October:
    """Nights of one folder with a message each, on days of October."""

    folder: Path
    history: History

    def one(self, day: int, history: History | None = None, lock: Any = None) -> dict[str, Any]:
        """day, history, lock → the record of that night."""
        clock, mail = Time(datetime(2026, 10, day, 2, tzinfo=UTC)), Notifier((f"file://{self.folder / f'{day}.txt'}",))
        past, four = history or self.history, Four()
        world = Ports(clock, RealDisk(self.folder), four, mail, past, four, lock or nullcontext())
        return night("M", str(self.folder), Nightly(), world)

    def statuses(self) -> list[str]:
        """→ date and status of every night on record, oldest first."""
        return [f"{n.night} {n.status}" for n in reversed(self.history.nights("M"))]


@contextmanager
def taken() -> Iterator[None]:
    """→ a folder in which a program is at work."""
    raise Busy("'tango run' is at work in this folder", "'tango run'")
    yield


def test_a_refused_night_names_what_the_next_one_puts_on_record(tmp_path: Path) -> None:
    """It has not the lock: a mark may be that of the night at work, and one of tonight's date is nobody's business."""
    disk = RealDisk(tmp_path)
    with opened(tmp_path / "history.db") as history:
        nights = October(tmp_path, history)
        nights.one(1)
        disk.begin("2026-10-02T020000Z", "2026-10-02T02:00:00Z")  # cut off; on the third no night begins
        disk.begin("2026-10-04T015959Z", "2026-10-04T01:59:59Z")  # at work
        refused = nights.one(4, lock=taken())
        assert nights.statuses() == ["2026-10-01 complete", "2026-10-04 refused"] and len(disk.unfinished()) == 2
        assert [text[:10] for text in refused["left_behind"]] == ["2026-10-02", "2026-10-03"]
        assert refused["unmeasured"] == refused["left_behind"]
        said = (tmp_path / "4.txt").read_text(encoding="utf-8")
        assert "* 2026-10-02: a night began and is not on record. If it is not the one at work, it was cut off" in said
        assert "* 2026-10-03: no night is on record" in said and "2026-10-04: a night began" not in said
        disk.ended("2026-10-04T015959Z")
        after = nights.one(5)
        on_record = ["1 complete", "2 failed", "3 missed", "4 refused", "5 complete"]
        assert nights.statuses() == [f"2026-10-0{text}" for text in on_record] and not disk.unfinished()
        assert [text[:10] for text in after["unmeasured"]] == ["2026-10-02", "2026-10-03", "2026-10-04"]
        assert "left_behind" not in after and history.verify() == ()


def test_a_night_whose_history_refuses_names_the_nights_that_are_missing(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        nights, read_only = October(tmp_path, history), ReadOnly(history.engine)
        nights.one(1)
        assert nights.one(3, read_only)["unmeasured"] == ["2026-10-02: no night is on record"]
        assert "* 2026-10-02: no night is on record" in (tmp_path / "3.txt").read_text(encoding="utf-8")
        assert [text[:10] for text in nights.one(4)["unmeasured"]] == ["2026-10-02", "2026-10-03"]
        assert nights.statuses() == [f"2026-10-0{text}" for text in ("1 complete", "2 missed", "3 failed", "4 complete")]


def test_a_result_that_waits_is_no_night_without_a_measurement(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        nights, read_only = October(tmp_path, history), ReadOnly(history.engine)
        nights.one(1)
        nights.one(2, read_only)
        waiting = nights.one(3, read_only)
        assert "unmeasured" not in waiting and waiting["left_behind"][0].startswith("2026-10-02: it measured, and the history")
        assert waiting["left_behind"][0] in (tmp_path / "3.txt").read_text(encoding="utf-8")
        nights.one(4)
        assert nights.statuses() == [f"2026-10-0{text}" for text in ("1 complete", "2 complete", "3 failed", "4 complete")]
