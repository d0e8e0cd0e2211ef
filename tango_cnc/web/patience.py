"""A connection that says nothing, or says it too slowly, is closed: a few hundred of them would take every place of the server."""

from __future__ import annotations

import asyncio
from collections import Counter
from typing import Any, ClassVar

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

OF_ONE = 250  # connections of one address, half of those that the server takes: the others stay for everybody else
WAIT = 15.0  # s from the first byte that is awaited to the end of a request, which has at most 16 kB


class Patient(H11Protocol):
    """uvicorn's HTTP/1.1 with an end to waiting: neither a half head nor a half body holds a connection for longer than WAIT, and
    no address has all connections. Behind a proxy all of them are of the proxy, which limits its own clients.
    """

    held: ClassVar[Counter[str]] = Counter()  # connections by address

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """transport → the clock of its first request runs; or it is closed, where its address has too many."""
        super().connection_made(transport)
        self._clock: Any = self.loop.call_later(WAIT, self._late)
        self._address = str(self.client[0]) if self.client else ""
        self.held[self._address] += 1
        if self.held[self._address] > OF_ONE and not self.config.proxy_headers:
            transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """What ended it → its clock stops."""
        self._clock.cancel()
        self.held[self._address] -= 1
        if not self.held[self._address]:
            del self.held[self._address]
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """An answer has gone → the clock of the next request runs."""
        super().on_response_complete()
        self._clock.cancel()
        self._clock = self.loop.call_later(WAIT, self._late)

    def _late(self) -> None:
        if self.conn.their_state in (h11.IDLE, h11.SEND_BODY):
            self.transport.close()
        else:  # the server is at work; what it takes is no fault of the browser
            self._clock = self.loop.call_later(WAIT, self._late)
