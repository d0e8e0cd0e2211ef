"""The real world of a night: this computer's clock and disk, the control at the end of the line, people who get messages."""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..files import read_readings_text, write_text
from ..files.nightly import Nightly
from ..link.lock import HeldError, holding
from ..nightly import Measured, PreflightPoint
from ..nightly.ports import Busy
from ..plan import part, plan, plan_hash
from ..records import Cell, LinkError, Plan, TangoError
from ..texts import joined, say
from ._cell_nights import again
from ._common import address_of, dialect, start_patience, writing
from ._cut_off import executed_until, from_journal, newest_run, note_planned
from ._night_gate import as_found, proves
from ._night_start import starts
from ._night_warm import warm, warmth
from ._start import counts, disproven_of, misses_of

LISTEN = 5.0  # s that a control may take to say what it is


@dataclass(frozen=True)
class RealClock:
    """This computer's clock."""

    def now(self) -> datetime:
        """→ now, with the local zone."""
        return datetime.now().astimezone()


@dataclass(frozen=True)
class RealDisk:
    """nights/ in the cell: a folder a night, begun/ for those under way, outbox/ for messages that wait."""

    folder: Path

    def free_mb(self) -> float:
        """→ room on the disk of the cell."""
        return shutil.disk_usage(self.folder).free / 1e6

    def begin(self, stamp: str, text: str) -> None:
        """Marks a night as begun."""
        write_text(self.folder / "nights" / "begun" / stamp, text)

    def unfinished(self) -> Sequence[tuple[str, str]]:
        """→ nights that were begun and never ended."""
        return _texts(self.folder / "nights" / "begun")

    def ended(self, stamp: str) -> None:
        """Takes the mark away."""
        (self.folder / "nights" / "begun" / stamp).unlink(missing_ok=True)

    def write(self, stamp: str, name: str, text: str) -> None:
        """A file of a night; one that is there with the same text is left alone, another text goes beside it."""
        file = self.folder / "nights" / stamp / name
        if file.exists():
            if file.read_text(encoding="utf-8", errors="surrogateescape") == text:
                return
            file = file.with_name(f"{file.stem}.again{file.suffix}")
        write_text(file, text)

    def read(self, stamp: str, name: str) -> str | None:
        """→ text of a file of a night, None where there is none."""
        file = self.folder / "nights" / stamp / name
        return file.read_text(encoding="utf-8", errors="surrogateescape") if file.exists() else None

    def post(self, stamp: str, text: str) -> None:
        """Puts a message into the outbox."""
        write_text(self.folder / "nights" / "outbox" / f"{stamp}.txt", text)

    def unsent(self) -> Sequence[tuple[str, str]]:
        """→ messages that wait, oldest first."""
        return [(name.removesuffix(".txt"), text) for name, text in _texts(self.folder / "nights" / "outbox")]

    def sent(self, stamp: str) -> None:
        """Moves a message to sent/."""
        source = self.folder / "nights" / "outbox" / f"{stamp}.txt"
        target = self.folder / "nights" / "sent" / source.name
        target.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):  # another night, or --tell, has sent it at the same time
            os.replace(source, target)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """folder of a cell → held by this night until the block ends. Raises Busy with the name of who has it, LinkError."""
    with ExitStack() as stack:
        try:
            stack.enter_context(holding(folder, "tango nightly"))
        except HeldError as error:
            raise Busy(str(error), error.holder) from None
        yield


def _texts(folder: Path) -> list[tuple[str, str]]:
    if not folder.is_dir():
        return []
    found = []
    for file in sorted(f for f in folder.iterdir() if not f.name.startswith(".")):
        with suppress(FileNotFoundError, IsADirectoryError):  # another night has just taken it away
            found.append((file.name, file.read_text(encoding="utf-8", errors="replace")))
    return found


def _journaled(folder: Path, made: Plan) -> tuple[str, Mapping[str, Any]] | None:
    """folder of a night, plan of its run → text of the readings in its journal, where they come from; None for none."""
    with suppress(TangoError, OSError, ValueError):
        return from_journal(folder, made)
    return None


def _cell_hash(folder: Path) -> str:
    """folder of a cell → SHA-256 over name and bytes of its files (*.yaml), in the order of the alphabet."""
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.yaml")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


