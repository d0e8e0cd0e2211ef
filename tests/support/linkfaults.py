"""Whole runs in memory, with seeded faults between a real client and the simulated control, judged by the simulator's ledger."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import random
import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

import postprocessors as posts
from sim_controller import motion as motions
from sim_controller.faults import WORDS, Disturbance, Faults
from sim_controller.languages import Alarm, Silence, grbl, macro_b
from sim_controller.languages.grbl import switched_on
from sim_controller.lines import even
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.protocols.grbl import Input
from sim_controller.protocols.modbus import IDLE, STATUS, TICKET, Registers
from support.linkparts import FakeClock
from tango_cnc.files import read_cell, read_readings, read_world
from tango_cnc.link import measure as measuring
from tango_cnc.link import rest as resting
from tango_cnc.link.client import Failed, Task
from tango_cnc.link.layout import read_layout
from tango_cnc.link.measure import Wanted, measure
from tango_cnc.link.transport import Lost
from tango_cnc.link.wire import Parity
from tango_cnc.plan import plan, plan_hash
from tango_cnc.program import Program
from tango_cnc.records import LinkError, Plan

EXAMPLE = Path(__file__).parents[2] / "examples" / "hu40t"
TOUCHES = 60
CLOSE = 1e-3  # mm, deg: what the records are rounded to, and what their check sum lets through
PERCENT, SEVEN = even(b"%"), bytes(byte & 0x7F for byte in range(256))
RIGHT = bytes(byte for byte in range(256) if byte.bit_count() % 2 == 0)  # characters of even parity
REMEMBERED = 10_000  # results kept of each kind
ATTEMPTS = 400  # a line that spoils every second record needs its time; what counts is that nothing is lost or invented


@functools.cache
def scene(turning: bool = True):
    """whether the spindle turns → the cell of 60 touches without noise, its plan, its rig."""
    cell = read_cell(EXAMPLE)
    kept, left = [], TOUCHES
    for indexation in cell.strategy.indexations:
        if left > 0:
            position = indexation.position if turning else {**indexation.position, "S": 0.0}
            kept.append(replace(indexation, position=position, facets=indexation.facets[:left]))
            left -= len(kept[-1].facets)
    cell = replace(cell, strategy=replace(cell.strategy, indexations=tuple(kept)))
    world = replace(read_world(EXAMPLE / "world.yaml"), noise=0.0, effects=())
    return cell, plan(cell), rig(cell.machine, cell.artefact, world)


def remembered(function: Callable, key: Callable[..., object] | None = None) -> Callable:
    """The same things are planned, posted and moved in every session: what comes of them is computed once."""
    known: dict = {}

    def again(*arguments):
        name = (key or _key)(*arguments)
        if name not in known:
            if len(known) >= REMEMBERED:
                known.clear()
            known[name] = function(*arguments)
        return known[name]

    return again


def _key(*arguments) -> tuple:
    return tuple(a.tobytes() if isinstance(a, np.ndarray) else a if isinstance(a, (int, float)) else id(a) for a in arguments)


class Ledger:
    """What truly happened."""

    def __init__(self) -> None:
        self.contacts: list[dict[str, float]] = []
        self.unsafe: list[str] = []
        self.deflected = 0
        self.injected: Counter[str] = Counter()  # what went wrong on the line

    def disturbance(self, rates: dict[str, float], seed: int) -> Disturbance:
        """chances, seed → a disturbance whose faults are counted here."""
        made = Disturbance(rates, seed)
        made.happened = self.injected
        return made

    def note(self, event, **data) -> None:
        if event == "contact":
            self.contacts.append(data["at"])
        elif event in ("unsafe", "collision"):
            self.unsafe.append(f"{event}: {data}")
        elif event == "skip" and data["result"] != "miss":
            self.deflected += 1


class Tape:
    """A control behind a line of 7 bits and parity: it stores the program, runs it, and prints whatever becomes of the line.

    A character of wrong parity and a block of an odd number of characters are alarms of its reader (TH, TV): it runs nothing.
    """

    chunk = 256

    def __init__(
        self, ledger: Ledger, clock: FakeClock, faults: Faults, there: Disturbance, bytes_in: Disturbance, cut: int | None
    ) -> None:
        self.clock, self._tape, self._ran, self._cut = clock, b"", False, cut
        self._ledger, self._faults, self._there, self._disturb = ledger, faults, there, bytes_in
        self._printed: list[tuple[float, bytes]] = []
        self._given = self._read = self._marks = 0

    def write(self, data: bytes) -> int:
        came = b"".join(piece for _, piece in self._there(data))
        self._tape += came
        self._marks += came.count(PERCENT)
        if not self._ran and self._spoilt():
            self._ran = True
        if not self._ran and self._marks == 2 and self._tape.rstrip().endswith(PERCENT):
            self._ran = True
            self._run(self._tape.translate(SEVEN).decode())
        return len(data)

    def _spoilt(self) -> bool:
        """→ whether the control's reader has stopped: of the blocks that have come completely since it looked last."""
        end = self._tape.rfind(b"\n") + 1
        blocks, self._read = self._tape[self._read : end], max(end, self._read)
        odd = any(len(block) % 2 == 0 and block != PERCENT for block in blocks.split(b"\n")[:-1])  # with its line end
        return odd or bool(blocks.translate(None, RIGHT))

    def _run(self, text: str) -> None:
        events, printed = ran(text, self._faults)
        for event, data in events:
            self._ledger.note(event, **data)
        began, late = self.clock.seconds, 0.0
        for moment, data in printed:
            for more, piece in self._disturb(even(data)):
                late += more
                self._printed.append((began + moment + late, piece))

    def read(self, timeout: float) -> bytes:
        if self._cut is not None and self._given >= self._cut:
            self._ledger.injected["cut"] += 1
            raise Lost("the line was cut")
        if self._printed and self._printed[0][0] <= self.clock.seconds + timeout:
            moment, data = self._printed.pop(0)
            self.clock.seconds = max(self.clock.seconds, moment)
            self._given += len(data)
            return data
        self.clock.seconds += timeout
        return b""

    def close(self) -> None:
        pass


