"""grbl 1.1, grblHAL and FluidNC: lines answered with ok, `[PRB:…]` in machine coordinates, alarms that lock.

There is no logic in this language: a line is a move, a setting or a question. What differs between the three is a row of
`FIRMWARE`. Facts: gnea/grbl 1.1h (protocol.c, gcode.c, motion_control.c, report.c), grblHAL core of August 2026 (the same files and
errors.h), FluidNC where it keeps to grbl. Parameters and brackets are in `_grbl_numbers.py`. The places of G28 and G30 are machine
zero. Searches away from contact (G38.4, G38.5) are not simulated and answered as unknown.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from tango_cnc.records import Array, Machine

from ...motion import Motion, MotionStop, Note
from .._shared.alarm import Alarm, Silence
from .._shared.known import Controls
from .._shared.scales import shown
from .numbers import Parameters, Refusal, code

__all__ = ["CONTROLS", "Control", "Profile", "default_profile", "switched_on"]

LETTERS = "XYZABC"
WORDS = "FGMNPRST" + LETTERS
SPINDLE = (3, 4, 5)
MOTIONS = (0.0, 1.0, 38.2, 38.3)
HOMES = (28, 30)
FRAMES = (54, 55, 56, 57, 58, 59)
KNOWN = {*MOTIONS, *HOMES, *FRAMES, 4, 17, 20, 21, 40, 49, 53, 80, 90, 91, 94}
INCH = 25.4
GIVES = math.radians(0.01)  # that a clamped axis may be told to turn before its drive gives up
RESET = 0x18
REALTIME = {ord("?"), ord("!"), ord("~"), RESET, *range(0x80, 0x100)}  # acted on wherever they stand, unknown ones dropped
HINT = re.compile(r"\(([^)]*)\)?|;.*")


@dataclass(frozen=True)
class Firmware:
    """What the three do differently."""

    version: str  # answer to $I
    room: int  # characters of a line
    comments_count: bool  # whether blanks and comments are among them
    letters: str  # axes that it can have
    names_axes: bool  # $I says which
    keeps_contact: bool  # a failed G38.2 shows the contact before it
    repeats_errors: bool  # after an error nothing is executed before an empty line or a $-command
    one_line_end: bool  # CR LF is one end of a line, not two
    orients: bool  # knows M19
    expressions: bool  # knows parameters, brackets and (PRINT,…), where the build has them
    more: tuple[float, ...] = ()  # G-codes that the others lack, without effect here


FIRMWARE: Mapping[str, Firmware] = {
    "grbl": Firmware("[VER:1.1h.20190825:]", 80, False, "XYZ", False, True, False, False, False, False),
    "grblHAL": Firmware("[VER:1.1f.20260818:]", 256, True, LETTERS, True, False, True, True, True, True, (50, 61, 98, 99)),
    "FluidNC": Firmware("[VER:3.9 FluidNC v3.9.1:]", 128, False, LETTERS, False, True, False, False, False, True),
}


@dataclass(frozen=True)
class Profile:
    """Firmware and settings of the control."""

    firmware: Literal["grblHAL", "grbl", "FluidNC"] = "grblHAL"
    inches: bool = False  # $13: positions are shown in inches, whatever G20 and G21 say
    protection: bool = True  # $65 bit 5 of grblHAL, probe_hard_limit of FluidNC: contact in any other move is an alarm
    probe_reports: bool = True  # $10 bit 7 of grblHAL: a search is answered with [PRB:…]
    expressions: bool = True  # NGC_EXPRESSIONS_ENABLE of grblHAL; FluidNC has them in any case, grbl in none
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg
    unclamp: Mapping[str, int] = field(default_factory=dict)  # {axis: M code of a plugin that frees it}
    clamp: Mapping[str, int] = field(default_factory=dict)  # {axis: M code that holds it}; held when switched on
    scaled: Mapping[str, float] = field(default_factory=dict)  # G51 of grblHAL, left on; -1 is a mirror image


CONTROLS = Controls()


def default_profile(machine: Machine) -> Profile:
    """machine → grblHAL with all of its axes."""
    return Profile()


def switched_on(motion: Motion, note: Note = lambda event, **data: None, **settings: Any) -> Control:
    """motion, fields of the profile → a control whose answers nobody punches."""
    return Control(motion, Profile(**settings), lambda data: None, note)


class Control:
    """The control as its line hears it: `line` executes one, `report` answers the ?."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self.motion, self.profile, self._punch, self._note = motion, profile, punch, note
        self.kind = FIRMWARE[profile.firmware]
        self.axes = tuple(name for name in self.kind.letters if name in motion.machine.names)
        self.state = "Idle"
        self._probed, self._flag = dict.fromkeys(self.axes, 0.0), 0
        self._modal, self._relative, self._inch, self._feed, self._frame, self._spindle = 0.0, False, False, 0.0, 54, 5
        self._knows = self.kind.expressions and (profile.expressions or profile.firmware != "grblHAL")
        self._parameters = Parameters(self._knows, profile.firmware == "grblHAL")
        self._held = {*profile.clamp, *profile.unclamp}
        self._error = "ok"
        self._silent = False

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of a file → executed one by one, their answers sent. Raises Alarm and Silence where it locks or falls silent."""
        for line in lines:
            answers = self.line(line)
            self._punch("".join(f"{answer}\r\n" for answer in answers).encode("ascii"))
            if self._silent:
                raise Silence
            if self.state != "Idle":
                raise Alarm(next((a for a in answers if a.startswith("ALARM:")), self.state), "locked", line)
            if answers and answers[-1].startswith("error:"):
                raise Alarm(answers[-1], "refused", line)

    def report(self) -> list[str]:
        """→ the answer to ?; nothing when its power is gone."""
        pin = "|Pn:P" if self.motion.deflected else ""
        return [] if self._silent else [f"<{self.state}|MPos:{self._shown(self._place())}|FS:0,0{pin}>"]

    def line(self, text: str) -> list[str]:
        """one line without its end → what is answered."""
        if self._silent:
            return []
        text = text.partition("\0")[0]
        self.motion.reads(text)
        words = "".join(c for c in HINT.sub("", text) if c > " ").upper()
        if len(text.lstrip() if self.kind.comments_count else words) >= self.kind.room:
            return self._told(["error:11"])
        said = self._printed(text) if self.state == "Idle" and self._error == "ok" and not words.startswith("$") else []
        if not words:
            return self._told([*said, "ok"])
        if words.startswith("$"):
            return self._told(self._dollar(words))
        if self.state == "Hold:0":
            return []  # it stays in the buffer and nothing moves; nobody here lets it go on
        if self.state != "Idle":
            self._note("unsafe", why=f"{text} in alarm")
            return self._told(["error:9"])
        if self.kind.repeats_errors and self._error != "ok":
            return [self._error]
        self.state = "Run"
        try:
            answers = [*said, *self._block(words)]
        except MotionStop as stop:
            return self._stopped(stop)
        except Refusal as refusal:
            answers = [f"error:{refusal.number if self.profile.firmware == 'grblHAL' else min(refusal.number, 2)}"]
        self.state = "Idle" if self.state == "Run" else self.state
        return self._told(answers)

    def realtime(self, code: int) -> list[str]:
        """character that is part of no line (`REALTIME`) → what is answered at once."""
        if code == ord("?"):
            return self.report()
        if self._silent:
            return []
        if code == RESET:
            self._modal, self._relative, self._inch, self._feed, self._error, self._frame = 0.0, False, False, 0.0, "ok", 54
            self._spindle = 5
            self.state = "Alarm" if self.state in ("Alarm", "Run") else "Idle"
            return ["", "Grbl 1.1f ['$' for help]"]
        if code == ord("!") and self.state in ("Idle", "Run"):
            self.state = "Hold:0"
        elif code == ord("~") and self.state == "Hold:0":
            self.state = "Idle"
        return []

    def _printed(self, text: str) -> list[str]:
        """line as it came → what its remarks make the control say."""
        self._system(text)
        found = [self._parameters.printed(hint[1]) for hint in HINT.finditer(text) if hint[1]]
        begin, end = ("[MSG:", "]") if self.profile.firmware == "grblHAL" else ("[MSG:INFO: PRINT,", "]")
        return [f"{begin}{said}{end}" for said in found if said is not None]

    def _system(self, text: str) -> None:
        """line → what parameters tell that nobody sets, where it may speak of one."""
        if not self._knows or "<_" not in text.replace(" ", ""):
            return
        here, work = self._place(), self._work()
        self._parameters.system = {f"_{name.lower()}": here[name] - work[name] for name in self.axes}
        self._parameters.system |= {f"_abs_{name.lower()}": here[name] for name in self.axes}
        self._parameters.system |= {"_feed": self._feed, "_metric": float(not self._inch), "_absolute": float(not self._relative)}

    def _told(self, answers: list[str]) -> list[str]:
        self._error = answers[-1]
        return answers

    def _stopped(self, stop: MotionStop) -> list[str]:
        """What ended a motion → what is said of it."""
        if str(stop) == "silence":
            self._silent = True
            return []
        self.state = "Door:0" if str(stop) == "door" else "Alarm"
        self._note("alarm", text=str(stop))
        guarded = self.profile.protection and self.profile.firmware != "grbl"
        alarm = {"clamped": "ALARM:17", "overtravel": "ALARM:2", "collision": "ALARM:13" if guarded else "ALARM:1"}.get(
            stop.cause, "ALARM:3"
        )
        return [] if str(stop) == "door" else [alarm]

    def _dollar(self, text: str) -> list[str]:
        if text == "$X":
            locked, self.state = self.state != "Idle", "Idle"
            return [*(["[MSG:Caution: Unlocked]"] if locked else []), "ok"]
        zero = self._shown(dict.fromkeys(self.axes, 0.0))
        named = [f"[AXS:{len(self.axes)}:{''.join(self.axes)}]"] if self.kind.names_axes else []
        news = [f"[NEWOPT:ENUMS,RT+{',EXPR' if self._knows else ''},SED]"] if self.profile.firmware == "grblHAL" else []
        modes = f"G{self._modal:g} G{self._frame} G17 G{20 if self._inch else 21} G{91 if self._relative else 90}"
        modes += f" G51:{''.join(self.profile.scaled)}" if self.profile.scaled else ""
        frames = [f"[G{g}:{self._shown(self._work(g))}]" for g in FRAMES]
        others = [f"[{name}:{zero}]" for name in ("G28", "G30", "G92")]
        answers = {
            "$I": [self.kind.version, "[OPT:VNMSL,100,1024]", *news, *named],
            "$$": [f"$10={511 if self.profile.probe_reports else 383}", f"$13={int(self.profile.inches)}", "$22=0"],
            "$G": [f"[GC:{modes} G94 M{self._spindle} M9 T0 F{self._feed:g} S0]"],
            "$#": [*frames, *others, "[TLO:0.000]", f"[PRB:{self._shown(self._probed)}:{self._flag}]"],
        }
        return [*answers[text], "ok"] if text in answers else ["error:3"]

    def _block(self, text: str) -> list[str]:
        """condensed line → everything is checked before anything is done."""
        self._system(text)
        if (words := self._words(text)) is None:
            return ["error:1"]
        codes = [number for letter, number in words if letter == "G"]
        others = [letter for letter, _ in words if letter != "G"]
        values = {letter: number for letter, number in words if letter != "G"}
        motions = [code for code in codes if code in (*MOTIONS, 80)]
        orient = values.get("M") == 19 and self.kind.orients
        motion = motions[0] if motions else self._modal
        if error := self._unknown(codes, others, values, orient) or self._against(codes, others, values, motions, motion, orient):
            return [f"error:{error}"]
        self._modal, self._feed = motion, values.get("F", self._feed)
        self._relative = (self._relative or 91 in codes) and 90 not in codes
        self._inch = (self._inch or 20 in codes) and 21 not in codes
        self._frame = next((int(code) for code in codes if code in FRAMES), self._frame)
        return self._done(codes, values, orient)

    def _words(self, text: str) -> list[tuple[str, float]] | None:
        """condensed line → (letter, number) of its words, None where something is no word; assignments are made."""
        words: list[tuple[str, float]] = []
        at = 0
        while at < len(text):
            if text[at] == "#":
                at = self._parameters.assigned(text, at + 1)
                continue
            if not "A" <= text[at] <= "Z":
                return None
            value, end = self._parameters.value(text, at + 1)
            words.append((text[at], code(value) if text[at] in "GM" else value))
            at = end
        return words

    def _unknown(self, codes: list[float], others: list[str], values: Mapping[str, float], orient: bool) -> int:
        """G codes, other letters, their numbers, whether the spindle is oriented → error of a word that is not known, else 0."""
        switches = values.get("M") in (*self.profile.clamp.values(), *self.profile.unclamp.values())
        known = orient or switches or values.get("M") in SPINDLE
        strange = any(code not in KNOWN and code not in self.kind.more for code in codes) or any(x not in WORDS for x in others)
        missing = any(letter in LETTERS and letter not in self.axes for letter in others)
        return 20 if strange or missing or ("M" in values and not known) else 0

    def _against(
        self, codes: list[float], others: list[str], values: Mapping[str, float], motions: list[float], motion: float, orient: bool
    ) -> int:
        """The same, its motions, the one that acts → error of words that cannot stand together, else 0."""
        if any(sum(code in group for code in codes) > 1 for group in (FRAMES, (20, 21), (90, 91), (4, 53, *HOMES))):
            return 21
        if len(motions) > 1 or (motions and any(code in HOMES for code in codes)):
            return 24
        if len(set(others)) != len(others):
            return 25
        if values.get("F", 0.0) < 0:
            return 4
        if ("P" in values and 4 not in codes) or ("R" in values and not orient):
            return 36
        if 53 in codes and motion > 1:
            return 30
        return 31 if motion == 80 and any(name in values for name in self.axes) else 0

    def _done(self, codes: list[float], values: Mapping[str, float], orient: bool) -> list[str]:
        if 4 in codes:
            self.motion.dwell(values.get("P", 0.0))
            return ["ok"] if "P" in values else ["error:28"]
        self._spindle = next((code for code in SPINDLE if values.get("M") == code), self._spindle)
        self._clamps(values.get("M"))
        if orient:
            self.motion.rapid({"S": math.radians(values.get("R", 0.0))})
        if any(code in HOMES for code in codes):
            self.motion.rapid(dict.fromkeys(self.axes, 0.0))
            return ["ok"]
        if not any(name in values for name in self.axes):
            return ["error:26"] if any(code >= 38 and code in MOTIONS for code in codes) else ["ok"]
        target = self._target(values, 53 in codes)
        if self._modal and not self._feed:
            return ["error:22"]
        self._holds(target)
        feed = self._feed * (INCH if self._inch else 1.0)
        if self._modal >= 38:
            return self._probe(target, feed)
        if self._modal == 1:
            self.motion.feed(target, feed)
        else:
            self.motion.rapid(target)
        return ["ok"]

    def _clamps(self, word: float | None) -> None:
        """M code → it has freed or held what it is there for, before the motion of its line."""
        for names, known in ((self.profile.unclamp, self._held.difference), (self.profile.clamp, self._held.union)):
            if switched := {name for name, own in names.items() if own == word}:
                self._held = known(switched)
                self._note("switched", word=word, held="".join(sorted(self._held)))

    def _holds(self, target: Mapping[str, float]) -> None:
        """Raises MotionStop when a clamped axis is to turn. A search with one that is loose is noted."""
        here = self._place()
        for name, value in target.items():
            if name in self._held and abs(value - math.radians(here[name])) > GIVES:
                raise MotionStop("clamped", f"{name} is clamped")
        if self._modal >= 38 and (loose := set(self.profile.clamp) - self._held):
            self._note("unsafe", why=f"a search while {' '.join(sorted(loose))} is loose")

    def _target(self, values: Mapping[str, float], machine: bool) -> dict[str, float]:
        here, work = self._place(), self._work()
        found = {}
        for name in self.axes:
            if name in values:
                base = here[name] if self._relative else 0.0 if machine else work[name]
                factor = self.profile.scaled.get(name, 1.0) * (INCH if self._inch and name in "XYZ" else 1.0)
                value = base + values[name] * factor
                found[name] = value if name in "XYZ" else math.radians(value)
        return found

    def _probe(self, target: Mapping[str, float], feed: float) -> list[str]:
        here = self._place()
        if all(abs((v if n in "XYZ" else math.degrees(v)) - here[n]) < 1e-6 for n, v in target.items()):
            return ["error:33"]
        skip = self.motion.skip(target, feed)
        if skip.already:
            self.state, self._flag = "Alarm", 0
            self._note("alarm", text="4")
            return ["ALARM:4", "ok"]
        failed = not skip.hit and self._modal == 38.2
        self._flag = int(skip.hit)
        if not (failed and self.kind.keeps_contact):
            self._probed = self._place(skip.position)
        report = [f"[PRB:{self._shown(self._probed)}:{self._flag}]"] if self.profile.probe_reports else []
        if failed:
            self.state = "Alarm"
            return ["ALARM:5", *report, "ok"]
        return [*report, "ok"]

    def _work(self, frame: int | None = None) -> dict[str, float]:
        offset = self.profile.g54 if (frame or self._frame) == 54 else {}
        return {name: float(offset.get(name, 0.0)) for name in self.axes}

    def _place(self, position: Array | None = None) -> dict[str, float]:
        return shown(self.motion, self.axes, position)

    def _shown(self, place: Mapping[str, float]) -> str:
        """{axis: mm, deg} → the numbers as grbl shows them: three places in mm, four in inches."""
        if self.profile.inches:
            return ",".join(f"{v / INCH:.4f}" if name in "XYZ" else f"{v:.3f}" for name, v in place.items())
        return ",".join(f"{v:.3f}" for v in place.values())
