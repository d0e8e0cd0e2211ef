"""A run that another program makes, as its journal grows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..records import InputError
from .entries import End, ProgramSent, Reading, RefusedRecord
from .journal import read_journal
from .session import News, news_of


def follow(file: Path, watch: Callable[[News], None], pause: Callable[[], None]) -> bool:
    """journal of a run that another program makes → whether it came to its end; every reading goes to `watch` as it is written.

    Raises InputError when there is no run.
    """
    if not file.exists():
        raise InputError(f"{file}: no such file; there is no run to follow")
    shown = done = total = 0
    ended: bool | None = None
    part: tuple[int, ...] = (1, 1)
    while ended is None:
        entries, _ = read_journal(file)
        for entry in entries[shown:]:
            if isinstance(entry, ProgramSent):
                total, ended, part = max(total, done + len(entry.touches)), None, entry.part
            elif isinstance(entry, Reading):
                done += 1
                watch(news_of(entry, done, total))
            elif isinstance(entry, RefusedRecord):
                watch(News(done, total, entry.time_s, None, f"not believed: {entry.record!r}: {entry.why}"))
            elif isinstance(entry, End):
                more = entry.complete and part[0] < part[1]
                ended = None if more else entry.complete
                what = f"part {part[0]} of {part[1]}" if part[1] > 1 else "the run"
                watch(News(done, total, 0.0, None, f"{what} has ended: {entry.why}"))
        shown = len(entries)
        if ended is None:
            pause()
    return ended
