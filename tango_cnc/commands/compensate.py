"""`tango compensate`: write compensation files for the control, and check that they helped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..compensate import as_json, capped, loop, propose, targets
from ..compensate.outcome import Outcome, asked_otherwise, outcome, ran, switched
from ..compensate.proposal import CAP_DEG, CAP_MM, Proposal
from ..compensate.trusted import as_far_as_trusted, kept_as_promised, worth_acting, wrong_by
from ..estimate import Estimate
from ..files import read_cell, read_readings, read_terms
from ..files.origin import current
from ..files.then import at_that_time
from ..judgement import Judgement
from ..judging import judged, made_up
from ..loaded import BACK, HELPS, IN_CONTROL
from ..records import Cell, InputError, TangoError
from ..verify.apart import apart
from . import _compensate, _program, _read_back, _scales, _short_check, _sign_trial
from ._beside import alone, beside, stated
from ._common import Output, cell_option, json_option, write_json
from ._compensated import recorded
from ._handed import pasted, printed
from ._present import contained, ended, present, rows, whose_is
from ._trust import despite_option, usable
from ._with_tcp import as_answered

PLACE = "Act 10"  # in the list of commands

ROWS = (
    "A single number that is wrong between the touches is not seen: read the files back from the control into a copy of the folder "
    "and compare them by --check"
)
path = click.Path(path_type=Path)
OF_TABLES = ("set", "over", "volume", "present", "cap-mm", "cap-deg", "dry-run", "sign-trial", "tcp", "no-tcp")  # not of programs
JUDGES = ("-C", "--readings", "--tcp", "--no-tcp", "--json")  # what acts with readings that judge a compensation


def _list(context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:
    if wanted and not context.resilient_parsing:
        click.echo(_compensate.listed())
        context.exit()


def _facts(context: click.Context, _parameter: click.Parameter, name: str | None) -> None:
    if name is not None and not context.resilient_parsing:
        click.echo(_compensate.facts(name))
        context.exit()


@click.command()
@click.argument("source", type=click.Path(path_type=Path, exists=True, dir_okay=False), required=False, metavar="[PROGRAM]")
@cell_option
@click.option("--target", metavar="NAME", help="Control or file form; --list shows them.")
@alone("-C")("--list", is_flag=True, is_eager=True, expose_value=False, callback=_list, help="List the targets, and end.")
@alone("-C")("--facts", is_eager=True, expose_value=False, callback=_facts, metavar="NAME", help="What a target is built on.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Setting of the target; --facts shows them.")
@click.option("--readings", "file", type=path, metavar="FILE", help="Readings file [default: readings.csv, else simulated.csv].")
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option("--over", type=click.Choice(["probed", "travel"]), default="probed", show_default=True, help="Volume to fit.")
@click.option("--volume", metavar="X=-100:100,…", help="Limits of single axes, mm and degrees, in place of --over.")
@click.option("--present", type=path, metavar="PATH", help="What is in the control: a compensation's folder or YAML; 'none'.")
@click.option("--cap-mm", type=click.FloatRange(0, min_open=True), default=CAP_MM, show_default=True, help="Largest change, mm.")
@click.option("--cap-deg", type=click.FloatRange(0, min_open=True), default=CAP_DEG, show_default=True, help="Largest change, deg.")
@click.option("-o", "--out", type=path, metavar="DIR", help="Where files go [default: a new folder in compensations/].")
@click.option("--dry-run", is_flag=True, help="Only says what would be written.")
@alone("-C", "--json")(
    "--check", "checked", type=path, metavar="DIR", help="Compare the files of a compensation with what was written."
)
@alone("-C")("--written", type=int, metavar="N", help="Note that compensation N has been loaded into the control.")
@alone(*JUDGES, "--terms", "--degree", "--turned", "--same-stylus", "--warmer", "--despite")(
    "--measured", type=int, metavar="N", help="Judge compensation N by --readings made with it in the control."
)
@alone("-C", "-o", "--tcp", "--no-tcp", "--minutes", "--rows", "--same-stylus", "--json")(
    "--short-check", "short", type=int, metavar="N", help="Choose a few touches that show whether N has helped."
)
@beside("--short-check")(
    "--minutes", type=click.FloatRange(1, 60), help="With --short-check: time, in place of as much as it needs."
)
@beside("--short-check")(
    "--rows", is_flag=True, help="With --short-check: also touches that meet every row of a table that can be met."
)
@beside("--measured")("--turned", metavar="C=180:X=MM,Y=MM", help="With --measured, for kinematics alone: a feature at two angles.")
@alone("-C", "--reason")(
    "--rolled-back", type=int, metavar="N", help="Note that undo/ of compensation N has been loaded; with --reason."
)
@beside("--rolled-back")("--reason", metavar="TEXT", help="With --rolled-back: why.")
@click.option("--tcp", is_flag=True, help="With --present, --measured, --short-check: tool center point control is on in the run.")
@click.option("--no-tcp", is_flag=True, help="The same: tool center point control is off.")
@beside("--measured", "--short-check")(
    "--same-stylus", is_flag=True, help="With --measured, --short-check: that of the full run, never out of its holder."
)
@beside("--measured")(
    "--warmer", type=click.FloatRange(-50, 50), metavar="K", help="With --measured: than in the full run; where no readings say it."
)
@alone("-C", "--json")("--history", "events", is_flag=True, help="What happened to the compensations of this cell.")
@click.option("--sign-trial", "trial_of", metavar="PLACE", help="Write files that change one place or table by 10 µm.")
@alone(*JUDGES, "--after")(
    "--sign-of", type=path, metavar="DIR", help="Judge a sign trial by --readings before it and --after with it."
)
@beside("--sign-of")("--after", type=path, metavar="FILE", help="With --sign-of: readings with the trial in the control.")
@_program.setup_options("PROGRAM")
@beside("PROGRAM")("--chord", type=float, default=0.001, show_default=True, help="With PROGRAM: chord error of arcs and parts, mm.")
@beside("PROGRAM")("--decimals", type=click.IntRange(2, 6), default=4, show_default=True, help="With PROGRAM: of the words.")
@beside("PROGRAM")("--no-rotary", is_flag=True, help="With PROGRAM: leave rotary words as they are.")
@despite_option
@click.option("--simulated", is_flag=True, help="Write files although the readings are simulated: to try them on no machine.")
@beside("PROGRAM")("--diff", type=Output(), metavar="FILE", help="With PROGRAM: every block that changed, before and after.")
@json_option
def command(**options: Any) -> int:
    """Says what a control can hold of the estimated errors, and writes files for it; or compensates an NC PROGRAM.

    With PROGRAM the words of an NC program are moved so that tool tip and direction go where it meant. What cannot be followed is
    refused by its name. Without, a control's tables and parameters are meant: nothing is sent to a control, a folder with files,
    the same files as they were before (undo) and a list of steps is written.
    A number that would change by more than the cap is refused.
    """
    folder: Path = options["folder"]
    if options["tcp"] and options["no_tcp"]:
        raise InputError("--tcp, --no-tcp: found both; allowed: the one that is true of the readings")
    options["tcp"] = True if options["tcp"] else False if options["no_tcp"] else None
    if options["checked"] is not None:
        return _checked(folder, options["checked"], options["json_file"])
    if options["events"]:
        return _history(folder, options["json_file"])
    if options["written"] is not None:
        return _written(folder, options["written"])
    if options["rolled_back"] is not None:
        return _rolled_back(folder, options["rolled_back"], options["reason"])
    cell = read_cell(folder)
    if options["measured"] is not None:
        return _measured(cell, options)
    if options["short"] is not None:
        return _short_check.choose(cell, options["short"], options)
    if options["sign_of"] is not None:
        return _sign_trial.judged(cell, options)
    if options["source"] is not None:
        return _program_of(cell, options)
    return _proposed(cell, options)


def _checked(folder: Path, checked: Path, json_file: str | None) -> int:
    """cell, folder of a compensation → exit code: whether its files are as they were written."""
    here = (folder / loop.CELL).exists()
    record = loop.check(checked, folder if here else None)
    if here:
        whose_is(loop.Kept(0, checked, record), read_cell(folder, strategy=False))
    if not write_json(json_file, {"format": "tango-compensation-check/1", "same": True, "target": record["target"]}):
        click.echo(f"{checked}: every file of {record['target']} for the machine {record.get('machine')!r} is as it was written")
    return 0


def _program_of(cell: Cell, options: dict[str, Any]) -> int:
    """cell, options → exit code: an NC program is compensated."""
    if ignored := [name for name in OF_TABLES if stated(name)]:
        raise InputError(f"--{ignored[0]}: found beside a PROGRAM, where it does nothing; allowed: without one, with --target")
    contained(cell.folder, options)
    options["of_no_machine"] = _consented(cell.folder, options)
    data = _program.program(cell, *(found := _estimate(cell, options)), options["source"], options)
    if not write_json(options["json_file"], data):
        click.echo(_program.said(data))
        _warmth(cell, found[0])
    return 0


def _proposed(cell: Cell, options: dict[str, Any]) -> int:
    """cell, options → exit code: what a control can hold, and the files for it."""
    folder: Path = options["folder"]
    if options["target"] is None:
        raise InputError(f"--target: found none; allowed: {', '.join(targets.names())}; 'tango compensate --list' describes them")
    targets.load(options["target"])
    _compensate.in_millimeters(cell, options["target"])
    there, last = present(cell, options)
    simulated = _consented(folder, options) if options["trial_of"] is not None or not options["dry_run"] else False
    result, judgement = _estimate(cell, options)
    asked = partial(
        propose,
        result,
        options["target"],
        (*_compensate.settings_of(last), *options["settings"]),
        there,
        options["over"],
        _volume(cell, options, last),
        tcp=True if options["trial_of"] is not None else options["tcp"],
        hidden_by=dict(judgement.hidden) if options["despite"] else wrong_by(result, judgement),
        read_back=_read_back.taken if options["trial_of"] is None else None,
    )
    proposal = asked()
    if not options["dry_run"]:
        untrusted = [name for name in judgement.untrusted if name not in judgement.stand]
        worth_acting(proposal.fit, result, untrusted, options["despite"])
        if judgement.verdict == "doubtful" and not options["despite"]:
            kept_as_promised(proposal.fit, result, {*judgement.untrusted} - {*dict(judgement.hidden)})
    if options["trial_of"] is not None:
        return _sign_trial.written(cell, proposal, result, options, _now(), simulated=simulated)
    if last and not options["despite"] and not as_answered(cell, result, proposal, last, options):
        proposal = asked(proven=False)
    taken = write_json(options["json_file"], as_json(proposal))
    if not taken:
        printed(_compensate.text(proposal))
        click.echo("\n".join(_compensate.met(proposal, result)))
        _warmth(cell, result)
    capped(proposal, options["cap_mm"], options["cap_deg"])
    if options["dry_run"]:
        return 0
    source = current(folder, options["file"])
    terms = cell.terms if options["terms"] is None else read_terms(options["terms"], folder)
    text = source.read_text(encoding="utf-8-sig")
    known = _short_check.made_from(folder, text, terms, options["degree"], tcp=options["tcp"] is True)
    by_hand = _short_check.by_hand(cell, proposal, result, tcp=options["tcp"] is True)
    kept = loop.store(folder, proposal, _now(), options["out"], rows(source), simulated=simulated, made_from=known, by_hand=by_hand)
    if options["out"] is None:
        recorded(folder)
    printed(_next(folder, kept, proposal, counted=options["out"] is None), err=taken)
    return 0


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _estimate(cell: Cell, options: dict[str, Any]) -> tuple[Estimate, Judgement]:
    """cell, options → estimate that may be used, and what is to be thought of it. Raises TangoError."""
    source = current(cell.folder, options["file"])
    readings = read_readings(source, cell.machine, cell.artefact)
    terms = cell.terms if options["terms"] is None else read_terms(options["terms"], cell.folder)
    result, judgement = judged(cell, readings, terms, options["degree"], source=source)
    if options["measured"] is not None:  # what was entered is judged all the same: a wrong sign must come out of the control
        judgement = replace(judgement, nothing=False)
    usable(judgement, options["despite"], "compensate")
    return result, judgement


def _consented(folder: Path, options: dict[str, Any]) -> bool:
    """cell, options → whether its readings are simulated. Raises InputError where nobody has agreed to files of such readings."""
    source = current(folder, options["file"])
    if not made_up(source):
        return False
    if not options["simulated"]:
        raise InputError(
            f"compensate: found {source}, which a simulator has made: its errors are those of no machine. Nothing was written. "
            "Allowed: readings of a machine ('tango run'); --simulated to try the files where no machine is"
        )
    click.echo(loop.SIMULATED, err=True)
    return True


def _warmth(cell: Cell, result: Estimate) -> None:
    for text in filter(None, (apart(result), _scales.said(cell.folder, result))):
        printed(text)


def _volume(cell: Cell, options: dict[str, Any], record: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """cell, options, record of what is in the control → the volume: its own where nothing else is asked for, so that tables fit."""
    own = _compensate.volume_of(_compensate.volume_text(record), cell.machine) if options["over"] == "probed" and record else {}
    return own | _compensate.volume_of(options["volume"], cell.machine)


def _next(folder: Path, kept: loop.Kept, proposal: Proposal, *, counted: bool) -> str:
    lines = [*([kept.record["simulated"]] if "simulated" in kept.record else []), *kept.record["steps"]]
    steps = "\n".join(f"  {line}" for line in lines)
    names = ", ".join(proposal.files)
    after = (
        f"When it is in the control:\n  tango compensate -C {pasted(folder)} --written {kept.number}\n{_measure(folder, kept)}"
        if counted
        else "The folder of -o has no number: --written and --measured know only what was proposed without -o"
    )
    return f"\n→ {kept.folder}: {names}; undo/ has them as they were before\n\n{steps}\n\n{after}"


def _written(folder: Path, number: int) -> int:
    kept = loop.one(folder, number)
    loop.check(kept.folder)
    whose_is(kept, read_cell(folder, strategy=False))
    if (state := loop.state(folder, number)) != "proposed":
        anew = f" ({_again(folder, kept)})" if state == BACK else ""
        raise InputError(f"--written: found compensation {number}, which is noted as {state}; allowed: one that is proposed{anew}")
    if (other := loop.other_control(folder, kept)) is not None:
        raise InputError(
            f"--written: found compensation {number} ({kept.record['target']}), and compensation {other.number} "
            f"({other.record['target']}) is in the control: together they would correct the same errors twice; allowed: when "
            f"{other.number} has been taken out, 'tango compensate --rolled-back {other.number} --reason TEXT' first"
        )
    loop.note(folder, kept, _now(), "written")
    recorded(folder)
    click.echo(
        f"compensation {number} ({kept.record['target']}) is noted as written. Look whether it has helped:\n"
        f"{_measure(folder, kept)}"
    )
    return 0


def _again(folder: Path, kept: loop.Kept) -> str:
    """cell, compensation that was taken out → the command that proposes it anew."""
    return f"'tango compensate -C {pasted(folder)} --target {kept.record['target']}' proposes it anew"


def _measure(folder: Path, kept: loop.Kept) -> str:
    """cell, compensation → the commands that judge it: by a short check, by the whole strategy, or by hand where touches cannot.

    Programs of this project probe without tool center point control.
    """
    if any("--turned" in text for text in kept.record["steps"]):
        hand = [text for text in kept.record["steps"] if "Look by hand" in text or "--turned" in text]
        return "\n".join([f"  the last steps of {kept.folder / loop.STEPS} say how:", *(f"  {text}" for text in hand)])
    changed = [v for v in kept.record["values"] if v["new"] != v["present"]]
    tcp = any("uncorrected" in v for v in changed)
    alone = tcp and all("uncorrected" in v for v in changed)  # without tool center point control nothing of it is seen
    how = " --tcp" if alone else " --no-tcp" if tcp else ""
    check, here = folder / loop.FOLDER / f"{loop.CHECK}{kept.number:03d}", f"  tango compensate -C {pasted(folder)}"
    short = [
        f"{here} --short-check {kept.number}{how if alone else ''}",
        f"  tango run -C {pasted(check)}",
        f"{here} --measured {kept.number} --readings {pasted(check / 'readings.csv')}{how}",
        "or with the whole strategy, which says more:",
    ]
    lines = [
        *(short if "made_from" in kept.record else []),
        f"  tango run -C {pasted(folder)} --readings after.csv",
        f"{here} --measured {kept.number} --readings after.csv{how}",
        *(["(--tcp in place of --no-tcp where tool center point control was on in that run)"] if tcp and not alone else []),
        *(
            ["(both with a program that runs with tool center point control on: without it nothing of this is seen)"]
            if alone
            else []
        ),
    ]
    return "\n".join(lines)


def _rolled_back(folder: Path, number: int, reason: str | None) -> int:
    kept = loop.one(folder, number)
    if not (reason or "").strip():
        raise InputError('--reason: found none; allowed: why it was taken out again, e.g. --reason "the spindle was changed"')
    if (state := loop.state(folder, number)) not in IN_CONTROL:
        raise InputError(
            f"--rolled-back: found compensation {number}, which is noted as {state}; allowed: one that is in the control"
        )
    last = loop.in_control(folder)
    if last is not None and last.number != number:
        raise InputError(
            f"--rolled-back: found compensation {number}, and compensation {last.number} was written after it: undo/ of "
            f"{last.number} holds what {number} had written; allowed: load undo/ of {last.number} and note it first, 'tango "
            f"compensate -C {pasted(folder)} --rolled-back {last.number} --reason TEXT'"
        )
    loop.note(folder, kept, _now(), "rolled back", text=reason)
    recorded(folder)
    click.echo(f"compensation {number} ({kept.record['target']}) is noted as rolled back: {reason}")
    return 0


def _measured(cell: Cell, options: dict[str, Any]) -> int:
    number = options["measured"]
    kept = loop.one(cell.folder, number)
    loop.check(kept.folder)
    if (state := loop.state(cell.folder, number)) not in IN_CONTROL:
        raise InputError(
            f"--measured: found compensation {number}, which is noted as {state}; allowed: one that is in the control ("
            + (_again(cell.folder, kept) if state == BACK else f"'tango compensate --written {number}'")
            + ")"
        )
    if options["turned"] is not None:
        if options["file"] is not None or options["tcp"] is False:
            raise InputError(
                "--turned: found it with --readings or --no-tcp; allowed: alone, or with --tcp: it is judged by itself"
            )
        return _noted(cell, kept, *_short_check.turned(cell, kept, options["turned"]), tcp=True, json_file=options["json_file"])
    file: Path | None = options["file"]
    if file is None:
        raise InputError(
            "--readings: found none; allowed: readings that were made with the compensation in the control "
            f"('tango run -C {pasted(cell.folder)} --readings after.csv' makes them)"
        )
    if file.exists() and (why := loop.older(kept.record, rows(file), ended(file))):
        raise InputError(f"--readings: found {file}: {why}; allowed: readings made with the compensation in the control")
    if file.exists() and _short_check.is_short(cell, kept, file):
        found, places = _short_check.judged(cell, kept, file, options)
    else:
        found, places = _by_itself(cell, kept, options)
    return _noted(cell, kept, found, places, tcp=bool(options["tcp"]), json_file=options["json_file"])


def _noted(cell: Cell, kept: loop.Kept, found: Outcome, places: list[str], *, tcp: bool, json_file: str | None) -> int:
    """cell, compensation, outcome, places that act with TCP only, whether the run had it on → exit status; history."""
    if (
        found.verdict in HELPS
        and not found.rows
        and any(h["table"] != h["place"] for h in kept.record["values"] if h["new"] != h["present"])
    ):
        found = replace(found, text=f"{found.text}. {ROWS}")
    figures = {"before_um": found.before.value, "promised_um": found.promised.value, "measured_um": round(found.measured.value, 4)}
    unseen: dict[str, Any] = {}
    if found.left_if_none is not None:
        unseen = {"not_seen": list(found.not_seen), "left_if_none_um": round(found.left_if_none, 4)}
    if found.rows:
        unseen["rows_not_met"] = list(found.rows)
    loop.note(cell.folder, kept, _now(), found.verdict, **figures, **unseen, text=found.said, **({"tcp": tcp} if places else {}))
    recorded(cell.folder)
    data = {"format": "tango-compensation-outcome/1", "compensation": kept.number, "verdict": found.verdict, **figures}
    data["measured_interval_um"] = [round(found.measured.low, 4), round(found.measured.high, 4)]
    data |= unseen
    if not write_json(json_file, data):
        printed(f"compensation {kept.number}: {found.verdict}: {found.said}")
    return 0 if found.in_any_case else TangoError.exit_code


def _by_itself(cell: Cell, kept: loop.Kept, options: dict[str, Any]) -> tuple[Outcome, list[str]]:
    """cell, compensation, options → outcome of a run that determines everything by itself, places that act with TCP only."""
    cell = at_that_time(cell, options["file"])
    _short_check.as_then(cell, kept)
    result, judgement = _estimate(cell, options)
    held = _short_check.held_of(cell, kept, result.model.coefficients)
    places = switched(kept.record, held)
    if places and options["tcp"] is None:
        raise InputError(_short_check.neither(kept.number, places))
    tcp = bool(options["tcp"])
    found = outcome(kept, result, held, tcp=tcp)
    if places and found.verdict not in HELPS:
        found = asked_otherwise(found, outcome(kept, result, held, tcp=not tcp), tcp=tcp)
    if not options["despite"]:
        run = ran(kept, result, held, tcp=tcp)
        found = as_far_as_trusted(found, kept.record, result, judgement.untrusted, dict(judgement.hidden), run)
    readings = read_readings(current(cell.folder, options["file"]), cell.machine, cell.artefact)
    return _short_check.by_place(found, cell, kept, readings, result, options), places


def _history(folder: Path, json_file: str | None) -> int:
    events = loop.history(folder)
    if not write_json(json_file, {"format": "tango-compensation-history/1", "events": events}):
        for e in events:
            more = f": {e['text']}" if "text" in e else ""
            click.echo(f"{e['utc']}  {e['compensation']}  {e['target']}  {e['event']}{more}")
        if not events:
            printed("no compensation yet; 'tango compensate --target NAME' proposes one")
    return 0
