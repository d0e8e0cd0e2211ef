"""A command of `tango` as a test gives it, and what comes back: a result, or exit status and texts."""

from __future__ import annotations

import pytest
from click.testing import CliRunner, Result

from tango_cnc.cli import guarded, tango


def run(*arguments: object) -> Result:
    """words of a command → its result; an error of the program is in it."""
    return CliRunner().invoke(tango, [str(a) for a in arguments])


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """words of a command → exit status as a shell has it, output, errors."""
    code = guarded(tango.main, [str(a) for a in arguments], standalone_mode=False)
    out, err = capsys.readouterr()
    return code, out, err


def said(*words: str) -> tuple[str, int]:
    """command → what it prints on one line, exit status."""
    done = CliRunner().invoke(tango, words, catch_exceptions=False, standalone_mode=False)
    return " ".join(done.output.split()), int(done.return_value or 0)
