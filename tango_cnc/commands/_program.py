"""`tango compensate program.nc -o out.nc`, and what it shares with `tango predict`."""

from __future__ import annotations

import codecs
import hashlib
import math
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any, TextIO

import click
import numpy as np

from ..compensate.fit import Known, known, rms
from ..compensate.space import Poses, limits_of, sample
from ..compensate.trusted import words_as_promised
from ..compensate.unparted import unparted
from ..estimate import Estimate
from ..files.checked import plain
from ..judgement import Judgement
from ..nc import blocks
from ..nc.follow import Setup, zero_of
from ..nc.predict import Way, touched_of
from ..nc.program import Account, RewriteSettings, compensated, made_with, mark_text, tools_of
from ..records import Cell, InputError
from ._beside import beside
from ._common import Decorator, dialect

path = click.Path(path_type=Path)


def setup_options(*acts: str) -> Decorator:
    """beside what they act, where not by themselves → decorator: what a program does not say: language, zero, tools."""

    option_of = beside(*acts)

    def decorated(call: Any) -> Any:
        for option in reversed(
            [
                option_of("--language", metavar="NAME", help="Of the program; default: by its text and the cell's dialect."),
                option_of(
                    "--zero", metavar="X=…,Y=…,Z=…", help="Machine coordinates of the program's zero, no tool length in them."
                ),
                option_of(
                    "--tool-length",
                    type=click.FloatRange(0, min_open=True),
                    metavar="MM",
                    help="Of every tool [default: that of the probe].",
                ),
                option_of("--tool", "tools", multiple=True, metavar="N=MM", help="Length of tool N; repeatable."),
                option_of(
                    "--metric-absolute",
                    is_flag=True,
                    help="The control is set to mm and absolute; needed where no block states it.",
                ),
            ]
        ):
            call = option(call)
        return call

    return decorated


def setup_of(cell: Cell, options: dict[str, Any]) -> Setup:
    """cell, options → set-up of the program. Raises InputError for a zero or a tool that is none."""
    tools = {}
    for text in options["tools"]:
        number, _, value = text.partition("=")
        try:
            tools[int(number)] = _length("--tool", float(value))
        except ValueError:
            raise InputError(f"--tool: found {text!r}; allowed: NUMBER=LENGTH, e.g. 3=112.4") from None
    length = options["tool_length"]
    length = cell.machine.probe.length if length is None else _length("--tool-length", length)
    return Setup(cell.machine, zero_of(options["zero"], cell.machine), length, tools, options["metric_absolute"])


def _length(what: str, value: float) -> float:
    if not 0 <= value <= 2000 or not math.isfinite(value):
        raise InputError(f"{what}: found {value:g}; allowed: 0 to 2000 mm")
    return value


def language_of(file: Path, cell: Cell, given: str | None) -> ModuleType:
    """program, cell, option → language. Raises InputError for a name that none has."""
    if given is not None:
        return blocks.language(given)
    with opened(file) as text:
        head = list(islice(text, blocks.HEAD))
    return blocks.language(blocks.guessed(head, _written(cell), file.suffix))


def _written(cell: Cell) -> str | None:
    """cell → language of its dialect; empty for a post of the user's own, which only runs where it is asked for; None: none."""
    import postprocessors as posts

    if cell.controller is None:
        return None
    return "" if posts.is_own(cell.controller.post) else dialect(cell).language


@contextmanager
def opened(file: Path) -> Iterator[TextIO]:
    """program → its text, line by line; comments in the characters of another age come out as they went in.

    Raises InputError for a device or a pipe, and for a byte order mark, which editors of Windows write.
    """
    plain(file)
    with file.open("rb") as whole:
        if whole.read(3) == codecs.BOM_UTF8:
            raise InputError(
                f"{file}: found a byte order mark before the first character; allowed: none, a control takes it for text"
            )
    with file.open(encoding="utf-8", errors="surrogateescape", newline="") as text:
        yield text


@contextmanager
def blamed(file: Path, language: ModuleType, given: str | None = None) -> Iterator[None]:
    """program, language, `--language` → what is wrong with a line of it is said with its name, and as what it was read."""
    try:
        yield
    except InputError as error:
        if str(error).startswith(str(file)):
            raise
        name = language.__name__.rpartition(".")[2]
        said = str(error).encode("utf-8", "replace").decode()
        others = " ".join(n for n in blocks.languages() if n != name)
        how = "as --language says" if given is not None else "a guess by its text, its name and the dialect of the cell"
        raise InputError(f"{file}: {said}. It was read as {name} ({how}); others: --language {others}") from None