def _run(text: str, faults: Faults) -> tuple[list[tuple[str, dict]], list[tuple[float, bytes]]]:
    """tape, faults of the machine → (what happened, what was printed and after how many s) on a control just switched on."""
    truth = scene()[2]
    events: list[tuple[str, dict]] = []
    printed: list[tuple[float, bytes]] = []

    def note(event: str, **data) -> None:
        if event in NOTED:
            events.append((event, data))

    motion = Motion(truth, note, faults=faults)
    with contextlib.suppress(Alarm, Silence):
        resident(text, motion, lambda data: printed.append((motion.time, data)))
    return events, printed


NOTED = ("contact", "collision", "skip", "unsafe")
# Nothing but the tape and the faults decides what such a control does.
ran = remembered(_run, lambda text, faults: (hashlib.sha256(text.encode()).digest(), *faults.after.items()))


class Cable:
    """A grbl control behind a serial line that spoils characters both ways; what a lost connection leaves of a line stays there."""

    chunk = 256
    LATENCY = 0.005  # s from a line to its answer beyond what the motion takes

    def __init__(
        self,
        control: grbl.Control,
        into: Input,
        ledger: Ledger,
        clock: FakeClock,
        there: Disturbance,
        back: Disturbance,
        cut: int | None,
    ):
        self.control, self.clock, self._ledger, self._cut = control, clock, ledger, cut
        self._into, self._there, self._back = into, there, back
        self._answers: list[tuple[float, bytes]] = []
        self._free = clock.seconds  # when the control has executed what it has

    def write(self, data: bytes) -> int:
        """A line asked for before an alarm is not asked for in it, when a fault cuts it in two and its beginning raises one."""
        could, before = self.control.state == "Idle", len(self._ledger.unsafe)
        self._taken(data)
        if could:
            self._ledger.unsafe[before:] = [event for event in self._ledger.unsafe[before:] if "in alarm" not in event]
        return len(data)

    def _taken(self, data: bytes) -> None:
        for _, piece in self._there(data):
            for byte in piece:
                taken = self._into.take(byte)
                if isinstance(taken, int):
                    self._say(self.control.realtime(taken), self.clock.seconds)
                elif taken is not None:
                    began, at = max(self.clock.seconds, self._free), self.control.motion.time
                    answer = self.control.line(taken)
                    self._free = began + self.control.motion.time - at + self.LATENCY
                    self._say(answer, self._free)

    def _say(self, lines: list[str], moment: float) -> None:
        for late, piece in self._back("".join(f"{line}\r\n" for line in lines).encode()):
            self._answers.append((moment + late, piece))
            self._answers.sort(key=lambda answer: answer[0])

    def read(self, timeout: float) -> bytes:
        if self._cut is not None and self._cut <= 0:
            self._ledger.injected["cut"] += 1
            raise Lost("the line was cut")
        if self._answers and self._answers[0][0] <= self.clock.seconds + timeout:
            moment, data = self._answers.pop(0)
            self.clock.seconds = max(self.clock.seconds, moment)
            self._cut = None if self._cut is None else self._cut - len(data)
            return data
        self.clock.seconds += timeout
        return b""

    def close(self) -> None:
        pass


