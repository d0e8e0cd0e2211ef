"""What goes on night after night is one alarm with one id until somebody decides; a knock on top of it is another one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.answers import answered
from support.nights_parts import Event, Story

from tango_cnc.history import opened
from tango_cnc.nightly.again import step_by_step
from tango_cnc.nightly.goes_on import same_pace
from tango_cnc.nightly.mail import message
from tango_cnc.report import morning
from tango_cnc.report.faults import faults, unclosed
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units

GROWS = tuple(Event(n, {"EY0C": 0.005}) for n in range(10, 16))


def told(a: dict[str, Any]) -> dict[str, Any]:
    return {"size": 0.005, "std": 0.0003, "unit": "mm", "rate_per_day": None} | a


@pytest.mark.parametrize(
    ("older", "tonight", "days", "same"),
    [
        (told({}), told({}), 1.0, True),
        (told({}), told({"size": 0.0098}), 1.0, True),
        (told({}), told({"size": 0.02}), 1.0, False),  # a knock on top of it
        (told({"size": 0.030, "rate_per_day": 0.005}), told({"size": 0.006}), 1.0, True),
        (told({"size": 0.030, "rate_per_day": 0.005}), told({"size": 0.030}), 1.0, False),
        (told({"size": 0.030, "rate_per_day": 0.005}), told({"size": 0.015}), 3.0, True),  # two nights were not measured
    ],
)
def test_what_goes_on_at_its_pace_is_the_same_alarm(
    older: dict[str, Any], tonight: dict[str, Any], days: float, same: bool
) -> None:
    assert same_pace(older, tonight, days) == same


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 4])
def test_growth_beyond_an_ignored_size_is_one_alarm_until_somebody_decides(root: Path, tmp_path: Path, seed: int) -> None:
    file = tmp_path / "h.db"
    records = answered(root, file, Story((Event(8, {"EY0C": 0.012}), *GROWS), wander=0.5), 18, {8: "ignore"}, seed)
    grown = [a for r in records[9:15] for a in r["alarms"]]
    assert len(grown) == 6 and len({a["id"] for a in grown}) == 1 and grown[0]["id"].startswith(records[9]["night"])
    for n, a in enumerate(grown, 1):
        assert abs(a["size"] - 0.005 * n) < 4 * a["std"] + 0.001 and a["since"] == records[8]["night"]
        assert "that Ann ignores until" in a["text"] and a["ignored"]["total"] == pytest.approx(0.012 + 0.005 * n, abs=0.002)
    last = records[14]
    assert last["verdict"] == "changed" and not last.get("standing")
    assert message(last, (), ())[1].count("to answer") == 1
    (waiting,) = records[17]["standing"]
    assert waiting["id"] == grown[0]["id"] and waiting["size"] == grown[-1]["size"]
    assert waiting["total"] == pytest.approx(0.030, abs=0.002) and "goes on" not in waiting["text"]
    with opened(file) as history:
        assert [a["id"] for a in history.open_alarms("trunnion")] == [grown[0]["id"]]
        assert history.fleet(records[-1]["end_utc"])[0].alarms_open == 1
        found, decisions = unclosed(history, "trunnion", records[-1]["night"])
    assert [a["id"] for a in found if a["id"] not in decisions] == [grown[0]["id"]]
    grows = [f for f in faults(records[-1], found, decisions, Units(), texts()) if grown[0]["id"] in f["ids"]]
    assert len(grows) == 1 and grows[0]["total"] == pytest.approx(0.042, abs=0.002)


@pytest.mark.long
def test_what_nobody_has_answered_goes_on_under_its_id_and_a_knock_has_its_own(root: Path, tmp_path: Path) -> None:
    story = Story((*GROWS[:5], Event(15, {"EY0C": 0.030})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 16, {})
    grown = [a for r in records[9:14] for a in r["alarms"]]
    assert len(grown) == 5 and len({a["id"] for a in grown}) == 1
    assert grown[-1]["rate_per_day"] == pytest.approx(0.005, abs=0.0005) and "night after night" in grown[-1]["text"]
    assert "the alarm of 2026-10-10 goes on" in records[13]["headline"] and "clamping" in grown[-1]["do"]
    assert message(records[13], (), ())[1].count("the alarm of 2026-10-10 goes on") == 2  # the headline and the alarm
    (knock,) = records[14]["alarms"]
    assert knock["id"] != grown[0]["id"] and knock["size"] == pytest.approx(0.030, abs=0.001)


@pytest.mark.long
def test_a_step_after_an_alarm_that_was_gone_again_is_another_alarm(root: Path, tmp_path: Path) -> None:
    """A drift of 9 µm goes back day by day; two weeks later the machine moves by 13 µm in one night. The night took this for the
    old alarm: who ignored that one had answered this one, and put the parts of two weeks in question."""
    crept = (*(Event(n, {"EY0C": 0.003}) for n in (8, 9, 10)), *(Event(n, {"EY0C": -0.0009}) for n in range(11, 21)))
    records = answered(root, tmp_path / "h.db", Story((*crept, Event(24, {"EY0C": 0.013})), wander=0.3), 24, {})
    (old,) = records[8]["alarms"]
    assert old["rate_per_day"] and "gone again" in records[22]["standing"][0]["now"]
    (step,) = records[23]["alarms"]
    assert step["id"] != old["id"] and not step.get("goes_on") and step["since"] == records[22]["night"]
    assert step["size"] == pytest.approx(0.013, abs=0.001) and step["sigmas"] > 8 and not step["rate_per_day"]


@pytest.mark.long
def test_an_answer_ends_an_alarm_and_who_has_it_keeps_it(root: Path, tmp_path: Path) -> None:
    """Whoever acknowledged it sees it go on; what is accepted and goes on is another alarm; a drift is ignored at its rate."""
    for action, ids in (("acknowledge", 1), ("ignore", 1), ("accept", 2)):
        records = answered(root, tmp_path / f"{action}.db", Story(GROWS, wander=0.5), 15, {12: action})
        assert len({a["id"] for r in records for a in r["alarms"]}) == ids
        if action == "ignore":
            assert not any(r["alarms"] for r in records[12:]) and "as Ann ignores it" in records[12]["headline"]
            continue
        (after,) = records[12]["alarms"]
        if action == "acknowledge":
            assert after["decision"] == "acknowledge" and after["owner"] == "Ann"
            assert "--action repaired" in message(records[12], (), ())[1]  # she is not asked to take it again
        else:
            assert after["decision"] is None and after["id"].startswith(records[12]["night"])


@pytest.mark.parametrize(
    ("total", "tonight", "rate", "knocks"),
    [(0.035, 0.015, None, True), (0.041, 0.015, None, False), (0.035, 0.015, 0.001, False), (None, 0.015, None, False)],
)
def test_two_steps_between_which_it_stood_still_are_two_knocks(
    total: float | None, tonight: float, rate: float | None, knocks: bool
) -> None:
    like = {"cause": "axis_location", "parameter": "EY0C", "rate_per_day": None}
    older = {**like, "size": 0.02, "total": total, "rate_per_day": rate, "now": ""}
    do = step_by_step({**like, "size": tonight, "do": "ask"}, [older], {"EY0C": {"value": 0.0}})["do"]
    assert (do == "ask") == knocks and ("clamping" in do) != knocks


@pytest.mark.long
def test_two_knocks_with_a_quiet_night_between_are_both_told(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, {"EY0C": 0.020}), Event(10, {"EY0C": 0.015})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 11, {})
    first, other = records[7]["alarms"][0], records[9]["alarms"][0]
    assert first["id"] != other["id"] and other["size"] == pytest.approx(0.015, abs=0.001)
    assert "clamping" not in other["do"] and other["do"] == first["do"]
    assert "in the night ending 2026-10-10)" in records[10]["headline"] and "µm now; +14." in records[10]["headline"]
    with opened(tmp_path / "h.db") as history:
        found, decisions = unclosed(history, "trunnion", records[10]["night"])
    (fault,) = faults(records[10], found, decisions, Units(), texts())
    assert "Two steps, and it stood still between them: +20 µm (night ending Thu 8 Oct 2026) and +15 µm (" in fault["text"]
    assert not fault["drifts"] and fault["todo"].startswith("Ask who was at the machine") and len(fault["ids"]) == 2


@pytest.mark.long
@pytest.mark.parametrize(("sizes", "seed"), [((0.020, 0.015), 3), ((0.020, 0.020), 4), ((0.012, 0.025), 5)])
def test_knocks_in_two_nights_one_after_the_other_are_two_alarms(
    root: Path, tmp_path: Path, sizes: tuple[float, float], seed: int
) -> None:
    story = Story(tuple(Event(n, {"EY0C": size}) for n, size in zip((8, 9), sizes, strict=True)), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 10, {}, seed)
    first, other = records[7]["alarms"][0], records[8]["alarms"][0]
    assert first["id"] != other["id"] and other["follows"]["alarm"] == first["id"] and not other.get("goes_on")
    assert [a["size"] for a in (first, other)] == pytest.approx(sizes, abs=0.0015) and other["since"] == records[7]["night"]
    assert "two knocks, or a movement that goes on" in records[8]["headline"] and "night after night" not in records[8]["headline"]
    both = "Ask who was at the machine in both nights. If it moves again in the next night, look for what goes on"
    assert other["do"].startswith(both) and first["do"].startswith("Ask who was at the machine. Run the full measurement.")
    for r, wanted, do in (
        (records[8], "two knocks, or a movement that goes on.", both),
        (records[9], "It has stood still since.", "Ask who was at the machine. Run the full measurement."),
    ):
        with opened(tmp_path / "h.db") as history:
            found, decisions = unclosed(history, "trunnion", r["night"])
        before = [a for a in found if str(a["utc"]) <= r["start_utc"] and a["id"] not in {x["id"] for x in r["alarms"]}]
        (fault,) = faults(r, before, decisions, Units(), texts())
        assert "Two steps, +" in fault["text"] and wanted in fault["text"] and "night after night" not in fault["text"]
        assert not fault["drifts"] and sorted(fault["ids"]) == sorted([first["id"], other["id"]])
        assert fault["todo"].startswith(do) and fault["total"] == pytest.approx(sum(sizes), abs=0.002)


@pytest.mark.long
def test_three_steps_in_three_nights_are_something_that_goes_on(root: Path, tmp_path: Path) -> None:
    story = Story((*(Event(n, {"EY0C": 0.015}) for n in range(8, 12)),), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 11, {})
    ids = [r["alarms"][0]["id"] for r in records[7:11]]
    assert ids == [ids[0], ids[1], ids[0], ids[0]] and ids[0] != ids[1]  # the second night cannot know
    last = records[10]["alarms"][0]
    assert last["goes_on"]["with"] == [ids[1]] and "night after night" in records[10]["headline"]
    assert last["since"] == records[6]["night"] and last["size"] == pytest.approx(0.060, abs=0.002)
    assert not any(r.get("standing") for r in records[9:11])
    with opened(tmp_path / "h.db") as history:
        found, _ = unclosed(history, "trunnion", records[10]["night"])
        assert [a["id"] for a in found] == [a["id"] for a in history.open_alarms("trunnion")] == [ids[0]]
        assert [s.alarms_open for s in history.fleet(records[10]["end_utc"])] == [1]


@pytest.mark.long
def test_who_answers_what_goes_on_has_answered_all_of_it(root: Path, tmp_path: Path) -> None:
    story = Story((*(Event(n, {"EY0C": 0.015}) for n in range(8, 11)),), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 12, {10: "accept"})
    assert records[9]["alarms"][0]["goes_on"]["with"] and not records[10]["alarms"] and not records[11]["alarms"]
    assert not records[11].get("standing") and records[11]["verdict"] == "good"


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 4])
def test_what_goes_on_asks_for_one_full_run_until_something_else_moves(root: Path, tmp_path: Path, seed: int) -> None:
    story = Story((*(Event(n, {"EY0C": 0.005}) for n in range(9, 17)), Event(15, {"EX0C": 0.020})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 17, {}, seed)
    (second,) = records[9]["alarms"]  # two small steps are one alarm, and no course yet
    assert "night after night" not in second["text"] and "in both nights" in second["do"]
    (fault,) = faults(records[9], (), {}, Units(), texts())
    assert "It moved in two nights, one after the other." in fault["text"] and not fault["drifts"]
    assert all(a.get("goes_on") for r in records[9:14] for a in r["alarms"]) and all(r["alarms"] for r in records[8:16])
    assert [n for n, r in enumerate(records, 1) if r["kind"] == "full"] == [1, 10, 16]
    assert [r["next"]["kind"] for r in records[8:16]] == ["full", *5 * ["check"], "full", "check"]


@pytest.mark.long
def test_a_stylus_that_creeps_is_one_alarm_as_well(root: Path, tmp_path: Path) -> None:
    """It has no way, but a length."""
    story = Story(tuple(Event(n, stylus={"EXt": 0.004, "EYt": 0.003}) for n in range(9, 13)), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 13, {})
    grown = [a for r in records[8:12] for a in r["alarms"]]
    assert {a["cause"] for a in grown} == {"stylus"} and len({a["id"] for a in grown}) == 1
    assert grown[-1]["size"] == pytest.approx(0.020, abs=0.0015)


@pytest.mark.long
def test_a_stylus_that_creeps_is_one_alarm_with_how_far_it_is_by_now(root: Path, tmp_path: Path) -> None:
    """Its size is a length in space: of no one parameter, and yet every morning says how far it has come, alarm or not."""
    creep = tuple(Event(n, stylus={"EXt": 0.0015}) for n in range(10, 22))
    records = answered(root, tmp_path / "h.db", Story(creep, wander=0.5), 22, {})
    told_ = [a for r in records for a in r["alarms"]]
    assert told_ and {a["cause"] for a in told_} == {"stylus"} and len({a["id"] for a in told_}) == 1
    begun = next(n for n, r in enumerate(records, 1) if r["alarms"])
    since = next(n for n, r in enumerate(records, 1) if r["night"] == records[begun - 1]["alarms"][0]["since"])
    assert 7 <= since <= 10 and begun <= 14, "after five nights, 7.5 µm, at the latest"
    for n, r in enumerate(records[begun - 1 :], begun):
        (own,) = [*r["alarms"], *r.get("standing", ())]
        there = own.get("total") or own["size"]
        assert there == pytest.approx(0.0015 * (min(n, 21) - max(since, 9)), abs=0.0012), r["night"]
    (last,) = records[-1]["standing"]
    assert "µm now" in str(last["now"]) and "µm now" in records[-1]["headline"]
    there = round(1e3 * last["total"])
    assert f"off by up to {there} µm" in morning.render(records[-1])


@pytest.mark.long
def test_a_stylus_that_is_back_has_gone_again(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, stylus={"EYt": 0.020}), Event(10, stylus={"EYt": -0.020})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 11, {})
    (there,) = records[8]["standing"]
    assert there["total"] == pytest.approx(0.020, abs=0.002) and "still there" in there["now"]
    assert all("gone again" in a["now"] for a in records[10]["standing"] if a["id"] == there["id"])