def found_of(result: Estimate, command: str = "compensate", so: str = "there is nothing to compensate") -> Known:
    """estimate → what of it acts at a pose. Raises TangoError, by the command, where nothing does."""
    return known(result, _touched(result), command, so)


def _touched(result: Estimate) -> Poses:
    """estimate → poses of what was touched."""
    touches = result.model.touches
    return sample(touches.machine, limits_of(touches.machine, touches, "probed", {}), 64)


def foretold(result: Estimate, judgement: Judgement, *, despite: bool) -> None:
    """estimate, what is to be thought of it, --despite → nothing. Raises TangoError where something named makes wrong what would be
    predicted."""
    if judgement.verdict == "doubtful" and not despite:
        wrong = {*judgement.untrusted} - {*dict(judgement.hidden)}
        words_as_promised(found_of(result, "predict"), result, wrong, _touched(result), "predict", still=False)


def _trusted(result: Estimate, judgement: Judgement, *, despite: bool) -> dict[str, float]:
    """estimate, what is to be thought of it, --despite → plain data of what no touch parts from the stylus; {} where S was turned.

    Raises TangoError where something named makes wrong what the words would be moved by.
    """
    at = _touched(result)
    if judgement.verdict == "doubtful" and not despite:
        words_as_promised(found_of(result), result, {*judgement.untrusted} - {*dict(judgement.hidden)}, at)
    stays = unparted(result, at)
    return {} if stays is None else {"spindle_um": round(rms(np.linalg.norm(stays.levers, axis=1) * stays.size), 4)}


def digest_of(found: Known) -> str:
    """what is known → its hash, as the mark of a program has it."""
    return hashlib.sha256(repr(list(zip([c.name for c in found.coefficients], found.values, strict=True))).encode()).hexdigest()[
        :12
    ]


def mark_of(found: Known, setup: Setup) -> str:
    """what is known, set-up → what the mark of a program that is compensated with them says of them."""
    return made_with(digest_of(found), setup.zero, tools_of(setup))


def ends_of(file: Path) -> str:
    """program → how its lines end."""
    with file.open("rb") as text:
        return "\r\n" if b"\r\n" in text.read(4096) else "\n"


def program(cell: Cell, result: Estimate, judgement: Judgement, source: Path, options: dict[str, Any]) -> dict[str, Any]:
    """cell, estimate, what is to be thought of it, program, options → plain data of what was done.

    The compensated program is written whole or not at all.
    """
    target: Path = options["out"]
    if options["target"] is not None:
        raise InputError("--target: found it beside a program; allowed: one of them: a table for the control, or a program")
    if target is None:
        raise InputError("-o: found nothing; allowed: the file of the compensated program, e.g. -o out.nc")
    if target.exists() and (target.is_dir() or os.path.samefile(target, source)):
        raise InputError(f"-o: found {target}; allowed: a file of its own, not the program itself")
    if not 1e-5 <= options["chord"] <= 1:
        raise InputError(f"--chord: found {options['chord']:g}; allowed: 0.00001 to 1 mm")
    language = language_of(source, cell, options["language"])
    setup, found, account = setup_of(cell, options), found_of(result), Account()
    stays = _trusted(result, judgement, despite=options["despite"])
    touched = touched_of(result.model.touches)
    settings = RewriteSettings(
        options["chord"], options["decimals"], not options["no_rotary"], options["diff"] is not None, touched
    )
    mark = mark_text(digest_of(found), setup.zero, tools_of(setup), simulated=options["of_no_machine"])
    ends = ends_of(source)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    try:
        with (
            os.fdopen(handle, "w", encoding="utf-8", errors="surrogateescape", newline="") as out,
            blamed(source, language, options["language"]),
            opened(source) as text,
        ):
            for line in compensated(text, language, setup, found, settings, account, mark):
                out.write(line + ends)
        os.chmod(name, 0o644)
        os.replace(name, target)
    except BaseException:
        os.unlink(name)
        raise
    if options["diff"] is not None:
        lines = [f"- {old}\n" + "".join(f"+ {line}\n" for line in new) for old, new in account.changes]
        options["diff"].write_text("".join(lines), encoding="utf-8", errors="surrogateescape")
    count = max(account.count, 1)
    return {
        "format": "tango-compensated-program/1",
        **({"simulated": True} if options["of_no_machine"] else {}),
        "program": str(target),
        "language": language.__name__.rpartition(".")[2],
        **({"metric_absolute": "as given"} if setup.settled else {}),
        "already_compensated": account.marked,
        "blocks": account.blocks,
        "lines": account.lines,
        "compensated": account.compensated,
        "unchanged_motions": account.passed,
        "arcs": account.arcs,
        "split": account.split,
        "points": account.count,
        "extrapolated": account.outside,
        "turning_rapids": account.turning,
        "turning_rapid_lines": account.turning_lines,
        **unstated(account),
        **stays,
        "largest_before_um": round(account.before, 4),
        "largest_before_line": account.worst_block,
        "largest_after_um": round(account.after, 4),
        "rms_before_um": round(float(np.sqrt(account.squares_before / count)), 4),
        "rms_after_um": round(float(np.sqrt(account.squares_after / count)), 4),
    }