class Turns:
    """A program of the control that waits for the other side: in a thread of its own, which runs only when it is its turn."""

    def __init__(self) -> None:
        self._go, self._back = threading.Semaphore(0), threading.Semaphore(0)
        self._running = self._over = False

    def waited(self) -> None:
        """Called by the program: the other side's turn."""
        self._back.release()
        self._go.acquire()
        if self._over:
            raise Silence

    def step(self, work: Callable[[], None]) -> None:
        """what is to be done, or goes on → until it waits or has ended"""
        if self._running:
            self._go.release()
        else:
            self._running = True
            threading.Thread(target=self._work, args=(work,), daemon=True).start()
        self._back.acquire()

    def _work(self, work: Callable[[], None]) -> None:
        work()
        self._running = False
        self._back.release()

    def end(self) -> None:
        """Switches the control off."""
        self._over = True
        if self._running:
            self.step(lambda: None)


class Bus:
    """Modbus as it goes wrong: lost requests and answers, answers of before, answers half old and half new, a busy device."""

    chunk = 1024
    KINDS = ("request lost", "answer lost", "late answer", "torn", "busy", "line lost")

    def __init__(
        self,
        device: Registers,
        clock: FakeClock,
        chance: random.Random,
        rates: dict[str, float],
        turns: Turns | None = None,
        injected: Counter[str] | None = None,
    ) -> None:
        self._injected: Counter[str] = Counter() if injected is None else injected
        self._device, self.clock, self._chance, self._rates, self._turns = device, clock, chance, rates, turns
        self._request, self._before, self._wait = b"", "", 0
        self._old = list(device.words)

    def write(self, data: bytes) -> int:
        self._request += data
        return len(data)

    def read(self, timeout: float) -> bytes:
        line, end, self._request = self._request.partition(b"\n")
        if not end:
            self.clock.seconds += timeout
            return b""
        self.clock.seconds += 0.01
        answer = self._answer(*map(int, line.split()))
        return f"{answer}\n".encode()

    def _answer(self, code: int, address: int, *words: int) -> str:
        fault = next((kind for kind in self.KINDS if self._chance.random() < self._rates.get(kind, 0.0)), None)
        if fault is not None:
            self._injected[fault] += 1
        if fault == "line lost":
            raise Lost("the line was cut")
        if fault == "request lost" or self._device.silent:
            return "- no answer"
        if fault == "busy":
            return "! 6"
        if code == 16:
            if self._device.write(address, list(words)):
                self._wait = self._chance.randrange(4)
            reply = f"16 {address} {len(words)}"
        else:
            self._wait = self._chance.randrange(4) if self._device.look() else self._wait
            if self._device.pending and self._wait == 0:
                self._old = list(self._device.words)
                self._turns.step(self._device.execute) if self._turns else self._device.execute()
            self._wait = max(0, self._wait - 1)
            now = self._device.words
            if fault == "torn":
                cut = self._chance.randrange(len(now))
                now = [*self._old[:cut], *now[cut:]]
            reply = " ".join(map(str, [3, *now[address : address + words[0]]]))
        late, self._before = self._before, reply
        if fault == "late answer":
            fits = late.split()[:1] == [str(code)] and len(late.split()) == len(reply.split())
            return late if fits else "- the answer to another request"
        return "- no answer" if fault == "answer lost" else reply

    def close(self) -> None:
        if self._device.pending and self._turns is None:  # a program waits until its record is taken
            self._device.execute()  # the control finishes what it was told, whatever becomes of the line


