"""How far something has come, on stderr: one line that click draws anew on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import os
import sys
import threading
import time
from contextlib import suppress
from typing import Any

import click

TICK = 1.0  # s between two drawings of a stage that goes on
PARTS = 10  # lines of a whole where there is no terminal


def said(text: str, err: bool = True, nl: bool = True) -> bool:
    """text → on the screen, where there is one: a window that was closed ends no run. → whether it got there."""
    try:
        click.echo(text, err=err, nl=nl)
    except (OSError, ValueError):  # ValueError: the stream is closed
        _to_nowhere(2 if err else 1)
        return False
    return True


def _to_nowhere(handle: int) -> None:
    """What is still to be written to a broken stream, at the end of the program too, goes nowhere."""
    with suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, handle)
        os.close(nowhere)


class Progress:
    """Counts and stages → one line of stderr, drawn by click; where that is no terminal, the same line every ten percent."""

    def __init__(self) -> None:
        self._terminal = sys.stderr is not None and sys.stderr.isatty()
        self._bar: Any = None
        self._shown = -1
        self._began = time.monotonic()
        self._doing, self._drawing, self._over = "", threading.RLock(), threading.Event()
        self._clock: threading.Thread | None = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def count(self, done: int, total: int, text: str = "") -> None:
        """how many of how many, what there is to say beside it → shown, with the time that is left."""
        self._stop()
        if self._bar is None or self._bar.length != total or done < self._bar.pos:  # the next part of a run has begun
            self._begin(total, show_pos=True, width=24, fill_char="#", empty_char=".", bar_template="[%(bar)s] %(info)s")
        self._draw(done - self._bar.pos, text)
        part = PARTS * done // max(total, 1)
        if not self._terminal and part != self._shown:
            self._shown = part
            said(self._bar.format_progress_line())

    def stage(self, text: str) -> None:
        """what is being done → shown on a terminal, with the seconds since the beginning; how long it will take is unknown."""
        with self._drawing:
            self._doing = text
            if self._bar is None:
                self._begin(None, width=0, show_eta=False, show_percent=False, bar_template="%(info)s")
            self._draw(0, f"{time.monotonic() - self._began:.0f} s: {text} …")
        if self._terminal and self._clock is None:
            self._over.clear()
            self._clock = threading.Thread(target=self._goes_on, daemon=True)
            self._clock.start()

    def _goes_on(self) -> None:
        """Draws the seconds anew while a stage takes long: who waits sees that it has not stopped."""
        while not self._over.wait(TICK):
            with self._drawing:
                if self._bar is not None and not self._over.is_set():
                    self._draw(0, f"{time.monotonic() - self._began:.0f} s: {self._doing} …")

    def close(self) -> None:
        """Ends the line that is drawn anew."""
        self._stop()
        if self._bar is not None and self._terminal:
            with suppress(OSError, ValueError):
                self._bar.render_finish()
        self._bar = None

    def _stop(self) -> None:
        """Draws no seconds any more."""
        self._over.set()
        if self._clock is not None:
            self._clock.join()
            self._clock = None

    def _begin(self, total: int | None, **look: Any) -> None:
        self.close()
        self._bar = click.progressbar(
            length=total,
            iterable=None if total is not None else (),
            item_show_func=_same,
            update_min_steps=0,
            hidden=not self._terminal,
            file=sys.stderr,
            **look,
        )

    def _draw(self, steps: int, text: str) -> None:
        try:
            self._bar.update(steps, text)
        except (OSError, ValueError):
            _to_nowhere(2)


def _same(text: str | None) -> str | None:
    return text or None
