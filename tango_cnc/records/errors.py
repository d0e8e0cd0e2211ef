"""What ends a command, and with which exit status."""

from __future__ import annotations


class TangoError(Exception):
    """Something the person at the machine has to know; `exit_code` is what the command line returns."""

    exit_code = 1


class InputError(TangoError):
    """A file or an option is wrong: nothing was written, nothing was moved."""

    exit_code = 2


class LacksSettingError(InputError):
    """A port's URL lacks the `setting`, name=value, that a plan needs: nothing was written, nothing was moved."""

    def __init__(self, text: str, setting: str = "") -> None:
        super().__init__(text)
        self.setting = setting


class LinkError(TangoError):
    """The controller or the line to it failed; what was measured so far is on disk."""

    exit_code = 3


class NothingSentError(LinkError):
    """A run could not begin on this computer: the control was sent nothing, and nothing moves."""