def stopped_by_the_user(protocol: str, made: Plan, motion: Motion, options: dict, due: Callable) -> tuple[list, list[tuple]]:
    """modbus or grbl, plan, its motion, options, (client, events) → whether Ctrl-C comes now → events, where it went."""
    device: Any = Registers(motion) if protocol == "modbus" else switched_on(motion)
    numbers = tuple(touch.number for touch in made.touches)
    job = Task(made, "", "M", made.machine.names, (99.0,) * (len(numbers) + 1), numbers)
    client = importlib.import_module(f"tango_cnc.link.protocols.{protocol}").Client(job, options)
    events: list = []
    went: list[tuple] = []
    told = False
    while not any(isinstance(event, Failed) for event in events):
        request = client.bytes_to_send(1 << 16)
        if protocol == "modbus":
            bus = Bus(device, FakeClock(), random.Random(0), {})
            bus.write(request)
            answer = bus.read(0.0)
            if device.pending:
                device.execute()
        else:
            lines = device.report() if request == b"?" else device.line(request.decode().strip())
            answer = "".join(f"{line}\n" for line in lines).encode()
        went.append(tuple(motion.position))
        events += client.receive(answer)
        if due(client, events) and not told:
            told = True
            client.stop()
    return events, went


def _post(part) -> list[Program]:
    cell, _, _ = scene()
    name, mark, lines = posts.program(posts.load("fanuc"), part, {}, plan_hash(part))
    written = tuple(lines())
    return [Program(name, mark, lambda: iter(written), part, cell.machine.names)]


def _touched(strategy) -> tuple:
    """→ what one plan of the scene differs by from another"""
    return tuple((*indexation.position.items(), indexation.facets) for indexation in strategy.indexations)


post = remembered(_post, lambda part: _touched(part.strategy))
hashed = remembered(plan_hash, lambda part: _touched(part.strategy))
lasting = remembered(measuring.durations, lambda part: _touched(part.strategy))
replanned = remembered(plan, lambda cell, obstructed: _touched(cell.strategy))
SEARCHES = {name: remembered(search) for name, search in vars(motions).items() if name.startswith("first_")}
gaps = remembered(
    lambda r, row, positions, direction: motions.surfaces.gaps(
        r.surfaces, motions.place(r.true, positions, np.broadcast_to(direction, positions.shape)).tip
    )[:, row]
)
layout = functools.cache(read_layout)


def moves_remembered(monkeypatch) -> None:
    """A machine without noise and effects meets on the same move the same thing."""
    for name, search in SEARCHES.items():
        monkeypatch.setattr(motions, name, search)
    monkeypatch.setattr(Motion, "_gaps", lambda self, *move: gaps(self.rig, *move))


def patched(monkeypatch, clock: FakeClock) -> None:
    """Whole sessions in memory: no waiting, no disk."""
    moves_remembered(monkeypatch)
    monkeypatch.setattr(measuring, "time", SimpleNamespace(monotonic=clock))
    monkeypatch.setattr("tango_cnc.link.journal.os.fsync", lambda handle: None)
    monkeypatch.setattr(resting, "make_plan", replanned)
    monkeypatch.setattr(measuring, "plan_hash", hashed)
    monkeypatch.setattr(measuring, "durations", lasting)
    monkeypatch.setattr("tango_cnc.link.protocols.modbus.read_layout", layout)


