"""What a run shows the person at the machine, and asks, before anything moves."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import click

from ..files import blamed_on
from ..records import Cell, InputError, Plan
from ._handed import whole
from ._progress import said

if TYPE_CHECKING:
    from postprocessors import Post

    from ..commission import Experiment

HELD = "deflected"  # the belief that is tried with the stylus held aside
MISSES = 3  # of a post without that option: its driver counts them
FATAL = 1  # beliefs of this danger are no question, once they are proven wrong: no hand at feed hold is quick enough
DANGEROUS = 2  # beliefs up to this danger are named before a run: what they lead to breaks something, or a whole night is lost


def in_spindle(part: Plan) -> str:
    """plan → which probe has to be in the spindle: how long it is, and with which stylus, where the machine has several."""
    machine = part.machine
    return f"Probe{f' with stylus {machine.stylus}' if machine.styli else ''} ({machine.probe.length:g} mm)"


def unproven_of(cell: Cell, post: Post, trying: Collection[str] = ()) -> list[str]:
    """cell, its post, beliefs that are tried now → others that can break something and that nothing in its commissioning.yaml
    proves today, in sentences.
    """
    from ._proofs import proven

    found, left = proven(cell, post), _left(cell, post, trying)
    wrong = {e.belief: f". It is NOT so: {found[e.belief].found}. What to do: {e.advice}" for e in left if e.belief in found}
    return [f"{e.says}{wrong.get(e.belief, '')}" for e in left]


def _left(cell: Cell, post: Post, trying: Collection[str]) -> list[Experiment]:
    from ._proofs import proven, unproven

    there = [e for e in unproven(proven(cell, post)) if cell.machine.rotary or "rotary" not in e.on]
    return [e for e in there if e.danger <= DANGEROUS and e.belief not in trying]


def tries_of(cell: Cell, post: Post, trying: Collection[str] = ()) -> str:
    """cell, its post, beliefs that are tried now → which commands try the others that can break something; '' where none is left.

    A stylus that is held aside is seen by no move of the other programs, in the air or at the table.
    """
    left = _left(cell, post, trying)
    air, them = [e for e in left if not e.touches], "it" if len(left) == 1 else "these"
    found = []
    if [e.belief for e in air] == [HELD]:
        found.append(
            "'tango commission --held' tries it at a terminal: you hold the stylus aside, and a move of 0.5 mm has to stop"
        )
    elif air:
        found.append(f"'tango commission' tries {them} in minutes, high above the table")
    if len(air) < len(left):
        found.append(f"'tango commission --touch' tries {'the rest' if air else them} at the table")
    return f"{'; '.join(found)}." if found else ""


def disproven_of(cell: Cell, post: Post) -> list[tuple[str, str]]:
    """cell, its post → (what is not so, what mends it): beliefs that break something, and are proven wrong today."""
    return [(text, e.advice) for text, e in _wrong(cell, post)]


def _wrong(cell: Cell, post: Post) -> list[tuple[str, Experiment]]:
    """cell, its post → (what is not so, its experiment) of beliefs that break something, and are proven wrong today."""
    from ._proofs import proven, unproven

    found = proven(cell, post)
    wrong = [e for e in unproven(found) if e.danger <= DANGEROUS and e.belief in found]
    return [(f"{e.says}. It is NOT so: {found[e.belief].found}", e) for e in wrong]


def _fatal(one: Experiment) -> bool:
    """experiment → whether nobody can be careful enough; who is at the machine sees a stylus that hangs aside."""
    return one.danger <= FATAL and one.belief != HELD


def _mended(advice: str) -> str:
    return f"What to do: {advice}. Then 'tango commission' tries it again"


def unattended(cell: Cell, post: Post, simulated: bool = False) -> None:
    """Says what nobody has proven of this control, as nobody is asked. Raises InputError for what is proven not to be so.

    No simulated control breaks: of it only what is proven not to be so is named, as the flag may stand in a script by mistake.
    """
    from ..files.commissioning import NAME

    if simulated:
        for text, _ in _wrong(cell, post):
            said(f"{cell.folder / NAME}: {text}. It goes on only because of --simulated: leave that out on a real machine")
        return
    if wrong := _wrong(cell, post):
        (text, one), *_ = wrong
        who = "nobody may" if _fatal(one) else "only a person at the machine may"
        how = "" if _fatal(one) else ", at a terminal and without --yes"
        raise InputError(f"{cell.folder / NAME}: {text}. {_mended(one.advice)}. Nothing was sent: {who} go on with it{how}")
    for text in unproven_of(cell, post):
        said(f"not proven on this control: {text}")
    if tries := tries_of(cell, post):
        said(whole(tries))


def refuse_fatal(cell: Cell, post: Post, trying: Collection[str] = (), simulated: bool = False) -> None:
    """cell, its post, beliefs that are tried now → nothing, where a person may be asked whether to start.

    Raises InputError where a belief that nobody can be careful enough about is proven wrong: a probe that is not heard, an axis
    that goes the other way. Who is in a hurry says yes to that.
    """
    from ..files.commissioning import NAME

    for text, one in _wrong(cell, post):
        if _fatal(one) and one.belief not in trying and not simulated:
            raise InputError(f"{cell.folder / NAME}: {text}. {_mended(one.advice)}. Nothing was sent: nobody may go on with it")


def gate_of(cell: Cell, post: Post) -> str:
    """cell, its post → what proves the probe alive in its programs."""
    import postprocessors as posts

    assert cell.controller is not None
    with blamed_on(cell.folder / "tango.yaml"):
        return str(posts.settings(post, cell.controller.options).get("gate", "none"))


def obeys(cell: Cell, post: Post) -> bool:
    """cell, its post → whether the feed override acts on measuring moves, by its profile or by what is known of the control."""
    import postprocessors as posts

    assert cell.controller is not None
    with blamed_on(cell.folder / "tango.yaml"):
        return posts.settings(post, cell.controller.options).get("feed_override") == "acts"


def counts(post: Post) -> bool:
    """post → whether its programs count touches in a row without contact, and end after as many as the profile says."""
    return any(option.name == "misses" for option in post.options)


def misses_of(cell: Cell, post: Post) -> int:
    """cell, its post → touches in a row without contact after which its programs stop, by its profile."""
    import postprocessors as posts

    assert cell.controller is not None
    with blamed_on(cell.folder / "tango.yaml"):
        return int(posts.settings(post, cell.controller.options).get("misses", MISSES))


def ask(
    part: Plan, address: str, feed: float | None, unproven: list[str], which: str, dialled: bool = False, tries: str = ""
) -> None:
    """Raises click.Abort unless the person at the machine agrees, also to what nobody has proven of this control.

    `dialled`: the feed override acts on measuring moves. `tries`: which commands try what is not proven.
    """
    from ..duration import duration, proof, spoken

    for text in unproven:
        click.echo(f"not proven on this control: {text}", err=True)
    if tries:
        click.echo(whole(tries), err=True)
    if dialled:
        click.echo("The feed override acts on measuring moves (feed_override: acts): turn it to 100 %, leave it there.", err=True)
    time = spoken(sum(duration(part, feed).values()) + proof(part, which, feed))
    click.echo(
        f"{part.machine.name} on {address} will make {len(part.touches)} touches in about {time}. "
        f"{in_spindle(part)} in the spindle, switched on, clear of the table; hand on feed hold.",
        err=True,
    )
    click.confirm("Start?", default=False, abort=True, err=True)