def said(data: dict[str, Any]) -> str:
    """plain data → what a person reads."""
    if data["already_compensated"]:
        return f"the program bears the mark of a compensated one: it is copied as it is → {data['program']}"
    unchanged = data["unchanged_motions"]
    given = "as you say, in millimeters and absolute wherever no block states it\n" if "metric_absolute" in data else ""
    more = f"; {unchanged} motions as they were (machine coordinates, or before every axis was placed)" if unchanged else ""
    beyond = (
        f"extrapolated: at {100 * data['extrapolated'] / data['points']:.0f} % of the places an axis is beyond the touches: the "
        "machine was not measured there, and what is written for it is a guess\n"
        if data["extrapolated"]
        else ""
    )
    turning = _turning(data["turning_rapids"], data["turning_rapid_lines"])
    stand = "".join(f"{line}\n" for line in unstated_lines(data, "corrections"))
    spindle = (
        "NOTE: the spindle was never turned, so where it is may be the runout of the stylus: none of it is in the words, and about "
        f"{data['spindle_um']:.1f} µm (rms, one standard deviation) stay beside the figures below. Touch with S turned by 180° "
        "as well\n"
        if "spindle_um" in data
        else ""
    )
    return (
        f"{data['blocks']} blocks, {data['compensated']} compensated, {data['arcs']} arcs written as lines, {data['split']} split"
        f"{more}\n{given}{stand}{beyond}{turning}{spindle}"
        f"tip against where the program means it, with rapids: largest {data['largest_before_um']:.1f} µm before "
        f"(line {data['largest_before_line']}), {data['largest_after_um']:.2f} µm after; rms {data['rms_before_um']:.1f} and "
        f"{data['rms_after_um']:.2f} µm, as far as the errors are known\n→ {data['program']}, {data['lines']} lines"
    )


def _turning(count: int, lines: list[int]) -> str:
    """rapids that turn a rotary axis, the first of their lines → what to think of them; '' without any."""
    if not count:
        return ""
    listed = ", ".join(map(str, lines)) + (" …" if count > len(lines) else "")
    return (
        f"{count} rapids turn a rotary axis (lines {listed}): their ends are corrected, the way between is not split, as many "
        "controls do not move in a line in rapid. Near the part write a feed move (G1) there\n"
    )


def unstated(found: Account | Way) -> dict[str, Any]:
    """what was found along a program → plain data of what no block states; empty where all is stated."""
    data = {"taken_as_zero": sorted(found.assumed), "m_functions": dict(found.unknown)}
    return {key: value for key, value in data.items() if value}


def unstated_lines(data: Mapping[str, Any], figures: str) -> list[str]:
    """plain data, what would be wrong (corrections) → lines on rotary axes that no block places and on unknown M functions."""
    lines = []
    if axes := data.get("taken_as_zero"):
        names, stand, them = " and ".join(axes), "stands" if len(axes) == 1 else "stand", "it" if len(axes) == 1 else "them"
        words = " ".join(f"{axis}0." for axis in axes)
        lines.append(
            f"no block says where {names} {stand}: taken to be at 0. If the control has {them} elsewhere, the {figures} are wrong: "
            f"write {words} into the first rapid"
        )
    if first := data.get("m_functions"):
        names = ", ".join(f"{name} (line {line})" for name, line in first.items())
        lines.append(
            f"M functions of the machine's builder: {names}. The program assumes that they leave the path alone. Look in the "
            "manual: where one mirrors, shifts or moves an axis, or switches tool center point control, "
            f"the {figures} after it are wrong"
        )
    return lines
