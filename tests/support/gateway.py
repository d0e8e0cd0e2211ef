"""Modbus behind a gateway that delivers late, twice, in another order, out of a cache, for two computers at once; and its judge.

Written from docs/link.md, section `modbus`, alone: the control here shares nothing with `sim_controller`, the gateway nothing with
`linkfaults`. Time is virtual. The judge knows what each run was to ask for, in which order, and sees what the control began.
"""

from __future__ import annotations

import contextlib
import heapq
import math
import random
from dataclasses import dataclass, field

from support.linkparts import job
from tango_cnc.link.client import Ended, Event, Failed, Touched
from tango_cnc.link.protocols.modbus import Client
from tango_cnc.link.transport import Lost

WORD = 1 << 16
LARGE = 1 << 31  # numbers of runs
BEGIN, MOVE, TURN, PROBE, END = 0x101F, 0x10E3, 0x116C, 0x12B4, 0x1351
CONSTANTS = {30: 3, 31: 0x1234, 32: 0x0102, 33: 0x0304}
FRESH, SILENCE = 2, 10
ANSWER = 1.0  # s that the computer waits for an answer
IDLE, BUSY, HOLD = 0, 1, 5
LONGEST = 3600.0  # s of a session: whatever happens, it has an end
OTHERS = 1e-3  # chance of a second computer, at each step
TEN = [10.0**-4] * 7


@dataclass
class Begun:
    """What the control began: when, for whom, which command."""

    at: float
    client: int
    sequence: int
    words: tuple[int, ...]  # command, mask, touch, feed, target


class Control:
    """The seven rules of docs/link.md, scanned every 20 ms of virtual time."""

    SCAN = 0.02

    def __init__(self, chance: random.Random) -> None:
        self.chance, self.now = chance, 0.0
        self.begun: list[Begun] = []
        self.contacts: dict[tuple[int, int], list[int]] = {}  # (client, touch) → counts
        self.moved_until = 0.0
        self.unheard = 0.0  # longest time of moving without a new `heard`, s
        self.r = [0] * 100
        self.switch_on()

    def switch_on(self) -> None:
        """Rule 1."""
        place = self.r[10:24]
        self.r = [0] * 100
        self.r[10:24] = place
        for register, value in CONSTANTS.items():
            self.r[register] = value
        self.r[3] = self.r[2] = self.chance.randrange(WORD)
        self.r[1] = self.chance.randrange(WORD)
        self.r[4], self.since, self.issued = 100, self.now, 100
        self.newest, self.heard_at, self.done_at = 0, self.now - 1e6, 0.0

    def scan(self) -> None:
        """Rules 2 to 6, once."""
        r = self.r
        r[4] = (100 + int(self.now - self.since)) % WORD
        if (r[4] - r[83]) % WORD < (r[4] - self.newest) % WORD:
            self.newest, self.heard_at = r[83], self.now
        attended = (r[4] - self.newest) % WORD <= SILENCE
        if r[0] == BUSY:
            self.unheard = max(self.unheard, self.now - self.heard_at)
            if not attended:
                r[0] = HOLD
            elif self.now >= self.done_at:
                self._done()
            return
        if r[0] != IDLE:
            return
        due = (r[1] + 1) % WORD
        aged = (r[4] - self.issued) % WORD > FRESH
        if r[62] == due and (r[60:82] != r[34:56] or r[2] == r[3] or aged):
            r[34:56] = r[60:82]
            r[3] = (r[3] + 1) % WORD
            self.issued, aged = r[4], False
        if r[82] == r[3] and r[2] != r[3] and not aged and r[36] == due and attended:
            r[0], r[2] = BUSY, r[3]
            self.begun.append(Begun(self.now, self.client, r[36], tuple(r[37:56])))
            self.done_at = self.now + self.chance.choice([0.05, 0.5, 2.0, 6.0])

    @property
    def client(self) -> int:
        """→ number of the run whose request stands in the echo."""
        return self.r[34] << 16 | self.r[35]

    def _done(self) -> None:
        r = self.r
        for axis in range(7):
            if r[38] >> axis & 1 and r[37] in (MOVE, TURN, PROBE):
                r[10 + 2 * axis : 12 + 2 * axis] = r[42 + 2 * axis : 44 + 2 * axis]
        if r[37] == PROBE:
            r[5], r[6] = r[39], 1
            contact = [round(v / 1e-4) for v in contact_of(r[39])]
            for axis, counts in enumerate(contact):
                r[10 + 2 * axis : 12 + 2 * axis] = [counts >> 16 & 0xFFFF, counts & 0xFFFF]
            self.contacts[self.client, r[39]] = contact
        r[1] = r[36]
        r[0] = IDLE

    def reset(self) -> None:
        """Somebody at the control ends what it holds; the command is not acknowledged."""
        self.r[0] = IDLE

    def until(self, moment: float) -> None:
        """→ scanned until then."""
        while self.now < moment - 1e-9:
            self.now += self.SCAN
            self.scan()


