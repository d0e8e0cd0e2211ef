"""A whole night, deterministic: clock, disk, link, probe, machine, operator and mail follow one seed, and every step is looked at.

A year is 365 nights of one machine. The machine wanders, is knocked, warms; the disk fills and loses power at any moment; the
line dies before or within a run; the probe chips, sticks or is dead; an operator takes the machine, decides about alarms or
forgets to; mail is down for days. What a night may never do is checked as it happens (`Broken`), not afterwards.

The machine's readings are linear in its true errors, with a response found by moving the errors in the simulator one at a time:
thousands of years in the time of one run of the real simulator, and none of the product's mathematics.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import Any

import numpy as np
from sqlalchemy import create_engine, event
from sqlalchemy.pool import StaticPool

from sim_controller.simulate import simulate
from support.night_contract import Contract
from support.nights_parts import nights_of
from tango_cnc.files import readings_text
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import History
from tango_cnc.history import _database as database
from tango_cnc.nightly import Delivery, Measured, Ports, PreflightPoint, night
from tango_cnc.nightly.ports import Busy
from tango_cnc.plan import plan
from tango_cnc.records import Cell, LinkError, Readings
from tango_cnc.records import World as Truth

NOISE = 0.0007
SIZE = {"mm": 3e-4, "rad": 6e-7, "mm/mm": 2e-7}
FAULTS = {  # chance a night
    "power": 0.02,
    "disk full": 0.01,
    "line dead": 0.01,
    "line dies": 0.01,
    "probe dead": 0.01,
    "alarm": 0.01,
    "mail down": 0.03,
    "database down": 0.005,
    "operator": 0.01,
    "chip": 0.02,
    "asleep": 0.01,
    "knock": 0.003,
    "twice": 0.01,
}


# Faults that no year has by itself, for campaigns that ask for them: two errors are knocked in one night; one is knocked while the
# machine is measured; the probe scatters.
MORE = ("knocks", "within", "scatter")
SCATTER = 13.0  # times as much as on other nights
KNOCK = {"mm": 0.02, "rad": 5e-5, "mm/mm": 2e-5}


def unit_of(name: str) -> str:
    """name of ISO 230-1 → the unit of the error: EX0S mm, EXXb mm, EBBb rad, EXX1 mm/mm."""
    return "rad" if name[1] in "ABC" else "mm/mm" if name[-1].isdigit() else "mm"


class Broken(BaseException):
    """Something happened that no night may do; no handler of the product may hide it."""


class PowerCut(BaseException):
    """The computer is gone; no handler of the product runs after it."""


@dataclass(frozen=True)
class Bench:
    """A cell, its analysis, and how its touches answer to every error of the machine, as the simulator has it."""

    cell: Cell
    truth: Truth
    names: tuple[str, ...]
    base: Readings
    response: np.ndarray  # (errors, n, 3) mm by error
    facet_response: np.ndarray  # (n, 3): along the approach
    units: dict[str, str]
    analysis: Callable[[Nightly], Any]

    @cached_property
    def rows(self) -> dict[int, int]:
        """→ {touch: row}."""
        return {int(t): i for i, t in enumerate(self.base.touch)}


def bench(cell: Cell, truth: Truth) -> Bench:
    """cell, true machine → bench. The response is a difference of two simulations without noise."""
    quiet = replace(truth, noise=0.0, effects=())
    base = simulate(cell.machine, cell.artefact, cell.strategy, quiet, seed=1)
    made = plan(cell)
    first = nights_of(cell, Nightly(diagnose=False), made, deep=False)
    units = {n: u for n, u in zip(first.followed.names, first.followed.units, strict=True) if n in truth.errors}
    steps = {"mm": 1e-3, "rad": 1e-6}
    found = []
    for name in truth.errors:
        step = steps.get(units.get(name, ""), 1e-6)
        errors = {**truth.errors, name: truth.errors[name] + step}
        moved = simulate(cell.machine, cell.artefact, cell.strategy, replace(quiet, errors=errors), seed=1)
        found.append((moved.position - base.position)[:, :3] / step)
    lifted = {f: truth.facets.get(f, 0.0) + 1e-3 for f in cell.artefact.facets}
    moved = simulate(cell.machine, cell.artefact, cell.strategy, replace(quiet, facets=lifted), seed=1)
    along = (moved.position - base.position)[:, :3] / 1e-3

    def analysis(settings: Nightly) -> Any:
        return replace(first, settings=settings, written=None)

    _ = first.lever, first.offered  # computed once, for every night
    return Bench(cell, truth, tuple(truth.errors), base, np.array(found), along, units, analysis)


@dataclass
class Clock:
    """Time that passes only where something takes time."""

    moment: datetime

    def now(self) -> datetime:
        """→ now."""
        return self.moment


@dataclass
class Disk:
    """What is on it survives; a write may fail, and power may go before or after it."""

    year: Year
    files: dict[tuple[str, str], str] = field(default_factory=dict)

    def free_mb(self) -> float:
        """→ room."""
        return 10.0 if self.year.fault == "disk full" and self.year.early else 1e4

    def _write(self, key: tuple[str, str], text: str) -> None:
        self.year.moment(f"before {key[0]}")
        if self.year.fault == "disk full" and (
            key[0] == "file" or not self.year.early
        ):  # early: a mark still fits, readings do not
            raise OSError(28, "No space left on device", key[1])
        self.files[key] = text
        self.year.moment(f"after {key[0]}")

    def begin(self, stamp: str, text: str) -> None:
        """Marks."""
        self._write(("begun", stamp), text)

    def unfinished(self) -> Sequence[tuple[str, str]]:
        """→ marks."""
        return sorted((s, t) for (kind, s), t in self.files.items() if kind == "begun")

    def ended(self, stamp: str) -> None:
        """Unmarks."""
        self.year.moment("before ended")
        self.files.pop(("begun", stamp), None)

    def write(self, stamp: str, name: str, text: str) -> None:
        """A file."""
        if ("file", f"{stamp}/{name}") in self.files:
            raise Broken(f"{stamp}/{name} is overwritten")
        self._write(("file", f"{stamp}/{name}"), text)

    def read(self, stamp: str, name: str) -> str | None:
        """→ a file, None where there is none."""
        return self.files.get(("file", f"{stamp}/{name}"))

    def post(self, stamp: str, text: str) -> None:
        """A message."""
        self._write(("outbox", stamp), text)
        self.year.said.add(stamp)

    def unsent(self) -> Sequence[tuple[str, str]]:
        """→ messages."""
        return sorted((s, t) for (kind, s), t in self.files.items() if kind == "outbox")

    def sent(self, stamp: str) -> None:
        """Sent."""
        self.year.moment("before sent")
        if stamp not in self.year.delivered:
            raise Broken(f"the message {stamp} is taken out and was not delivered")
        self.files.pop(("outbox", stamp))


@dataclass
class Control:
    """The machine: it may be taken, dead, in alarm; it measures only after a preflight that passed."""

    year: Year
    allowed: bool = False

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        """→ what is found."""
        self.year.moment("before preflight")
        fault = self.year.fault
        points = [
            PreflightPoint("control", fault not in ("line dead", "alarm", "operator"), f"{fault or 'idle'}"),
            PreflightPoint("probe", fault != "probe dead", "dead" if fault == "probe dead" else "not triggered"),
        ]
        self.year.looked = True
        self.allowed = all(p.passed for p in points) and not (fault == "disk full" and self.year.early)
        return points

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        """→ readings. Raises LinkError."""
        if not self.allowed:
            raise Broken("the machine moves after a preflight that failed")
        if not self.year.locked:
            raise Broken("the machine moves and the folder is not locked")
        self.allowed = False
        self.year.moves += 1
        self.year.moment("before measure")
        return self.year.measured(kind, touches)


@dataclass
class Mail:
    """People, who hear nothing while mail is down."""

    year: Year

    def send(self, subject: str, text: str, but: Sequence[str] = ()) -> Sequence[Delivery]:
        """→ delivered or not."""
        self.year.moment("before send")
        if self.year.mail_down > 0:
            return (Delivery("ann", False, "no answer"),)
        self.year.heard.append(f"{subject}\n{text}")
        for stamp, words in self.year.disk.unsent():
            if words == f"{subject}\n{text}":
                self.year.delivered.add(stamp)
        self.year.told = True
        return (Delivery("ann", True),)


@dataclass
class Year:
    """365 nights of one machine and everything around it, out of one seed."""

    bench: Bench
    seed: int
    settings: Nightly = field(default_factory=lambda: Nightly(diagnose=False))
    rates: dict[str, float] = field(default_factory=lambda: dict(FAULTS))
    fault: str = ""
    early: bool = False
    locked: bool = False
    looked: bool = False
    told: bool = False
    mail_down: int = 0
    moves: int = 0
    said: set[str] = field(default_factory=set)
    delivered: set[str] = field(default_factory=set)
    heard: list[str] = field(default_factory=list)
    cut_at: int = -1
    steps: int = 0
    trace: list[str] = field(default_factory=list)
    number: int = -1  # of the night that is played
    contract: Contract = field(default_factory=Contract)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.disk, self.control, self.mail = Disk(self), Control(self), Mail(self)
        self.clock = Clock(datetime(2026, 1, 1, 2, 0, tzinfo=UTC))
        self.engine = create_engine("sqlite://", poolclass=StaticPool, connect_args={"check_same_thread": False})
        event.listen(self.engine, "connect", database._durable)
        event.listen(self.engine, "begin", database._begin)
        event.listen(self.engine, "commit", lambda connection: self._commit(connection))
        self.ready = False
        database._migrate(self.engine)
        self.ready = True
        self.history = History(self.engine)
        self.errors = np.array([self.bench.truth.errors[n] for n in self.bench.names])
        self.offset = np.zeros(len(self.bench.base))
        scale = [SIZE.get(self.bench.units.get(n, ""), 0.0) * (0.3 if n.endswith("b") else 1.0) for n in self.bench.names]
        self.walk = np.array(scale) * float(self.rng.uniform(0.5, 2.0))
        self.analysis = self.bench.analysis(self.settings)
        self.name = self.bench.cell.machine.name
        self.changes: list[int] = []
        self.entries = 0

    def _commit(self, connection: Any) -> None:
        if self.ready and connection.get_execution_options().get("writes"):
            self.moment("before commit")
            if connection.exec_driver_sql("PRAGMA synchronous").scalar() != 2:
                raise Broken("a commit that does not wait for the disk")
            if self.fault == "database down":
                raise OSError(5, "Input/output error", "history.db")

    def moment(self, what: str) -> None:
        """A point in time at which power may go."""
        self.steps += 1
        self.trace.append(what)
        if self.fault == "power" and self.steps == self.cut_at:
            raise PowerCut(what)
        if self.steps > 200:
            raise Broken("a night that does not end")

    @contextmanager
    def lock(self) -> Iterator[None]:
        """The lock of the folder; somebody else may have it."""
        if self.fault == "locked":
            raise Busy("'tango run' is at work in this folder", "'tango run'")
        if self.locked:
            raise Busy("'tango nightly' is at work in this folder", "'tango nightly'")
        self.locked = True
        try:
            yield
        finally:
            self.locked = False

    def _begun_again(self) -> None:
        """Nothing of what programs remember is left: only disk and database."""
        self.history, self.analysis = History(self.engine), self.bench.analysis(self.settings)

    def measured(self, kind: str, touches: Sequence[int]) -> Measured:
        """kind, touches → what the true machine reads tonight."""
        b, rng = self.bench, self.rng
        if self.fault == "line dies" and self.early:
            raise LinkError("the line died before the first touch")
        if self.fault == "twice":
            self._second()
        rows = np.array([b.rows[t] for t in touches]) if len(touches) else np.arange(len(b.base))
        change = self.errors - np.array([b.truth.errors[n] for n in b.names])
        moved = np.einsum("e,enk->nk", change, b.response[:, rows])
        along = b.facet_response[rows]
        noise = NOISE * (SCATTER if self.fault == "scatter" else 1.0)
        moved += along * (self.offset[rows] + rng.normal(0, noise, len(rows)))[:, None]
        if self.fault == "chip":
            row = rng.integers(len(rows))
            moved[row] += along[row] * 0.02
        position = b.base.position[rows].copy()
        position[:, :3] += moved
        read = b.base.rows(rows)
        read = replace(read, position=position, time=np.arange(len(rows)) * 4.5)
        if self.fault == "within":
            half, before = len(rows) // 2, self.errors.copy()
            self._knock(self.number, None)
            position[half:, :3] += np.einsum("e,enk->nk", self.errors - before, b.response[:, rows[half:]])
            read = replace(read, position=position)
        planned, why = len(rows), ""
        if self.fault == "line dies":
            read, why = read.rows(np.arange(max(1, len(rows) * 2 // 3))), "the line died"
        self.clock.moment += timedelta(seconds=4.5 * len(read))
        return Measured(read, readings_text(read), planned, 4.5 * len(read), why)

    def _knock(self, number: int, which: int | None) -> None:
        """number of the night, place of an error (None: any) → it is somewhere else."""
        i = int(self.rng.integers(len(self.bench.names))) if which is None else int(which)
        size = KNOCK[unit_of(self.bench.names[i])]
        self.errors[i] += size * self.rng.choice([-1, 1])
        self.changes.append(number)

    def _second(self) -> None:
        """Another night begins in the same second, while this one measures. Raises Broken where it does not stay out of the way."""
        begun = self.disk.unfinished()
        world = Ports(self.clock, self.disk, self.control, self.mail, self.history, self.analysis, self.lock())
        record = night(self.name, "/cells/m", self.settings, world)
        if record["status"] != "refused" or record["touches"]:
            raise Broken("two nights at once, and the second one is not refused")
        if record["artefacts"]["folder"].removeprefix("nights/") not in self.said and not self.told:
            raise Broken("a refused night without a message")
        if self.disk.unfinished() != begun:
            raise Broken("a refused night has taken away the mark of the one at work")
        if self.history.last(self.name).record["status"] != "refused":  # type: ignore[union-attr]
            raise Broken("a refused night is not in the history")
        self.told = False

    def one(self, number: int) -> str:
        """number of the night → what became of it: '', 'asleep', 'power' or its verdict. Raises Broken."""
        rng = self.rng
        self.fault = next((name for name, p in self.rates.items() if rng.random() < p), "")
        self.early = bool(rng.random() < 0.5)
        self.cut_at, self.steps, self.trace, self.told = int(rng.integers(1, 22)), 0, [], False
        self.mail_down = max(self.mail_down - 1, 0) + (int(rng.integers(1, 4)) if self.fault == "mail down" else 0)
        if self.fault == "operator" and rng.random() < 0.3:
            self.fault = "locked"
        self.errors = self.errors + self.walk * rng.normal(size=len(self.errors))
        if self.fault in ("knock", "knocks"):
            for i in rng.choice(len(self.bench.names), 2, replace=False) if self.fault == "knocks" else (None,):
                self._knock(number, i)
        self.clock.moment = datetime(2026, 1, 1, 2, 0, tzinfo=UTC) + timedelta(days=number, minutes=float(rng.uniform(0, 3)))
        if self.fault == "asleep":
            return "asleep"
        before, moves = self._entries(), self.moves
        self.looked = False
        self.control.allowed = False
        world = Ports(self.clock, self.disk, self.control, self.mail, self.history, self.analysis, self.lock())
        try:
            record = night(self.name, "/cells/m", self.settings, world)
        except PowerCut:
            self.locked = False
            self._whole(before)
            self._begun_again()
            self.fault = ""
            self.contract.cut_off(self)
            return "power"
        self._whole(before)
        if self.locked:
            raise Broken("the lock is kept after the night")
        stamp = record["artefacts"]["folder"].removeprefix("nights/")
        nowhere = any("neither kept nor sent" in text for text in record.get("trouble") or ())  # then it was printed
        if stamp not in self.said and not self.told and not (nowhere and self.mail_down and self.fault == "disk full"):
            raise Broken("a night without a message")
        said = [record["why"], *((record.get("plausible") or {}).get("reasons") or ())]
        if found := next((text for text in said if "mistake of this program" in text), None):
            raise Broken(found)
        if self.looked and not record["preflight"]:
            raise Broken("what the preflight found is not in the record")
        if any(not p["passed"] for p in record["preflight"]) and self.moves > moves:
            raise Broken("moved after a failed preflight")
        if record["touches"] and self._entries() == before and not record.get("trouble"):
            raise Broken("what was measured is not in the history, and nothing says so")
        last = self.history.last(self.name)
        if not record.get("trouble") and (last is None or last.record["start_utc"] != record["start_utc"]):
            raise Broken("the night is not the newest in the history")
        known = self.history.latest_knowledge(self.name)
        if record.get("state") and not record.get("trouble") and (known is None or known[0].start_utc != record["start_utc"]):
            raise Broken("the state of the night is not the one that goes on")
        if last is not None and last.record["touches"] and last.readings is None:
            raise Broken("what was measured is not kept")
        if last is not None and last.readings is not None and last.record["touches"] != last.readings.count("\n") - 1:
            raise Broken("readings are lost or invented")
        self._honest(number, record)
        if wrong := next(self.contract.ended(self, number, record), ""):
            raise Broken(wrong)
        if rng.random() < 0.7 and record["alarms"] and not record.get("trouble"):
            self._decide(record)
        return str(record["verdict"])

    def _honest(self, number: int, record: dict[str, Any]) -> None:
        """What is said of the machine is true, but for a change of the last nights that is not seen yet. Raises Broken."""
        if self.fault in ("knock", "chip", "knocks", "within") or any(0 <= number - c <= 3 for c in self.changes):
            return
        for i, name in enumerate(self.bench.names):
            told = (record.get("parameters") or {}).get(name)
            if told is not None and abs(told["value"] - self.errors[i]) > 8 * told["std"]:
                raise Broken(f"{name} is told as {told['value']:.3g} ± {told['std']:.2g} and is {self.errors[i]:.3g}")
        if self.fault == "" and record["touches"] and record["status"] == "complete" and record["volume"]["std_um"] > 50:
            raise Broken("nothing is known after a night without a fault")
        if self.fault == "" and not record["touches"]:
            raise Broken(f"nothing failed, and nothing was measured: {record['why']}")

    def _decide(self, record: dict[str, Any]) -> None:
        from tango_cnc.history import Decision

        self.fault = ""
        action = str(self.rng.choice(["accept", "acknowledge", "repaired", "ignore"]))
        until = (self.clock.moment + timedelta(days=20)).strftime("%Y-%m-%d") if action == "ignore" else None
        utc = self.clock.moment.strftime("%Y-%m-%dT%H:%M:%SZ")
        self.history.decide(self.name, Decision(record["alarms"][0]["id"], action, "Ann", "", until, utc))
        self.contract.decided(record["alarms"][0]["id"], action, until)

    def _entries(self) -> int:
        """→ entries, as the database itself has them."""
        cursor = self.engine.raw_connection().cursor()
        return int(cursor.execute("SELECT count(*) FROM entry").fetchone()[0])

    def _whole(self, before: int) -> None:
        """What was there is there, and what is new is whole. Raises Broken."""
        self.fault, fault = "", self.fault
        if self._entries() < before:
            raise Broken("entries have gone from the history")
        self.fault = fault

    def _origins(self) -> list[str]:
        """→ start of every night with an alarm; one that only says that a repair has not helped is the alarm before once more."""
        nights = reversed(self.history.alarmed(self.name))
        return [s.night.start_utc for s in nights if not all(a.get("repair") for a in s.record["alarms"])]

    def run(self, nights: int = 365) -> dict[str, Any]:
        """→ what became of every night, and alarms that nothing caused. Raises Broken, with the night."""
        became: list[str] = []
        for number in range(nights):
            self.number = number
            try:
                became.append(self.one(number))
            except Broken as error:
                raise Broken(f"seed {self.seed}, night {number}, fault {self.fault!r}: {error}\n{self.trace}") from None
        self.fault = ""
        if wrong := self.history.verify():
            raise Broken(f"seed {self.seed}: {wrong[0]}")
        first = {c: True for c in self.changes}
        alarms = self._origins()
        days = [(datetime.fromisoformat(start) - datetime(2026, 1, 1, tzinfo=UTC)).days for start in alarms]
        blamed = [d for d in days if not any(0 <= d - c <= 3 for c in self.changes)]
        measured = len([n for n in self.history.nights(self.name) if n.p_value is not None])
        self.engine.dispose()
        return {
            "became": became,
            "false": len(blamed),
            "true": len(alarms) - len(blamed),
            "knocks": len(first),
            "measured": measured,
        }
