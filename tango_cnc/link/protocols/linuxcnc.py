"""LinuxCNC on this computer, told what to do through linuxcncrsh (2.9 and newer) and read from the log that its program writes.

    HELLO ▶ enable ▶ estop, machine, homed? ▶ mode auto ▶ program put and opened ▶ run ▶ { log lines, status, errors } ▶ end mark

The dialects differ in what they answer to `set`, and with which line end (2.9~pre: LF CR); therefore every `set` is followed by a
`get` whose answer is waited for, other answers are taken note of only when they refuse, and no command is used that 2.9 lacks.
linuxcncrsh has no way to send a file or to read one: the transport puts the program at `file` and hands the lines of `log` in,
with LOG in front. Emergency stop is not released, the machine not switched on and nothing homed from here: people do that.

LinuxCNC 2.9 now and then loses count of its own motions between two probing moves and ends the program (`LOST_COUNT`). Nothing
has been met then: the machine goes back as after an end that the user wants, and the run can be resumed at once.

An end that the user wants is an abort, wherever the machine is then, and in MDI the way back that the plan came: from the
measuring move to the stand-off, from the approach to where it began. Elsewhere it stands on a way that is clear already.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence

from ...records import Machine, Plan, Touch
from .._dialogue import Dialogue, Stop, Talk
from ..client import Begun, Ended, Identified, Refused, Task, Touched
from ..words import record

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "file": (),  # where LinuxCNC finds the program; written by the transport
    "log": (),  # what (LOGOPEN,…) of the program writes
    "password": (),
    "enable": (),
}
SCHEMES: Mapping[str, str] = {"linuxcnc": "rsh"}
IDLE_POLLS = 3  # answers in a row that say the program does not run, before that is believed
READY = {"estop": "OFF", "machine": "ON"}
ADVICE = {"estop": "release emergency stop", "machine": "switch the machine on"}
RUNS = "a program is running: wait for its end, or abort it at the control and draw the probe clear, then run again"
PLACES = "XYZABC"  # order of the values of abs_act_pos
BESIDE, TURNED = 0.5, 0.1  # mm, deg from a move that the machine still is on
THERE = 0.01  # mm
LOST_COUNT = "QUEUE IS NOT EMPTY AFTER PROBING"  # github.com/LinuxCNC/linuxcnc, issues 263, 662, 3650
LEAVING = 1000.0  # mm/min


class Client(Dialogue):
    """Runs one program and reads its log."""

    drives = False
    explains = True

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client."""
        self._task, self._options = task, options
        self._begun = self._running = self._finished = False
        self._place = self._told = 0
        self.advice = "the program is at the control and is started from here: press nothing"
        super().__init__(task.start_patience)

    @classmethod
    def begins(cls, options: Mapping[str, str]) -> bool:
        """{option: value} → True: the program is started from here."""
        return True

    @classmethod
    def hello(cls, options: Mapping[str, str]) -> bytes:
        """{option: value} → a greeting and questions that move nothing."""
        asked = "".join(f"get {what}\r\n" for what in (*READY, "program_status"))
        return f"hello {options.get('password', 'EMC')} tango 1.1\r\n{asked}".encode("ascii")

    @classmethod
    def told(cls, data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
        """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item."""
        lines = [line.strip() for line in data.decode("latin-1").splitlines() if line.strip()]
        greeting = next((line for line in lines if line.upper().startswith("HELLO")), "")
        if not greeting:
            return False, ["this is no answer of linuxcncrsh: is it the right port (5007)?"]
        if "NAK" in greeting.upper():
            return False, ["linuxcncrsh refuses the connection password: state password=… in the port's URL"]
        said = {line.split()[0].upper(): line for line in lines if line != greeting}
        open_ = [
            f"{ADVICE[what]} before a run" for what, wanted in READY.items() if wanted not in said.get(what.upper(), wanted).upper()
        ]
        complete = all(what.upper() in said for what in (*READY, "program_status"))
        return complete and not open_, [f"LinuxCNC: {greeting}", *said.values(), *open_]

    @classmethod
    def busy(cls, data: bytes, options: Mapping[str, str]) -> str:
        """what came after `hello` → why nobody may begin here unattended; empty where no program runs."""
        said = [line.strip() for line in data.decode("latin-1").splitlines() if line.strip().upper().startswith("PROGRAM_STATUS")]
        return f"it says {said[-1]}: a program is running" if said and "IDLE" not in said[-1].upper() else ""

    @property
    def sent(self) -> tuple[int, int]:
        """→ (characters of the program put, characters in all)."""
        return self._told, len(self._task.program)

    def _late(self) -> str:
        return "come to the next touch" if self._begun else "begun the program"

    def _conversation(self) -> Talk:
        answer = yield f"hello {self._options.get('password', 'EMC')} tango 1.1\r"
        while not answer.upper().startswith("HELLO"):
            answer = yield ""
        if "NAK" in answer.upper():
            raise Stop("linuxcncrsh refuses the connection password: state password=… in the port's URL")
        self._events.append(Identified(answer))
        yield from self._set(f"set enable {self._options.get('enable', 'EMCTOO')}", "enable")
        for what, wanted in READY.items():
            found = yield from self._get(what)
            if wanted not in found.upper().split():
                raise Stop(f"the control says {found!r}: {ADVICE[what]}, then run again")
        homed = yield from self._get("joint_homed")
        machine = self._task.plan.machine
        joints = len(machine.linear) + len(machine.rotary)  # more than the machine has are listed, and are never homed
        if "NO" in homed.upper().split()[1 : 1 + joints]:
            raise Stop(f"the control says {homed!r}: home all joints, then run again")
        if "IDLE" not in (yield from self._get("program_status")).upper():
            raise Stop(RUNS)
        yield from self._set("set mode auto", "mode")
        yield f"put {len(self._task.program)} {self._task.program.encode('ascii').hex()}\r"  # of the transport, answered by it
        self._told = len(self._task.program)
        yield from self._set(f"set open {self._options.get('file', '')}", "program")
        self._running = True
        yield from self._set("set run", "program_status")
        yield from self._follow()

    def _follow(self) -> Talk:
        """Until the end mark: readings, errors, and whether the program runs."""
        idle = 0
        while not self._finished:
            if self._stopping:
                yield from self._leave("stopped by the user")
            trouble = yield from self._get("error")
            if LOST_COUNT in trouble.upper():
                yield from self._leave(
                    f"the control says {trouble!r}, a known fault of LinuxCNC 2.9 and none of the program: resume it"
                )
            if trouble.upper().split()[-1:] != ["OK"]:
                raise Stop(f"the control says {trouble!r}")
            running = "IDLE" not in (yield from self._get("program_status")).upper()
            idle = 0 if running else idle + 1
            if idle > IDLE_POLLS and not self._finished:
                raise Stop("the program has ended before its end mark")

    def _leave(self, why: str) -> Talk:
        """Aborts the program, draws the probe clear and ends the conversation."""
        self._done()
        yield from self._set("set abort", "program_status")
        at = yield from self._where()
        before: dict[str, float] = {}
        while at != before or "IDLE" not in (yield from self._get("program_status")).upper():
            at, before = (yield from self._where()), at
        way = way_back(self._task.plan, self._task.numbers[: self._place + 1], at)
        if way:
            yield from self._set("set mode mdi", "mode")
        for target in way:
            words = " ".join(f"{name}{value:.4f}" for name, value in target.items())
            yield from self._set(f"set mdi G21 G90 G94 G53 G1 {words} F{LEAVING:g}", "mode")
            while max(abs(value - at[name]) for name, value in target.items()) > THERE:
                trouble = yield from self._get("error")
                if trouble.upper().split()[-1:] != ["OK"]:
                    raise Stop(f"{why}; the probe is not drawn clear: the control says {trouble!r}")
                at = yield from self._where()
        raise Stop(f"{why}; the program is aborted and the probe " + ("has been drawn clear" if way else "is clear"))

    def _where(self) -> Generator[str, str, dict[str, float]]:
        """→ {axis: mm or deg}, machine coordinates."""
        answer = yield from self._get("abs_act_pos")
        return dict(zip(PLACES, map(float, answer.split()[1:]), strict=False))

    def _set(self, request: str, then: str) -> Generator[str, str, None]:
        yield from self._get(then, f"{request}\r\n")

    def _get(self, what: str, before: str = "") -> Generator[str, str, str]:
        """name → the answer to `get`; what comes before it is no answer, but may refuse."""
        answer = yield f"{before}get {what}\r"
        while not answer.upper().startswith(what.upper()):
            if "NAK" in answer.upper().split():
                raise Stop(f"the control refuses: {answer!r}")
            if answer.startswith("LOG "):
                self._logged(answer[4:])
            answer = yield ""
        return answer

    def _logged(self, line: str) -> None:
        """One line of the log → its event. Raises Stop for the marks of another program."""
        if not self._running:  # it logs before it has been asked
            raise Stop(RUNS)
        event = record(line, self._task.letters)
        if isinstance(event, Begun):
            if (event.mark, event.count) != (self._task.mark, len(self._task.numbers)) or self._begun:
                raise Stop(f"the log is of another program, or of another run: {line!r}")
            self._begun = True
        elif isinstance(event, Ended) and event.mark not in ("", self._task.mark):
            raise Stop(f"the log has the end mark of another program: {line!r}")
        elif not self._begun and not isinstance(event, Refused):
            raise Stop(f"a record came before the start mark: {line!r}")
        if isinstance(event, Touched) and event.number in self._task.numbers:
            self._place = max(self._place, self._task.numbers.index(event.number) + 1)
        self._finished |= isinstance(event, Ended)
        self._allowed = self._task.patience[self._place]
        self._done()
        self._events.append(event)


def way_back(plan: Plan, numbers: Sequence[int], at: Mapping[str, float]) -> list[dict[str, float]]:
    """plan, numbers of the touches up to the one that is due, {axis: mm or deg} → places of X Y Z to go to, one after the other.

    Empty when the machine is neither on a measuring move, an approach nor the way up from one: then nothing is near.
    """
    machine, touches = plan.machine, {touch.number: touch for touch in plan.touches}
    for touch in (touches[number] for number in numbers[-2:][::-1]):
        if not _turned_to(machine, touch, at):
            continue
        here = [at[name] for name in machine.linear]
        stand, end, came, goes = (
            [place[machine.column(name)] for name in machine.linear]
            for place in (touch.standoff, touch.end, touch.enter or touch.over, touch.leave or touch.over)
        )
        due = touch.number == numbers[-1]
        up = came if due else goes
        ways = [stand, up] if _on(here, stand, end) else [up] if _on(here, stand, up) else []
        if ways:
            return [dict(zip(machine.linear, place, strict=True)) for place in ways]
    return []


def _turned_to(machine: Machine, touch: Touch, at: Mapping[str, float]) -> bool:
    apart = (math.degrees(touch.standoff[machine.column(name)]) - at[name] for name in machine.rotary)
    return all(abs(math.remainder(angle, 360.0)) <= TURNED for angle in apart)


def _on(place: Sequence[float], start: Sequence[float], end: Sequence[float]) -> bool:
    """mm → whether the place lies on the way from start to end."""
    way, along = [b - a for a, b in zip(start, end, strict=True)], [b - a for a, b in zip(start, place, strict=True)]
    length = math.hypot(*way)
    if length == 0.0:
        return math.dist(place, start) <= BESIDE
    s = min(max(sum(a * b for a, b in zip(way, along, strict=True)) / length**2, 0.0), 1.0)
    return math.dist(along, [s * a for a in way]) <= BESIDE
