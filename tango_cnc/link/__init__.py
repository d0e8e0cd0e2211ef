"""Plan and program → readings: the only part that talks to a controller.

    transport (bytes) ↔ client of a protocol (events) → trust (readings) → journal (disk), turned by session

A protocol is a file of this folder with `Client` and `OPTIONS`; `_client` says what that is.
"""

from __future__ import annotations

import pkgutil

NO_PROTOCOL = ("transport", "session", "journal", "entries", "lock")


def protocols() -> list[str]:
    """→ names of the protocols: the files of this folder that are neither helpers nor the frame around the clients."""
    return [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_") and m.name not in NO_PROTOCOL]
