"""A program, compensated: words are moved so that the tip goes where the program meant; blocks come and go a batch at a time."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain, groupby, islice
from types import ModuleType

import numpy as np

from ..compensate.fit import Known
from ..records import Array, InputError
from .blocks import HEAD, MARK, Block, marked, refused
from .correct import Machinery, pieces
from .follow import Motion, Setup, arc_points, beyond, follow, positions, words

BATCH = 2000  # motions at a time: memory does not grow with the program
MOST = 2000  # parts of a block
STRETCH = np.pi / 6  # rad that a rotary axis turns at most between two looks at a line


WARNING = " FROM SIMULATED READINGS, FOR NO MACHINE"  # in the mark
NAMED = 12  # lines that an answer names


@dataclass
class Account:
    """What was done; deviations of the tip in µm, largest and sums for the mean square."""

    blocks: int = 0
    lines: int = 0
    compensated: int = 0
    passed: int = 0  # motions before every axis was known, and in machine coordinates
    arcs: int = 0
    split: int = 0  # blocks that became several
    outside: int = 0  # ends of parts where an axis is beyond what was touched
    marked: bool = False
    before: float = 0.0
    after: float = 0.0
    squares_before: float = 0.0
    squares_after: float = 0.0
    count: int = 0
    worst_block: int = 0
    assumed: set[str] = field(default_factory=set)  # rotary axes that are taken to be at 0, while something is cut
    unknown: dict[str, int] = field(default_factory=dict)  # M functions that may do anything: the line where each stands first
    turning: int = 0  # rapids that turn a rotary axis: only their ends are corrected
    turning_lines: list[int] = field(default_factory=list)  # of the first of them
    changes: list[tuple[str, list[str]]] = field(default_factory=list)


@dataclass(frozen=True)
class RewriteSettings:
    """How it is done: chord error of arcs and of parts of lines, mm; digits; whether rotary words move."""

    chord: float = 0.001
    decimals: int = 4
    rotary: bool = True
    keep: bool = False  # remember what changed, for a word-for-word difference
    touched: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # range by axis, mm rad


@dataclass(slots=True)
class _State:
    """What goes on from batch to batch."""

    turned: Array
    out: dict[str, float] = field(default_factory=dict)  # what was written last, by axis


def compensated(
    lines: Iterable[str], language: ModuleType, setup: Setup, known: Known, settings: RewriteSettings, account: Account, mark: str
) -> Iterator[str]:
    """lines, language, set-up, what is known of the machine → lines without their ends.

    A program with this mark comes out as it went in. Raises InputError by name for what cannot be followed, and for a program with
    the mark of another estimate or zero.
    """
    source = iter(lines)
    head = [line.rstrip("\r\n") for line in islice(source, HEAD)]
    place = 0
    while place < min(len(head), HEAD - 1) and language.HEAD.fullmatch(head[place]):
        place += 1
    if (line_of := marked(head)) is not None:
        _same(head[line_of - 1], mark, line_of)
        if line_of - 1 > place:
            raise refused(line_of, head[line_of - 1].strip(), "the mark of a compensated program stands in its head: take it out")
        account.marked = True
        for line in chain(head, (line.rstrip("\r\n") for line in source)):
            account.blocks += 1
            account.lines += 1
            yield line
        return
    stripped = (line.rstrip("\r\n") for line in source)
    state = _State(np.zeros(len(setup.machine.rotary)))
    machinery: dict[float, Machinery] = {}
    motions = follow(chain(head, stripped), language, setup)
    numbered = 0
    pending: list[Motion] = []
    first = True
    while pending := list(islice(motions, BATCH)):
        for text, block in _batch(pending, language, setup, known, settings, account, state, machinery):
            if first and block.number > place:
                first = False
                yield _numbered(language.mark(mark), numbered, language.COUNTED)
                numbered += 1
                account.lines += 1
            for line in text:
                yield _numbered(line, numbered, language.COUNTED)
                numbered += 1
            account.lines += len(text)
    if first:
        raise InputError("the program has no blocks; nothing was written")


def _numbered(line: str, number: int, counted: bool) -> str:
    """One line → the line with its number: where lines are counted, new ones shift the numbers of all that follow."""
    return f"{number} {re.sub(r'^ *[0-9]+ +', '', line)}" if counted and line else line


def _batch(
    motions: list[Motion],
    language: ModuleType,
    setup: Setup,
    known: Known,
    settings: RewriteSettings,
    account: Account,
    state: _State,
    machinery: dict[float, Machinery],
) -> Iterator[tuple[list[str], Block]]:
    """motions of a batch → their lines; `account`, `state` and `machinery` go on from batch to batch."""
    rotary = set(setup.machine.rotary) if settings.rotary else set()
    chosen = [m for m in motions if m.block.kind in ("rapid", "feed", "arc") and (m.known or rotary & m.block.target.keys())]
    _counted(motions, chosen, setup, account)
    written: dict[int, list[Array]] = {}
    for length in {m.length for m in chosen} - machinery.keys():
        machinery[length] = Machinery(setup.machine, known, length, positions(setup, [{}], [length])[0])
    for _, same in groupby(chosen, key=lambda m: m.length):  # runs of one tool
        run = list(same)
        _corrected(run, machinery[run[0].length], setup, settings, account, state, written)
    for m in motions:
        if (parts := written.get(m.block.number)) is not None:
            yield _written(m, parts, language, setup, settings, account, state), m.block
            continue
        account.passed += m.block.kind != "none"
        if m.block.kind == "rapid":
            state.out.update(m.block.target)
        for axis in m.block.forgets:
            state.out.pop(axis, None)
        yield [m.block.text], m.block


def _counted(motions: list[Motion], chosen: list[Motion], setup: Setup, account: Account) -> None:
    """Motions of a batch, those that are corrected: what the account says of them."""
    account.blocks += len(motions)
    account.assumed |= {axis for m in motions if m.assumed and m.block.kind in ("feed", "arc") for axis in m.assumed}
    for m in motions:
        for name in m.block.unknown:
            account.unknown.setdefault(name, m.block.number)
    for m in chosen:
        if m.block.kind == "rapid" and m.known and not m.block.target.keys().isdisjoint(setup.machine.rotary):
            account.turning += 1
            if len(account.turning_lines) < NAMED:
                account.turning_lines.append(m.block.number)


def _written(
    m: Motion, parts: list[Array], language: ModuleType, setup: Setup, settings: RewriteSettings, account: Account, state: _State
) -> list[str]:
    """motion, corrected positions (k,) of the ends of its parts → its lines."""
    moves = [_words(m, at, i == 0, i == len(parts) - 1, setup, settings, state) for i, at in enumerate(parts)]
    moves = [move for i, move in enumerate(moves) if move or i == 0]
    text: list[str] = language.write(m.block, moves, settings.decimals)
    account.compensated += 1
    account.split += len(parts) > 1
    account.arcs += m.block.kind == "arc"
    if settings.keep and text != [m.block.text]:
        account.changes.append((m.block.text, text))
    return text


def _words(
    m: Motion, at: Array, first: bool, last: bool, setup: Setup, settings: RewriteSettings, state: _State
) -> dict[str, float]:
    """motion, corrected position (k,) of a part, whether it is the first and the last → what its block says of each axis."""
    rotary = set(setup.machine.rotary) if settings.rotary else set()
    new: dict[str, float] = {}
    for axis, v in words(setup, at, m.added).items():
        meant = m.block.target.get(axis)
        if not m.known and axis not in rotary:  # where the linear axes are, no block has said yet
            if meant is not None:
                new[axis] = state.out[axis] = meant
            continue
        rounded = round(v, settings.decimals) + 0.0
        named = meant is not None and (last or m.block.kind == "arc" or axis in setup.machine.linear)
        changed = axis in state.out and state.out[axis] != rounded
        if (named and (first or last)) or changed or (meant is not None and axis not in state.out):
            new[axis] = state.out[axis] = rounded
    return new


def _corrected(
    run: list[Motion],
    mach: Machinery,
    setup: Setup,
    settings: RewriteSettings,
    account: Account,
    state: _State,
    written: dict[int, list[Array]],
) -> None:
    """Fills `written`: by block number the corrected positions (k,) of the ends of its parts."""
    machine = setup.machine
    added = [m.added for m in run]
    end = positions(setup, [m.end for m in run], added)
    start = positions(setup, [{**m.end, **m.start} for m in run], added)  # an axis comes from where it goes to, if unknown
    turned_end = np.tile(state.turned, (len(run), 1))
    turned_start = turned_end.copy()
    if machine.rotary and settings.rotary:
        named = np.array([[a in m.block.target for a in machine.rotary] for m in run])
        wanted = np.zeros_like(turned_end)
        rows = np.flatnonzero(named.any(axis=1))
        if len(rows):
            wanted[rows] = mach.turns(end[rows])
        now = state.turned
        for i in range(len(run)):
            turned_start[i] = now
            if named[i].any():
                now = np.where(named[i], wanted[i], now)
            turned_end[i] = now
        state.turned = now
    shares = (0.0, 0.25, 0.5, 0.75, 1.0)
    looked = [i for i, m in enumerate(run) if m.block.kind == "feed"]
    counts = np.ones(len(run), dtype=int)
    if looked:
        a, b = start[looked], end[looked]
        ta, tb = turned_start[looked], turned_end[looked]
        # Errors repeat with every turn: looked at too seldom, a turn looks like standing still.
        turning = np.abs(b - a)[:, [machine.column(n) for n in machine.rotary]].max(axis=1, initial=0.0)
        stretches = np.maximum(1, np.ceil(turning / STRETCH)).astype(int)
        for i, most in zip(looked, stretches, strict=True):
            if most > MOST:
                raise refused(run[i].block.number, run[i].block.text.strip(), f"a turn that would become more than {MOST} parts")
        of = np.repeat(np.arange(len(looked)), stretches)
        first = np.cumsum(stretches) - stretches
        begin = ((np.arange(len(of)) - first[of]) / stretches[of])[:, None]
        change = []
        for part in shares:
            s = begin + part / stretches[of][:, None]
            there = a[of] + s * (b - a)[of]
            change.append(mach.corrected(there, ta[of] + s * (tb - ta)[of]) - there)
        columns = list(mach.chain.linear_columns)
        flat = [c[:, columns] for c in change]
        parts = np.maximum.reduceat(pieces(flat[0], flat[-1], flat[1:4], settings.chord), first)
        counts[looked] = np.minimum(MOST, stretches * parts)
    nominal: list[Array] = []
    turned: list[Array] = []
    owner: list[int] = []
    for i, m in enumerate(run):
        if m.block.kind == "arc":
            points = arc_points(m, settings.chord)
            nominal.append(positions(setup, points, [m.added] * len(points)))
            share = np.arange(1, len(points) + 1)[:, None] / len(points)
        else:
            share = np.arange(1, counts[i] + 1)[:, None] / counts[i]
            nominal.append(start[i] + share * (end[i] - start[i]))
        turned.append(turned_start[i] + share * (turned_end[i] - turned_start[i]))
        owner += [i] * len(share)
    at = np.vstack(nominal)
    found = mach.corrected(at, np.vstack(turned))
    for j, i in enumerate(owner):
        written.setdefault(run[i].block.number, []).append(found[j])
    sure = np.array([run[i].known for i in owner])
    if sure.any():
        _judge(at[sure], found[sure], [i for i in owner if run[i].known], run, mach, setup, settings, account)


def _judge(
    at: Array,
    found: Array,
    owner: list[int],
    run: list[Motion],
    mach: Machinery,
    setup: Setup,
    settings: RewriteSettings,
    account: Account,
) -> None:
    """Adds how far the tip is from where it is meant to be: as programmed, and with the words as they are written."""
    step = np.array([10.0**-settings.decimals * (1.0 if axis.kind == "linear" else np.pi / 180) for axis in setup.machine.axes])
    rounded = np.round(found / step) * step
    meant = mach.meant(at)
    before = np.linalg.norm(mach.true(at) - meant, axis=1) * 1e3
    after = np.linalg.norm(mach.true(rounded) - meant, axis=1) * 1e3
    if before.max() > account.before:
        account.before = float(before.max())
        account.worst_block = run[owner[int(before.argmax())]].block.number
    account.after = max(account.after, float(after.max()))
    account.squares_before += float(before @ before)
    account.squares_after += float(after @ after)
    account.count += len(at)
    account.outside += int(beyond(setup.machine, at, settings.touched).sum())


def _same(line: str, mark: str, number: int) -> None:
    """line with a mark, the mark that would be written, number of the line → nothing. Raises InputError where they differ."""
    own = mark.upper().removeprefix(MARK).removeprefix(WARNING.upper()).strip()
    if own not in line.upper():
        raise refused(
            number,
            line.strip(),
            f"the mark of a program that was compensated with another estimate, zero or tool length than now ({own}): its words "
            "are moved already. Take the program that it was made from",
        )


def made_with(digest: str, zero: Mapping[str, float], tools: str = "") -> str:
    """hash of the errors, zero of the program, lengths of its tools (`tools_of`) → what the mark says of them."""
    return " ".join(x for x in (digest, "ZERO", *(f"{a}{v:g}" for a, v in zero.items()), tools) if x)


def tools_of(setup: Setup) -> str:
    """set-up → what a mark says of the lengths of the tools: the one length, or with tools of their own a hash of all."""
    if not setup.tools:
        return f"TOOL {setup.length:g}"
    every = repr((setup.length, sorted(setup.tools.items())))
    return f"TOOLS {hashlib.sha256(every.encode()).hexdigest()[:8]}"


def mark_text(digest: str, zero: Mapping[str, float], tools: str = "", *, simulated: bool = False) -> str:
    """hash of the errors, zero of the program, lengths of its tools, whether the errors are of no machine → text of the mark."""
    warning = WARNING if simulated else ""
    return f"{MARK}{warning} {made_with(digest, zero, tools)}"
