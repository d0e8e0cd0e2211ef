"""Many nights on the terminal: a line of characters a parameter, and a table of what the parameters follow."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import click

from ..nearest import printable
from ..report.units import shown
from ._common import on_terminal, table
from ._shop import here

if TYPE_CHECKING:
    from ..history import History, Trend
    from ..nightly.lookback import Followed
    from ..report.texts import Texts

TEMPERATURE = "temperature"  # name of an alarm, and of what the sensors said
INTERVAL = 1.96  # standard deviations of a 95 % interval


def heads(t: Texts, *names: str) -> list[str]:
    """texts, names of columns → their heads; of one without a name nothing."""
    return [t(f"cli.history.{name}") if name else "" for name in names]


def each_of(history: History, machine: str, names: Sequence[str]) -> tuple[str, ...]:
    """history, machine, names as alarms have them → names of the trends: scales is every linear scale that the nights know."""
    from ..terms import SCALES

    known = history.parameters(machine) if "scales" in names else ()
    scales = tuple(scale for scale in SCALES if scale in known) or ("scales",)
    return tuple(each for name in names for each in (scales if name == "scales" else (name,)))


def trend_of(history: History, machine: str, name: str) -> Trend:
    """history, machine, parameter or temperature → its nights. Raises InputError for one that no night knows."""
    from ..nightly.lookback import warmth

    return warmth(history, machine) if name == TEMPERATURE else history.trend(machine, name)


def broken_chains(wrong: Mapping[str, Sequence[str]], t: Texts) -> int:
    """{machine: what is wrong with its chain}, texts → exit status; each is named on stderr."""
    for name, texts in wrong.items():
        key = "broken" if name else "broken_nobody"
        more = t("cli.history.broken_more", count=len(texts) - 1) if len(texts) > 1 else ""
        click.echo(t(f"cli.history.{key}", machine=name, first=printable(t.of(texts[0]), 400), more=more), err=True)
    return 1 if wrong else 0


def lines(trends: Sequence[Trend], alarmed: Collection[str]) -> str:
    """→ one line a parameter: its nights as a sparkline from lowest to highest, first and last value; alarms marked below."""
    from ..report.characters import Course, courses, told, width

    found = []
    for trend in trends:
        factor, unit = shown(trend.unit)
        half, values = INTERVAL * float(trend.std[-1]) * factor, (trend.value * factor).tolist()
        found.append(Course(trend.name, values, half, unit, [start in alarmed for start in trend.start_utc]))
    text = courses(found, width())
    return "\n".join([text, *textwrap.wrap(here()(f"cli.history.drawn_{told(found, width())}"), width())]) if text else text


def followed(found: Sequence[Followed], t: Texts) -> str:
    """what parameters follow, texts → a table; a sentence where they follow nothing."""
    if not found:
        return t("cli.history.wander")
    rows = [heads(t, "parameter", "follows", "by", "by_chance", "as_well")]
    for f in found:
        cause = t(f"cause_name.{f.cause}") if f"cause_name.{f.cause}" in t else f.cause
        rows.append([f.parameter, cause, _by(f, t), f"{f.p_value:.1g}", ", ".join(f.instead)])
    return table(rows, "<<<<<", on_terminal())


def _by(f: Followed, t: Texts) -> str:
    """what a parameter follows, texts → by how much, and since when where it is a part of the nights."""
    factor, unit = shown(f.unit)
    size = f"{f.size * factor:+.3g} ± {f.std * factor:.1g} {unit}"
    if f.cause == "season":
        return t("cli.history.season", size=size.lstrip("+"), date=f.since)
    if f.cause != "drift":
        return t(f"cli.history.{f.cause}", size=size, **({"date": f.since} if f.since else {}))
    if not f.since:
        return t("cli.history.drift", size=size)
    return (
        t("cli.history.drift_until", size=size, date=f.since, until=f.until)
        if f.until
        else t("cli.history.drift_since", size=size, date=f.since)
    )
