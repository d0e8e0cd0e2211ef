"""Real servers of files behind a network that breaks, and somebody at the control; judged by what the machine truly did.

The servers are those of `test_link_remote` (pyftpdlib, OpenSSH, Samba) and `lsv2`. Between them and the client stands a proxy that
refuses, cuts, delays and chops connections; an FTP server breaks its data connections itself. Time is real, and short.
"""

from __future__ import annotations

import contextlib
import functools
import random
import socket
import ssl
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from sim_controller.faults import Faults
from sim_controller.probing import rig
from support import linkfaults
from support.opcua import Gone
from tango_cnc.files import read_cell, read_world
from tango_cnc.link import measure as measuring
from tango_cnc.link import rest as resting
from tango_cnc.link.measure import Wanted, measure
from tango_cnc.link.transport import _lsv2, _opcua, _remote, _stores
from tango_cnc.plan import plan
from tango_cnc.records import LinkError

TOUCHES = 12
ATTEMPTS = 60
SILENCE = 0.5  # s
PAUSE = 0.05  # s until the person tries again
SILENT = 1.0  # s for which a connection that is gone looks open
PRESSED = 4  # times that the person at the computer presses Enter in one attempt
LONGEST = 120.0  # s of a session: one that hangs passes it
LONG = 200_000  # bytes of a run over one connection
WHOLE_SCENE = linkfaults.scene


