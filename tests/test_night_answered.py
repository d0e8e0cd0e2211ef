"""What somebody has answered to an alarm is held against the nights that follow: a repair that helped or not, what is ignored."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import date, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.answers import UNTIL, accept_stylus, answered, decide, open_and_decided
from support.histories import knowledge
from support.histories import record as kept
from support.nights_parts import Event, Story

from tango_cnc.cli import tango
from tango_cnc.history import Decision, History, opened
from tango_cnc.nightly.again import after_a_repair, step_by_step
from tango_cnc.nightly.answered import repaired, undone
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.moved import Moved
from tango_cnc.nightly.night import EXIT
from tango_cnc.nightly.words import headline
from tango_cnc.report.faults import earlier, faults
from tango_cnc.report.morning import context, render
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.state.naming import Hypothesis
from tango_cnc.texts import say

KNOCK = 20e-6  # rad, EC0X on night 8


def one(then: float, now: float) -> Moved:
    h = Hypothesis("axis_location", "EX0C", np.eye(4)[:, :1], "mm", ("C",))
    return Moved(np.array([then]), np.array([now]), np.array([0.0005]), np.array([0.0005]), np.array([0.0002]), h)


@pytest.mark.parametrize(
    ("now", "apart"),
    [(0.0, False), (0.0012, False), (-0.0012, False), (0.0019, False), (0.01, True), (0.02, True), (0.03, True), (-0.01, True)],
)
def test_a_repair_has_helped_where_no_more_is_left_than_touches_leave_open(now: float, apart: bool) -> None:
    assert one(0.02, now).apart() == apart


@pytest.mark.parametrize(
    ("now", "grown", "beyond"),
    [
        *((0.01, 1.0, False), (0.0117, 1.0, False), (0.0, 1.0, False), (0.013, 1.0, True), (0.035, 1.0, True), (-0.01, 1.0, True)),
        *((0.013, 1.5, False), (0.035, 1.5, True), (-0.01, 1.5, True)),
    ],
)
def test_what_is_ignored_is_what_was_seen_and_what_a_drift_has_added_since(now: float, grown: float, beyond: bool) -> None:
    assert one(0.01, now).beyond(grown) == beyond


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("utc", "after", "judged", "counts"),
    [
        ("2026-10-03T08:00:00Z", True, False, True),  # the morning after
        ("2026-10-03T01:59:58Z", True, False, True),  # the same by a clock that is behind
        ("2026-10-03T02:10:00Z", False, False, True),  # while the night measured, which did not know it
        ("2026-10-03T02:10:00Z", False, True, False),  # and which did
        ("2026-10-02T08:00:00Z", False, False, False),  # the evening before: that night has seen it
    ],
)
def test_a_repair_is_measured_by_the_night_after_it_whatever_clocks_say(
    tmp_path: Path, utc: str, after: bool, judged: bool, counts: bool
) -> None:
    said = Decision("2026-10-02-1", "repaired", "Ann", utc=utc)
    night = {"start_utc": "2026-10-03T02:00:00Z", "end_utc": "2026-10-03T02:30:00Z"}
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(2, alarms=[{"id": "2026-10-02-1", "cause": "step"}]), "touch\n1\n", knowledge(2))
        if not after:
            history.decide("M", said)
        told = {"repaired": [{"alarm": "2026-10-02-1"}]} if judged else {}
        history.add_night(kept(3, **night, **told), "touch\n1\n", knowledge(3))
        if after:
            history.decide("M", said)
        assert [d.alarm for d in repaired(history, "M")] == (["2026-10-02-1"] if counts else [])


@pytest.mark.long
@pytest.mark.parametrize(
    ("then", "verdict", "said"),
    [
        ({}, "changed", "has not helped"),
        ({"EC0X": -KNOCK / 2}, "changed", "that is left of"),
        ({"EC0X": KNOCK}, "changed", "has made it worse, it was"),
        ({"EC0X": -2 * KNOCK}, "changed", "went too far"),
        ({"EC0X": -KNOCK, "EY0C": 0.015}, "changed", "C axis has moved along Y"),
        ({"EC0X": -KNOCK}, "good", "as before, after the repair by Ann on 2026-10-08"),
    ],
)
def test_a_repair_is_measured(root: Path, tmp_path: Path, then: dict[str, float], verdict: str, said: str) -> None:
    story = Story((Event(8, {"EC0X": KNOCK}), Event(9, then)), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 11, {8: "repaired"})
    night = records[8]
    assert [a["parameter"] for a in records[7]["alarms"]] == ["EC0X"] and night["kind"] == "full"
    assert night["verdict"] == verdict and said in night["headline"]
    assert EXIT[night["verdict"]] == (0 if verdict == "good" else 1)
    before = "Parts made before the repair, after the night ending 2026-10-07, the last one without the change: up to "
    other = said in ("that is left of", "has made it worse, it was", "went too far")  # "up to 81 µm" was said of parts with 119
    assert any(before in a["on_part"] and "Since 2026-10-08 " in a["on_part"] for a in night["alarms"]) == other
    assert {r["verdict"] for r in records[9:]} == {verdict}  # nobody has answered the new alarm; a good end stays one
    assert not any(a for r in records[9:] for a in r["alarms"])  # one message says it, no further one
    left = KNOCK + then.get("EC0X", 0.0)
    for found in (*(a for a in night["alarms"] if a["parameter"] == "EC0X"), *night.get("repaired", ())):
        assert abs(found["size"] - left) < 4 * found["std"]
    if abs(left) > 1e-9:
        (alarm,) = night["alarms"]
        assert alarm["repair"]["alarm"] == records[7]["alarms"][0]["id"] and "Ask Ann" in alarm["do"]
        assert "still there" in records[9]["standing"][0]["now"]  # and not gone: the repair did not make it
        assert alarm["repair"]["back"] == pytest.approx(then.get("EC0X", 0.0), abs=4e-6)
    else:
        (helped,) = night["repaired"]
        assert helped["parameter"] == "EC0X" and helped["back"] == pytest.approx(-KNOCK, abs=4e-6)
        assert helped["size_before"] + helped["back"] == pytest.approx(helped["size"]) and abs(helped["size"]) < helped["least"]
        assert helped["since"] == records[6]["night"]
        back, left, before = (f"{1e6 * helped[key]:+.1f}" for key in ("back", "size", "size_before"))
        what, std = "X axis out of square, turned about Z", f"{1e6 * helped['std']:.1f}"
        said = f"{what} has gone back by {back} µrad (EC0X): {left} ± {std} µrad of {before}"
        if verdict == "good":
            assert said in night["headline"] and "moved" not in night["headline"]
            assert said in message(night, (), ())[1]


@pytest.mark.long
def test_a_table_that_was_not_put_back_is_off_as_before(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, table=(0.0, 0.012, 0.008)),), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 9, {8: "repaired"})
    assert [a["cause"] for a in records[7]["alarms"]] == ["table"]
    (alarm,) = records[8]["alarms"]
    assert alarm["cause"] == "table" and alarm["size"] == pytest.approx(0.0144, abs=0.001)
    assert "has not helped" in alarm["text"] and records[8]["verdict"] == "changed"


@pytest.mark.long
def test_what_is_ignored_alarms_again_when_it_is_larger_and_not_before(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, {"EY0C": 0.010}), Event(11, {"EY0C": 0.025})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 13, {8: "ignore"})
    assert [r["verdict"] for r in records[8:10]] == ["good", "good"]
    (alarm,) = records[10]["alarms"]
    assert alarm["parameter"] == "EY0C" and alarm["size"] == pytest.approx(0.025, abs=0.002)
    assert f"that Ann ignores until {UNTIL}" in alarm["text"] and alarm["ignored"]["seen"].startswith("+10.")
    assert {r["verdict"] for r in records[10:]} == {"changed"}


@pytest.mark.long
def test_every_night_says_what_is_ignored_and_a_larger_one_says_how_far_it_is_in_all(root: Path, tmp_path: Path) -> None:
    """Also where a step alone is smaller than what is ignored."""
    story = Story((Event(8, {"EY0C": 0.015}), Event(11, {"EY0C": 0.012})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 12, {8: "ignore"})
    for quiet in records[8:10]:
        assert quiet["verdict"] == "good" and EXIT[quiet["verdict"]] == 0 and not quiet.get("ignored")
        (unheard,) = quiet["unheard"]
        assert unheard["alarm"] == records[7]["alarms"][0]["id"] and unheard["total"] == pytest.approx(0.015, abs=0.002)
        (fault,) = faults(quiet, records[7]["alarms"], {}, Units(), texts())  # as the pages of a server show it
        assert fault["now"].startswith("still there: +15") and not fault["gone"]
        page = context(quiet, (), None, texts())
        assert page["ignored"][0] in " ".join(render(quiet).replace("&#39;", "'").split())
        for said in (quiet["headline"], message(quiet, (), ())[1], " ".join(page["ignored"])):
            assert "Ann" in said and "moved along Y" in said and "still there: +1" in said.lower()
            assert "nothing has changed" not in said.lower()
    (alarm,) = records[10]["alarms"]
    assert "+27." in alarm["text"] or "+26." in alarm["text"]
    assert f"in all since {records[6]['night']}, more than the +1" in alarm["text"] and "that Ann ignores" in alarm["text"]
    assert alarm["size"] == pytest.approx(0.012, abs=0.002) and alarm["ignored"]["total"] == pytest.approx(0.027, abs=0.002)
    assert alarm["ignored"]["since"] == records[6]["night"]
    assert str(records[6]["night"]) in alarm["on_part"] and alarm["on_part_um"] == pytest.approx(54, abs=4)
    page = context(records[10], (), None, texts())["first"]
    assert "27 µm" in page["text"] and "7 Oct" in page["on_part"] and "8 Oct" not in page["on_part"]
    for later in records[10:]:
        assert [u["owner"] for u in later["unheard"]] == ["Ann"] and "Ann ignores until" in message(later, (), ())[1]


@pytest.mark.long
def test_a_table_that_is_moved_farther_than_is_ignored_says_how_far_it_is_in_all(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, table=(0.0, 0.016, 0.012)), Event(9, table=(0.0, 0.008, 0.006))), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 9, {8: "ignore"})
    (alarm,) = records[8]["alarms"]
    assert alarm["cause"] == "table" and alarm["size"] == pytest.approx(0.010, abs=0.001)
    assert alarm["ignored"]["total"] == pytest.approx(0.030, abs=0.002) and alarm["on_part_um"] == pytest.approx(30, abs=2)
    assert f"in all since {records[6]['night']}, more than the +" in alarm["text"]


def test_what_is_ignored_is_in_the_sentence_of_a_night_beside_what_else_it_says() -> None:
    ignored = {"alarm": "a", "night": "2026-10-08", "text": "it moved by +15 µm", "now": "still there: +14 µm", "owner": "Cy"}
    record = {"status": "complete", "verdict": "good", "alarms": [], "limits": [], "unheard": [ignored | {"until": "2026-10-20"}]}
    record |= {"change": {"p_value": 0.5}}
    told = "it moved by +15 µm (still there: +14 µm)"
    assert headline(record).startswith(f"no alarm, as Cy ignores it until 2026-10-20: {told}")
    helped = headline(record | {"repaired": [{"text": "as before, after the repair"}]})
    assert helped.startswith("as before, after the repair") and told in helped and "Cy ignores it until 2026-10-20" in helped
    assert "something else creeps" in headline(record | {"trend": {"parameter": "EX0C", "text": "something else creeps"}})
    gone = say("night.alarms.gone_again_left", told="+0 µm")
    assert headline(record | {"unheard": [record["unheard"][0] | {"now": gone}]}).startswith("nothing has changed")


@pytest.mark.long
def test_an_ignored_change_that_goes_back_is_said_and_does_not_alarm(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, {"EY0C": 0.010}), Event(11, {"EY0C": -0.010})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 12, {8: "ignore"})
    assert records[10]["verdict"] == "good" and "as Ann ignores it" in records[10]["headline"]
    assert records[10]["ignored"][0]["size"] == pytest.approx(-0.010, abs=0.002)


@pytest.mark.parametrize(
    ("then", "now", "tonight", "back"),
    [(0.020, 0.0003, -0.0197, True), (0.020, 0.012, -0.008, False), (0.008, 0.006, 0.006, False), (0.008, 0.005, -0.003, False)],
)
def test_a_change_takes_an_older_one_back_only_where_it_goes_the_other_way_and_most_of_it(
    monkeypatch: pytest.MonkeyPatch, then: float, now: float, tonight: float, back: bool
) -> None:
    """On a machine that wanders by more than the older change was, nothing stands out: that is no return."""
    h = Hypothesis("axis_location", "EX0C", np.eye(4)[:, :1], "mm", ("C",))
    gone = Moved(np.array([then]), np.array([now]), np.array([0.0005]), np.array([0.0005]), np.array([0.004]), h)
    older = (SimpleNamespace(record={"night": "2026-10-08"}), {"id": "2026-10-08-1"})
    monkeypatch.setattr("tango_cnc.nightly.answered.unclosed", lambda *_: iter([older]))
    monkeypatch.setattr("tango_cnc.nightly.answered.moved", lambda *_: gone)
    alarm = {"cause": "axis_location", "parameter": "EX0C", "text": "t", "since": "2026-10-20", "size": tonight, "std": 0.0005}
    (told,) = undone(*[None] * 4, [alarm])  # type: ignore[arg-type]
    assert ("undoes" in told) == back and ("gone back" in told["text"]) == back


@pytest.mark.long
@pytest.mark.parametrize(("back", "left"), [(-0.056, 0.0), (-0.044, 0.012)])
def test_a_repair_that_takes_an_older_ignored_change_with_it_has_helped(
    root: Path, tmp_path: Path, back: float, left: float
) -> None:
    """The last alarm is counted from a night on which the machine was off already: back at the start is not "too far"."""

    def repaired(history: History, record: Mapping[str, Any]) -> None:
        decide(history, record, record["alarms"][0]["id"], "repaired")

    events = (Event(8, {"EY0C": 0.026}), Event(10, {"EY0C": 0.030}), Event(11, {"EY0C": back}))
    records = answered(root, tmp_path / "h.db", Story(events, wander=0.5), 12, {8: "ignore", 10: repaired})
    night = records[10]
    assert night["verdict"] == "good" and not night["alarms"] and not night.get("ignored")
    (helped,) = night["repaired"]
    assert helped["also"] == records[7]["alarms"][0]["id"]
    assert helped["size"] == pytest.approx(left, abs=0.001) and helped["back"] == pytest.approx(back, abs=0.002)
    assert ("as before this alarm" if left else "as before, after the repair by Ann") in night["headline"]
    assert "which belongs to the older alarm" in night["headline"] or not left
    assert "went too far" not in night["headline"] and "has gone back along Y by" in night["headline"]
    found, last = open_and_decided(tmp_path / "h.db", records[11]["night"])
    for later in records[10:] if not left else ():
        page = context(later, tuple(last.values()), None, texts(), waiting=earlier(found))
        assert page["answer"].may == "yes" and page["first"]["gone"] and "It has gone back since" in page["first"]["text"]
        assert bool(page["suspect"]) != bool(page["repaired"])  # which parts to check is said once


@pytest.mark.parametrize(
    ("behind", "told"),
    [("EY0C", "Ann ignores C axis off in Y (EY0C) until 2026-12-24"), ("EX0C", "Ann ignores C axis off in Y (EY0C)")],
)
def test_the_headline_of_a_crossed_limit_names_who_ignores_what(behind: str, told: str) -> None:
    limit = {"what": "volume", "value": 95.0, "unit": "µm", "limit": 90.0, "passed": False}
    silent = {"parameter": "EY0C", "text": "it moved", "owner": "Ann", "until": "2026-12-24", "now": ""}
    record = {"status": "complete", "verdict": "out_of_limits", "alarms": [], "limits": [limit]}
    record |= {"behind": [{"what": "volume", "parameter": behind, "text": "moved"}], "unheard": [silent]}
    assert told in headline(record) and "90 µm are allowed: moved" in headline(record)
    assert told in headline(record | {"unheard": [], "ignored": [silent]})


@pytest.mark.long
def test_a_change_that_goes_back_unanswered_says_so_and_what_is_left(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, {"EY0C": 0.020}), Event(9, {"EY0C": -0.020})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 9, {})
    (alarm,) = records[8]["alarms"]
    assert alarm["undoes"]["alarm"] == records[7]["alarms"][0]["id"] and records[8]["verdict"] == "changed"
    assert "has gone back along Y by -" in alarm["text"] and "of +20." in alarm["text"] and "moved" not in records[8]["headline"]
    found, last = open_and_decided(tmp_path / "h.db", records[8]["night"])
    page = context(records[8], tuple(last.values()), None, texts(), waiting=earlier(found))
    assert "+20 µm" in page["first"]["text"] and "of 20 µm is left" in page["first"]["text"]
    assert "Correct the whole error" not in page["first"]["whole"] and "gone back" in page["first"]["todo"]
    assert (
        page["suspect"].startswith("All that were made between Wed 7 Oct 2026")
        and "Fri 9 Oct 2026, the first night without it again" in page["suspect"]
    )


@pytest.mark.long
def test_an_ignored_change_that_has_gone_back_is_no_reason_to_measure_the_first_part(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, {"EY0C": 0.020}), Event(9, {"EY0C": -0.020})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 11, {8: "ignore"})
    assert "gone back along Y" in records[8]["headline"] and [g["alarm"][:10] for g in records[10]["gone"]] == [records[7]["night"]]
    found, last = open_and_decided(tmp_path / "h.db", records[10]["night"])
    page = context(records[10], tuple(last.values()), None, texts(), waiting=earlier(found))
    assert page["answer"].may == "yes" and "It has gone back since" in page["first"]["text"]


def test_a_repair_that_helped_is_said_beside_a_crossed_limit() -> None:
    helped = {"text": "as before, after the repair by Ann on 2026-10-08: all of it"}
    limit = {"what": "volume", "value": 95.0, "unit": "µm", "limit": 90.0, "passed": False}
    record = {"status": "complete", "verdict": "out_of_limits", "alarms": [], "limits": [limit], "repaired": [helped]}
    assert "90 µm are allowed" in headline(record) and helped["text"] in headline(record)


@pytest.mark.long
def test_a_knock_on_top_of_an_ignored_drift_is_told_with_its_own_size(root: Path, tmp_path: Path) -> None:
    """Also after weeks, when the drift alone has come farther than the knock is large."""
    story = Story((Event(6, drift={"EY0C": 0.0012}), Event(34, {"EY0C": 0.020})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 36, {n: "ignore" for n in range(7, 33)})
    first = next(i for i, r in enumerate(records) if r["alarms"])
    assert all(r["verdict"] == "good" for r in records[first + 1 : 33])  # it goes on as it was seen
    (alarm,) = records[33]["alarms"]
    assert alarm["rate_per_day"] is None and alarm["size"] == pytest.approx(0.0212, abs=0.002)
    with opened(tmp_path / "h.db") as history:
        decided = {d.alarm: d for d in history.decisions("trunnion")}
        waiting = [a | {"utc": s.record["start_utc"]} for s in history.alarmed("trunnion") for a in s.record["alarms"]]
    shown = faults(records[35], waiting, decided, Units(), texts(), today=records[35]["night"])
    drift, knock = shown  # what does more to a part first, also where somebody ignores it
    assert "21 µm" in knock["text"] and not knock["drifts"] and "drift" not in knock["text"]
    assert drift["drifts"] and knock["night"] == records[33]["night"]


@pytest.mark.long
@pytest.mark.parametrize(("example", "bent"), [("trunnion", "EC0X"), ("hu40t", "EC0Y")])
def test_a_stylus_that_is_accepted_takes_no_knock_with_it(root: Path, tmp_path: Path, example: str, bent: str) -> None:
    story = Story((Event(8, {bent: 15e-6}, stylus={"EXt": 0.3, "EYt": -0.1, "EZt": 0.5}),), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 10, {8: accept_stylus}, example=example)
    assert {a["parameter"] for a in records[7]["alarms"]} == {"stylus", bent}
    assert "besides" in records[7]["headline"] and bent in records[7]["headline"]
    for later in records[8:]:
        assert later["verdict"] == "changed" and [a["parameter"] for a in later["standing"]] == [bent]
        assert not later["alarms"]


@pytest.mark.long
@pytest.mark.parametrize("example", ["hu40t"])
def test_a_longer_stylus_alone_is_a_stylus_alone(root: Path, tmp_path: Path, example: str) -> None:
    """Touches on balls are not linear over a millimetre: what that leaves is no second change."""
    story = Story((Event(8, stylus={"EXt": 0.6, "EYt": -0.3, "EZt": 1.2}),), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 9, {8: accept_stylus}, example=example)
    assert [a["parameter"] for a in records[7]["alarms"]] == ["stylus"] and records[8]["verdict"] == "good"


@pytest.mark.long
def test_three_causes_of_one_night_are_three_alarms(root: Path, tmp_path: Path) -> None:
    truth = {"EC0X": 20e-6, "EY0C": 0.015, "EA0C": 30e-6}
    records = answered(root, tmp_path / "h.db", Story((Event(8, truth),), wander=0.5), 9, {})
    alarms = {a["parameter"]: a for a in records[7]["alarms"]}
    assert set(alarms) == set(truth) and len({a["id"] for a in alarms.values()}) == 3
    assert all(abs(a["size"] - truth[name]) < 4 * a["std"] for name, a in alarms.items())
    assert all(name in records[7]["headline"] for name in truth) and not records[8]["alarms"]
    assert message(records[7], (), ())[1].count("to answer") == 3


def test_a_decision_says_what_follows_from_it(tmp_path: Path) -> None:
    alarm = {"id": "2026-10-02-1", "cause": "axis_location", "parameter": "EX0C", "size": 0.02, "std": 0.001, "unit": "mm"}
    alarms: list[dict[str, Any]] = [
        alarm | {"text": "it moved", "since": "2026-10-01"},
        alarm | {"id": "2026-10-02-2", "text": "it goes on", "since": "2026-10-01", "rate_per_day": 0.0013, "steady": True},
        {"id": "2026-10-02-3", "cause": "unknown", "parameter": "several", "size": 0.0, "std": 0.0, "unit": "", "text": "changed"},
    ]
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(2, alarms=alarms))

    def decide(which: int, *more: str) -> str:
        command = ["history", "decide", f"2026-10-02-{which}", "--history", str(tmp_path / "history.db"), "--owner", "Ann"]
        result = CliRunner().invoke(tango, [*command, "--action", *more])
        assert result.exit_code == 0, result.output
        return " ".join(result.output.split())

    until = ("ignore", "--until", (date.today() + timedelta(days=300)).isoformat())
    assert "within what was seen: +20.0 ± 1.0 µm. More than that alarms again" in decide(1, *until)
    assert "+20.0 ± 1.0 µm, +1.3 µm a day" in decide(2, *until)
    assert "any further change alarms again" in decide(3, *until)
    assert "it alarms again" in decide(1, "repaired")


@pytest.mark.long
def test_what_comes_back_after_a_repair_names_it(root: Path, tmp_path: Path) -> None:
    story = Story((Event(8, {"EY0C": 0.018}), Event(10, {"EY0C": -0.0175}), Event(12, {"EY0C": 0.015})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 13, {9: "repaired"})
    (alarm,) = records[11]["alarms"]
    repair = records[8]["night"]
    assert alarm["again"] == {"alarm": records[7]["alarms"][0]["id"], "owner": "Ann", "date": repair}
    assert f"; Ann had repaired it on {repair}, and it has come back" in alarm["text"]
    assert alarm["do"].startswith(f"Look at the repair by Ann on {repair} first")
    assert "Ann had repaired it on" in records[12]["headline"]
    assert records[12]["kind"] == "full" and "Look at the repair by Ann" in message(records[12], (), ())[1]  # still what to do
    assert "Ann had repaired it on" in context(records[11], (), None, texts())["first"]["text"]


def found(size: float, parameter: str = "EX0C", **more: object) -> dict[str, Any]:
    """alarm of a record, as far as what is repeated is looked for in it."""
    return {"cause": "axis_location", "parameter": parameter, "size": size, "text": "moved", "do": "ask", "now": "", **more}


PARAMETERS = {name: {"value": 0.0, "std": 0.0, "unit": "mm"} for name in ("EX0C", "EY0C")}


@pytest.mark.parametrize(
    ("older", "drifts"),
    [
        *(([], False), ([found(0.01)], True), ([found(-0.01)], False), ([found(0.01, "EY0C")], False)),
        *(([found(0.01) | {"now": say("night.alarms.gone_again_left", told="0")}], False),),
        *(([found(-0.01), found(0.004)], True),),
    ],
)
def test_steps_the_same_way_are_a_drift_to_whoever_has_to_act(older: list[dict[str, Any]], drifts: bool) -> None:
    do = step_by_step(found(0.002), older, PARAMETERS)["do"]
    assert ("clamping" in do) == drifts and (do == "ask") != drifts


def test_a_table_that_is_knocked_twice_does_not_drift() -> None:
    """What is said of it is a length, which has no way."""
    assert step_by_step(found(0.02, "table"), [found(0.02, "table")], PARAMETERS)["do"] == "ask"


@pytest.mark.parametrize(
    ("answers", "size", "again"),
    [
        ({"a": "repaired"}, 0.01, True),
        ({"a": "repaired"}, -0.01, False),
        ({"a": "repaired", "b": "accept"}, 0.01, False),  # the machine was accepted as it was since
        ({"b": "accept"}, 0.01, False),
        ({"a": "ignore"}, 0.01, False),
    ],
)
def test_the_last_answer_decides_whether_something_comes_back(answers: dict[str, str], size: float, again: bool) -> None:
    nights = [SimpleNamespace(record={"alarms": [found(0.015, id=k)]}, night=SimpleNamespace(entry=0)) for k in answers]
    decided = [
        Decision(key, action, "Ann", "", None, f"2026-10-0{i}T00:00:00Z") for i, (key, action) in enumerate(answers.items(), 1)
    ]
    past: Any = SimpleNamespace(knows=lambda _: True, decisions=lambda _: decided, alarmed=lambda *_: nights)
    (told,) = after_a_repair(past, "M", [found(size)])
    assert ("again" in told) == again == ("Ann had repaired it on 2026-10-01" in told["text"])


@pytest.mark.long
def test_what_goes_on_beyond_what_is_ignored_has_one_order_and_one_size(root: Path, tmp_path: Path) -> None:
    steps = tuple(Event(n, {"EY0C": 0.003}) for n in range(9, 13))
    records = answered(root, tmp_path / "h.db", Story((Event(8, {"EY0C": 0.018}), *steps), wander=0.3), 14, {8: "ignore"})
    text = message(records[-1], (), ())[1]
    assert "alarm of" in text and "have the compensation written" not in text
    true = 2 * (0.018 + 4 * 0.003) * 1e3
    said = [float(x) for x in re.findall(r"comes out up to ([0-9.]+) µm", text)]
    assert said and all(abs(x - true) < 4 for x in said)


@pytest.mark.long
def test_a_repair_is_held_against_what_there_was_when_it_was_made(root: Path, tmp_path: Path) -> None:
    """20 µrad on night 8 and 20 more on night 10: "the repair has made it worse, it was 20 µrad before", and nothing had moved."""
    story = Story((Event(8, {"EC0X": KNOCK}), Event(10, {"EC0X": KNOCK})), wander=0.5)
    night = answered(root, tmp_path / "h.db", story, 11, {10: "repaired"})[10]
    told = [str(a["text"]) for a in night["alarms"] if a.get("repair")]
    assert told and all("has not helped" in text for text in told) and "worse" not in night["headline"], night["headline"]
