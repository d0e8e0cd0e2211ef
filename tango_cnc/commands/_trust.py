"""What every command that shows numbers has in common: the words of a judgement, its JSON and its exit status."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from ..judgement import Judgement, Suspicion
from ..judging import suspected
from ..records import TangoError
from ._handed import printed

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

despite_option: Decorator = click.option(
    "--despite",
    is_flag=True,
    help="Go on with a result that is implausible or incomplete, or of which no parameter is trusted: "
    "the exit status is then that of the rest.",
)


def usable(judgement: Judgement, despite: bool, what: str) -> None:
    """judgement, --despite, what would be made of the estimate → nothing. Raises TangoError when it may not be used."""
    lines = "\n".join(told(judgement))
    if status(judgement, despite):
        raise TangoError(f"{what}: the estimate is {_why(judgement)} and is not used (--despite uses it all the same)\n{lines}")
    if lines:
        printed(lines, err=True)


def status(judgement: Judgement, despite: bool) -> int:
    """judgement, --despite → exit status."""
    return int((judgement.verdict == "implausible" or judgement.incomplete or judgement.nothing) and not despite)


def told(judgement: Judgement) -> list[str]:
    """judgement → lines for people; none but remarks where the result is trustworthy."""
    lines = []
    if judgement.verdict != "trustworthy":
        lines.append(_head(judgement))
        lines += [f"  {text}" for text in judgement.reasons]
        lines += suspected(judgement)
    if judgement.untrusted and judgement.verdict != "implausible":  # the first line says it of all of them
        lines.append(f"not to be trusted: {', '.join(judgement.untrusted)}")
    return lines + [f"note: {text}" for text in judgement.remarks]


def _why(judgement: Judgement) -> str:
    if judgement.verdict == "implausible":
        return "implausible"
    return "incomplete" if judgement.incomplete else "doubtful, no parameter of it is trusted,"


def _head(judgement: Judgement) -> str:
    if judgement.verdict == "implausible":
        return "IMPLAUSIBLE: do not act on these numbers"
    if judgement.incomplete:
        return "INCOMPLETE: too little was measured to act on these numbers; --despite takes what there is"
    if judgement.nothing:
        return "DOUBTFUL: no parameter is trusted, do not act on these numbers"
    return "DOUBTFUL: look at this before you act on the numbers"


def members(judgement: Judgement) -> dict[str, Any]:
    """judgement → the members that every JSON result of an estimate carries."""
    return {
        "verdict": judgement.verdict,
        "reasons": list(judgement.reasons),
        "remarks": list(judgement.remarks),
        "suspicions": [_suspicion(s) for s in judgement.suspicions],
        "untrusted": list(judgement.untrusted),
        "incomplete": judgement.incomplete,
        "nothing_trusted": judgement.nothing,
    }


def _suspicion(s: Suspicion) -> dict[str, Any]:
    return {
        "kind": s.kind,
        "text": s.text,
        "file": s.file,
        "line": s.line,
        "key": s.key,
        "change": s.change,
        "touches": list(s.touches),
        "evidence": {"rms_before_um": s.before * 1e3, "rms_after_um": s.after * 1e3, "fits": s.fits, "odds": s.odds},
        "equally": list(s.equally),
    }
