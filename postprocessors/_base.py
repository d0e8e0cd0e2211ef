"""What every post is made of: a table of steps, a table of options, numbers and words that no control can misread.

A post is a file with `POST = Post(...)`. A step is a function `(job, leg) → lines`; a step that a dialect forgets is a
TypeError when its file is read, because `Post` has no defaults for them. `program` calls the steps in the order of the plan:

    begin · probe_on · { retract clear index approach probe back record } per move · probe_off · end

Of a double touch, finding is a `probe` at another feed without `record`, then `back`, then a `retract` to where measuring begins.
Lines are produced one by one, so that the length of a plan does not matter.
"""

from __future__ import annotations

import hashlib
import importlib.util
import math
import re
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any

from tango_cnc.gate import gate, served
from tango_cnc.nearest import printable, suggestion
from tango_cnc.records import Approach, InputError, Machine, Plan, Touch

from ._confirmed import confirmed
from ._options import GATE, KEPT, OBEYS, PROBE_STATE, UNPROVEN, UNSEEN, memory, stated
from ._options import PROVES as PROVES
from ._options import Option as Option
from ._options import answered as answered
from ._options import settled as settled
from ._options import with_defaults as with_defaults
from ._remedies import Remedies

FOLDER = Path(__file__).parent
BLANK = "000000000000"  # stands for the mark while the mark is computed
MARK = re.compile(r"\bPROGRAM ([0-9A-F]{12})\b")


@dataclass(frozen=True)
class Job:
    """One plan on its way into a program."""

    plan: Plan
    options: Mapping[str, Any]
    plan_mark: str
    mark: str  # hash of the program's own text
    unverified: tuple[str, ...]
    part: tuple[int, int] = (1, 1)  # of a split plan: which, of how many

    @property
    def machine(self) -> Machine:
        """→ the machine of the plan."""
        return self.plan.machine


@dataclass(frozen=True)
class Leg:
    """One move as a post sees it: `target` the axes that move, `to` every axis whose place is known after it, `came` before it.

    mm and rad; axes that nobody has moved yet are missing from `to` and `came`.
    """

    kind: str
    target: Mapping[str, float]
    to: Mapping[str, float]
    touch: Touch
    came: Mapping[str, float] = field(default_factory=dict)


Lines = Iterable[str]
Whole = Callable[[Job], Lines]
Step = Callable[[Job, Leg], Lines]


@dataclass(frozen=True, kw_only=True)
class Post:
    """A dialect. Every step is required."""

    title: str
    extension: str  # without the dot
    options: tuple[Option, ...]
    doubts: tuple[str, ...]  # facts about the control that no option can change: open until the profile lists them as confirmed
    stem: Callable[[Job], str]  # file name without extension
    begin: Whole  # framing, what this is, modal reset, checks before anything moves, start mark
    probe_on: Whole
    retract: Step  # up along the tool, guarded
    clear: Step  # above everything, guarded
    index: Step  # rotary axes and spindle
    approach: Step  # down to the stand-off, guarded
    probe: Step  # the measuring move, whether it hit, missed or came early, and off the facet so that the probe comes free
    record: Step  # one line for the reader: touch, flag, machine coordinates
    back: Step  # to the stand-off, guarded
    probe_off: Whole
    end: Whole  # end mark, end of program, macros that travel with it
    language: str = ""  # that the program is written in: one of tango_cnc/readback/languages; empty: by what it looks like
    summed: bool = True  # whether every record ends with K, the sum of its coordinates; one without it is refused then
    link: str = "dnc"  # how the program gets to the control: a protocol of tango_cnc.link
    links: tuple[str, ...] = ()  # that this control can have; (): nobody has stated them
    filed: bool = True  # whether the control can write its records into a file; else they only answer over the line
    record_letters: Callable[[Machine], tuple[str, ...]] = field(default=lambda machine: machine.names)
    finish: Callable[[Iterator[str]], Iterator[str]] = iter  # what is done to the lines as a whole: block numbers
    further: Callable[[Mapping[str, Any]], tuple[str, ...]] = field(default=lambda given: ())  # doubts that an option brings
    companions: Callable[[Job], Mapping[str, Lines]] = field(default=lambda job: {})  # file name → lines that the control needs too
    gate: Step | None = None  # the slow move before the first descent during which somebody touches the stylus
    memory: int = 0  # kB that a program may have where the profile states nothing; 0: it is never split for its size
    alarms: Callable[[Mapping[str, Any]], Mapping[str, str]] = field(default=lambda options: {})  # {number it raises: text}
    tcp_off: tuple[str, str] = ("", "")  # option with which a program switches tool center point control off, word that it needs
    remedies: Remedies = field(default_factory=dict)  # belief of 'tango commission' → what of the control itself mends it

    def __post_init__(self) -> None:
        further = ((GATE,) if self.gate is not None else ()) + ((memory(self.memory),) if self.memory else ())
        further += (OBEYS, *((KEPT,) if self.filed else ()))
        has = {option.name for option in self.options}
        object.__setattr__(self, "options", (*self.options, *(option for option in further if option.name not in has)))


