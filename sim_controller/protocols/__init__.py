"""How a control talks on its line: one file a protocol, named after it; `_name` is a helper.

A protocol file ends with its record `TALK`. Its `serve(line, session, once)` talks over `line` until the other side hangs up, or
until one program has ended when `once` is set. `session` (`sim_controller.session.Session`) makes the control that executes what
arrives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..lines import Line
from ..session import Session


@dataclass(frozen=True)
class Talk:
    """A protocol: how it talks, and the URL of its port for the other side, with {} for host and port or the device.

    `stored`: the program comes to the control by other ways. `session.resident` is then the program of `--start`, or each that a
    command of tango waits for.
    """

    serve: Callable[[Line, Session, bool], None]
    tcp: str = "socket://{}"
    pty: str = "{}"
    stored: bool = False
