"""`tango commission`: test how the control behaves, with moves in the air, and write it into the cell."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..files import read_cell
from ..files.commissioning import NAME
from ..records import InputError, LinkError, Plan
from ._asking import answered
from ._beside import alone, beside
from ._commission_record import record_of
from ._commission_second import Ready, at_quarter, file_of, held_aside, unasked
from ._common import address_of, ahead, attended, cell_option, controller_of, json_option, start_patience, writing
from ._handed import Kept, hands, whole
from ._links import say_doubt
from ._start import HELD, counts, in_spindle, obeys
from ._written import said_beside, written
from .check import positioning_feed

KEPT = Kept(("port", "timeout", "within"), {"touch": ("within",)})
FOLDER = "commissioning"  # of the cell: program, records and journal of the last try
FAILED = 1
BY_DIAL = ("feed", "append")  # beliefs that a second program with the feed override turned shows
UNHEARD = (
    "Did the probe move up slowly, and go on although you touched the stylus? (no: it stopped there, it did not get there, or you "
    "have not seen it)"
)
PLACE = "Measure 30"  # in the list of commands


@click.command()
@cell_option
@click.option("--port", metavar="URL", help="Default: controller.port of the cell.")
@alone("-C", "--within", "--touch", "--again")(
    "--program", "only_program", is_flag=True, help="Write the program and stop: nothing is sent."
)
@click.option(
    "--held/--no-held",
    default=None,
    help="Also test with the stylus held aside: a program of one move of 0.5 mm has to stop at once. Default: at a terminal.",
)
@click.option(
    "--dial/--no-dial",
    default=None,
    help="Also test feed override and file of records: a second program, with the override at 25 %. Default: at a terminal.",
)
@click.option(
    "--within",
    type=click.FloatRange(0, 20),
    metavar="MM",
    help="How far from artefact.yaml the table may stand; the moves in the air are so much higher. Default: 20, or less where the "
    "travels leave no room for it; the command says how far.",
)
@click.option("--touch", is_flag=True, help="Test on the table: touch a few facets at two angles and two feeds.")
@beside("--touch")("--yes", is_flag=True, help="With --touch: do not ask before the machine moves.")
@click.option("--again", is_flag=True, help="Test everything again, also what has passed.")
@click.option(
    "--answers",
    type=click.Choice(["ask", "yes", "none"]),
    default="ask",
    show_default=True,
    help="Questions that a person has to answer: ask at the terminal, take yes for each, or leave them open.",
)
@click.option("--said", metavar="TEXT", default="", help="What stands on the screen of the control where the program stopped.")
@click.option(
    "--timeout",
    type=click.FloatRange(0, min_open=True),
    metavar="S",
    help="Seconds without an answer after which the program counts as stopped.",
)
@json_option
@hands(KEPT)
def command(
    folder: Path,
    port: str | None,
    only_program: bool,
    held: bool | None,
    dial: bool | None,
    within: float | None,
    touch: bool,
    yes: bool,
    again: bool,
    answers: str,
    said: str,
    timeout: float | None,
    json_file: str | None,
) -> None:
    """Tests how the control behaves before the first real run: short moves in the air, high above the table.

    You stand at the machine, with a hand on feed hold, and touch the stylus with a finger when the program asks for it. PASS or
    FAIL of every point goes into commissioning.yaml of the cell, with date, program and control. What has passed is not tested
    again until the profile, the axes of machine.yaml or the port change.
    """
    from postprocessors import unverified

    from .. import commission
    from ..commission.above import flight
    from ..link.measure import fitting
    from ..plan import by_stylus
    from ._commission_first import by_hand
    from ._commission_first import questions as by_hand_first
    from ._commission_touch import touched
    from ._proofs import proven, told, unproven

    cell = by_stylus(read_cell(folder))[0]  # with the first stylus, where there are several
    controller = controller_of(cell)
    post = writing(cell)
    known = {} if again else proven(cell, post)
    wanted = {experiment.belief for experiment in unproven(known) if experiment.touches == touch}
    if not wanted and not only_program:
        more = "" if touch or not unproven(known) else ", but what only a touched table shows: 'tango commission --touch'"
        once = f"'tango commission {'--touch ' if touch else ''}--again' tries it once more"
        click.echo(whole(f"everything is proven on this control{more}, see {folder / NAME}; {once}", KEPT))
        return
    _together(touch, {"--within": within is not None, "--held": held, "--dial": dial, "--said": bool(said)})
    if touch:
        touched(cell, post, port, wanted, yes, only_program, timeout, json_file)
        return
    someone = attended()
    if held and not someone and not only_program:
        raise InputError("--held: found no terminal; allowed: a terminal with a person who holds the stylus aside when asked")
    if dial and not someone and not only_program:
        raise InputError("--dial: found no terminal; allowed: a terminal with a person who turns the feed override when asked")
    alone = {HELD, *BY_DIAL}  # what only a second program shows
    if not someone and not wanted - alone and not only_program:
        what = " and ".join(sorted(wanted))
        do = "who holds the stylus aside" if wanted == {HELD} else "who does what it asks"
        be = "is" if len(wanted) == 1 else "are"
        click.echo(f"only {what} {be} not proven, see {folder / NAME}; it needs a terminal and a person {do}")
        return
    if wanted == {HELD} and held is False and not only_program:
        click.echo(f"only deflected is not proven, see {folder / NAME}; --no-held leaves it out")
        return
    address = None if only_program else address_of(cell, port, post.link)
    moves = flight(cell, commission.MOST if wanted - {"alive", "directions", "override", *alone} else 1, wanted, within)
    made = moves.plan
    if address is not None:
        fitting(address, post.link, made)
        say_doubt(post, address)
    options, feed = _careful(cell, post, wanted)
    programs = written(cell, folder / FOLDER / "program", post, made, options)
    first = by_hand_first(made, wanted, controller.post).values()
    if address is None:
        _before(programs, f"{in_spindle(made)} in the spindle and on.", *(f"{text} If not, do not start it." for text, _ in first))
        return
    at = _Control(cell, post, address, timeout, someone, options, moves)
    questions = {belief: each for belief, each in commission.questions(made).items() if belief in wanted}
    if not (someone and answers == "ask"):
        for text, _ in first:
            click.echo(f"not asked: {text} If not, do not start the program.", err=True)
    elif not by_hand(cell, post, made, wanted, programs[0].mark, json_file):
        raise click.exceptions.Exit(FAILED)
    asks = partial(_announced, at, feed if "directions" in wanted else None, sorted(known.keys() - wanted), questions)
    seen, control = at.tried(made, programs, confirm=asks)  # also brings the axes to where a hand is safe
    seen = replace(seen, largest=moves.largest, stored=file_of(at.address, post) is not None, feed=feed or seen.feed)
    seen = replace(seen, doubts=unverified(post, controller.options))
    seen = replace(seen, obeys=obeys(cell, post), anew=controller.options.get("records_file") == "anew")
    seen = _explained(at, seen, said)
    if seen.ended and HELD in wanted and (held or (held is None and someone)):
        seen, control = held_aside(at, seen, control)
    if seen.ended and wanted & set(BY_DIAL) and (dial or (dial is None and someone)):
        seen, control = at_quarter(at, seen, control)
    said_so = _asked(commission.answerable(questions, seen), answers if someone or answers != "ask" else "none")
    seen = replace(seen, answers=said_so, unasked=answers == "yes")
    judged = [j for j in commission.judge(seen) if j.experiment.belief in wanted or j.verdict.verdict == "FAIL"]
    failed = told(cell, post, judged, programs[0].mark, control, json_file)
    if not seen.ended:
        _broken_off(seen, not failed, "\n".join(line for program in programs for line in program.lines()))
    if failed:
        raise click.exceptions.Exit(FAILED)
    if json_file != "-":
        _afterwards(folder, [j.experiment.belief for j in judged if j.verdict.verdict == "OPEN"])


@dataclass(frozen=True)
class _Control:
    """The control that is tried: its cell and post, its port, how long it may be silent, whether somebody is there, the moves."""

    cell: Any
    post: Any
    address: str
    timeout: float | None
    someone: bool
    options: Mapping[str, Any]  # of the profile, as the programs have them
    moves: Any

    def program(self, made: Plan, changed: Mapping[str, Any]) -> list[Any]:
        """plan, options that differ → its program, written."""
        return written(self.cell, self.cell.folder / FOLDER / "program", self.post, made, {**self.options, **changed})

    def tried(
        self,
        made: Plan,
        programs: list[Any],
        patience: float | None = None,
        start: float | None = None,
        ready: Ready = unasked,
        confirm: Callable[[Any, Any], None] = lambda *_: None,
    ) -> tuple[Any, str]:
        """plan, its programs, s of silence and s for the start mark where they are not those of the command, what is asked when
        the control has the program, what before that, when its port is open → what came, what the control calls itself.
        """
        begins = start or start_patience(self.someone)
        return _tried(self.cell, self.post, made, programs, self.address, patience or self.timeout, begins, ready, confirm)


def _careful(cell: Any, post: Any, wanted: Collection[str]) -> tuple[dict[str, Any], float | None]:
    """cell, post, beliefs to try → options of the program, its feed (mm/min): slow until the directions are proven."""
    from .. import commission

    options = {**controller_of(cell).options, "gate": "finger"}  # whatever the runs do: here it is what is tried
    if counts(post):
        options["misses"] = 20  # every move of this program is to meet nothing
    feed = positioning_feed(cell)
    if feed is not None and "directions" in wanted:
        feed = options["positioning_feed"] = min(feed, commission.UNTRIED_FEED)
    return options, feed


def _together(touch: bool, others: Mapping[str, bool | None]) -> None:
    """whether the table is touched, {option of the moves in the air: whether it is stated} → nothing.

    Raises InputError for both.
    """
    for name, stated in others.items():
        if touch and stated:
            why = "--touch takes the table to be where its file says" if name == "--within" else "that is of the moves in the air"
            raise InputError(f"{name}: found --touch too; allowed: one of them, as {why}")


def _before(programs: Sequence[Any], *texts: str) -> None:
    """programs that are not sent, what has to be so before one is started → says both."""
    said_beside(programs)
    for program in programs:
        click.echo(whole(f"{program.file}: run it, then 'tango commission' with the port of the cell reads its records", KEPT))
    for text in texts:
        click.echo(f"before it: {text}")


def _announced(at: _Control, feed: float | None, settled: Sequence[str], questions: Mapping[str, Any], *_: Any) -> None:
    """control, mm/min where it is slow, what is proven, what is asked → says it. Raises Abort when nobody wants it."""
    from ..commission.above import said

    made = at.moves.plan
    click.echo(
        f"{made.machine.name}: the program goes to the clear level, asks for a finger at the stylus, and makes {len(made.touches)} "
        f"moves in the air{f', at {feed:g} mm/min at most until their directions are proven' if feed else ''}. {said(at.moves)} "
        f"{in_spindle(made)} in the spindle and on; hand on feed hold.",
        err=True,
    )
    if settled:
        click.echo(f"proven already, and not asked again: {', '.join(settled)}", err=True)
    if not at.someone:
        return
    for text in ("You will be asked:", *(f"  {question.text}" for each in questions.values() for question in each.values())):
        click.echo(text, err=True)
    if not click.confirm("Start?", err=True):
        raise click.Abort


def _explained(at: _Control, seen: Any, said: str) -> Any:
    """what came, what --said states → the same with what the screen shows, and whether the probe was heard."""
    if not seen.ended and not said and not seen.said and at.someone:
        said = click.prompt("The program stopped. What stands on the screen of the control? (Enter: nothing)", default="", err=True)
    if not seen.ended:
        seen = replace(seen, said=_with_text(said or seen.said, at.post, at.options))
    if at.someone and _unclear(seen):
        seen = replace(seen, unheard=click.confirm(UNHEARD, err=True))
    return seen


def _afterwards(folder: Path, still: Sequence[str]) -> None:
    """cell, beliefs that are neither proven nor refuted → what to do about them, where there are any, and what comes next."""
    if still:
        click.echo(
            f"OPEN is not proven: {', '.join(still)}. Before a run that nobody watches, commission again at a terminal, with a "
            "person at the machine who answers what is asked (--held and --dial are asked there, too)",
            err=True,
        )
    click.echo(whole("Where artefact.yaml is right to some 20 mm only, 'tango locate' finds the table first", KEPT), err=True)
    ahead(folder, "commission --touch", "run")


def _with_text(said: str, post: Any, options: Mapping[str, Any]) -> str:
    """what stood on the screen, post, options → the same with the text of an alarm of the program that is there by its number."""
    import postprocessors as posts

    own = post.alarms(posts.settings(post, options))
    found = next((own[number] for number in re.findall(r"\d+", said) if number in own), "")
    return f"{said}: {found}" if found and found not in said.upper() else said


def _broken_off(seen: Any, alone: bool, program: str) -> None:
    """what came of a program without end, whether no belief has failed, program → what to do next; raises LinkError then."""
    from ..commission import stopped_by

    text = f"the program did not come to its end: {len(seen.records)} of {len(seen.plan.touches)} moves were made"
    if seen.said:
        text += f". {stopped_by(seen.said, seen.doubts, program)}" if alone else ""
    else:
        text += (
            ". What does the screen of the control show? Pass it on: 'tango commission --said 'ITS TEXT'', or answer at a terminal"
        )
    text += ". Then commission again: what has passed is not tried twice"
    if alone:
        raise LinkError(text)
    click.echo(whole(text, KEPT), err=True)


def _tried(
    cell: Any,
    post: Any,
    made: Plan,
    programs: list[Any],
    address: str,
    timeout: float | None,
    start: float,
    ready: Ready,
    confirm: Callable[[Any, Any], None],
) -> tuple[Any, str]:
    """→ what came of the program, and what the control calls itself."""
    from .. import commission
    from ..link import entries
    from ..link.journal import read_journal
    from ..link.lock import holding
    from ..link.measure import Wanted, measure, protocol_of
    from ..link.session import Unwanted

    target = cell.folder / FOLDER / "readings.csv"
    journal = target.with_suffix(".journal")
    why, earlier = "", journal.read_bytes() if journal.exists() else b""  # of the try before: proves nothing today
    with holding(cell.folder, "tango commission"):
        again = "'tango commission' tries what is not proven yet"
        wanted = Wanted(
            address, post.link, cell.controller.post, target, False, timeout, start, misses=len(made.touches) + 1, then=again
        )
        try:
            measure(cell, made, wanted, lambda part: programs, _told, confirm, ready=ready)
        except LinkError as error:
            why = str(error)
            if not journal.exists() or journal.read_bytes() == earlier:
                raise  # the port did not open
            if isinstance(error, Unwanted):  # nobody is there who could be asked
                raise LinkError(f"{why}; a control that has its program goes on with it: press feed hold, then reset") from None
            if made.only is None:  # else there is no record to wait for
                click.echo(whole(why, KEPT), err=True)
    records: dict[int, tuple[int, dict[str, float]]] = {}
    refused, control, ended, begun, marked = [], "", False, False, False
    seconds: float | None = None
    times: dict[int, float] = {}
    for entry in read_journal(journal)[0]:
        begun |= isinstance(entry, entries.StartMark)
        if isinstance(entry, entries.Identity):
            control = entry.text
        if isinstance(entry, entries.End):
            marked = entry.stands
            ended = entry.complete or (made.only is not None and entry.stands)
        if isinstance(entry, entries.Reading | entries.RefusedRecord):
            found = record_of(entry.record, made)
            if found is not None:
                records[found[0]] = found[1:]
                seconds = times[found[0]] = entry.time_s
            else:
                refused.append(entry.record)
    explains = protocol_of(address, post.link)[0].Client.explains
    own = any(words in why.upper() for words in ("PROBE", "THE CONTROL SAYS"))  # of the control, not of the line to it
    said = why if explains and (begun or own) else ""
    return commission.Seen(made, records, begun, ended, tuple(refused), said, seconds, marked=marked, times=times), control


def _unclear(seen: Any) -> bool:
    """what came → whether only the person can say if the probe was heard: the program stopped, nothing is recorded."""
    from .. import commission

    alive = next(j for j in commission.judge(seen) if j.experiment.belief == "alive")
    return bool(seen.begun and not seen.ended and not seen.records and alive.verdict.verdict != "FAIL")


def _asked(questions: dict[str, dict[str, str]], how: str) -> dict[str, dict[str, bool]]:
    """{belief: {what: question}}, ask, yes or none → {belief: {what: answer}}; what nobody has seen is left out."""
    if how == "none":
        return {}
    said: dict[str, dict[str, bool]] = {}
    for belief, each in questions.items():
        for what, text in each.items():
            answer = answered(text) if how == "ask" else True
            if answer is not None:
                said.setdefault(belief, {})[what] = answer
    return said


def _told(step: Any) -> None:
    if step.remark:
        click.echo(step.remark, err=True)
