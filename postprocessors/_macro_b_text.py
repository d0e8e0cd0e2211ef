"""The pieces of macro text of the Macro-B family, for a call (arguments in #1 … #26) or in place (arguments as numbers)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from tango_cnc.gate import INCH, MIRRORED, STEP, STEP_FEED, step

from ._base import Job, early_distance, number
from ._common import axis_numbers, signed
from ._common import unproven as unmet

ARGUMENT = {"A": 1, "B": 2, "C": 3, "I": 4, "J": 5, "K": 6, "F": 9, "S": 19, "T": 20, "X": 24, "Y": 25, "Z": 26}
FRAME = 100  # #101 …: machine minus work coordinate of axis 1 …
MISSES = 109  # touches in a row without contact
FLAG = 110  # and #111 …: flag and machine coordinates of the last touch
WORK = 30  # #31 #32 #33: target in the work frame (local variables end at #33)
WAY = 27  # #28 #29 #30: from the start to the contact
ARRIVED = 0.01  # deg
TRIED, PAST, OUT = 8999, 9000, 9001  # sequence numbers: behind the first jump, behind the ways out, of the first of them
UNPROVEN = 7  # the stop whose text depends on what proves the probe
STOPS = {  # number from 0: what the control shows, at most 26 characters
    0: "PROBE ON OR MET SOMETHING",
    1: "WORK OFFSET CHANGED",
    2: "NO CONTACT. CHECK PROBE",
    3: "ROTARY AXIS NOT IN PLACE",
    6: "PROBE IS DEFLECTED",
    8: "MACROS OF ANOTHER PROGRAM",
    9: "ANOTHER PROGRAM WAS CALLED",
    10: "POSITIONS ARE IN INCHES",
    11: MIRRORED,
}


@dataclass(frozen=True)
class Words:
    """What differs between the dialects of the family."""

    open: tuple[str, ...] = ("POPEN",)
    close: tuple[str, ...] = ("PCLOS",)
    end: str = "M30"
    wait: str = "G53"  # where it is no option: a block after which #5021 is read with the axes at rest
    dwell: str = "G4 X{}."  # s
    shown: str = "({})"  # a text for the person at the machine
    look: str = ""  # where it is an M code of ours: the block that stops while the probe is deflected
    settle: str = ""  # a block behind the words that switch the probe on
    alarm: str = "#3000={number}({text})"
    first_alarm: int = 81
    o_digits: int = 4
    fastest: float = math.inf  # mm/min of G31

    def stop(self, which: int, text: str) -> str:
        """number from 0, at most 26 characters (older controls show no more) → the statement that ends everything."""
        return self.alarm.format(number=self.first_alarm + which, text=text)

    def tidies(self, job: Job) -> list[str]:
        """job → the blocks that switch the probe off and close the port before an alarm; none where there is nothing to do."""
        if job.options["alarm"] == "at once":
            return []
        return [*filter(None, [job.options["probe_off"]]), *self.close]

    def unless(self, job: Job, condition: str, which: int) -> str:
        """condition, number from 0 → the statement that stops where it holds: a jump to its way out, or the alarm itself."""
        return f"IF[{condition}]" + (f"GOTO{OUT + which}" if self.tidies(job) else f"THEN{self.stop(which, said(job, which))}")

    def tried(self, job: Job) -> Iterator[str]:
        """A jump before anything moves: controls that refuse one in a drip-fed program refuse it there."""
        if self.tidies(job):
            yield "(DRIP-FED WITHOUT GOTO - STATE ALARM AT ONCE IN THE PROFILE)"
            yield from (f"GOTO{TRIED}", f"N{TRIED}")

    def ways_out(self, job: Job, whiches: Iterable[int]) -> Iterator[str]:
        """numbers of alarms → their ways out, which what has gone well passes by. They stand before M30 and M99, behind which
        controls need not read."""
        if tidy := self.tidies(job):
            yield f"GOTO{PAST}"
            for which in whiches:
                yield f"N{OUT + which}"
                yield from tidy
                yield self.stop(which, said(job, which))
            yield f"N{PAST}"


def said(job: Job, which: int) -> str:
    """number of a stop from 0 → what the control shows."""
    if which == 10 and in_inches(job):
        return "POSITIONS ARE IN MM"
    return unmet(job) if which == UNPROVEN else STOPS[which]


def in_inches(job: Job) -> bool:
    """job → whether its control gives positions in inches, whatever G21 says."""
    return bool(job.options["position_unit"] == "inch")


def at(job: Job, base: int, name: str, axis: int) -> str:
    """5020 (machine), 5040 (work) or 5060 (skip), axis letter and number → the expression of that position, mm or deg."""
    return f"[#{base + axis}*{INCH:g}]" if in_inches(job) and name in "XYZ" else f"#{base + axis}"


Arguments = Mapping[str, str] | None  # None: the text of a macro, whose arguments are in local variables


def protected(job: Job, words: Words, given: Arguments) -> Iterator[str]:
    """G31 to X Y Z at F: whatever stops it short is an alarm. An axis that is not named stays where it is.

    In place its word is left out: nothing that the control may think of its position moves it.
    """
    for name, axis in _linear(job):
        if given is None:
            yield f"IF[#{ARGUMENT[name]}EQ#0]THEN#{ARGUMENT[name]}={at(job, 5020, name, axis)}"
    yield from _targets(job, given)
    named = {name: WORK + i for i, (name, _) in enumerate(_linear(job), 1) if given is None or name in given}
    yield from _free(job, words)
    yield f"{job.options['skip']} {' '.join(f'{name}#{place}' for name, place in named.items())} F{_value(given, 'F')}"
    yield from _skipped(job)
    yield words.unless(job, f"{_short(job)}GT{number(job.options['tolerance'])}", 0)


def measuring(job: Job, words: Words, given: Arguments) -> Iterator[str]:
    """G31 from I J K to X Y Z at F: flag and machine coordinates."""
    yield from _targets(job, given)
    yield from _free(job, words)
    yield f"{job.options['skip']} X#31 Y#32 Z#33 F{_value(given, 'F')}"
    yield from _skipped(job)
    for name, axis in axis_numbers(job).items():
        skipped, machine, work = (at(job, base, name, axis) for base in (5060, 5020, 5040))
        yield f"#{FLAG + axis}={skipped}+{machine}-{work}({name})"
    yield _same_frame(job, words)
    for i, (start, (_, axis)) in enumerate(zip("IJK", _linear(job), strict=True), 1):
        yield f"#{WAY + i}=#{FLAG + axis}-{signed(_value(given, start))}"
    yield f"#{FLAG}=1"
    yield f"IF[SQRT[#28*#28+#29*#29+#30*#30]LT{number(early_distance(job.plan))}]THEN#{FLAG}=2"
    yield f"IF[{_short(job)}LT{number(job.options['tolerance'])}]THEN#{FLAG}=0"
    yield f"#{MISSES}=#{MISSES}+1"
    yield f"IF[#{FLAG}NE0]THEN#{MISSES}=0"
    yield words.unless(job, f"#{MISSES}GE{job.options['misses']}", 2)


def record(job: Job, words: Words, given: Arguments) -> Iterator[str]:
    """One printed line: touch T, flag, machine coordinates, spindle at S, and their sum: the line itself checks nothing."""
    if given is not None:
        yield f"#{ARGUMENT['T']}={given['T']}"
        yield f"#{ARGUMENT['S']}={given['S']}"
    form = job.options["print_format"]
    places = {name: f"#{FLAG + axis}" for name, axis in axis_numbers(job).items()} | {"S": f"#{ARGUMENT['S']}"}
    yield f"#31={'+'.join(places.values())}(CHECK SUM K)"
    coordinates = "*".join(f"{name}{place}[{form}]" for name, place in {**places, "K": "#31"}.items())
    yield f"DPRNT[P#{ARGUMENT['T']}[60]*H#{FLAG}[10]*{coordinates}]"


def arrived(job: Job, words: Words, given: Arguments) -> Iterator[str]:
    """Rotary axes stand at A B C, whole turns aside; one that is not named is not asked. No work offset has turned with them."""
    yield from waited(job)
    for name in job.machine.rotary:
        if given is not None and name not in given:
            continue
        place = f"#{5020 + axis_numbers(job)[name]}"
        if given is None:
            yield f"IF[#{ARGUMENT[name]}EQ#0]THEN#{ARGUMENT[name]}={place}"
        yield f"#31=ABS[{place}-{signed(_value(given, name))}]"
        yield "#31=ABS[#31-360*FIX[#31/360+0.5]]"
        yield words.unless(job, f"#31GT{number(ARRIVED)}", 3)
    yield _same_frame(job, words)  # a dynamic one (G54.2, G254) would displace every move from here on


def _same_frame(job: Job, words: Words) -> str:
    """→ the statement that stops where the difference of machine and work coordinates has changed."""
    moved = "+".join(f"ABS[{at(job, 5020, n, axis)}-{at(job, 5040, n, axis)}-#{FRAME + axis}]" for n, axis in _linear(job))
    return words.unless(job, f"{moved}GT{0.0075 if in_inches(job) else 0.005}", 1)


def stepped(job: Job, words: Words) -> Iterator[str]:
    """Before all else a step: positions in inches, or a mirror image, would send the first move anywhere."""
    name, by = step(job.plan)
    place = at(job, 5020, name, axis_numbers(job)[name])
    yield f"(A STEP OF {number(STEP)} MM SHOWS WHETHER POSITIONS COME IN MM)"
    yield from _free(job, words)
    yield f"#{WORK + 1}={place}"
    yield f"G91 {job.options['skip']} {name}{number(by)} F{number(STEP_FEED)}"
    yield "G90"
    yield from _skipped(job)
    way = f"{place}-#{WORK + 1}" if by > 0 else f"#{WORK + 1}-{place}"
    yield f"#{WORK + 1}={way}"
    other, near = (STEP * INCH, "0.1") if in_inches(job) else (STEP / INCH, "0.005")
    yield words.unless(job, f"ABS[#{WORK + 1}-{number(other)}]LT{near}", 10)
    beyond = f"ABS[#{WORK + 1}-{number(STEP / 2)}]GT{number(STEP / 2 + float(job.options['tolerance']))}"
    yield words.unless(job, beyond, 11)
    short = f"ABS[#{WORK + 1}-{number(STEP)}]GT{number(job.options['tolerance'])}"
    yield words.unless(job, short, 0)


Piece = Callable[[Job, Words, Arguments], Iterator[str]]
PIECES: tuple[tuple[str, Piece], ...] = (
    ("PROTECTED MOVE TO MACHINE X Y Z AT F", protected),
    ("MEASURING MOVE FROM MACHINE I J K TO X Y Z AT F", measuring),
    ("RECORD OF TOUCH T WITH SPINDLE AT S", record),
    ("ROTARY AXES HAVE ARRIVED AT A B C", arrived),
)


def _free(job: Job, words: Words) -> Iterator[str]:
    """Where the profile knows a variable for it: a deflected probe is an alarm, before a G31 that might not notice."""
    if job.options["probe_state"] and words.look:
        yield words.look
    elif job.options["probe_state"]:
        yield from waited(job)
        yield words.unless(job, f"#{job.options['probe_state']}NE0", 6)


def waited(job: Job) -> Iterator[str]:
    """What the control must have done before a position is read: nothing is read ahead of it, or of two blocks one by one."""
    wait = job.options["wait"]
    yield wait
    if wait.startswith("G103"):
        yield from (";", ";")


def _skipped(job: Job) -> Iterator[str]:
    """A control that carries out macro statements ahead of motion does so behind a G31 as well."""
    if job.options["wait"].startswith("G103"):
        yield from waited(job)


def _linear(job: Job) -> list[tuple[str, int]]:
    return [(name, axis) for name, axis in axis_numbers(job).items() if name in "XYZ"]


def _value(given: Arguments, letter: str) -> str:
    return f"#{ARGUMENT[letter]}" if given is None else given[letter]


def _targets(job: Job, given: Arguments) -> Iterator[str]:
    for i, (name, axis) in enumerate(_linear(job), 1):
        known = given is None or name in given
        yield f"#{WORK + i}={_value(given, name) if known else at(job, 5020, name, axis)}-#{FRAME + axis}"


def _short(job: Job) -> str:
    """→ the expression for the distance in mm, axis by axis, between where a G31 ended and its target."""
    return "+".join(f"ABS[{at(job, 5060, name, axis)}-#{WORK + i}]" for i, (name, axis) in enumerate(_linear(job), 1))
