"""Whole nights of `tango nightly` at a simulated control, on a disk that refuses a call that writes, and what is wrong afterwards.

The control is a process of its own behind a line that counts what is sent to it. The history is a file of SQLite, whose own calls
are refused as well. One receiver is a file, one a mail server. A trial is two nights: the one that meets the disk, and the next.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import shutil
import socket
import socketserver
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from email import message_from_bytes, policy
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import yaml

from support.nights_parts import RealDisk
from support.refusingdisk import SHORT, Call, Disk, refusing
from support.refusingsqlite import refusing_sqlite
from support.runs import Result
from tango_cnc.commands.init import write_example
from tango_cnc.history import History, opened
from tango_cnc.link.lock import NAME as LOCK
from tango_cnc.program import write
from tango_cnc.records import LinkError

KINDS = ("first", "check", "unkept", "cut off")  # new cell; after a night; after one that the history did not take; one that died
NUMBER = {"first": 0, "check": 1, "unkept": 2, "cut off": 2}  # of the night that meets the disk
FACETS = (10, 11, 14, 16, 21, 22)
FIRST = datetime(2026, 11, 23, 2, 0, tzinfo=UTC)
HOW = ("once", "from then on", "half is taken")
ERRORS = (errno.ENOSPC, errno.EIO, errno.EROFS)
SQLITE = ("database or disk is full", "disk I/O error", "unable to open database file")  # its own words
# What a night does without, and what it takes away or moves when all is kept: nothing need be said.
HARMLESS = {
    ("unlink", "link/measure.py:_finish"),
    ("unlink", "link/lock.py:_released"),
    ("unlink", "files/plan.py:write_together"),
    ("rmdir", "files/plan.py:write_together"),
}


class Line:
    """What stands between a night and its control: it counts the bytes that are sent to the machine."""

    def __init__(self, control: str) -> None:
        host, port = control.removeprefix("socket://").rsplit(":", 1)
        self._control, self.sent = (host, int(port)), 0
        self._server = socket.create_server(("127.0.0.1", 0))
        self.url = f"socket://127.0.0.1:{self._server.getsockname()[1]}?listen=no"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            near, _ = self._server.accept()
            far = socket.create_connection(self._control)
            for source, target, counts in ((near, far, True), (far, near, False)):
                threading.Thread(target=self._passes, args=(source, target, counts), daemon=True).start()

    def _passes(self, source: socket.socket, target: socket.socket, counts: bool) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                self.sent += len(data) if counts else 0
                target.sendall(data)
        for one in (source, target):
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        if counts:
            source.close()
            target.close()


class _Post(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        self.wfile.write(b"220 here\r\n")
        text: list[bytes] | None = None
        for line in self.rfile:
            if text is None:
                text = [] if line[:4].upper() == b"DATA" else None
                ends = b"221 bye\r\n" if line[:4].upper() == b"QUIT" else b"250 so be it\r\n"
                self.wfile.write(b"354 go on\r\n" if text is not None else ends)
            elif line == b".\r\n":
                letter = message_from_bytes(b"".join(text), policy=policy.default)
                self.server.letters.append(f"{letter['Subject']}\n{letter.get_content()}")  # type: ignore[attr-defined]
                self.wfile.write(b"250 taken\r\n")
                text = None
            else:
                text.append(line)


class Mail(socketserver.ThreadingTCPServer):
    """A mail server that takes every letter."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Post)
        self.letters: list[str] = []
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()


def write_cell(cell: Path, board: Path, mail: Mail) -> None:
    """folder, where the screen on the wall is, mail server → a cell whose first night is good; the others are quick checks."""
    write_example(cell, "hu40t")
    strategy = yaml.safe_load((cell / "strategy.yaml").read_text())
    few = [{**one, "facets": [f for f in one["facets"] if f in FACETS]} for one in strategy["indexations"][::2]]
    (cell / "strategy.yaml").write_text(yaml.safe_dump({**strategy, "indexations": [one for one in few if one["facets"]]}))
    text = (cell / "tango.yaml").read_text()
    (cell / "tango.yaml").write_text(text.replace("  post: fanuc", "  post: fanuc\n  gate: none"))
    board.mkdir(exist_ok=True)
    notify = [f"file://{board}/board.txt", f"mailto:ann@example.org?smtp=127.0.0.1:{mail.server_address[1]}"]
    settings = {"nightly": 1, "owner": "Ann", "diagnose": False, "check_minutes": 2, "notify": notify}
    (cell / "nightly.yaml").write_text(yaml.safe_dump(settings))


