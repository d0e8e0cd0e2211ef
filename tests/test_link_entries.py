"""What an entry of a journal may say: every value at the limit of what a run writes, and right beyond it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from tango_cnc.link.entries import KINDS, entry_of, plain

UTC = "2026-05-01T06:00:00.000+00:00"
GOOD: Mapping[str, Mapping[str, Any]] = {
    "journal": {"format": "tango-journal/1"},
    "segment": {
        "utc": UTC,
        "tool_version": "1",
        "machine": "m",
        "controller": {"post": "grbl", "port": "/dev/ttyACM0"},
        "plan_hash": "A",
        "program_hash": "B",
        "touches": [1, 2],
        "part": [1, 1],
        "how": "--resume",
    },
    "identity": {"text": "Grbl"},
    "begun": {"utc": UTC, "time_s": 0.0, "boot": None, "clock_s": 12.5},
    "reading": {
        "touch": 1,
        "facet": "1",
        "position": [1.0, 2.0],
        "time_s": 0.0,
        "status": "ok",
        "deviation_um": None,
        "drift_um": 1.5,
        "direction": [-1, 0],
        "record": "P1",
        "temperatures": {"bed": 20.5, "room": None},
    },
    "again": {"touch": 1, "status": "ok", "moved_mm": None, "time_s": 0.0},
    "refused": {"why": "it is not the next touch", "record": "P9", "time_s": 0.0},
    "end": {"complete": True, "why": "", "utc": UTC, "stands": True},
}
LIMITS = [  # kind, member, values that a run may write, values that none writes, words of the refusal
    ("segment", "utc", [UTC, "2026-05-01T06:00:00+00:00"], ["2026-05-01", "", UTC + "x", UTC.replace("+00", "+02")], "utc: found"),
    ("begun", "utc", [UTC], ["2026-05-01 06:00:00.000+00:00"], "utc: found"),
    ("end", "utc", [UTC], ["noon"], "utc: found"),
    ("segment", "part", [[1, 1], [1, 2], [2, 2]], [[], [1], [0, 1], [2, 1], [1, 2, 3], [-1, 2]], "part: found"),
    ("segment", "how", ["--resume", "--resume --split 300"], ["", "--split 3", "--resume\n", " --resume"], "how: found"),
    ("segment", "controller", [{"post": "x", "port": "y", "simulated": "yes"}], [{}, {"post": "x"}, {"port": "y"}], "controller:"),
    ("reading", "touch", [1, 2], [0, -1], "touch: found"),
    ("again", "touch", [1, 2], [0, -1], "touch: found"),
    ("reading", "status", ["ok", "miss", "early"], ["", "OK", "late"], "status: found"),
    ("reading", "direction", [[0, 1], [-1, -1]], [[0], [0, 1, 0], [0, 2], [-2, 0]], "direction: found"),
    *((kind, "time_s", [0.0, 0.001, 1e6], [-0.001, -1], "time_s: found") for kind in ("begun", "reading", "again", "refused")),
    *((kind, "time_s", [0], [True, "0", None, float("inf")], "a finite number") for kind in ("begun", "reading")),
    ("segment", "touches", [[], [1]], [1, "1", [1.5], [True]], "touches: found"),
    ("reading", "temperatures", [None, {}, {"bed": None}], [[], {"bed": "20"}], "temperatures: found"),
    ("end", "complete", [True, False], [1, "yes", None], "true or false"),
    ("identity", "text", ["", "é"], [1, None], "a text"),
]


def test_every_kind_is_read_as_it_is_written() -> None:
    assert set(GOOD) == set(KINDS)
    for kind, members in GOOD.items():
        entry = entry_of({"kind": kind, **members, "of a later version": 1})
        assert entry_of(plain(entry) | {name: members[name] for name in members}) == entry


@pytest.mark.parametrize(("kind", "member", "good", "bad", "words"), LIMITS)
def test_a_value_that_no_run_writes_is_refused_and_one_at_the_limit_is_not(
    kind: str, member: str, good: list[Any], bad: list[Any], words: str
) -> None:
    for value in good:
        entry_of({"kind": kind, **GOOD[kind], member: value})
    for value in bad:
        with pytest.raises(ValueError, match=words):
            entry_of({"kind": kind, **GOOD[kind], member: value})


def test_a_member_that_is_missing_is_named_and_one_with_a_default_is_not_missed() -> None:
    for kind, members in GOOD.items():
        for name in members:
            given = {"kind": kind, **{other: value for other, value in members.items() if other != name}}
            default = name in ("part", "how", "boot", "clock_s", "temperatures", "stands")
            if default:
                entry_of(given)
            else:
                with pytest.raises(ValueError, match=f"{kind}: {name} is missing"):
                    entry_of(given)
    with pytest.raises(ValueError, match="kind: found 'else'; allowed: journal, segment"):
        entry_of({"kind": "else"})