def machine_faults(chance: random.Random) -> Faults:
    name = chance.choice([None, None, None, *WORDS])
    return Faults({} if name is None else {name: chance.randrange(1, TOUCHES)})


def tape_session(seed: int, folder: Path, monkeypatch, clock: FakeClock) -> tuple[Ledger, int]:
    """seed → the ledger, how often the run was resumed. Everything is measured when this returns."""
    chance, ledger = random.Random(seed), Ledger()
    rates = {kind: chance.choice([0.0, 3e-4, 3e-3]) for kind in ("drop", "flip", "double")}
    rates |= {kind: 5e-3 for kind in ("delay", "split", "merge")}
    there = {kind: chance.choice([0.0, 3e-6, 1e-5]) for kind in ("drop", "flip", "double")}

    def opened(address, **how):
        cut = chance.choice([None, None, None, None, chance.randrange(1, 6000)])
        disturb = ledger.disturbance(rates, chance.randrange(1 << 30))
        faults = machine_faults(chance) if chance.random() < 0.3 else Faults()
        return Parity(Tape(ledger, clock, faults, ledger.disturbance(there, chance.randrange(1 << 30)), disturb, cut), False)

    monkeypatch.setattr(measuring, "open_port", opened)
    return ledger, _until_all_is_measured("socket://localhost:1?tv=even", "dnc", folder)


def bus_session(seed: int, folder: Path, monkeypatch, clock: FakeClock) -> tuple[Ledger, int]:
    """seed → the ledger, how often the run was resumed; the control stays as it is between two attempts, but for its alarms.

    In every third session it runs the program itself and hands its records over; now and then nobody has brought the new one.
    """
    if seed % 3 == 0:
        return resident_session(seed, folder, monkeypatch, clock)
    chance, ledger = random.Random(seed), Ledger()
    rates = {kind: chance.choice([0.0, 3e-3, 3e-2]) for kind in Bus.KINDS[:-1]} | {"line lost": 1e-3}
    truth = scene()[2]
    first = Motion(truth, ledger.note, faults=machine_faults(chance))
    devices = [Registers(first, ledger.note, clock=clock, ticket=chance.randrange(1 << 16))]

    def opened(address, **how):
        if devices[0].words[STATUS] != IDLE or devices[0].silent or devices[0].motion.deflected:
            # somebody has cleared the alarm, freed the probe and sent the axes home
            devices[0] = Registers(Motion(truth, ledger.note), ledger.note, clock=clock, ticket=devices[0].words[TICKET] + 1)
        return Bus(devices[0], clock, chance, rates, injected=ledger.injected)

    monkeypatch.setattr(measuring, "open_port", opened)
    return ledger, _until_all_is_measured("modbus+tcp://localhost:1/1", "dnc", folder)


def resident_session(seed: int, folder: Path, monkeypatch, clock: FakeClock) -> tuple[Ledger, int]:
    """seed → the ledger, how often the run was resumed; before each attempt somebody resets the control."""
    chance, ledger = random.Random(seed), Ledger()
    rates = {kind: chance.choice([0.0, 3e-3, 3e-2]) for kind in Bus.KINDS[:-1]} | {"line lost": 1e-3}
    posted: list[str] = []
    turns: list[Turns] = []

    def brought(part) -> list[Program]:
        found = post(part)
        if not posted or chance.random() < 0.9:
            posted.append(found[0].text)
        return found

    def opened(address, **how):
        for old in turns:
            old.end()
        turns[:] = [Turns()]
        faults = machine_faults(chance) if chance.random() < 0.3 else Faults()
        motion, text = Motion(scene()[2], ledger.note, faults=faults), posted[-1]
        device = Registers(
            motion,
            ledger.note,
            program=lambda motion, punch: resident(text, motion, punch),
            waited=turns[0].waited,
            clock=clock,
            ticket=chance.randrange(1 << 16),
        )
        return Bus(device, clock, chance, rates, turns[0], ledger.injected)

    monkeypatch.setattr(measuring, "open_port", opened)
    resumed = _until_all_is_measured("modbus+tcp://localhost:1/1?run=program", "dnc", folder, posting=brought)
    turns[0].end()
    return ledger, resumed


