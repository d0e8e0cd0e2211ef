"""A change that has gone back is over: what moves after it is another event, with a night of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from support.answers import answered, decide, open_and_decided
from support.nights import night
from support.nights_parts import Event, Story

from tango_cnc.history import Decision, History, opened
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.standing import standing
from tango_cnc.nightly.words import headline
from tango_cnc.report.faults import earlier, faults
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import say


@pytest.mark.long
@pytest.mark.parametrize("back", ["accept", None])
def test_what_moves_after_a_change_has_gone_back_is_dated_by_itself(root: Path, tmp_path: Path, back: str | None) -> None:
    """Whoever asks who was at the machine must ask about the night of the knock, not of another one that had gone again."""
    story = Story((Event(8, {"EY0C": 0.020}), Event(9, {"EY0C": -0.020}), Event(12, {"EY0C": -0.030})), wander=0.5)
    decisions = {8: "acknowledge"} | ({9: back} if back else {})
    records = answered(root, tmp_path / "h.db", story, 13, decisions)
    (knock,) = records[11]["alarms"]
    found, last = open_and_decided(tmp_path / "h.db", records[12]["night"])
    page = context(records[12], tuple(last.values()), None, texts(), waiting=earlier(found))
    told = next(a for a in (page["first"], *page["also"]) if a["id"] == knock["id"])
    assert told["begun"] == knock["since"] and "−30 µm" in told["text"].replace("-", "−") and not told["gone"]
    others = [a for a in (page["first"], *page["also"]) if a["id"] != knock["id"]]
    assert all(a["gone"] for a in others) and bool(others) == (back is None)


@pytest.mark.long
@pytest.mark.parametrize("end", [7, 8])
@pytest.mark.parametrize("action", ["repaired", "accept"])
def test_who_repaired_it_before_he_said_so_has_closed_both_alarms(root: Path, tmp_path: Path, action: str, end: int) -> None:
    """It went back in night 9, and the answer came after it, to the alarm of the knock or to that of its way back: the next nights
    are good, and name no fault.
    """

    def late(history: History, record: Mapping[str, Any]) -> None:
        decide(history, record, str(history.alarmed("trunnion")[8 - end].record["alarms"][0]["id"]), action)

    story = Story((Event(8, {"EY0C": 0.020}), Event(9, {"EY0C": -0.0185})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 12, {8: "acknowledge", 10: late})
    assert records[8]["alarms"][0]["undoes"]["alarm"] == records[7]["alarms"][0]["id"]
    for told in records[10:]:
        assert told["verdict"] == "good" and not told["alarms"] and not told.get("standing"), told["headline"]
    helped = records[10].get("repaired") or []
    assert [h["parameter"] for h in helped] == (["EY0C"] if action == "repaired" else [])
    for h in helped:
        assert h["size"] == pytest.approx(0.0015, abs=0.001) and h["since"] == records[6]["night"]
        assert "has gone back along Y by -18" in h["text"] and "not helped" not in records[10]["headline"]
    found, last = open_and_decided(tmp_path / "h.db", records[11]["night"])
    page = context(records[10], tuple(last.values()), None, texts(), waiting=earlier(found))
    assert not found and page["first"] is None and page["count"] == 0 and not page["suspect"] and page["answer"].may == "yes"


@pytest.mark.long
def test_a_fault_that_comes_back_after_its_way_back_is_no_way_back(root: Path, tmp_path: Path) -> None:
    """+20, −20, +20 µm, and nobody answers: the third is the fault once more, and asks who was at the machine."""
    story = Story((Event(8, {"EY0C": 0.020}), Event(9, {"EY0C": -0.020}), Event(10, {"EY0C": 0.020})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 11, {})
    assert records[8]["alarms"][0]["undoes"]["alarm"] == records[7]["alarms"][0]["id"]
    (again,) = records[9]["alarms"]
    assert not again.get("undoes") and "gone back" not in again["text"] and again["size"] == pytest.approx(0.020, abs=0.002)


def test_what_has_gone_back_is_apart_from_what_came_after_it_on_the_page() -> None:
    said = {"parameter": "EY0C", "cause": "axis_location", "unit": "mm", "std": 0.0005, "text": "it moved"}
    first = said | {"id": "2026-11-12-a", "size": 0.020, "since": "2026-11-11", "utc": "2026-11-12T02:00:00Z"}
    gone = said | {"id": "2026-11-15-a", "size": -0.020, "since": "2026-11-14", "utc": "2026-11-15T02:00:00Z"}
    gone |= {"undoes": {"alarm": first["id"], "left": 0.0}}
    knock = said | {"id": "2026-11-27-a", "size": -0.034, "since": "2026-11-26"}
    record = {"verdict": "changed", "alarms": [knock], "standing": [], "start_utc": "2026-11-27T02:00:00Z", "night": "2026-11-27"}
    found = faults(record, [gone, first], {}, Units(), texts())
    assert [(x["begun"], x["gone"]) for x in found] == [("2026-11-26", False), ("2026-11-11", True)]


def _told(number: int, um: float, **more: Any) -> dict[str, Any]:
    """number of the night, µm that the C axis has moved that night along Y → its alarm, as nights write them."""
    since, dated = (night("M", i)["night"] for i in (number - 1, number))
    text = say("changed.off", what="C axis", letter="Y", size=f"{um:+.1f} ± 0.3 µm", since=since, name="EY0C")
    return {
        **{"id": f"{dated}-020000-1", "cause": "axis_location", "parameter": "EY0C", "since": since, "unit": "mm", "text": text},
        **{"size": um / 1e3, "std": 0.0003, "sigmas": 60.0, "rate_per_day": None, "instead": [], "owner": "Ann", "decision": None},
        **{"on_part_um": 2 * abs(um), "on_part": f"Since {dated} a part is off.", "do": "Ask who was at the machine."},
        **more,
    }


def test_what_went_back_and_moved_again_is_neither_still_there_nor_gone_by_the_alarm_of_its_way_back(tmp_path: Path) -> None:
    """+20, −20, +20 µm: the mail had the first as "still there, confirmed", and the way back as gone again: "+1.1 µm is left"."""
    knock = _told(2, 20.0)
    back = _told(4, -19.9, undoes={"alarm": knock["id"], "night": "2026-10-26", "size_before": 0.02, "left": 0.0001, "std": 0.0003})
    again, alarms = _told(6, 20.5), {2: [knock], 4: [back]}
    height = {2: 0.020, 3: 0.020, 6: 0.0206}  # by night
    records = []
    for i in range(7):
        record = night("M", i, "changed" if i in alarms else "good", alarms=alarms.get(i, []))
        change = height.get(i, 0.0) - height.get(i - 1, 0.0)
        record["parameters"]["EY0C"] |= {"value": 0.012 + height.get(i, 0.0), "change": change, "seen": True}
        records.append(record)
    with opened(tmp_path / "h.db") as history:
        for record in records[:6]:
            history.add_night(record)
        found = {a["id"]: a for a in standing(history, "M", 20_757.2, records[6]["parameters"], "full")}
    first, way_back = found[knock["id"]], found[back["id"]]
    assert str(first["now"]).startswith("gone again: +0.1") and first["total"] == pytest.approx(0.0001) and not first["confirmed"]
    assert not way_back["now"] and way_back["total"] == way_back["size"] and not way_back["confirmed"]
    record = records[6] | {"verdict": "changed", "alarms": [again], "standing": list(found.values())}
    told = message(record, (), ())[1]
    assert "still there" not in told and told.count("the first night without it again, differ") == 2
    assert told.count("a part is off") == 1  # of what stands
    page = context(record, (), None, texts())
    assert page["first"]["id"] == again["id"] and page["also"][0]["gone"] and page["first"]["on_part_um"] == pytest.approx(41.0)
    assert "It has gone back since: 0.1 µm of 20 µm is left." in page["also"][0]["text"]
    gone = page["also"][0]["on_part"]
    assert gone.startswith("Parts that were made between Sun 25 Oct 2026, the last night without it, and Wed 28 Oct 2026, ")
    assert "between 2026-10-25, the last night without it, and 2026-10-28" in told  # the message has the same parts
    assert page["suspect"].endswith("Those between Sun 25 Oct 2026 and Wed 28 Oct 2026, when another fault went back, too.")


def test_a_third_change_that_was_repaired_leaves_no_still_changed_in_the_message(tmp_path: Path) -> None:
    """+20, −20, +20 µm, the third repaired and gone: the subject was STILL CHANGED, and the headline began with the way back,
    "still there: −18.4 µm, confirmed", beside "−0.1 µm is left" without a date.
    """
    knock = _told(2, 20.0)
    back = _told(4, -19.9, undoes={"alarm": knock["id"], "night": "2026-10-26", "size_before": 0.02, "left": 0.0001, "std": 0.0003})
    alarms = {2: [knock], 4: [back], 6: [_told(6, 20.5)]}
    height = {2: 0.020, 3: 0.020, 6: 0.0206, 7: 0.0011}  # mm by night
    with opened(tmp_path / "h.db") as history:
        for i in range(8):
            record = night("M", i, "changed" if i in alarms else "good", alarms=alarms.get(i, []))
            change = height.get(i, 0.0) - height.get(i - 1, 0.0)
            record["parameters"]["EY0C"] |= {"value": 0.012 + height.get(i, 0.0), "change": change, "seen": True}
            if i < 7:
                history.add_night(record)
        history.decide("M", Decision(alarms[6][0]["id"], "repaired", "Dora", "", None, "2026-10-30T09:00:00Z"))
        stands = standing(history, "M", 20_758.2, record["parameters"], "full")
    assert [a["id"] for a in stands] == [knock["id"], back["id"]]  # the change before its way back
    helped = {"alarm": alarms[6][0]["id"], "text": "as before, after the repair by Dora", "since": "2026-10-29"}
    record |= {"verdict": "changed", "standing": stands, "repaired": [helped]}
    record["headline"] = headline(record)
    subject, text = message(record, (), ())
    first = text.splitlines()[0]
    assert subject == "M: ALARM OPEN (2026-10-31)"
    assert first.startswith("Alarm of 2026-10-26 still open: C axis has moved along Y by +20.0 ± 0.3 µm")
    assert "(gone again: +0.1 ± 0.3 µm (night ending 2026-10-28) is left); nobody has answered" in first
    assert "still changed" not in text.lower() and "still there" not in text and "confirmed" not in text
    knocked = record | {"standing": [_told(6, 20.5) | {"now": "", "total": 0.0205, "night": "2026-10-30"}, *stands]}
    assert message(knocked | {"headline": headline(knocked)}, (), ())[0] == "M: STILL CHANGED (2026-10-31)"
