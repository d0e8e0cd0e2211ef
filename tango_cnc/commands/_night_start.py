"""Who starts the program of a night: its link, the control by itself, or a person, who is not there when a timer begins it."""

from __future__ import annotations

from ..link import protocols
from ..link.measure import protocol_of
from ..nightly import PreflightPoint
from ..records import Cell
from ..texts import say
from ._common import dialect


def starts(cell: Cell, address: str, within: float) -> PreflightPoint | None:
    """cell, port of its control, s in which the control starts the program by itself (0: it does not) → why no timer can begin its
    nights, or that nightly.yaml states who does; None where the link begins their programs.
    """
    post = dialect(cell)
    protocol, parsed = protocol_of(address, post.link)
    if protocol.Client.begins(parsed.options):
        return None
    if within:
        return PreflightPoint("start", True, say("preflight.world.control_starts", seconds=f"{within:g}"))
    begin = [name for name in post.links if protocols.load(name).Client.begins({})]
    links = say("preflight.world.links_that_begin", names=", ".join(begin)) if begin else ""
    found = say("preflight.world.nobody_starts", address=parsed.url)
    return PreflightPoint("start", False, found, say("preflight.world.nobody_starts_do", links=links))