def is_own(name: str) -> bool:
    """name of a post → whether it is the path of a file of the user's own."""
    return name.endswith(".py") or "/" in name or "\\" in name


def load(name: str, where: str = "post") -> Post:
    """name of a file in this folder, or path of a user's own, where it was stated → post. Raises InputError for what is none."""
    own = is_own(name)
    file = Path(name) if own else FOLDER / f"{name}.py"
    if own and not (file.is_file() and name.endswith(".py")):
        what = "is no file" if not file.is_file() else "does not end in .py"
        raise InputError(f"{where}: found {name!r}, which {what}; allowed: {', '.join(names())}, or the path of your own .py file")
    if not file.is_file() or (not own and name.startswith("_")):
        hint = suggestion(name, names())
        raise InputError(f"{where}: found {name!r}; allowed: {', '.join(names())}, or the path of your own .py file.{hint}")
    try:
        if own:  # anew each time: it may have changed
            spec = importlib.util.spec_from_file_location(f"own_post_{file.stem}", file)
            assert spec is not None and spec.loader is not None
            spec.loader.exec_module(module := importlib.util.module_from_spec(spec))
        else:
            module = importlib.import_module(f"postprocessors.{name}")
    except (Exception, SystemExit) as error:
        raise InputError(f"post {file}: cannot be read: {type(error).__name__}: {error}") from error
    post = vars(module).get("POST")
    if not isinstance(post, Post):
        raise InputError(f"post {file}: defines no POST = Post(...); see docs/dialects.md")
    return post


def names() -> list[str]:
    """→ the posts of this folder."""
    return sorted(file.stem for file in FOLDER.glob("*.py") if not file.name.startswith("_"))


def settings(post: Post, given: Mapping[str, Any]) -> dict[str, Any]:
    """post, `controller` keys → every option with its value.

    Raises InputError for an unknown key, a value that it cannot have, and what is `confirmed` and no doubt of the post.
    """
    known = {option.name: option for option in post.options}
    for key in given:
        if key not in known and key != "confirmed":
            hint = suggestion(str(key), ["port", "confirmed", *known])
            raise InputError(
                f"controller: found the unknown key {printable(repr(key))}; "
                f"allowed: post, port, confirmed, {', '.join(known)}.{hint}"
            )
    values = {name: stated(option, given[name]) if name in given else option.default for name, option in known.items()}
    unverified(post, given)  # for what it complains of
    return values


def unverified(post: Post, given: Mapping[str, Any]) -> tuple[str, ...]:
    """post, `controller` keys → what nobody has confirmed: a field that the profile states counts as confirmed, as does a doubt
    that it lists under `confirmed`. Raises InputError for what is listed there and is none.
    """
    open_fields = (o for o in post.options if not o.verified and o.name not in given)
    fields = tuple(f"{o.name} = {o.default if o.default != '' else 'none'}: {o.meaning}" for o in open_fields)
    with _own(post):
        unproven = () if post.gate is not None and given.get(GATE.name, GATE.default) != "none" else (UNPROVEN,)
        doubts = (*unproven, *_unseen(post, given), *post.doubts, *post.further(given))
    done = confirmed(given.get("confirmed", ()), doubts, fields)
    return (*fields, *(doubt for doubt in doubts if doubt not in done))