@dataclass
class RealControl:
    """The control of the cell; plans and programs are made, read back and hashed before anything is asked of it."""

    cell: Cell
    settings: Nightly
    whole: Plan
    check: Cell | None
    stamp: str
    port: str | None = None
    simulated: bool = False  # the control stands in for a machine that does not exist
    # A person at the terminal starts a program that does not begin by itself. When a timer begins the night, nobody is there.
    someone: bool = False
    twin: Callable[[], Path | None] = lambda: None  # another cell whose machine has this name, in the same history
    _points: list[PreflightPoint] = field(default_factory=list)
    _cold: bool = False  # what the preflight found: the machine warms up first

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        """→ commissioned, the program of these touches, what was left behind, control and probe. Nothing moves."""
        self._points = []
        checks = (
            self._name,
            self._commissioned,
            self._program,
            self._gate,
            self._start,
            self._left,
            *((self._warm,) if self.settings.temperature else ()),
            self._control,
        )
        for check in checks:
            try:
                if (point := check(kind, touches)) is not None:
                    self._points.append(point)
            except TangoError as error:
                self._points.append(PreflightPoint(check.__name__.strip("_"), False, str(error), ""))
        return self._points

    def _name(self, kind: str, touches: Sequence[int]) -> PreflightPoint | None:
        """A machine is compared with what is known under its name; None where that is this machine."""
        if (other := self.twin()) is None:
            return None
        found = say("preflight.world.twin", name=self.cell.machine.name, folder=str(other))
        return PreflightPoint("name", False, found, say("preflight.world.twin_do", folder=str(self.cell.folder.resolve())))

    def _commissioned(self, kind: str, touches: Sequence[int]) -> PreflightPoint | None:
        """What a person has proven wrong of this control, nobody goes on with at night; None where nothing is asked or known."""
        there = (self.cell.folder / "commissioning.yaml").exists()
        if not there and self.settings.commissioned:
            said, advice = say("preflight.world.no_commissioning_yaml"), say("preflight.world.run_tango_commission_with_person")
            return PreflightPoint("commissioned", False, said, advice)
        if not self.simulated and (wrong := disproven_of(self.cell, dialect(self.cell)) if there else []):
            (found, do), *_ = wrong
            return PreflightPoint(
                "commissioned", False, say("preflight.world.not_so", found=found), say("preflight.world.mend", do=do)
            )
        return PreflightPoint("commissioned", True, "commissioning.yaml") if self.settings.commissioned else None

    def _program(self, kind: str, touches: Sequence[int]) -> PreflightPoint:
        from .check import _postable

        made = self.planned(kind, touches)
        _postable(self.cell if kind == "full" or self.check is None else self.check, made)
        said = say("preflight.world.plan_touches_read_back", plan_hash=plan_hash(made), count=len(made.touches))
        return PreflightPoint(
            "program", True, joined("; ", (said, *made.start))
        )  # nobody is there to bring the axes near the first place

    def _gate(self, kind: str, touches: Sequence[int]) -> PreflightPoint:
        """Nobody is there at night: a program that waits for a finger at the probe would stand still until the morning."""
        return proves(self.cell if kind == "full" or self.check is None else self.check, self.planned(kind, touches))

    def _start(self, kind: str, touches: Sequence[int]) -> PreflightPoint | None:
        """Nobody presses cycle start at night; None where nobody has to, or somebody is there, as a simulated control always is."""
        return None if self.someone or self.simulated else starts(self.cell, self._address(), self.settings.control_starts_within)

    def _left(self, kind: str, touches: Sequence[int]) -> PreflightPoint:
        journals = [f for f in self.cell.folder.glob("*.partial.csv")]
        if journals:
            return PreflightPoint("left", True, say("preflight.world.run_was_not_resumed_left", name=journals[0].name))
        return PreflightPoint("left", True, say("preflight.world.no_run_was_left_behind"))

    def _warm(self, kind: str, touches: Sequence[int]) -> PreflightPoint:
        found, self._cold = warm(self.cell.folder, self.settings)
        return found

    def _control(self, kind: str, touches: Sequence[int]) -> PreflightPoint:
        from ..link.measure import protocol_of
        from ..link.session import listen
        from ..link.transport import open_port

        address = self._address()
        protocol, parsed = protocol_of(address, dialect(self.cell).link)
        client = protocol.Client
        hello = client.hello(parsed.options)
        line = open_port(parsed)
        if not hello:
            line.close()
            until = None if parsed.options.get("listen") == "no" else executed_until(self.cell.folder, self.stamp, self.whole)
            if until is not None and datetime.now(UTC) < until:
                goes_on = say("preflight.world.may_go_on", address=address, until=f"{until.astimezone():%H:%M}")
                return PreflightPoint("control", False, goes_on, say("preflight.world.wait_or_look"), moving=True)
            passed = not self.settings.probe
            return PreflightPoint(
                "control",
                passed,
                say("preflight.world.open_this_control_cannot_be", address=address),
                "" if passed else say("preflight.world.probe_false"),
            )
        try:
            data = listen(line, hello, LISTEN, time.monotonic, lambda got: (client.told(got, parsed.options) or (True,))[0])
        finally:
            line.close()
        if not data:
            return PreflightPoint(
                "control",
                False,
                say("preflight.world.nothing_was_answered", address=address),
                say("preflight.world.control_on_at_right_port"),
            )
        fine, sentences = client.told(data, parsed.options) or (True, [])
        said = "; ".join(sentences) or "answers"
        if fine and (busy := client.busy(data, parsed.options)):
            return PreflightPoint("control", False, f"{address}: {busy}", say("preflight.world.stop_what_runs"))
        return PreflightPoint("control", bool(fine), said, "" if fine else say("preflight.world.see_tango_link_test"))

    def _address(self) -> str:
        return address_of(self.cell, self.port, dialect(self.cell).link)

    def planned(self, kind: str, touches: Sequence[int]) -> Plan:
        """kind of night, touches of the strategy (empty: all) → its plan."""
        if kind == "check" and self.check is not None:
            return as_found(self.check, plan(self.check), writing(self.check))
        whole = as_found(self.cell, self.whole, writing(self.cell))
        return part(whole, list(touches)) if touches else whole

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        """→ what came of the run. Moves the machine. Raises LinkError where nothing at all was measured."""
        folder = self.cell.folder / "nights" / self.stamp
        folder.mkdir(parents=True, exist_ok=True)
        target = folder / "readings.csv"
        own = self.check if kind == "check" and self.check is not None else self.cell
        made = self.planned(kind, touches)
        note_planned(folder, kind, touches)
        began = time.monotonic()
        if self._cold:
            self._warmed(own, made, folder)
        why = trouble = ""
        origin: Mapping[str, Any] = {}
        text: str | None = None
        try:
            origin = self._run(own, made, target)
        except LinkError as error:
            why, target = str(error), target.with_suffix(".partial.csv")
            if not target.exists():  # nothing was measured, or the disk has refused the readings: then the journal has them
                if (found := _journaled(folder, made)) is None:
                    raise
                text, origin = found
                why, trouble = (why, "") if origin["missing"] else ("", why)
        if text is None:
            text = target.read_text(encoding="utf-8")
        read = read_readings_text(text, self.cell.machine, self.cell.artefact)
        hashes = (
            *(("cell", _cell_hash(self.cell.folder)), ("plan", plan_hash(made))),
            *(("program", str(origin.get("program_hash", ""))), ("readings", hashlib.sha256(text.encode()).hexdigest())),
        )
        spent, many = time.monotonic() - began, len(made.touches)
        return Measured(read, text, many, spent, why, hashes, tuple(touches), self.simulated, trouble, origin.get("no_temperature"))

    def _run(self, own: Cell, made: Plan, target: Path) -> Mapping[str, Any]:
        """cell with the strategy of tonight, its plan, file → what is known of the run. Raises LinkError where it stops."""
        from ..link.measure import Wanted, measure, silence_after
        from ._live import Live
        from .check import positioning_feed
        from .run import keep, written_for

        assert self.cell.controller is not None
        post = dialect(self.cell)
        with Live(None) as live:
            wanted = Wanted(
                self._address(),
                post.link,
                self.cell.controller.post,
                target,
                False,
                None,
                self.settings.control_starts_within or start_patience(self.someone),
                None,
                misses=misses_of(self.cell, post),
                counted=counts(post),
                simulated=self.simulated,
                then=again(),
                quiet=silence_after(newest_run(self.cell.folder, self.stamp)[1], self.whole),
                feed=positioning_feed(self.cell),
            )
            return measure(
                own,
                made,
                wanted,
                lambda piece: written_for(own, post, made, piece, None, None),
                live,
                lambda piece, program: None,
                keep=lambda piece, programs: keep(own, post, made, piece, programs),
            )

    def _warmed(self, own: Cell, made: Plan, folder: Path) -> None:
        """Runs the program of the night until the machine is warm. Its readings are kept, and no estimate uses them.

        Raises LinkError where it is still cold after the time there is, or where a run stops.
        """
        assert self.settings.temperature is not None
        low, minutes = self.settings.temperature[0], self.settings.warm_up_minutes
        end = time.monotonic() + 60 * minutes
        number = 0
        while True:
            now = warmth(self.cell.folder, self.settings)
            if now.value is not None and now.value >= low:
                return
            if time.monotonic() >= end:
                raise LinkError(say("preflight.warm.still_cold", now=now.words, minutes=f"{minutes:g}", low=f"{low:g}"))
            number += 1
            self._run(own, made, folder / f"warm-up-{number}.csv")
