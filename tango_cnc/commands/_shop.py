"""What the terminal says, in the language of the shop: texts of nightly.yaml, and what the nights of a list said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..files.nightly import Nightly, read_nightly
from ..report.repeated import as_decided, as_found, on_another_day
from ..report.texts import Texts, texts_of
from ..report.tonight import sized

if TYPE_CHECKING:
    from ..history import History, Night

LOOKED = 7  # nights
ENDED = {"unsent": "ended_before", "waiting": "ended_waits"}  # how a night ended that has the mark of one at work: its text


def of_shop(settings: Nightly) -> Texts:
    """settings of the nights → texts of the folder that they name, else English. Raises InputError for texts with a mistake."""
    return texts_of(settings.templates)


def here() -> Texts:
    """the command that runs, with -C → texts of its cell. Raises InputError."""
    folder = click.get_current_context().params.get("folder")
    return of_shop(read_nightly(folder) if isinstance(folder, Path) else Nightly())


def headlines(history: History, nights: Sequence[Night], by_now: bool = True) -> Mapping[int, str]:
    """history, nights of one machine, whether an alarm of another night has the size of the night that names it, and the date of
    the night that found it → {entry: what the night said, with what was decided since}, as texts that can be translated where they
    were recorded so.
    """
    from ..history.answers import every_decision  # databases are slow to load

    records = history.records_of([n.entry for n in nights])
    decisions = every_decision(history, nights[0].machine) if nights else ()
    said = {n.entry: as_decided(records.get(n.entry, {}), decisions) or n.headline for n in nights}
    if not by_now:
        return said
    whole = {entry: records.get(entry, {}) for entry in said}
    return {entry: sized(on_another_day(as_found(text, whole[entry]), whole[entry]), whole[entry]) for entry, text in said.items()}


def note_simulated(history: History, machine: str, t: Texts) -> None:
    """history, its machine, texts → a line on stderr where its newest nights measured no machine."""
    nights = history.nights(machine, last=LOOKED) if machine in history.machines() else ()
    if any(r.get("simulated") for r in history.records_of([n.entry for n in nights]).values()):
        click.echo(f"{machine}: {t('audit.simulated')}", err=True)


def looked_at(place: str | Path) -> str | Path:
    """history → itself, or an empty one in memory where the file is missing, so that a mere look creates no file."""
    return "sqlite://" if isinstance(place, Path) and not place.exists() else place
