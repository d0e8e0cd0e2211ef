"""The disk of a control over a bad network: what a look at it may show, when it cannot be reached, and a person at the control.

The person starts what lies at the place of the program as soon as the run looks for its records, and resets the control before
every new attempt. The machine and its ledger are those of the other links (`linkfaults`).
"""

from __future__ import annotations

import random
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

from sim_controller.faults import Faults
from support.linkfaults import Ledger, _until_all_is_measured, machine_faults, ran
from support.linkparts import FakeClock
from tango_cnc.link.transport import _remote

RECORDS, PROGRAM = "/records/TANGO.TXT", "/programs/O8700.NC"
SCHEMES = ("ftp", "sftp", "smb")


class Disk:
    """What truly stands on the disk at a time: the versions of the record file, each from when on."""

    KINDS: ClassVar = ("refused", "reset", "closed", "stale", "short", "nul", "gone", "put cut", "put short", "outage")

    def __init__(self, ledger: Ledger, clock: FakeClock, chance: random.Random, rates: dict[str, float]) -> None:
        self.ledger, self.clock, self.chance, self.rates = ledger, clock, chance, rates
        self.program, self.told, self.away = b"", False, 0.0
        self.injected: dict[str, int] = {}
        self._versions: list[tuple[float, bytes]] = [(-1e9, b"TANGO END of another day\n")]

    def happens(self, kind: str) -> bool:
        """kind → whether it happens now; counted."""
        if self.chance.random() >= self.rates.get(kind, 0.0):
            return False
        self.injected[kind] = self.injected.get(kind, 0) + 1
        return True

    def reset(self) -> None:
        """The person resets the control some time later: what its program has not written by then is never written."""
        self.clock.seconds += self.chance.uniform(5, 120)
        self._versions = [(at, data) for at, data in self._versions if at <= self.clock.seconds]
        self.told = False

    def started(self) -> None:
        """The person starts the program that lies there."""
        self.told = True
        faults = machine_faults(self.chance) if self.chance.random() < 0.3 else Faults()
        events, printed = ran(self.program.decode(), faults)
        for event, data in events:
            self.ledger.note(event, **data)
        anew = self.chance.random() < 0.3  # some controls begin the file anew
        begun, content = self.clock.seconds + self.chance.uniform(1, 20), b"" if anew else self.now()
        for moment, data in printed:
            content += data
            self._versions.append((begun + moment, content))

    def now(self, ago: float = 0.0) -> bytes:
        """s ago → what stood in the record file then."""
        at = self.clock.seconds - ago
        while len(self._versions) > 1 and self._versions[1][0] < self.clock.seconds - 60:
            self._versions.pop(0)
        return next((data for since, data in reversed(self._versions) if since <= at), self._versions[0][1])

    def seen(self) -> bytes | None:
        """→ what one look shows of it, None for no such file."""
        if self.happens("gone"):
            return None
        data = self.now(self.chance.uniform(0, 15) if self.happens("stale") else 0.0)
        if self.happens("nul"):  # it has grown before its data have come
            cut = self.chance.randrange(len(data) + 1)
            data = data[:cut] + bytes(len(data) - cut)
        return data


class Net:
    """A connection to the disk: the verbs of a store, and what happens on the way."""

    def __init__(self, disk: Disk) -> None:
        self._disk = disk
        if disk.clock.seconds < disk.away or disk.happens("refused"):
            raise ConnectionRefusedError(111, "Connection refused")

    def _way(self) -> None:
        disk = self._disk
        disk.clock.seconds += 0.01
        if disk.happens("outage"):
            disk.away = disk.clock.seconds + disk.chance.uniform(20, 120)
        if disk.clock.seconds < disk.away:
            raise TimeoutError(110, "Connection timed out")
        if disk.happens("reset"):
            raise ConnectionResetError(104, "Connection reset by peer")
        if disk.happens("closed"):
            raise EOFError

    def size(self, path: str) -> int | None:
        self._way()
        if path == PROGRAM:
            return len(self._disk.program) or None
        assert path == RECORDS
        data = self._disk.seen()
        return None if data is None else len(data)

    def lacks(self, folder: str) -> bool:
        self._way()
        assert RECORDS.startswith(folder) or PROGRAM.startswith(folder)
        return False

    def read(self, path: str, offset: int, most: int) -> bytes:
        self._way()
        disk = self._disk
        if path == PROGRAM:
            return disk.program[offset : offset + most]
        if disk.program and not disk.told:
            disk.started()
        data = (disk.seen() or b"")[offset : offset + most]
        return data[: disk.chance.randrange(len(data) + 1)] if disk.happens("short") else data

    def write(self, path: str, data: bytes) -> None:
        self._way()
        assert path == PROGRAM
        disk = self._disk
        if disk.happens("put cut"):
            disk.program = data[: disk.chance.randrange(len(data))]
            raise ConnectionResetError(104, "Connection reset by peer")
        disk.program = data[: disk.chance.randrange(len(data))] if disk.happens("put short") else data  # its disk is full

    def remove(self, path: str) -> None:
        self._way()
        assert path == PROGRAM
        self._disk.program = b""

    def close(self) -> None:
        pass


def disk_session(seed: int, folder: Path, monkeypatch, clock: FakeClock) -> tuple[Ledger, int, dict[str, int]]:
    """seed → the ledger, how often the run was resumed, what was injected. Everything is measured when this returns."""
    chance, ledger = random.Random(seed), Ledger()
    rates = {kind: chance.choice([0.0, 1e-3, 5e-3]) for kind in Disk.KINDS[:-3]}
    rates |= {"put cut": 0.1, "put short": 0.1, "outage": chance.choice([0.0, 1e-3])}
    disk = Disk(ledger, clock, chance, rates)

    def store(scheme: str, parts: object, options: object) -> Net:
        return Net(disk)

    real = _remote.Remote.__init__

    def attempt(self, address) -> None:
        disk.reset()
        real(self, address)

    def waited(seconds: float) -> None:
        clock.seconds += seconds

    monkeypatch.setattr(_remote, "store", store)
    monkeypatch.setattr(_remote, "time", SimpleNamespace(monotonic=clock, sleep=waited))
    monkeypatch.setattr(_remote.Remote, "__init__", attempt)
    port = f"{SCHEMES[seed % len(SCHEMES)]}://anna@localhost{RECORDS}?program={PROGRAM}"
    try:
        return ledger, _until_all_is_measured(port, "dnc", folder), disk.injected
    finally:
        monkeypatch.setattr(_remote.Remote, "__init__", real)
