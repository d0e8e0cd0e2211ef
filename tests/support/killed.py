"""What several tests share of link kills."""

from __future__ import annotations

import contextlib
import os
import signal
import sys

import pytest

from sim_controller import __main__ as sim_controller
from support.linkfaults import moves_remembered
from tango_cnc.link import journal, transport  # noqa: F401  imported here, they need not be in every child
from tango_cnc.link.protocols import dnc, grbl, modbus  # noqa: F401


def process(work, out=os.devnull):
    """what to do, where its output goes → number of a process that does it, without the seconds that starting Python takes."""
    number = os.fork()
    if number:
        return number
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(out if stream == 1 and isinstance(out, int) else nothing, stream)
    sys.stdin, sys.stdout, sys.stderr = os.fdopen(0, "r"), os.fdopen(1, "w"), os.fdopen(2, "w")  # pytest's are others
    status = 1  # where it ends in an error too: what has been forked must not go on with the tests
    try:
        status = work()
    finally:
        os._exit(status)


@contextlib.contextmanager
def controller(folder, *options):
    """A simulated control in a process of its own → its address. What it meets on a move that was made before, it remembers."""

    def work():
        moves_remembered(pytest.MonkeyPatch())
        return sim_controller.run(["--cell", str(folder), *options])

    read, write = os.pipe()
    number = process(work, write)
    os.close(write)
    try:
        with os.fdopen(read) as out:
            yield out.readline().strip()
    finally:
        os.kill(number, signal.SIGKILL)
        os.waitpid(number, 0)
