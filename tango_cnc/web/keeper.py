"""Of many machines the list is computed before somebody asks: at the start, and about once a minute what is new since."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from datetime import datetime, timedelta

from .places import Places

MANY = 20  # machines from which that is done; fewer are read while the first page waits
EVERY = 60.0  # s between two looks
LOG = logging.getLogger("tango.serve")


class Keeper:
    """A thread that looks at all machines as a page does, so that a page finds nearly all of them looked at."""

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
        """No further look begins."""
        self._over.set()

    def reading(self) -> bool:
        """→ whether the first look at all machines still goes on."""
        return not self._first.is_set()

    def _keep(self) -> None:
        while not self._over.is_set():
            try:
                self._look()
            except Exception as error:  # the page itself says what is wrong, and the next look may succeed
                if not self._over.is_set():  # else the histories were closed under it
                    LOG.warning("%s", error)
            self._first.set()
            self._over.wait(min(EVERY, _to_midnight()))


def _to_midnight() -> float:
    """→ s until ages and dates are those of another day."""
    now = datetime.now().astimezone()
    then = (now + timedelta(days=1)).replace(hour=0, minute=0, second=0, microsecond=0)
    return max(1.0, (then - now).total_seconds() + 0.1)
