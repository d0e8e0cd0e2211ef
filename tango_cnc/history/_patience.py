"""Connections to PostgreSQL that wait for no server for ever: one that takes the connection and is silent is off.

The time-out of a connection is over once it is made, a time-out of a statement is the server's own to keep, and the kernel of a
computer whose database is stopped still acknowledges every packet. So who asks counts the seconds.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from functools import cache
from typing import Any

from sqlalchemy import Engine, event

CANCELLED = "57014"  # SQLSTATE of a statement that the server itself gave up


def patient(engine: Engine, seconds: float, cancels: bool) -> None:
    """engine of PostgreSQL, s for which its server may be silent, whether the server gives up a statement of that time by itself →
    nothing; its connections are closed then, with OperationalError.

    What waits for a lock goes on in the server when nobody listens any more: where many ask again and again it has to give up, too.
    """

    def connected(_: Any, __: Any, given: Any, options: Any) -> Any:
        made = _kind().connect(*given, **options)
        made.patience = seconds + (1.0 if cancels else 0.0)  # the server says it first, and the connection is kept
        return made

    def limited(connection: Any, _: Any) -> None:
        connection.autocommit = True  # else it is gone with the first transaction
        connection.execute(f"SET statement_timeout = {round(1000 * seconds)}")
        connection.autocommit = False

    event.listen(engine, "do_connect", connected)
    if cancels:
        event.listen(engine, "connect", limited)


def gave_up(error: Any) -> bool:
    """what the driver has raised → whether the server was silent for too long, or gave up: to ask once more takes as long again."""
    return getattr(error, "sqlstate", None) == CANCELLED or bool(getattr(error, "silent", False))


@cache
def _kind() -> Any:
    """→ class of the connections; the driver is there with the extra `postgres` alone."""
    import psycopg

    class SilentServerError(psycopg.OperationalError):
        """A server that took the connection does not answer."""

        silent = True

    class PatientConnection(psycopg.Connection[Any]):
        """A connection whose server may be silent for `patience` seconds."""

        patience = 0.0  # s; 0: as long as it likes

        def wait(self, gen: Any, *args: Any, **more: Any) -> Any:
            """what goes on over the connection → its result. Raises SilentServerError."""
            return super().wait(self._until(gen) if self.patience else gen, *args, **more)

        def _until(self, gen: Any) -> Generator[Any, Any, Any]:
            heard = time.monotonic()
            try:
                wanted = next(gen)
                while True:
                    ready = yield wanted
                    if ready:
                        heard = time.monotonic()
                    elif time.monotonic() - heard > self.patience:
                        self.pgconn.finish()
                        raise SilentServerError(f"the server has not answered for {self.patience:.0f} s")
                    wanted = gen.send(ready)
            except StopIteration as end:
                return end.value

    return PatientConnection