def resident(text: str, motion: Motion, punch: Callable[[bytes], None]) -> None:
    """program, machine, where its output goes → run to its end. Raises Alarm and Silence."""
    profile = macro_b.default_profile(scene()[0].machine)
    control = macro_b.Control(motion, profile, punch, lambda event, **data: None)
    control.run([line for line in text.strip().strip("%").splitlines() if line.strip()], False)


def cable_session(seed: int, folder: Path, monkeypatch, clock: FakeClock) -> tuple[Ledger, int]:
    """seed → the ledger, how often the run was resumed; somebody clears alarms and frees the probe between two attempts.

    The spindle is not turned: no grbl says where it stands, so that nothing finds a digit of M19 that was lost.
    """
    chance, ledger = random.Random(seed), Ledger()
    rates = [
        {kind: chance.choice([0.0, 1e-5, 5e-5]) for kind in ("drop", "flip", "double", "other")} | {"split": 5e-3, "merge": 0.0}
        for _ in range(2)
    ]
    truth = scene()[2]
    state = {
        "control": grbl.switched_on(Motion(truth, ledger.note, faults=machine_faults(chance)), ledger.note),
        "into": Input(True),
    }
    touched: list[str] = []

    def opened(address, **how):
        control = state["control"]
        stuck = control.motion.deflected and touched[-1:] == [str(control.motion.position)]
        touched.append(str(control.motion.position))
        if control.state != "Idle" or not control.report() or stuck:
            state["control"] = grbl.switched_on(Motion(truth, ledger.note), ledger.note)
        cut = chance.choice([None, None, None, None, chance.randrange(1, 60000)])
        there, back = (ledger.disturbance(part, chance.randrange(1 << 30)) for part in rates)
        return Cable(state["control"], state["into"], ledger, clock, there, back, cut)

    monkeypatch.setattr(measuring, "open_port", opened)
    return ledger, _until_all_is_measured("grbl+serial:///dev/ttyACM0", "dnc", folder, turning=False)


def _until_all_is_measured(port: str, protocol: str, folder: Path, turning: bool = True, posting: Callable = post) -> int:
    cell, made, _ = scene(turning)
    resume = 0
    for attempt in range(ATTEMPTS):
        begun = attempt > 0 and (folder / "readings.journal").exists()  # a port that does not open starts nothing
        wanted = Wanted(port, protocol, "fanuc", folder / "readings.csv", resume=begun, start_timeout=60.0)
        try:
            measure(cell, made, wanted, posting, lambda step: None, lambda part, program: None)
            return resume
        except LinkError:
            resume += 1
    raise AssertionError(f"not measured after {ATTEMPTS} attempts")


def judged(folder: Path, ledger: Ledger) -> tuple[int, int, int]:
    """folder of a session, its ledger → (readings lost, readings invented, moves asked for from an unsafe state)."""
    cell, made, _ = scene()  # the touches are the same whether the spindle turns or not
    readings = read_readings(folder / "readings.csv", cell.machine, cell.artefact)
    lost = set(range(1, len(made.touches) + 1)) - set(readings.touch.tolist())
    facet = {touch.number: touch.facet for touch in made.touches}
    scale = np.array([1.0 if axis.kind == "linear" else 180 / np.pi for axis in cell.machine.axes])
    contacts = np.array([[at[name] for name in cell.machine.names] for at in ledger.contacts])
    invented = 0
    for i, number in enumerate(readings.touch.tolist()):
        if readings.facet[i] != facet[number]:
            invented += 1
        elif readings.status[i] == "ok":
            away = contacts - readings.position[i] * scale
            away[:, scale != 1.0] = np.remainder(away[:, scale != 1.0] + 180, 360) - 180
            invented += not (np.abs(away).max(axis=1) < CLOSE).any()
    invented += max(0, sum(status != "ok" for status in readings.status) - ledger.deflected)
    return len(lost), invented, len(ledger.unsafe)
