"""A grblHAL-like control: lines answered with ok, realtime ?, [PRB:…] in machine coordinates, alarms that lock.

What it understands is what a probing host sends: G0 G1 G4 G38.2 to G38.5, G53, modal words without effect here, M19, $-commands.
"""

from __future__ import annotations

import math
import queue
import re
import threading
from collections.abc import Mapping

from ..lines import Line
from ..motion import Motion, MotionStop, Note
from ..session import Session

TCP, PTY = "grbl+socket://{}", "grbl+serial://{}"
WORD = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))")
KNOWN = {0, 1, 4, 17, 20, 21, 38.2, 38.3, 38.4, 38.5, 40, 49, 53, 54, 80, 90, 91, 94}
LETTERS = "XYZABC"
WORDS = "GMFSTNPR" + LETTERS
INCH = 25.4
ROOM = 255  # characters of a line


class Grbl:
    """The control as its line hears it: `line` executes one, `report` answers the ?."""

    def __init__(
        self, motion: Motion, note: Note = lambda event, **data: None, *, inches: bool = False, work: Mapping[str, float]
    ) -> None:
        self.motion, self._note, self._inches, self._work = motion, note, inches, work
        self.axes = tuple(name for name in LETTERS if name in motion.machine.names)
        self.state = "Idle"
        self._probed, self._flag = dict.fromkeys(self.axes, 0.0), 0
        self._modal, self._relative = 0.0, False
        self._silent = False

    def report(self) -> list[str]:
        """→ the answer to ?; nothing when its power is gone."""
        pin = "|Pn:P" if self.motion.deflected else ""
        return [] if self._silent else [f"<{self.state}|MPos:{self._shown(self._place())}|FS:0,0{pin}>"]

    def line(self, text: str) -> list[str]:
        """one line without its end → what is answered."""
        if self._silent:
            return []
        if not text:
            return ["ok"]
        if len(text) > ROOM:
            return ["error:11"]
        if text.startswith("$"):
            return self._dollar(text)
        if self.state == "Alarm":
            self._note("unsafe", why=f"{text} in alarm")
            return ["error:9"]
        try:
            return self._block(text.replace(" ", "").upper())
        except MotionStop as stop:
            if str(stop) == "silence":
                self._silent = True
                return []
            self.state = {"door": "Door:0"}.get(str(stop), "Alarm")
            self._note("alarm", text=str(stop))
            return (
                []
                if str(stop) == "door"
                else ["ALARM:2" if stop.cause == "overtravel" else "ALARM:13" if stop.cause == "collision" else "ALARM:3"]
            )

    def _dollar(self, text: str) -> list[str]:
        if text == "$X":
            self.state = "Idle"
            return ["[MSG:Caution: Unlocked]", "ok"]
        zero = self._shown(dict.fromkeys(self.axes, 0.0))
        answers = {
            "$I": [
                "[VER:1.1f.20240101:]",
                f"[OPT:VNMSL,100,1024,{len(self.axes)},0]",
                f"[AXS:{len(self.axes)}:{''.join(self.axes)}]",
            ],
            "$$": ["$10=511", f"$13={int(self._inches)}", "$22=0"],
            "$G": [f"[GC:G0 G54 G17 G21 G{91 if self._relative else 90} G94 G49 G98 G50 M5 M9 T0 F0. S0.]"],
            "$#": [
                f"[G54:{self._shown({name: self._work.get(name, 0.0) for name in self.axes})}]",
                f"[G92:{zero}]",
                "[TLO:0.000]",
                f"[PRB:{self._shown(self._probed)}:{self._flag}]",
            ],
        }
        return [*answers[text], "ok"] if text in answers else ["error:3"]

    def _block(self, text: str) -> list[str]:
        if WORD.sub("", text):
            return ["error:1"]
        words = [(letter, float(number)) for letter, number in WORD.findall(text)]
        codes = [number for letter, number in words if letter == "G"]
        values = dict(words)
        if any(code not in KNOWN for code in codes) or any(letter not in WORDS for letter, _ in words):
            return ["error:20"]
        self._modal = next((code for code in codes if code in (0, 1, 38.2, 38.3, 38.4, 38.5)), self._modal)
        self._relative = (self._relative or 91 in codes) and 90 not in codes
        if 4 in codes:
            self.motion.dwell(values.get("P", 0.0))
        elif values.get("M") == 19:
            self.motion.rapid({"S": math.radians(values.get("R", 0.0))})
        elif any(name in values for name in LETTERS):
            if any(name in values for name in LETTERS if name not in self.axes):
                return ["error:20"]
            target = self._target(values, 53 in codes)
            if self._modal >= 38:
                return self._probe(target, values)
            if self._modal == 1:
                if values.get("F", 1.0) <= 0:
                    return ["error:22"]
                self.motion.feed(target, values.get("F", 1000.0))
            else:
                self.motion.rapid(target)
        return ["ok"]

    def _target(self, values: Mapping[str, float], machine: bool) -> dict[str, float]:
        here = self._place()
        found = {}
        for name in self.axes:
            if name in values:
                base = here[name] if self._relative else 0.0 if machine else self._work.get(name, 0.0)
                value = base + values[name]
                found[name] = value if name in "XYZ" else math.radians(value)
        return found

    def _probe(self, target: Mapping[str, float], values: Mapping[str, float]) -> list[str]:
        here = self._place()
        if all(abs((v if n in "XYZ" else math.degrees(v)) - here[n]) < 1e-6 for n, v in target.items()):
            return ["error:33"]
        if "F" not in values:
            return ["error:22"]
        skip = self.motion.skip(target, values["F"])
        if skip.already:
            self.state = "Alarm"
            self._note("alarm", text="4")
            return ["ALARM:4", "ok"]
        self._probed, self._flag = self._place(skip.position), int(skip.hit)
        answer = [f"[PRB:{self._shown(self._probed)}:{self._flag}]", "ok"]
        if not skip.hit and self._modal == 38.2:
            self.state = "Alarm"
            return ["ALARM:5", *answer]
        return answer

    def _place(self, position: object = None) -> dict[str, float]:
        values = self.motion.position if position is None else position
        named = dict(zip(self.motion.machine.names, map(float, values), strict=True))  # type: ignore[call-overload]
        return {name: named[name] if name in "XYZ" else math.degrees(named[name]) for name in self.axes}

    def _shown(self, place: Mapping[str, float]) -> str:
        """{axis: mm, deg} → the numbers as grbl shows them: three places in mm, four in inches."""
        if self._inches:
            return ",".join(f"{v / INCH:.4f}" if name in "XYZ" else f"{v:.3f}" for name, v in place.items())
        return ",".join(f"{v:.3f}" for v in place.values())


def serve(line: Line, session: Session, once: bool) -> None:
    """line, session → served until the line closes; CR and LF both end a line, ? is answered at once."""
    if session.device is None:
        session.device = Grbl(session.motion(), session.note, work={})
    control: Grbl = session.device
    lines: queue.Queue[str] = queue.Queue()
    lock = threading.Lock()

    def say(texts: list[str]) -> None:
        with lock:
            line.send("".join(f"{text}\r\n" for text in texts).encode("ascii"))

    def work() -> None:
        while True:
            say(control.line(lines.get()))

    threading.Thread(target=work, daemon=True).start()
    text = bytearray()
    while True:
        data = line.receive(0.05)
        session.received(len(data))
        for byte in data:
            if byte == ord("?"):
                say(control.report())
            elif byte in b"\r\n":
                lines.put(text.decode("latin-1").strip())
                text.clear()
            else:
                text.append(byte)
