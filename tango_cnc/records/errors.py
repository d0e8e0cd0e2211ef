"""What ends a command, and with which exit status."""

from __future__ import annotations


class TangoError(Exception):
    """Something the person at the machine has to know; `exit_code` is what the command line returns."""

    exit_code = 1


class InputError(TangoError):
    """A file or an option is wrong: nothing was written, nothing was moved."""

    exit_code = 2


class LinkError(TangoError):
    """The controller or the line to it failed; what was measured so far is on disk."""

    exit_code = 3


class NothingSentError(LinkError):
    """A run could not begin on this computer: the control was sent nothing, and nothing moves."""