@dataclass
class Told:
    """What a night has come to: exit status, what it said to whom, its record, and what was sent to the machine (bytes)."""

    code: int
    said: str
    record: dict[str, Any]
    sent: int


@dataclass
class Walk:
    """A place in which nights begin again and again from the same cells."""

    place: Path
    line: Line
    mail: Mail
    trials: int = 0
    begun: dict[str, Path] = field(default_factory=dict)

    @property
    def cell(self) -> Path:
        """→ folder of the cell, the same in every trial: it is in the history."""
        return self.place / "cell"

    @property
    def board(self) -> Path:
        """→ folder of the screen on the wall."""
        return self.place / "board"

    def night(self, number: int, disk: Disk | None = None) -> Told:
        """number of the night from 0, disk → what it has come to."""
        out, letters, sent = self.place / "record.json", len(self.mail.letters), self.line.sent
        out.unlink(missing_ok=True)
        now = FIRST + timedelta(days=number)
        with contextlib.ExitStack() as stack:
            stack.enter_context(patch(f"{RealDisk.__module__}.RealClock", lambda: SimpleNamespace(now=lambda: now)))
            stack.enter_context(patch.object(write, "proven", _proven))
            if disk is not None:
                stack.enter_context(refusing(disk))
                stack.enter_context(refusing_sqlite(disk))
            found = Result("nightly", "-C", self.cell, "--port", self.line.url, "--json", out)
        lock = self.cell / LOCK
        if lock.exists():  # it could not be taken away, and the process that wrote it has ended
            lock.write_text(lock.read_text().replace(f'"pid": {os.getpid()}', f'"pid": {1 << 22}'))
        record = json.loads(out.read_text()) if out.exists() else {}
        told = "\n".join([found.out, found.err, json.dumps(record, ensure_ascii=False), *self.mail.letters[letters:]])
        return Told(found.code, told, record, self.line.sent - sent)

    def disk(self, at: int | None = None, how: str = "once") -> Disk:
        """number of the call to refuse, how → a disk under cell and screen."""
        error = SHORT if how == "half is taken" else ERRORS[(at or 0) % len(ERRORS)]
        return Disk((self.cell, self.board), at, error, how == "from then on")

    def back(self, kind: str) -> None:
        """kind of night → the cell is as it is before one; made at the first call."""
        for folder in (self.cell, self.board):
            shutil.rmtree(folder, ignore_errors=True)
        if kind not in self.begun:
            if kind == "first":
                write_cell(self.cell, self.board, self.mail)
            else:
                self.back("first" if kind == "check" else "check")
                _PREPARED[kind](self)
            self.begun[kind] = self.place / f"before {kind}"
            shutil.copytree(self.cell, self.begun[kind])
            return
        shutil.copytree(self.begun[kind], self.cell)
        self.board.mkdir()

    def calls(self, kind: str) -> list[Call]:
        """kind of night → its calls that write, in their order, on a disk that takes everything."""
        self.back(kind)
        disk = self.disk()
        told = self.night(NUMBER[kind], disk)
        assert told.code == 0 and told.record["verdict"] == "good", told.said
        return disk.calls

    def wrong(self, kind: str, at: int, how: str) -> Iterator[str]:
        """kind of night, number of the call to refuse, how → what is wrong with what came of it."""
        self.back(kind)
        before, files = _history(self.cell), _files(self.cell)
        disk = self.disk(at, how)
        told = self.night(NUMBER[kind], disk)
        if not disk.refused:  # half of a call that is no write
            return
        self.trials += 1
        first = disk.refused[0]
        where = f"{kind}, call {at} {how}: {first.what} of {first.site} to {Path(first.path).name}: exit {told.code}"
        for text in (
            *self._at_once(told, disk, how),
            *_changed(files, _files(self.cell)),
            *self._next(kind, told, before, disk.on),
        ):
            yield f"{where}: {text}"

    def _at_once(self, told: Told, disk: Disk, how: str) -> Iterator[str]:
        """What the night that met the disk has come to, and said."""
        first = disk.refused[0]
        if "Traceback" in told.said or "a mistake in this program" in told.said:
            yield f"a mistake: {told.said[-600:]}"
        if told.code not in (0, 1, 3):
            yield told.said[-600:]
        words = () if disk.error == SHORT else (os.strerror(disk.error),)
        words = (*words, *SQLITE) if "history.db" in first.path else words
        silent = words and not any(word in told.said for word in words)
        if silent and not self._harmless(first, told) and not (disk.error == SHORT and told.code == 0):
            yield f"nothing is said of {words[0]!r}: {told.said[:300]!r}"
        failed = [point for point in told.record.get("preflight", ()) if not point["passed"]]
        if told.sent and (failed or not told.record):
            yield f"{told.sent} bytes were sent to the machine although {failed or 'there is no record'}"
        if told.code == 3 and told.record.get("verdict", "not_measured") != "not_measured":
            yield f"verdict {told.record['verdict']}"

    def _harmless(self, first: Call, told: Told) -> bool:
        """call that was refused, what the night has come to → whether nobody has to hear of it: nothing came of it."""
        if told.code == 0 and "history.db" in first.path:  # SQLite did it again, or did without: the night is there
            night = _history(self.cell).get(str(told.record["start_utc"]))
            return night is not None and night[0]["touches"] == told.record["touches"]
        sent = told.record.get("notifications") or [{"sent": False}]
        if "/nights/outbox" in first.path or "/nights/sent" in first.path:  # it was sent without having waited there
            return all(one["sent"] for one in sent)
        if Path(first.path).parent == self.board and any((self.cell / "nights" / "outbox").glob("[!.]*")):
            return True  # a message of another night, which waits as before
        return (first.what, first.site) in HARMLESS

    def _next(self, kind: str, told: Told, before: dict[str, Any], on: bool) -> Iterator[str]:
        """The next night, on a disk that takes everything."""
        after = self.night(NUMBER[kind] + 1)
        if after.code != 0 or "Traceback" in after.said:
            yield f"then exit {after.code}: {after.said[:700]}"
            return
        if not (self.cell / str(after.record["artefacts"]["folder"]) / "morning.html").exists():
            yield "then the next night has no page"
        with opened(self.cell / "history.db", create=False) as history:
            if broken := history.verify():
                yield f"then the history is {broken}"
        now = _history(self.cell)
        if lost := [start for start, record in before.items() if now.get(start, [None])[0] != record[0]]:
            yield f"then the history has lost {lost}"
        start = (FIRST + timedelta(days=NUMBER[kind])).strftime("%Y-%m-%dT%H:%M:%SZ")
        date = start[:10]
        there = [record for key, records in now.items() for record in records if record["night"] == date]
        if kind != "first" and not there:
            yield f"then no night of {date} is on record"
        if len(there) > 1:
            yield f"then {len(there)} nights of {date} are on record"
        nowhere = "nor on the disk" in told.said  # then its journal is all there is, and the night counts as cut off
        measured = 0 if nowhere else told.record.get("touches") or 0
        if measured and [record["touches"] for record in there] != [measured]:
            yield f"then the history has {[record['touches'] for record in there]} of {measured} touches"
        for folder in (self.cell / "nights").glob("2026*"):
            if (many := _journaled(folder)) > _rows(folder):
                yield f"then {_rows(folder)} of {many} touches of {folder.name} are in files of readings"
        hidden = () if on else self.cell.rglob(".*")  # where nothing could be taken away any more
        left = [str(f.relative_to(self.cell)) for f in hidden if f.name != ".tango.lock"]
        left += [str(f.relative_to(self.cell)) for name in ("begun", "outbox") for f in (self.cell / "nights" / name).glob("[!.]*")]
        if left:
            yield f"then {left} are left"