def _unseen(post: Post, given: Mapping[str, Any]) -> tuple[str, ...]:
    """post, `controller` keys → the doubt of a profile that says that the program need not look at the probe's input."""
    option = next((option for option in post.options if option.name == PROBE_STATE), None)
    return (UNSEEN,) if option is not None and PROBE_STATE in given and not stated(option, given[PROBE_STATE]) else ()


def reach(plan: Plan) -> tuple[str, ...]:
    """plan → what a person must know of the touches that a straight stylus can hardly make; empty when there are none."""
    many, machine = len(plan.doubtful), plan.machine
    facing = (f"{many} touches are on facets that face away from the spindle",) if many else ()
    length = f"{machine.probe.length:g} mm long"
    own = (f"stylus {machine.stylus}, {length}, is in the spindle: the program cannot see which one is",) if machine.styli else ()
    return (*facing, *own)


def in_order(doubts: Sequence[str], each_run: Sequence[str]) -> tuple[str, ...]:
    """what is unverified, what a person must know of this plan → the list of a header, the most dangerous first."""
    from tango_cnc.commission import by_danger  # here: it knows the experiments, and reads numpy for them

    bare = tuple(doubt for doubt in doubts if doubt == UNPROVEN)
    return (*bare, *each_run, *by_danger(doubt for doubt in doubts if doubt != UNPROVEN))


def of_part(post: Post, given: Mapping[str, Any], part: tuple[int, int], stylus: int = 1) -> dict[str, Any]:
    """post, `controller` keys, (which part, of how many), stylus → the keys for it; a program that has a number gets its own.

    Numbers go up by five, as up to four macros follow a program, and by a hundred for each further stylus: in the memory of a
    control no program takes the place of another.
    """
    first = {option.name: option.default for option in post.options}.get("program_number")
    if first is None or (part[1] == 1 and stylus == 1):
        return dict(given)
    return {**given, "program_number": given.get("program_number", first) + 5 * (part[0] - 1) + 100 * (stylus - 1)}


def program(
    post: Post, plan: Plan, given: Mapping[str, Any], plan_mark: str, part: tuple[int, int] = (1, 1)
) -> tuple[str, str, Callable[[], Iterator[str]]]:
    """post, plan, `controller` keys, hash of the plan → file name, mark of the program, its lines (from the start at each call).

    The mark is the sha256 of the program's text with zeros in its own place. `part`: which of how many programs of the plan
    with this hash it is; its header says so, and `given` are the keys of `of_part`. Raises InputError for options and numbers
    that cannot be written.
    """
    options = settings(post, given)
    job = _marked(post, plan, given, plan_mark, part)
    digest = hashlib.sha256()
    for line in _lines(post, job(BLANK)):
        digest.update(line.encode("ascii") + b"\n")
    mark = digest.hexdigest()[: len(BLANK)].upper()
    stem = _stem(post, job(mark))
    return (
        f"{stem if 'program_number' in options else named(job(mark), stem)}.{post.extension}",
        mark,
        lambda: _lines(post, job(mark)),
    )


def length(
    post: Post, plan: Plan, given: Mapping[str, Any], plan_mark: str, part: tuple[int, int] = (1, 1), line_end: int = 2
) -> int:
    """what `program` is given, characters of a line end → characters of that program. Raises InputError as `program` does."""
    return sum(len(line) + line_end for line in _lines(post, _marked(post, plan, given, plan_mark, part)(BLANK)))


def _marked(post: Post, plan: Plan, given: Mapping[str, Any], plan_mark: str, part: tuple[int, int]) -> Callable[[str], Job]:
    """what `program` is given → {mark of the program → its job}."""
    options, doubts = settings(post, given), in_order(unverified(post, given), reach(plan))
    if part[1] > 1:
        plan_mark = f"{plan_mark} PART {part[0]} OF {part[1]}"
    return lambda mark: Job(plan, _counted(plan, options), plan_mark, mark, doubts, part)


