"""Who says `repaired` late, of what had gone back and moved again since, has repaired what went back, and not what came after."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.answers import answered, decide
from support.nights import night
from support.nights_parts import Event, Story

from tango_cnc.history import Decision, History, Knowledge, opened
from tango_cnc.nightly import answered as judged
from tango_cnc.nightly.answered import after_repairs
from tango_cnc.nightly.mail import message

M = "M"
KNOWN = Knowledge(("EY0C",), np.zeros(1), np.eye(1))


def alarm(number: int, um: float, **more: Any) -> dict[str, Any]:
    """number of the night, µm that the C axis has moved that night along Y → its alarm."""
    since, dated = (night(M, i)["night"] for i in (number - 1, number))
    told = {"id": f"{dated}-1", "cause": "axis_location", "parameter": "EY0C", "since": since, "unit": "mm", "size": um / 1e3}
    return {**told, "std": 0.0003, "text": f"moved by {um}", "rate_per_day": None, "instead": [], "do": "Ask."} | more


@pytest.mark.parametrize("end", ["knock", "way back"])
@pytest.mark.parametrize(("again", "third", "judges"), [(True, "", False), (True, "repaired", True), (False, "", True)])
def test_a_repair_is_not_held_against_what_came_after_its_way_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str, again: bool, third: str, judges: bool
) -> None:
    knock = alarm(2, 20.0)
    back = alarm(4, -19.9, undoes={"alarm": knock["id"], "left": 0.0001, "std": 0.0003})
    alarms = {2: [knock], 4: [back]} | ({6: [alarm(6, 20.5)]} if again else {})
    asked: list[str] = []
    monkeypatch.setattr(judged, "moved", lambda *args: asked.append(str(args[-1]["id"])))
    with opened(tmp_path / "h.db") as history:
        for i in range(7):
            found = alarms.get(i, [])
            history.add_night(night(M, i, "changed" if found else "good", alarms=found), None, KNOWN)
        utc = night(M, 6)["end_utc"].replace("T02", "T09")
        history.decide(M, Decision(knock["id"] if end == "knock" else back["id"], "repaired", "Dora", "", None, utc))
        if third:
            history.decide(M, Decision(alarms[6][0]["id"], third, "Emil", "", None, utc))
        other = alarm(7, 9.0, parameter="EX0C")
        (told,), helped = after_repairs(history, M, None, None, [other])  # type: ignore[arg-type]
    assert (knock["id"] in asked) == judges and not helped
    assert ("Dora" in str(told["text"]) or "Emil" in str(told["text"])) == judges  # else it is no alarm after a repair


@pytest.mark.long
def test_a_repair_that_was_said_late_is_not_blamed_for_the_next_knock(root: Path, tmp_path: Path) -> None:
    """+20, −20, +20 µm, and on the morning after the third the first is said to be repaired: one open alarm, and no blame."""

    def late(history: History, record: dict[str, Any]) -> None:
        decide(history, record, str(history.alarmed("trunnion")[2].record["alarms"][0]["id"]), "repaired")

    story = Story((Event(8, {"EY0C": 0.020}), Event(9, {"EY0C": -0.020}), Event(10, {"EY0C": 0.020})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 11, {10: late})
    (third,) = records[9]["alarms"]
    assert not records[10]["alarms"] and [a["id"] for a in records[10]["standing"]] == [third["id"]]
    assert "has not helped" not in message(records[10], (), ())[1] and "has not helped" not in records[10]["headline"]