PROVEN, REAL = dict[tuple[str, ...], tuple[str, ...]](), write.proven


def _proven(post: Any, lines: Callable[[], Iterator[str]], *more: Any) -> tuple[str, ...]:
    """As the command's own, but the same program is read back once: the disk has no part in it."""
    text = (post.title, *lines())
    if text not in PROVEN:
        PROVEN[text] = REAL(post, lines, *more)
    return PROVEN[text]


def _history(cell: Path) -> dict[str, list[dict[str, Any]]]:
    """cell → records of its history by their start."""
    if not (cell / "history.db").exists():
        return {}
    found: dict[str, list[dict[str, Any]]] = {}
    with opened(cell / "history.db", create=False) as history:
        for night in reversed(history.nights()):
            found.setdefault(night.start_utc, []).append(dict(history.night(night.entry).record))
    return found


def _files(cell: Path) -> dict[str, bytes]:
    """cell → what nights have left there, by its name."""
    nights = (f for f in (cell / "nights").glob("2026*/*") if not f.name.startswith("."))
    return {str(f.relative_to(cell)): f.read_bytes() for f in nights}


def _changed(before: dict[str, bytes], after: dict[str, bytes]) -> Iterator[str]:
    for name, data in before.items():
        if after.get(name) != data:
            yield f"{name} of a night before is {'another' if name in after else 'gone'}"