def begins(post: Post, plan: Plan, given: Mapping[str, Any]) -> None:
    """post, plan, `controller` keys → nothing. Raises InputError for options that are none or do not fit machine and plan.

    Looks at how a program begins: there a post tells what it cannot write.
    """
    job = Job(plan, _counted(plan, settings(post, given)), BLANK, BLANK, ())
    with _own(post):
        for _ in _said(post.begin(job)):
            pass
    _stem(post, job)


def _stem(post: Post, job: Job) -> str:
    with _own(post):
        stem = post.stem(job)
    if not isinstance(stem, str) or not stem or {"/", "\\"} & set(stem):
        raise InputError(f"post {post.title}: stem gave {stem!r}; allowed: a file name without folder and ending; correct the post")
    return stem


def named(job: Job, name: str) -> str:
    """job, name of its program → the same with the number of its stylus, from the second on, and of the part that it is."""
    stylus = job.plan.machine.stylus
    end = (f"_S{stylus}" if stylus > 1 else "") + (f"_{job.part[0]}" if job.part[1] > 1 else "")
    return name if name.endswith(end) else name + end


def companions(post: Post, plan: Plan, given: Mapping[str, Any]) -> dict[str, list[str]]:
    """post, plan, `controller` keys → {file name: lines} of what has to be on the control beside the program; often nothing."""
    job = Job(plan, settings(post, given), BLANK, BLANK, ())
    with _own(post):
        return {name: list(lines) for name, lines in post.companions(job).items()}


def mark_of(text: str) -> str:
    """text of a program → its mark. Raises InputError when it has none or was changed after it was written."""
    found = MARK.search(text)
    if found is None:
        raise InputError("the program carries no mark 'PROGRAM …': it was not written by tango plan")
    blank = text.replace("\r\n", "\n").replace(found[1], BLANK)
    if hashlib.sha256(blank.encode("utf-8")).hexdigest()[: len(BLANK)].upper() != found[1]:
        raise InputError(f"the program was changed after tango plan wrote it (mark {found[1]}): write it again with tango plan")
    return found[1]


def _lines(post: Post, job: Job) -> Iterator[str]:
    with _own(post):
        for line in post.finish(_steps(post, job)):
            if not isinstance(line, str):
                raise InputError(f"post {post.title}: a step gave {line!r}; allowed: lines of text; correct the post")
            if not line.isascii() or not (line.isprintable() or not line):
                raise InputError(f"post {post.title}: the line {line!r} has characters that no control reads; correct the post")
            yield line


