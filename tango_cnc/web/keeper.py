"""Of many machines the list is computed before somebody asks: at the start, and about once a minute what is new since."""

from __future__ import annotations

import gc
import logging
import threading
from collections.abc import Callable
from datetime import datetime, timedelta

from .places import Places, today

MANY = 20  # machines from which that is done; fewer are read while the first page waits
EVERY = 60.0  # s between two looks
LOG = logging.getLogger("tango.serve")


class Keeper:
    """A thread that looks at all machines as a page does, so that a page finds nearly all of them looked at.

    It asks again what would become too old before its next look, and puts what it has read out of the way of the search for cycles.
    """

    def __init__(self, places: Places, look: Callable[[], object]) -> None:
        self.places, self._look = places, look
        self._first, self._over = threading.Event(), threading.Event()
        self.count = 0
        self._first.set()

    def begin(self) -> None:
        """Starts it, where there are many machines. Until the first look is over `reading` says so."""
        self.count = self.places.expected()
        if self.count >= MANY:
            self._first.clear()
            threading.Thread(target=self._keep, name="tango keeper", daemon=True).start()

    def end(self) -> None:
        """No further look begins; what was put out of the way of the search for cycles is searched again."""
        self._over.set()
        if self.count >= MANY:
            gc.unfreeze()

    def reading(self) -> bool:
        """→ whether the first look at all machines still goes on."""
        return not self._first.is_set()

    def _keep(self) -> None:
        day = ""
        while not self._over.is_set():
            try:
                with self.places.early(2 * EVERY):  # what would be too old before the next look is over, no page has to ask
                    self._look()
            except Exception as error:  # the page itself says what is wrong, and the next look may succeed
                if not self._over.is_set():  # else the histories were closed under it
                    LOG.warning("%s", error)
            day, before = today(), day
            if not self._over.is_set():
                _put_aside(anew=day != before)
            self._first.set()
            self._over.wait(min(EVERY, _to_midnight()))


def _put_aside(anew: bool) -> None:
    """Whether a day has begun → what is in memory is out of the way of Python, which now and then stops all threads and walks over
    every object that may be part of a cycle: with 200 machines a page waited 0.3 s and longer for that.

    Cycles of what came since the last look are found here; those of what was put aside before, once a day, while nobody reads.
    """
    if anew:
        gc.unfreeze()
    gc.collect()
    gc.freeze()


def _to_midnight() -> float:
    """→ s until ages and dates are those of another day."""
    now = datetime.now().astimezone()
    then = (now + timedelta(days=1)).replace(hour=0, minute=0, second=0, microsecond=0)
    return max(1.0, (then - now).total_seconds() + 0.1)
