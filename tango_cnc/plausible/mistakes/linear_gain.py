"""A linear axis goes further than its readings say, in proportion: a compensation, a scaling or a pitch of another screw."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...texts import say
from ._case import Case, Hypothesis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each linear axis with any gain near 1 that no tolerance allows."""
    for name in case.machine.linear:
        own = f"E{name}{name}1"
        yield Hypothesis("", "readings", name, "", free=[own], words=partial(_words, name), price=1.5,
                         least={own: case.machine.tolerances.scale})  # fmt: skip


def _words(name: str, values: Mapping[str, float]) -> tuple[str, str]:
    gain = values[f"E{name}{name}1"]
    return (
        say("mistake.linear_gain.gain", name=name, ratio=f"{1 + gain:.5f}"),
        say("mistake.linear_gain.see", name=name),
    )