@contextmanager
def _own(post: Post) -> Iterator[None]:
    """post → within it, what fails in a file of the user's own is an InputError that names file and line."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        steps = [value.__func__ if isinstance(value, MethodType) else value for value in vars(post).values()]
        codes = [step.__code__ for step in steps if isinstance(step, FunctionType)]
        own = [code.co_filename for code in codes if Path(code.co_filename).parent != FOLDER]
        frames = traceback.extract_tb(error.__traceback__)
        at = [frame for frame in frames if frame.filename in own]
        if not at and own and isinstance(error, TypeError) and frames[-1].filename == __file__:
            raise InputError(
                f"post {own[-1]}: {error}; a step is a function of job, or of job and leg, that yields lines"
            ) from error
        if not at:
            raise
        raise InputError(f"post {at[-1].filename}:{at[-1].lineno}: {type(error).__name__}: {error}") from error


def _steps(post: Post, job: Job) -> Iterator[str]:
    steps: dict[str, Step] = {
        "retract": post.retract,
        "clear": post.clear,
        "index": post.index,
        "approach": post.approach,
        "find": lambda job, leg: post.probe(finding(job), leg),
        "off": post.back,
        "near": post.retract,
        "probe": post.probe,
        "back": post.back,
        "prove": post.gate or post.probe,
    }
    to: dict[str, float] = {}
    yield from _said(post.begin(job))
    yield from _said(post.probe_on(job))
    from . import _alive

    which = job.options.get(GATE.name, "none")
    asks = post.gate if which == "finger" else None
    before = -1 if asks is None else gate(job.plan).before
    for number, (move, touch) in enumerate(served(job.plan, which)):
        if asks is not None and number == before:
            yield from _said(asks(job, _alive.leg(job, dict(to))))
        came, to = to, {**to, **move.target}
        leg = Leg(move.kind, move.target, to, touch, came)
        yield from _said(steps[move.kind](job, leg))
        if move.kind == "probe":  # before the way back: what stops there takes no reading with it
            yield from _said(post.record(job, leg))
    yield from _said(post.probe_off(job))
    yield from _said(post.end(job))


def of_approach(plan: Plan, approach: Approach) -> Plan:
    """plan, how its facets are to be touched → the plan with that, its touches as they were."""
    return replace(plan, strategy=replace(plan.strategy, approach=approach))


def finding(job: Job) -> Job:
    """job → the same with the feed that finds as the measuring one. Raises InputError where the strategy has no find."""
    approach = job.plan.strategy.approach
    if approach.find is None:
        raise InputError("the strategy finds nothing before it measures; see approach.find")
    return replace(job, plan=of_approach(job.plan, replace(approach, feed=approach.find.feed)))


def _counted(plan: Plan, options: dict[str, Any]) -> dict[str, Any]:
    """plan, options → those that the steps see: a program counts both moves of a double touch that meet nothing."""
    return (
        options if plan.strategy.approach.find is None or "misses" not in options else options | {"misses": 2 * options["misses"]}
    )


def _said(lines: Iterable[str]) -> Iterator[str]:
    """What a step gives, checked: one text would be taken for a line a letter."""
    if isinstance(lines, str):
        raise TypeError(f"a step gave the text {lines!r}")
    return iter(lines)


def number(value: float, decimals: int = 4) -> str:
    """value → text with a decimal point, without exponent, trailing zeros or -0: '119.04', '10.', '0.'.

    Raises InputError for what is not finite or has more than eight digits, which controls refuse or misread.
    """
    if not math.isfinite(value):
        raise InputError(f"a position is {value!r}: no number for a program; check machine and artefact")
    text = f"{value:.{decimals}f}".rstrip("0") if decimals else f"{value:.0f}."
    if len(text) > 8 and len(text.replace(".", "").replace("-", "")) > 8:
        raise InputError(f"the number {text} has more than the eight digits that controls read; check machine and artefact")
    return "0." if text in ("-0.", "0.") else text


@lru_cache(maxsize=4096, typed=True)  # the same few names stand at thousands of touches
def comment(text: object, length: int = 60) -> str:
    """any text, from any file → what may stand in a comment or message: capitals, digits, blanks and . - +, no mark."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in " .-+") else " " for c in str(text).upper())
    return MARK.sub(r"PROGRAM-\1", " ".join(plain.split()))[:length].rstrip()


def degrees(value: float) -> float:
    """rad → deg, free of the rounding of the conversion."""
    return round(math.degrees(value), 9) + 0.0


def rolled(value: float, decimals: int) -> float:
    """deg → the same place in [0, 360), also after rounding to `decimals`."""
    turned = round(value, decimals) % 360.0
    return 0.0 if round(turned, decimals) >= 360.0 else turned


def may_roll(machine: Machine, name: str) -> bool:
    """axis letter → whether [0, 360) is within its travel, so that any angle may be written as one of these."""
    travel = machine.axis(name).travel
    return travel is None or (travel[0] <= 1e-9 and travel[1] >= 2 * math.pi - 1e-9)


def is_endless(machine: Machine, name: str) -> bool:
    """axis letter → whether it turns without limits: travel of more than two turns and a little, which no limited table has."""
    travel = machine.axis(name).travel
    return may_roll(machine, name) and (travel is None or travel[1] - travel[0] > math.radians(800))


def early_distance(plan: Plan) -> float:
    """plan → mm from the stand-off within which a contact is early: the search zone is `search` before and after the contact."""
    approach = plan.strategy.approach
    return max(approach.standoff - approach.search, 0.1 * approach.standoff)


def search_distance(plan: Plan) -> float:
    """plan → mm from the stand-off to the search end."""
    return plan.strategy.approach.standoff + plan.strategy.approach.search
