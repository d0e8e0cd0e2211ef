"""What most posts have in common: options that fit the machine, header and remarks, words of axes, the table of steps."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from textwrap import wrap
from typing import Any

from tango_cnc.gate import HOLD, PROVING, TOUCH, gate, proving_touch
from tango_cnc.gate import RELEASE as RELEASE
from tango_cnc.records import OFF, InputError, Machine

from ._base import Job, Leg, Option, Step, Whole, comment, degrees, is_endless, may_roll, number, rolled
from ._options import PROBE_STATE

LONGEST = 1000  # characters of a remark before it is broken into lines
SWITCH = re.compile(r"[HM]\d{1,4}( [PQ]\d{1,4})?")  # M10, M64 P1: nothing that moves an axis
STOPS_OR_SPINS = re.compile(r"(?<![A-Z])M0*(?:[2346]|30|99)(?!\d)")  # end of program, spindle on, tool change
HOLDS = re.compile(r"M0*(?:[01]|98)(?!\d)")  # waits for a person, calls a program: no word that holds an axis
# G words that change what the moves behind them mean: all but a dwell, the frame of G15, a call, and the builder's own G100 …
MODAL = re.compile(r"(?<![A-Z])G *0*(?!(?:4|15|65)(?!\d))\d{1,2}(?!\d)")
WAITS = ("G53", "G103 P1")  # blocks of their own that wait for the axes, or end reading ahead
LIMITS = {  # of options that are numbers; what is beyond them is a slip of the finger
    "positioning_feed": (1, 1_000_000),
    "tolerance": (0.001, 1),  # with more, a move that was stopped short would pass
    "misses": (1, 20),
    "orient_time": (1, 3600),
}
PROBE_SWITCHES = (
    Option("probe_on", "", "words that switch the probe on", codes=True),
    Option("probe_off", "", "words that switch the probe off", codes=True),
)
ROLLOVER = Option(
    "rollover",
    "auto",
    "angles of 0 to 360 for rotary axes without limits (auto) or for all that can stand there (always); never: as planned",
    choices=("auto", "always", "never"),
)
TOLERANCE = Option("tolerance", 0.02, "mm from its target within which a move has not been stopped", verified=True)
MISSED = Option("misses", 3, "touches in a row without contact after which the program stops: the probe may be dead", verified=True)
TOUCHING = f"{TOUCH} - THE PROBE MOVES UP SLOWLY FOR 20 S"
AFTER = (  # what a header says of stops
    "AFTER A STOP - RESET. SWITCH THE PROBE OFF. MOVE UP ALONG THE TOOL BY HAND",
    "BEFORE ANYTHING TURNS. THEN TANGO RUN --RESUME MAKES THE MISSING TOUCHES",
)
LETTING_GO = "LET GO OF THE STYLUS"
UNTOUCHED, UNMET = (
    "STYLUS WAS NOT TOUCHED",
    "PROBE DID NOT NOTICE FACET",
)  # or the probe is dead, off, or wired to another input: nothing has come near the table
IN_THE_AIR = "CONTROL SAYS CONTACT WHERE NOTHING WAS MET"  # behind a protected move that has arrived
STEPS = ("begin", "probe_on", "retract", "clear", "index", "approach", "probe", "record", "back", "probe_off", "end", "gate")


def showing(stop: str) -> Option:
    """block that stops and shows a remark → the option show: where TOUCH THE STYLUS stands."""
    said = f"stop: {stop} shows it and waits for start before the slow move"
    return Option(
        "show",
        "comment",
        f"where TOUCH THE STYLUS stands: in a comment, which the block display shows, or {said}",
        True,
        ("comment", "stop"),
    )


def stops_for(job: Job, leg: Leg) -> bool:
    """job, the move of the gate → whether the program stops before it, so that the person reads what to do."""
    return job.options.get("show") == "stop" and leg.kind != "prove"


def proves(job: Job, leg: Leg) -> str:
    """job, the move of the gate → what the program says before it: to a person, or to whoever reads it later."""
    if leg.kind == "prove":
        return f"{PROVING} {comment(leg.touch.facet, 20)}"
    return f"{TOUCH} - THE PROBE MOVES ALONG {way} FOR 20 S" if (way := gate(job.plan).along) else TOUCHING


def unproven(job: Job) -> str:
    """job → what the program says when it stops because the probe noticed nothing."""
    return UNMET if job.options["gate"] == "facet" else UNTOUCHED


def steps(here: Mapping[str, Any]) -> dict[str, Any]:
    """globals() of a post → {step: the function named after it}; one that is missing, but `gate`, is missed by `Post`."""
    return {name: here[name] for name in STEPS if name in here}


def clamping(unclamp: str, clamp: str) -> tuple[Option, Option]:
    """words that a control of this kind may have → the options unclamp and clamp with these as examples."""
    return (
        Option("unclamp", {}, f"word before a rotary axis turns, e.g. {{B: {unclamp}}}; empty: the control does it"),
        Option("clamp", {}, f"word after a rotary axis has turned, e.g. {{B: {clamp}}}; empty: the control does it"),
    )


def switches(remark: str, settle: str = "") -> tuple[Whole, Whole]:
    """form of a comment such as '(%s)', block behind the words that switch the probe on → the steps probe_on and probe_off.

    They are the words of the profile, or a remark for want of them.
    """

    def step(word: str) -> Whole:
        def words(job: Job) -> Iterator[str]:
            """The words of the profile, if there are any."""
            stated = job.options[f"probe_{word}"]
            yield stated or remark % f"NO WORDS STATED THAT SWITCH THE PROBE {word.upper()}"
            if stated and word == "on" and settle:
                yield settle

        return words

    return step("on"), step("off")


def approaching(remark: str, move: Step) -> Step:
    """form of a comment such as '(%s)', guarded move → the step approach: which touch this is, then the move to its stand-off."""

    def approach(job: Job, leg: Leg) -> Iterator[str]:
        """Down to the stand-off."""
        yield remark % f"TOUCH {leg.touch.number} FACET {comment(leg.touch.facet, 20)}"
        yield from move(job, leg)

    return approach


def titled(job: Job, remark: str) -> Iterator[str]:
    """job, form of a comment → what the program is: machine, marks, number of touches."""
    yield remark % f"TANGO {comment(job.machine.name, 40)}"
    yield remark % f"PROGRAM {job.mark} PLAN {job.plan_mark}"
    for text in counted(job):
        yield remark % text


def counted(job: Job) -> Iterator[str]:
    """job → the text of remarks: how many touches the program makes, and how many the plan leaves out, if any; of a program for a
    held stylus that this is one.
    """
    if job.plan.only is not None:
        yield f"{HOLD} - THE PROGRAM HAS TO STOP BY ITSELF"
        return
    yield f"{len(job.plan.touches)} TOUCHES OF {comment(job.plan.artefact.name, 40)}"
    if many := len(job.plan.left_out):
        yield f"{many} {'TOUCH' if many == 1 else 'TOUCHES'} OF THE STRATEGY LEFT OUT - NO STRAIGHT STYLUS MAKES THEM"


def warned(job: Job, remark: str, *notes: str) -> Iterator[str]:
    """job, form of a comment, notes on this control → what a person has to know before starting it, doubts last."""
    yield remark % "START WITH THE PROBE IN THE SPINDLE SWITCHED ON AND CLEAR OF THE TABLE"
    yield remark % "WATCH THE FIRST MOVE - IT ENDS HIGH ABOVE THE TABLE - HAND ON FEED HOLD"
    for note in (*notes, *AFTER, *kept_in_mind(job), *doubted(job, 110)):
        yield remark % note


def kept_in_mind(job: Job) -> Iterator[str]:
    """job → the text of remarks on what the profile says of this control, and a person has to do in every run."""
    yield from found_at(job)
    touches = any(touch.facet != "air" for touch in job.plan.touches)
    if touches and (many := job.options.get("misses")):  # both moves of a double touch count
        deep = number(job.plan.strategy.approach.search).rstrip(".")
        several = many // (2 if job.plan.strategy.approach.find else 1)
        yield f"A PROBE THAT DIES ON THE WAY IS PRESSED {deep} MM INTO UP TO {several} FACET{'S' * (several > 1)} - SEE MISSES"
    if not job.options.get(PROBE_STATE, True):
        yield "PROBE STATE NONE - THE PROGRAM DOES NOT SEE A STYLUS THAT IS DEFLECTED BEFORE A MOVE"
    if job.options.get("feed_override") != "acts":
        yield "DRY RUN AND FEED OVERRIDE MAY NOT ACT ON PROBING MOVES - HAND ON FEED HOLD"
    else:
        yield "KEEP THE FEED OVERRIDE AT 100 PERCENT - IT ACTS ON MEASURING MOVES"
    if job.options.get("records_file") == "anew":
        yield "COPY THE FILE OF THE RECORDS BEFORE THE NEXT PROGRAM - THAT BEGINS IT ANEW"


def found_at(job: Job) -> Iterator[str]:
    """job → the text of a remark on the facet that proves the probe: where its search ends, and who has found that place."""
    if job.options.get("gate") == "facet":
        one = proving_touch(job.plan)
        off = job.plan.met.get(one.number)
        where = "AT ITS PLACE IN THE PLAN - NO RUN HAS FOUND IT" if off is None else f"{off:+.2f} MM FROM THE PLAN AS LAST FOUND"
        yield f"FACET {comment(one.facet, 20)} PROVES THE PROBE - {where}"


def doubted(job: Job, width: int) -> Iterator[str]:
    """job, characters a line → the text of remarks that say all that is unverified, broken between words."""
    if job.unverified:
        yield "WHAT NOBODY HAS CONFIRMED HERE - THE MOST DANGEROUS FIRST"
    for doubt in job.unverified:
        yield from _wrapped(doubt, width)


@lru_cache(maxsize=1024)  # a program is made more than once: for its length, its mark, its text
def _wrapped(doubt: str, width: int) -> tuple[str, ...]:
    return tuple(wrap(f"UNVERIFIED {comment(doubt, LONGEST)}", width, subsequent_indent="  "))


def indexed(leg: Leg) -> str:
    """leg → the text of the remark over an indexation: where rotary axes and spindle stand after it, deg."""
    return "INDEX " + " ".join(f"{name}{number(degrees(value))}" for name, value in leg.to.items() if name not in "XYZ")


def unclamped(job: Job, name: str, turn: str) -> Iterator[str]:
    """job, axis letter, block that turns it → the block between the words of the profile that unclamp and clamp the axis."""
    yield from filter(None, [job.options["unclamp"].get(name)])
    yield turn
    yield from filter(None, [job.options["clamp"].get(name)])


def axes(machine: Machine) -> list[str]:
    """machine → letters of the axes that have a position to record: all but the spindle."""
    return [name for name in machine.names if name != "S"]


def axis_numbers(job: Job) -> dict[str, int]:
    """job → {axis letter: its number in the system variables}, as stated or in the order of the machine."""
    names, stated = axes(job.machine), job.options["axis_numbers"]
    return {name: int(stated[name]) for name in names} if stated else {name: i for i, name in enumerate(names, 1)}


def standoff(job: Job, leg: Leg) -> dict[str, float]:
    """leg → {axis letter: mm or rad} of the stand-off of its touch."""
    return dict(zip(job.machine.names, leg.touch.standoff, strict=True))


def off(job: Job, leg: Leg, decimals: int = 3) -> dict[str, str]:
    """leg → {linear axis: mm as text, with its sign} from where a measuring move has ended to where the probe has come free."""
    begin = standoff(job, leg)
    contact = dict(zip(job.machine.names, leg.touch.contact, strict=True))
    away = {name: begin[name] - contact[name] for name in "XYZ"}
    steps = {name: OFF * value / math.hypot(*away.values()) for name, value in away.items()}
    return {n: f"{'-' if s < 0 else '+'}{number(abs(s), decimals)}" for n, s in steps.items() if abs(s) >= 0.5 * 10**-decimals}


def words(job: Job, place: Mapping[str, float]) -> dict[str, str]:
    """positions (mm) → {linear axis: number as text} of those that are known, with `decimals` of the profile or four."""
    return {name: number(place[name], _decimals(job)) for name in "XYZ" if name in place}


def joined(place: Mapping[str, str]) -> str:
    """{axis letter: number as text} → the words of a block: 'X1. Y2.'."""
    return " ".join(name + value for name, value in place.items())


def angle(job: Job, name: str, value: float) -> str:
    """axis letter, rad → deg to command as text, by the option `rollover`."""
    turned, rule = degrees(value), job.options["rollover"]
    rolls = may_roll(job.machine, name) if rule == "always" else rule != "never" and is_endless(job.machine, name)
    return number(rolled(turned, _decimals(job)) if rolls else turned, _decimals(job))


def spindle(job: Job, value: float) -> str:
    """rad → angle of the spindle in [0, 360) as text."""
    return number(rolled(degrees(value), _decimals(job)), _decimals(job))


def signed(value: str) -> str:
    """number as text → as it may stand after a minus sign."""
    return f"[{value}]" if value.startswith("-") else value


def _decimals(job: Job) -> int:
    return int(job.options.get("decimals", 4))


def fits(job: Job, most: int = 9) -> None:
    """job, highest axis number → nothing. Raises InputError for options of many posts that do not fit the machine or the plan.

    Looks at those that the post has: feeds and counts, `axis_numbers`, `clamp` and `unclamp`, `orient`, and words that
    must not move an axis: those of the probe's switches, of waiting, of the frame.
    """
    options = job.options
    for name, (low, high) in LIMITS.items():
        each = 2 if name == "misses" and job.plan.strategy.approach.find else 1
        if name in options and not low <= options[name] / each <= high:
            raise InputError(f"controller.{name}: found {options[name] / each:g}; allowed: {low} … {high}")
    if options.get("misses") == 1:  # counted by move: the first miss of all would stop before it is on record
        raise InputError("controller.misses: found 1; allowed: 2 … 20, or 1 with approach.find in strategy.yaml")
    if "tolerance" in options and options["tolerance"] > (half := job.plan.strategy.approach.search / 2):
        raise InputError(
            f"controller.tolerance: found {options['tolerance']:g}; allowed: at most {half:g}, half of approach.search: "
            "a contact within it of the search end counts as none"
        )
    if "axis_numbers" in options:
        _axis_numbers(job, most)
    for key in ("unclamp", "clamp"):
        for name, word in options.get(key, {}).items():
            known = isinstance(word, str) and SWITCH.fullmatch(word) and not STOPS_OR_SPINS.search(word)
            if name not in job.machine.rotary or not known or HOLDS.search(word):
                allowed = f"a word such as M10 for {', '.join(job.machine.rotary) or 'a rotary axis, of which there is none'}"
                allowed += ", none that ends the program, waits for a person or turns the spindle" * isinstance(word, str)
                raise InputError(f"controller.{key}: found {name!r}: {word!r}; allowed: {allowed}")
    if "unclamp" in options and (held := sorted(set(options.get("clamp", {})) - set(options["unclamp"]))):
        raise InputError(f"controller.clamp: found a word for {', '.join(held)} and none under unclamp; allowed: both for an axis")
    turns = {round(touch.standoff[job.machine.column("S")], 9) for touch in job.plan.touches}
    if not options.get("orient", True) and len(turns) > 1:
        given, wanted = ("false", "true") if options["orient"] is False else ("nothing", "the word that orients the spindle")
        raise InputError(f"controller.orient: found {given}; allowed: {wanted}, as this strategy turns the spindle")
    if isinstance(word := options.get("orient"), str) and word and not word[-1].isalpha():  # M19 before 0 would be M190
        raise InputError(f"controller.orient: found {word!r}; allowed: words that end with the letter of the angle, e.g. M19 R")
    for key, value in (("probe_on", ""), ("probe_off", ""), ("wait", ""), ("machine_frame", ""), ("orient", "0")):
        if isinstance(word := options.get(key), str) and _moves(job, word + value):
            raise InputError(f"controller.{key}: found {word!r}; allowed: words that move no axis of the machine, or a call by G65")

    for key in ("probe_on", "probe_off", "orient", "wait", "machine_frame"):
        if isinstance(word := options.get(key), str) and (found := STOPS_OR_SPINS.search(word)):
            raise InputError(
                f"controller.{key}: found {options[key]!r}; allowed: no {found[0]}, after which the program is over or the spindle "
                "turns; a probe that is switched on by its spinning needs a macro that stops the spindle again"
            )
    for key in ("probe_on", "probe_off", "orient", "wait", "machine_frame"):
        if isinstance(word := options.get(key), str) and word not in WAITS and (found := MODAL.search(word)):
            raise InputError(
                f"controller.{key}: found {options[key]!r}; allowed: no {found[0]}, which may change what a move means"
            )


def spares(job: Job, first: int, last: int) -> None:
    """job, numbers of M codes that travel with the program → nothing. Raises InputError for a word of the profile that is one."""
    options = job.options
    stated = {key: options[key] for key in ("probe_on", "probe_off", "orient") if options.get(key)}
    stated |= {f"{key}: {name}": word for key in ("unclamp", "clamp") for name, word in options.get(key, {}).items()}
    for key, word in stated.items():
        if taken := [number for number in re.findall(r"(?<![A-Z])M *0*(\d+)", str(word)) if first <= int(number) <= last]:
            raise InputError(
                f"controller.{key}: found {word!r}; allowed: not M{taken[0]}, M{first} to M{last} travel with the program"
            )


def _moves(job: Job, words: str) -> bool:
    letters = "".join(name for name in job.machine.names if name != "S") + "UVW"
    if {"G65", "G66", "CALL"} & set(words.split()):
        return False  # their letters are arguments
    return re.search(rf"(?:^|[ \d.])(?:[{letters}] *-? *[\d.]|G0*(?:28|30)(?![\d.]))", words) is not None


def _axis_numbers(job: Job, most: int) -> None:
    names, stated = axes(job.machine), job.options["axis_numbers"]
    given = list(stated.values())
    whole = all(isinstance(n, int) and not isinstance(n, bool) and 1 <= n <= most for n in given)
    if stated and not (set(names) <= set(stated) <= set("XYZABC") | set(names) and whole and len(set(given)) == len(given)):
        raise InputError(
            f"controller.axis_numbers: found {stated!r}; allowed: a number 1 … {most} of its own for each of {', '.join(names)}"
        )