@functools.cache
def scene(turning: bool = True):
    """→ the cell of a few touches in several indexations, its plan, its rig."""
    cell = read_cell(linkfaults.EXAMPLE)
    kept = [replace(one, facets=one.facets[:3]) for one in cell.strategy.indexations[: TOUCHES // 3]]
    cell = replace(cell, strategy=replace(cell.strategy, indexations=tuple(kept)))
    world = replace(read_world(linkfaults.EXAMPLE / "world.yaml"), noise=0.0, effects=())
    return cell, plan(cell), rig(cell.machine, cell.artefact, world)


class Way:
    """What goes wrong on the way, in one session."""

    def __init__(self, chance: random.Random) -> None:
        self.chance, self.injected, self.away = chance, Counter[str](), 0.0
        self.rates = {kind: chance.choice([0.02, 0.06, 0.12]) for kind in ("refused", "outage")}
        self.rates |= {
            "cut": chance.choice([0.0, 0.1, 0.3]),
            "slow": 0.05,
            "pieces": 0.05,
            "data cut": chance.choice([0.01, 0.03, 0.1]),
            "silent": 0.15,
        }
        self.reach = 40_000  # bytes, both ways, before which a connection is cut that is to be cut
        self.whole = False  # nothing more goes wrong

    def happens(self, kind: str) -> bool:
        """kind → whether it happens now; counted."""
        if self.whole or self.chance.random() >= self.rates[kind]:
            return False
        self.injected[kind] += 1
        return True

    def out(self) -> bool:
        """→ whether nobody can be reached now."""
        return not self.whole and time.monotonic() < self.away


class Proxy:
    """Connections to a port of this computer, as bad as `way` has them."""

    def __init__(self, to: int) -> None:
        self.to, self.way = to, Way(random.Random(0))
        self.way.whole = True
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        while True:
            try:
                line, _ = self._door.accept()
            except OSError:
                return
            threading.Thread(target=self._joined, args=(line, self.way), daemon=True).start()

    def _joined(self, line: socket.socket, way: Way) -> None:
        if way.happens("outage"):
            way.away = time.monotonic() + way.chance.uniform(0.05, 0.3)
        if way.out() or way.happens("refused"):
            _reset(line)
            return
        try:
            there = socket.create_connection(("127.0.0.1", self.to))
        except OSError:
            _reset(line)
            return
        left = [way.chance.randrange(1, way.reach) if way.happens("cut") else 1 << 40]
        pieces, slow = way.happens("pieces"), way.happens("slow")
        for one in (line, there):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for a, b in ((line, there), (there, line)):
            threading.Thread(target=_pump, args=(a, b, left, pieces, slow, way), daemon=True).start()

    def close(self) -> None:
        """Nobody is let in any more."""
        self._door.close()


def _reset(line: socket.socket) -> None:
    with contextlib.suppress(OSError):
        line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        line.shutdown(socket.SHUT_RD)  # while the other thread waits in it, a socket that is closed stays open
    line.close()


def _pump(a: socket.socket, b: socket.socket, left: list[int], pieces: bool, slow: bool, way: Way) -> None:
    try:
        while data := a.recv(1 << 16):
            if way.out():
                break
            if slow:
                time.sleep(0.002)
            if left[0] <= len(data):  # the rest of it is lost with the connection
                b.sendall(data[: left[0]])
                if way.happens("silent"):  # nobody is told that the connection is gone
                    time.sleep(SILENT)
                break
            left[0] -= len(data)
            if pieces and len(data) < 600:
                for at in range(0, len(data), 7):
                    b.sendall(data[at : at + 7])
            else:
                b.sendall(data)
        else:
            with contextlib.suppress(OSError):
                b.shutdown(socket.SHUT_WR)
            return
    except OSError:
        pass
    _reset(a)
    _reset(b)


class Disk:
    """A control's disk in a folder."""

    def __init__(self, folder: Path) -> None:
        self.records, self.program = folder / "TANGO.TXT", folder / "O8700.NC"

    def text(self) -> str:
        """→ the program that lies there."""
        return self.program.read_text(encoding="ascii", errors="replace") if self.program.exists() else ""

    def write(self, data: bytes, anew: bool = False) -> None:
        """bytes → written behind the others, or in a new file."""
        with self.records.open("wb" if anew else "ab", buffering=0) as file:
            file.write(data)

    def stop(self) -> None:
        """The program that runs writes nothing more."""

    def begin(self) -> None:
        """A program is started."""

    def clean(self) -> None:
        """As at the beginning of a session."""
        self.records.write_bytes(b"TANGO END of another day\n")
        self.program.unlink(missing_ok=True)


class Drive(Disk):
    """The disk of a Heidenhain control behind its LSV2 server."""

    def __init__(self, control: Any) -> None:
        self.control = control
        self.names = ("TNC:\\TANGO.TXT", "TNC:\\O8700.NC")

    def text(self) -> str:
        return self.control.files.get(self.names[1], b"").decode("ascii", "replace")

    def write(self, data: bytes, anew: bool = False) -> None:
        self.control.files[self.names[0]] = (b"" if anew else self.control.files.get(self.names[0], b"")) + data

    def clean(self) -> None:
        self.control.files.clear()
        self.control.files[self.names[0]] = b"TANGO END of another day\n"
        self.control.heard.clear()
        self.control.joined.clear()


class Variables(Disk):
    """A control with an OPC UA server: its program comes as a file, its records go out through variables, one by one."""

    def __init__(self, server: Any) -> None:
        self.server = server

    def text(self) -> str:
        return bytes(self.server.files.get("TANGO.MPF", b"")).decode("ascii", "replace")

    def write(self, data: bytes, anew: bool = False) -> None:
        self.server.printed(data)

    def clean(self) -> None:
        self.server.anew()

    def stop(self) -> None:
        self.server.left.set()

    def begin(self) -> None:
        self.server.left.clear()


class Person:
    """Starts what lies at the place of the program when the run says so, and resets the control before every new attempt."""

    def __init__(self, disk: Disk, ledger: linkfaults.Ledger, chance: random.Random) -> None:
        self.disk, self.ledger, self.chance = disk, ledger, chance
        self._stop, self._thread, self._pressed = threading.Event(), None, 0
        self.sent: list[str] = []  # programs that the run wanted there
        self.moving, self.stands = threading.Event(), threading.Event()

    def reset(self) -> None:
        """Nothing more is written by what was started."""
        self._stop.set()
        self.disk.stop()
        if self._thread is not None:
            self._thread.join()
        self._stop, self._thread = threading.Event(), None
        self._pressed = 0
        self.stands.set()

    def told(self, step: Any) -> None:
        """What the run says; the person starts the program when it is to be started."""
        if step.remark and ("start it there" in step.remark or "start the program at" in step.remark) and self._thread is None:
            self.stands.clear()
            self.disk.begin()
            text = self.disk.text()
            if text not in self.sent:
                self.ledger.unsafe.append("a program that nobody sent was to be started")
                return
            self._thread = threading.Thread(target=self._runs, args=(text, self._stop), daemon=True)
            self._thread.start()

    def _runs(self, text: str, stop: threading.Event) -> None:
        faults = linkfaults.machine_faults(self.chance) if self.chance.random() < 0.15 else Faults()
        self.moving.set()
        events, printed = linkfaults.ran(text, faults)
        for event, data in events:
            self.ledger.note(event, **data)
        anew = self.chance.random() < 0.3
        with contextlib.suppress(Gone):
            for number, (_, data) in enumerate(printed):
                if stop.wait(0.001):
                    break
                self.disk.write(data, anew and number == 0)
        self.moving.clear()
        self.stands.set()

    def asked(self, timeout: float) -> bool | None:
        """As `_lsv2.Person`: Enter, once nothing moves; who has pressed it often and got no end mark leaves."""
        if not self.stands.wait(timeout) or self.moving.is_set():
            return None
        self._pressed += 1
        return self._pressed <= PRESSED


def patched(monkeypatch) -> None:
    """Short waits, a disk that is not waited for, what is the same in every session computed once."""
    monkeypatch.setattr(linkfaults, "scene", scene)
    monkeypatch.setattr(linkfaults, "TOUCHES", TOUCHES)
    linkfaults.moves_remembered(monkeypatch)
    monkeypatch.setattr("tango_cnc.link.journal.os.fsync", lambda handle: None)
    monkeypatch.setattr(resting, "make_plan", linkfaults.replanned)
    monkeypatch.setattr(measuring, "plan_hash", linkfaults.hashed)
    monkeypatch.setattr(measuring, "durations", linkfaults.lasting)
    for name, value in {"LOOK": 0.005, "AGAIN": 0.2, "BETWEEN": 0.02}.items():
        monkeypatch.setattr(_remote, name, value)
    for name, value in {"AGAIN": 0.3, "BETWEEN": 0.02, "ANSWER": 0.5, "LOOK": 0.002}.items():
        monkeypatch.setattr(_opcua, name, value)
    monkeypatch.setattr(_stores, "PATIENCE", 0.2)  # what a data connection that was cut costs
    trusting = ssl._create_unverified_context()  # reading the certificates of this computer takes longer than a session
    monkeypatch.setattr(_stores, "_context", lambda options: trusting)
    monkeypatch.setattr(_lsv2, "PATIENCE", 0.2)
    monkeypatch.setattr(_lsv2, "BETWEEN", 0.02)


def net_session(seed: int, url: str, way: Callable[[Way], None], disk: Disk, folder: Path, monkeypatch) -> SimpleNamespace:
    """seed, port URL, who gets the way, the disk, where the readings go → the verdict, when everything is measured."""
    chance, ledger = random.Random(seed), linkfaults.Ledger()
    disk.clean()
    bad, person = Way(chance), Person(disk, ledger, random.Random(seed + 1))
    way(bad)
    if isinstance(disk, Drive):
        disk.control.moving = person.moving.is_set
        monkeypatch.setattr(_lsv2, "Person", lambda: person)
    cell, made, _ = scene()

    def posting(part):
        found = linkfaults.post(part)
        person.sent.append(found[0].text)
        return found

    if isinstance(disk, Variables):  # one connection for the whole run
        bad.rates |= {"cut": chance.choice([0.5, 0.8, 0.95]), "silent": 0.03}
        bad.reach = LONG  # cut while the program is put there, and while its records come
    silence = 2 * SILENCE if isinstance(disk, Variables) else SILENCE
    begun, resumed = time.monotonic(), 0
    for attempt in range(ATTEMPTS):
        bad.whole = attempt > ATTEMPTS // 2
        wanted = Wanted(url, "dnc", "fanuc", folder / "readings.csv", (folder / "readings.journal").exists(), silence)
        try:
            measure(cell, made, wanted, posting, person.told, lambda part, program: None)
            break
        except LinkError:
            resumed += 1
            time.sleep(PAUSE)
        finally:
            person.reset()
    else:
        raise AssertionError(f"seed {seed}: not measured after {ATTEMPTS} attempts")
    lost, invented, unsafe = linkfaults.judged(folder, ledger)
    if isinstance(disk, Drive):
        unsafe += disk.control.while_moving() + len(disk.control.acted())
    hung = time.monotonic() - begun > LONGEST
    return SimpleNamespace(resumed=resumed, injected=bad.injected, lost=lost, invented=invented, unsafe=unsafe, hung=hung)


@contextlib.contextmanager
def behind(port: int) -> Iterator[Proxy]:
    """port of a server → a proxy before it."""
    proxy = Proxy(port)
    try:
        yield proxy
    finally:
        proxy.close()
