"""A grbl control as it answers: a line and what came before its ok, its state, axes, units and offsets."""

from __future__ import annotations

import re
from collections.abc import Generator, Mapping

from ._dialogue import Dialogue, Stop, Talk
from ._grbl import ALARMS, ERRORS
from .client import Identified, Task

INCH = 25.4
LETTERS = "XYZABC"
FRAMES = re.compile(r"\bG5[4-9](?:\.[1-3])?\b")
TURNED = re.compile(r"\bG(?:51|68)\b")  # as grblHAL says it: 'G51:XY'
Lines = Generator[str, str, list[str]]


class Control(Dialogue):
    """What is asked of the control besides moves."""

    explains = True

    def __init__(self, task: Task) -> None:
        """task → nothing known yet."""
        self._task, self._given = task, 0
        self._ready = False  # what a reset would undo has been set, and where the axes stand is known
        self._axes: tuple[str, ...] = ("X", "Y", "Z")
        self._unit = 1.0
        self._offset: dict[str, float] = {}
        super().__init__(task.start_patience)

    @classmethod
    def begins(cls, options: Mapping[str, str]) -> bool:
        """{option: value} → True: every move is asked for from here."""
        return True

    def _look(self) -> Talk:
        """Who is there, with which axes, units and offsets; raises Stop when it cannot do the plan."""
        who = yield from self._say("$I")  # what a run that was cut off left in the control's buffer is no line any more with $
        for line in who:
            if found := re.fullmatch(r"\[AXS:\d+:([A-Z]+)\]", line):
                self._axes = tuple(found[1])
        settings = yield from self._twice("$$")
        if "$13=1" in settings:
            self._unit = INCH
        modes = " ".join((yield from self._say("$G")))
        frame = FRAMES.search(modes)
        if frame is None:
            raise Stop(f"the control does not say which work offset is active: {modes!r}")
        if turned := TURNED.search(modes):
            raise Stop(f"the control says that {turned[0]} is on: targets would be scaled or turned; cancel it: G50, G69")
        listed = yield from self._twice("$#")
        if not any(line.startswith("[AXS:") for line in who):  # grbl 1.1 and FluidNC do not name their axes: they are in this order
            count = next((line.count(",") + 1 for line in listed if line.startswith(f"[{frame[0]}:")), len(self._axes))
            self._axes = tuple(LETTERS[:count])
        missing = [name for name in (*self._task.plan.machine.linear, *self._task.plan.machine.rotary) if name not in self._axes]
        if missing:
            raise Stop(f"the control has the axes {' '.join(self._axes)}; the plan moves {' '.join(missing)} as well")
        self._offset = dict.fromkeys(self._axes, 0.0)
        for line in listed:
            name, _, rest = line.strip("[]").partition(":")
            if name in (frame[0], "G92"):
                self._add(self._numbers(rest))
            elif name == "TLO":
                values = rest.split(",")
                self._add(self._numbers(rest) if len(values) > 1 else {"Z": float(values[0]) * self._unit})
        self._events.append(Identified(f"{' '.join(who)} {'inches' if self._unit != 1 else 'mm'}, {frame[0]}"))

    def _twice(self, line: str) -> Lines:
        """question → its answer. Raises Stop when the second one is another: a digit of it would shift every target."""
        first = yield from self._say(line)
        if (yield from self._say(line)) != first:
            raise Stop(f"asked twice, {line} is answered differently: the line is disturbed")
        return first

    def _modes(self, line: str, anyway: bool) -> Lines:
        """modal words, whether to send them even where they are modal already → modal, as the control says. Raises Stop when not.

        A character of such a line can make it another one, G28 of G21: it is better not sent.
        """
        wanted = set(line.split())
        said: list[str] = []
        for _ in range(2):
            if anyway:
                yield from self._say(line)
            said = yield from self._say("$G")
            if wanted <= set(" ".join(said).strip("[]").split(":")[-1].split()):
                return said
            if anyway:
                break
            anyway = True
        raise Stop(f"the control was sent {line} and says {' '.join(said)}")

    def _add(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self._offset[name] += value

    def _numbers(self, text: str) -> dict[str, float]:
        """'1.000,2.000,…' → {axis: mm or deg}. Raises Stop for anything else."""
        try:
            values = [float(number) for number in text.split(",")]
            pairs = dict(zip(self._axes, values, strict=True))
        except ValueError:
            raise Stop(f"found {text!r} where {len(self._axes)} numbers were due: the line is disturbed") from None
        return {name: value * (self._unit if name in "XYZ" else 1.0) for name, value in pairs.items()}

    def _say(self, line: str) -> Lines:
        """one line → what came before its ok. Raises Stop for errors, alarms, resets, an open door."""
        found: list[str] = []
        answer = yield line
        while answer != "ok":
            if answer.startswith("error:"):
                raise Stop(f"the control refuses {line!r}: {answer} ({ERRORS.get(answer[6:], 'see its list of errors')})")
            if answer.startswith("ALARM:"):
                raise Stop(f"the control is in alarm: {answer} ({ALARMS.get(answer[6:], 'see its list of alarms')})")
            if answer.lower().startswith("grbl"):
                if self._ready:
                    raise Stop(f"the control has been reset: {answer}")
                found, answer = [], (yield line)
                continue
            if answer.startswith("<"):
                self._state(answer)
            elif answer:
                found.append(answer)
            answer = yield ""
        self._done()
        return found

    def _state(self, report: str) -> dict[str, str]:
        """'<Idle|MPos:…|…>' → its fields. Raises Stop in a state that lets nothing move."""
        state, *fields = report.strip("<>").split("|")
        word = state.partition(":")[0]
        if word in ("Alarm", "Door", "Sleep", "Hold", "Check", "Tool"):
            raise Stop(f"the control cannot move: its state is {state}")
        return {"state": word} | {name: rest for name, _, rest in (field.partition(":") for field in fields)}