def contact_of(touch: int) -> tuple[float, float, float]:
    """touch → mm where the plan of linkparts meets its facet."""
    found = job().plan.touches[touch - 1].contact
    return found[0], found[1], found[2]


def wanted(made) -> list[tuple[int, ...]]:
    """job → what its run has to ask for, in this order: command, mask, touch, feed, target."""
    axes, approach = "XYZABCS", made.plan.strategy.approach
    asked = [(BEGIN, 0, 0, *[0] * 16)]
    for move in made.plan.moves:
        if move.kind == "back":
            continue
        code = {"probe": PROBE, "index": TURN}.get(move.kind, MOVE)
        counts = [0] * 7
        for letter, value in move.target.items():
            counts[axes.index(letter)] = round((value if letter in "XYZ" else math.degrees(value)) / 1e-4)
        words = [word for count in counts for word in (count >> 16 & 0xFFFF, count & 0xFFFF)]
        feed = round(approach.feed / 0.1) if move.kind == "probe" else 0
        mask = sum(1 << axes.index(letter) for letter in move.target)
        asked.append((code, mask, move.touch, feed >> 16, feed & 0xFFFF, *words))
    return [*asked, (END, 0, 0, *[0] * 16)]


class Gateway:
    """Requests and answers on their way; `rates` says how often what goes wrong."""

    KINDS = ("late request", "request twice", "request lost", "answer lost", "old answer", "cached", "turned bit", "restart")

    def __init__(self, control: Control, chance: random.Random, rates: dict[str, float]) -> None:
        self.control, self.chance, self.rates = control, chance, rates
        self.happened = dict.fromkeys(self.KINDS, 0)
        self._queue: list[tuple[float, int, list[int]]] = []  # writes that arrive some time
        self._count = 0
        self._snapshots: list[tuple[float, list[int]]] = []
        self._answers: dict[tuple[int, int], str] = {}

    def _now(self, kind: str) -> bool:
        hit = self.chance.random() < self.rates.get(kind, 0.0)
        self.happened[kind] += hit
        return hit

    def wait(self, seconds: float) -> None:
        """s → passed while no computer asks."""
        self.pass_time(seconds)

    def close(self) -> None:
        """The session has ended."""

    def pass_time(self, seconds: float) -> None:
        """s → passed; what is due arrives on the way, in the order of its being due and no other."""
        end = self.control.now + seconds
        while self._queue and self._queue[0][0] <= end:
            due, _, request = heapq.heappop(self._queue)
            self.control.until(due)
            self._arrive(request)
        self.control.until(end)

    def _arrive(self, request: list[int]) -> None:
        _, at, *words = request
        if at >= 60:
            self.control.r[at : at + len(words)] = words
        self.control.scan()

    def _later(self, request: list[int], seconds: float) -> None:
        self._count += 1
        heapq.heappush(self._queue, (self.control.now + seconds, self._count, request))

    def ask(self, line: str) -> str:
        """request of a computer → its answer, or that none came in time."""
        request = [int(word) for word in line.split()]
        if self._now("restart"):
            self.control.switch_on()
        if request[0] == 16 and self._now("turned bit"):
            place = self.chance.randrange(2, len(request))
            request[place] ^= 1 << self.chance.randrange(16)
        self.pass_time(self.chance.choice([0.02, 0.04, 0.1]))
        if self._now("request lost"):
            self.pass_time(ANSWER)
            return "- no answer"
        if self._now("late request"):
            self._later(request, self.chance.choice([0.5, 1.5, 3.0, 8.0, 15.0, 40.0, 120.0]))
            self.pass_time(ANSWER)
            return "- no answer"
        if self._now("request twice"):
            self._later(request, self.chance.choice([0.05, 0.3, 2.0, 12.0, 60.0]))
        answer = self._answered(request)
        if self._now("answer lost"):
            self.pass_time(ANSWER)
            return "- no answer"
        return answer

    def _answered(self, request: list[int]) -> str:
        code, at, *words = request
        shape = (code, words[0] if code == 3 else len(words))
        before = self._answers.get(shape)
        if code == 16:
            self._arrive(request)
            said = f"16 {at} {len(words)}"
        else:
            registers = self.control.r
            self._snapshots = [(t, r) for t, r in self._snapshots if self.control.now - t <= 5.0][-50:]
            if self._snapshots and self._now("cached"):
                registers = self.chance.choice(self._snapshots)[1]
            self._snapshots.append((self.control.now, list(self.control.r)))
            said = " ".join(map(str, [3, *registers[at : at + words[0]]]))
        self._answers[shape] = said
        return before if before is not None and self._now("old answer") else said