def _journaled(folder: Path) -> int:
    file = folder / "readings.journal"
    text = file.read_text(errors="replace") if file.exists() else ""
    return len(set(re.findall(r'"kind":"reading".*?"touch":(\d+).*\n', text)))


def _rows(folder: Path) -> int:
    """folder of a night → touches in its files of readings."""
    found = {line.split(",")[0] for f in folder.glob("readings*.csv") for line in f.read_text().splitlines()[1:]}
    return len(found)


def _good(walk: Walk) -> None:
    assert walk.night(0).code == 0


def _unkept(walk: Walk) -> None:
    """A night whose readings the history did not take: they wait in unkept.json."""

    def full(self: Any, *night: Any) -> int:
        raise LinkError("history: database or disk is full")

    with patch.object(History, "add_night", full):
        walk.night(1)
    assert list(walk.cell.glob("nights/*/unkept.json"))


def _cut_off(walk: Walk) -> None:
    """A night that died after some touches: its mark, its journal and what it was to touch are there."""
    for name in ("cell", "board"):
        shutil.copytree(walk.place / name, walk.place / f"{name} kept")
    assert walk.night(1).code == 0
    (night,) = (f for f in walk.cell.glob("nights/2026*") if f.name.startswith("2026-11-24"))
    journal = (night / "readings.journal").read_bytes().splitlines(keepends=True)
    planned = (night / "planned.json").read_bytes()
    for name in ("cell", "board"):
        shutil.rmtree(walk.place / name)
        shutil.move(walk.place / f"{name} kept", walk.place / name)
    folder = walk.cell / "nights" / night.name
    folder.mkdir(parents=True)
    (folder / "planned.json").write_bytes(planned)
    (folder / "readings.journal").write_bytes(b"".join(journal[: len(journal) // 2]))
    RealDisk(walk.cell).begin(night.name, "2026-11-24T02:00:00Z")
    RealDisk(walk.cell).post(night.name, "a message that waits\n")


_PREPARED = {"check": _good, "unkept": _unkept, "cut off": _cut_off}


def different(calls: Sequence[Call]) -> list[int]:
    """calls → numbers of those to refuse: of calls that do the same to one file the first, the second and the last."""
    alike: dict[tuple[str, ...], list[int]] = {}
    for number, call in enumerate(calls):
        name = re.sub(r"^\.?(.+?)(\.\w{8})?$", r"\1", Path(call.path).name)
        alike.setdefault((call.what, call.site, name), []).append(number)
    return sorted({number for numbers in alike.values() for number in (*numbers[:2], numbers[-1])})
