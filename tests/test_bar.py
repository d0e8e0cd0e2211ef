"""The bar of a run at a terminal: it counts touches, and no question stands in its line."""

from __future__ import annotations

import io
import sys

import click
import pytest

from tango_cnc.commands._live import Live
from tango_cnc.link.session import News


class Terminal(io.StringIO):
    """Takes what is written; a person sits before it."""

    def isatty(self) -> bool:
        return True


def test_a_remark_before_the_first_touch_draws_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """The question whether to start comes next: it stood behind '[....] 0/9'."""
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with Live(None) as live:
        live(News(0, 9, 0.0, None, "the control has to have TANGO.MPF now: it is not sent"))
        click.echo("Start? [y/N]", err=True)
        asked = screen.getvalue()
        live(News(1, 9, 1.0, None, "", touch=1, facet="3", status="ok"))
    assert asked == "the control has to have TANGO.MPF now: it is not sent\nStart? [y/N]\n"
    assert "1/9" in screen.getvalue()