@dataclass
class Run:
    """One computer's attempt, from its first request to its end."""

    nonce: int
    client: Client
    asked: list[tuple[int, ...]]
    ended: float | None = None
    complete: bool = False
    why: str = ""
    touched: list[Touched] = field(default_factory=list)
    began: float = 0.0

    def step(self, gateway: Gateway) -> None:
        """One request, or what the silence means."""
        before = gateway.control.now
        request = self.client.bytes_to_send(1 << 16)
        events: list[Event] = []
        try:
            if request:
                events += self.client.receive(self.answer(gateway, request))
            else:
                gateway.wait(0.05)
        except Lost as error:
            events.append(Failed(str(error)))
        events += self.client.elapsed(gateway.control.now - before)
        for event in events:
            if isinstance(event, Touched):
                self.touched.append(event)
            elif isinstance(event, Ended | Failed):
                self.ended, self.complete = gateway.control.now, isinstance(event, Ended)
                self.why = event.why if isinstance(event, Failed) else ""
        if self.ended is not None:
            self.gone()

    def answer(self, gateway: Gateway, request: bytes) -> bytes:
        """request in words → its answer in words; over a line Lost where that is gone."""
        return f"{gateway.ask(request.decode().strip())}\n".encode()

    def gone(self) -> None:
        """The process of this computer has ended."""


@dataclass
class Verdict:
    """What a session came to."""

    unsafe: list[str]
    lost: int
    invented: int
    hung: bool
    runs: int
    complete: int
    happened: dict[str, int]


def session(seed: int, behind: type[Gateway] = Gateway, computer: type[Run] = Run, others: float = OTHERS) -> Verdict:
    """seed, gateway and its computers, chance of a second one → one session.

    Runs over a bad gateway until one is complete, now and then a second computer, kills, restarts.
    """
    chance = random.Random(seed)
    rates = {kind: chance.choice([0.0, 0.005, 0.05]) for kind in behind.KINDS if kind != "restart"}
    rates["restart"] = chance.choice([0.0, 0.0, 2e-3])
    control = Control(chance)
    with contextlib.closing(behind(control, chance, rates)) as gateway:
        runs = played(gateway, computer, others)
        gateway.wait(200.0)  # whatever is still on its way arrives
        return judged(control, gateway, runs)


def played(gateway: Gateway, computer: type[Run], others: float) -> list[Run]:
    """gateway, its computers, chance of a second one → the runs, of which the last one is complete in time."""
    control, chance = gateway.control, gateway.chance
    runs: list[Run] = []

    def begin() -> Run:
        made = job(nonce=chance.randrange(1, LARGE), patience=(60.0,) * 4, start_patience=60.0)
        runs.append(computer(made.nonce, Client(made, {}), wanted(made), began=control.now))
        return runs[-1]

    live = [begin()]
    while not any(run.complete for run in runs) and control.now < LONGEST:
        run = chance.choice(live)
        run.step(gateway)
        if chance.random() < 1e-3:  # killed
            run.ended, run.why = control.now, "killed"
            run.gone()
        if len(live) == 1 and chance.random() < others:  # somebody else begins
            live.append(begin())
        live = [run for run in live if run.ended is None]
        if not live:
            gateway.wait(chance.choice([0.0, 0.5, 5.0, 30.0]))
            if control.r[0] not in (IDLE, BUSY):
                control.reset()
            live = [begin()]
        if len(runs) > 30:
            gateway.rates = {}
    for run in live:
        run.gone()
    return runs


def judged(control: Control, gateway: Gateway, runs: list[Run]) -> Verdict:
    """what the control began, what the runs were to ask for and were told → verdict."""
    unsafe = []
    done: dict[int, int] = {}
    for begun in control.begun:
        run = next((run for run in runs if run.nonce == begun.client and run.began <= begun.at), None)
        if run is None:
            unsafe.append(f"{begun}: nobody asked for it")
            continue
        if run.ended is not None and begun.at > run.ended + FRESH + 1.0:
            unsafe.append(f"{begun}: {begun.at - run.ended:.1f} s after its run had ended ({run.why})")
        place = done.get(id(run), 0)
        if place >= len(run.asked) or begun.words != run.asked[place]:
            unsafe.append(f"{begun}: its run's command {place} was another one")
        done[id(run)] = place + 1
    if control.unheard > SILENCE + 1.5:
        unsafe.append(f"moved for {control.unheard:.1f} s without having heard anybody")
    invented = 0
    for run in runs:
        for touched in run.touched:
            contact = control.contacts.get((run.nonce, touched.number))
            said = [round(touched.position[letter] / 1e-4) for letter in "XYZ"]
            invented += contact is None or said != contact
    complete = [run for run in runs if run.complete]
    lost = sum(3 - len({touched.number for touched in run.touched}) for run in complete)
    return Verdict(unsafe, lost, invented, not complete, len(runs), len(complete), gateway.happened)
