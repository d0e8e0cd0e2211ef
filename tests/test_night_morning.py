"""What a morning says: what has changed and what still is, since when, how fast, what it does, who has it, what is missing."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from support.histories import knowledge
from support.histories import record as kept
from support.nights_parts import Event, Story, nights, simulated

from sim_controller.simulate import simulate
from tango_cnc.commands._cell_nights import _judged
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import Decision, opened
from tango_cnc.nightly import Ports
from tango_cnc.nightly.alarms import Known, effect_of
from tango_cnc.nightly.answered import ignored
from tango_cnc.nightly.behind import behind
from tango_cnc.nightly.dates import since
from tango_cnc.nightly.doubt import NightDoubt, believed
from tango_cnc.nightly.mail import answer, message
from tango_cnc.nightly.night import known_before
from tango_cnc.nightly.standing import standing
from tango_cnc.nightly.words import changed, headline
from tango_cnc.noise import Noise
from tango_cnc.records import Cell
from tango_cnc.report.repeated import as_decided, shortened
from tango_cnc.state import Frame, State
from tango_cnc.texts import say

Tell = Callable[..., list[dict[str, Any]]]


@pytest.fixture
def tell(root: Path, tmp_path: Path) -> Tell:
    """→ nights of the trunnion machine, as a story has them; `answer`: night after which its alarms are accepted."""

    def play(story: Story, count: int, answer: int = 0, **settings: Any) -> list[dict[str, Any]]:
        folder, found = root / "examples" / "trunnion", []
        cell, truth = read_cell(folder), read_world(folder / "world.yaml")
        with opened(tmp_path / "history.db") as history:
            asked = Nightly(diagnose=False, owner="Ann Meier", **settings)
            for number, (record, _) in enumerate(nights(cell, truth, history, count, 3, story, asked), 1):
                found.append(record)
                if number == answer:
                    for alarm in history.open_alarms(cell.machine.name):
                        history.decide(cell.machine.name, Decision(alarm["id"], "accept", "Ann", utc=record["end_utc"]))
            assert history.verify() == ()
        return found

    return play


def night(**more: Any) -> dict[str, Any]:
    record: dict[str, Any] = {
        **{"machine": "M", "cell": "/cells/m", "night": "2026-10-04", "kind": "check", "status": "complete", "why": ""},
        **{"verdict": "good", "preflight": [], "touches": 74, "planned": 74, "machine_time_s": 300.0, "alarms": [], "limits": []},
        **{"owner": "Ann Meier", "artefacts": {"folder": "nights/now"}, **more},
    }
    return record | {"headline": headline(record)}


@pytest.mark.long
def test_a_drift_of_two_microns_a_night_is_named_with_its_rate_before_the_limit_is_crossed(tell: Tell) -> None:
    records = tell(Story((Event(6, drift={"EY0C": 0.002}),), wander=0.0), 10, limits={"volume": 60.0})
    alarmed = [i for i, r in enumerate(records, 1) if r["alarms"]]
    assert len(alarmed) == 1 and alarmed[0] in (7, 8)  # one alarm for one drift, and no later than its third night
    alarm = records[alarmed[0] - 1]["alarms"][0]
    assert (alarm["cause"], alarm["parameter"]) == ("axis_location", "EY0C")
    assert alarm["rate_per_day"] == pytest.approx(0.002, rel=0.2) and alarm["since"] in ("2026-10-04", "2026-10-05")
    assert all(r["verdict"] == "good" for r in records[:5])
    assert all("nothing has changed" not in r["headline"] for r in records[alarmed[0] - 1 :])
    beyond = [r for r in records if r["verdict"] == "out_of_limits"]
    assert beyond and all(r["behind"][0]["parameter"] == "EY0C" for r in beyond)
    text = message(beyond[-1], (), ())[1]
    assert "since 2026-10-05" in text and "+2.0 µm a day" in text and "owner: Ann Meier" in text and "what to do" in text


@pytest.mark.long
def test_a_knock_that_nobody_has_answered_is_told_every_morning_until_somebody_has(tell: Tell) -> None:
    records = tell(Story((Event(2, {"EY0C": 0.020}),), wander=0.0), 5, answer=4)
    assert [r["verdict"] for r in records] == ["good", "changed", "changed", "changed", "good"]
    assert [r["kind"] for r in records] == ["full", "check", "full", "check", "check"]
    for later in records[2:4]:  # what a full night has found again is not to be measured once more, on no later morning
        told = message(later, (), ())[1]
        assert "Run the full measurement" not in told
        assert "Ask who was at the machine: two measurements show the change." in told
    assert "Run the full measurement" in message(records[1], (), ())[1]
    alarm = records[1]["alarms"][0]
    assert alarm["on_part_um"] == pytest.approx(40, abs=2)  # a part that was set up at C 0 and is turned to C 180
    assert "C is turned by 180°" in alarm["on_part"]
    assert records[2]["kind"] == "full" and records[2]["alarms"] == []
    subject, text = message(records[2], (), ())
    assert "STILL CHANGED" in subject and "nothing has changed" not in text.lower()
    assert "confirmed by tonight's full measurement" in text and "not answered" in text and "owner: Ann Meier" in text
    assert "since last night" not in text and "since the night ending 2026-10-02" in text


@pytest.mark.long
def test_a_machine_that_warms_up_while_it_is_measured_is_no_broken_probe(tell: Tell, monkeypatch: pytest.MonkeyPatch) -> None:
    warming = {"cause": "thermal_drift", "amplitude": 0.025, "tau": 900, "direction": [0, 0.7, 0.7]}
    measure, count, made = simulated._Machine.measure, iter(range(1, 9)), simulated.nights_of

    def warm(self: Any, kind: str, touches: Any) -> Any:
        truth = self.truth
        self.truth = replace(truth, effects=(*truth.effects, warming)) if next(count) in (2, 3) else truth
        try:
            return measure(self, kind, touches)
        finally:
            self.truth = truth

    monkeypatch.setattr(simulated._Machine, "measure", warm)
    monkeypatch.setattr(simulated, "nights_of", lambda cell, settings, plan, deep: made(cell, settings, plan, deep=True))
    records = tell(Story(wander=0.0), 4)
    assert [r["kind"] for r in records[:3]] == ["full", "check", "full"]
    for record in records[1:3]:
        assert record["verdict"] == "doubtful" and not record["alarms"] and not record["carried"]
        assert "warm-up" in record["headline"] and "probe" not in record["headline"]
        assert "nothing of this night is carried on" in message(record, (), ())[1]
    assert records[2]["next"]["kind"] == records[3]["kind"] == "full"  # as the message of the night in doubt has said
    assert records[3]["verdict"] == "good"  # cold again: the state has not followed the warm-up


@pytest.mark.long
def test_a_check_of_three_minutes_is_judged_by_the_nights_before(tell: Tell, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has hardly more touches than there are unknowns: by itself it could never say which of them does not fit."""
    made = simulated.nights_of
    monkeypatch.setattr(simulated, "nights_of", lambda cell, settings, plan, deep: made(cell, settings, plan, deep=True))
    records = tell(Story(wander=0.0), 5, check_minutes=3.0)
    assert [r["kind"] for r in records] == ["full", *4 * ["check"]]
    assert {r["verdict"] for r in records} == {"good"}


@pytest.fixture(scope="module")
def cell(root: Path) -> Cell:
    return read_cell(root / "examples" / "hu40t")


def test_what_a_change_does_to_parts_is_reckoned_where_it_does_it(cell: Cell) -> None:
    known = Known(cell, cast(Frame, None), cast(Any, None))
    turned = effect_of(known, "axis_location", "EX0C", 0.0198, "mm", cast(Any, None))
    assert turned[0] == pytest.approx(39.6) and "39.6 µm" in turned[1]  # C 0 against C 180: twice the offset
    square = effect_of(known, "axis_location", "EC0X", 26.6e-6, "rad", cast(Any, None))
    travel = next(a.travel for a in cell.machine.axes if a.name == "X")
    assert travel is not None and square[0] == pytest.approx(26.6e-3 * (travel[1] - travel[0]))
    assert "no rotary axis" in square[1] and "location" not in square[2]


@pytest.mark.parametrize(("path", "drifts"), [((0.0, 0.002, 0.004, 0.006), True), ((0.0, 0.0001, 0.0199, 0.020), False)])
def test_a_knock_behind_a_crossed_limit_is_not_told_as_a_drift(cell: Cell, path: tuple[float, ...], drifts: bool) -> None:
    lever = np.zeros((1, 3, 1))
    lever[0, 0, 0] = 1.0
    followed = SimpleNamespace(
        **{"machine": [0], "names": ("EX0C",), "units": ("mm",), "families": ("location",)},
        selection=SimpleNamespace(label=lambda name: name),
    )
    limits = [{"what": "volume", "passed": True}]
    nights_before = [
        {
            **{"night": f"2026-10-{day:02d}", "limits": limits, "alarms": []},
            **{"state": {"day": float(day)}, "parameters": {"EX0C": {"value": value, "std": 2e-4}}},
        }
        for day, value in enumerate(path[:-1], 1)
    ]
    after = SimpleNamespace(mean=[path[-1]], std=[2e-4], day=float(len(path)))
    known = Known(cell, cast(Frame, followed), lever)
    (found,) = behind(known, nights_before[::-1], cast(State, after), {"what": "volume"})
    assert ("night after night" in found["text"]) == drifts == (found["rate_per_day"] is not None)
    assert ("since 2026-10-01" if drifts else "since 2026-10-02") in found["text"]


@pytest.mark.parametrize(("kinds", "confirmed"), [(("check", "full"), "2026-10-04"), (("full", "check"), None)])
def test_a_full_measurement_is_not_asked_for_where_one_has_found_the_cause_again(
    cell: Cell, kinds: tuple[str, str], confirmed: str | None
) -> None:
    """The first night after the knock has found it; only one after that has found it again."""
    lever = np.zeros((1, 3, 1))
    lever[0, 0, 0] = 1.0
    followed = SimpleNamespace(
        **{"machine": [0], "names": ("EX0C",), "units": ("mm",), "families": ("location",)},
        selection=SimpleNamespace(label=lambda name: name),
    )
    nights_before = [
        {
            **{"night": f"2026-10-{day:02d}", "kind": kind, "limits": [{"what": "volume", "passed": value < 0.01}], "alarms": []},
            **{"state": {"day": float(day)}, "parameters": {"EX0C": {"value": value, "std": 2e-4, "seen": True}}},
        }
        for day, (value, kind) in enumerate(zip((0.0, 0.0001, 0.0199, 0.02), ("full", "check", *kinds), strict=True), 1)
    ]
    after = SimpleNamespace(mean=[0.02], std=[2e-4], day=5.0)
    known = Known(cell, cast(Frame, followed), lever)
    (found,) = behind(known, nights_before[::-1], cast(State, after), {"what": "volume"})
    assert (found["confirmed"], found["cause"]) == (confirmed, "axis_location")


@pytest.mark.parametrize(
    ("sizes", "rate", "named"),
    [
        ((0.012, 0.020), 1e-8, ["EX0S", "EX0C"]),
        ((0.020, 0.005), 1e-8, ["EX0C"]),  # a quarter of what the other does
        ((0.020, 0.008), 1e-4, ["EX0C"]),  # it wanders as far in these days
    ],
)
def test_every_cause_of_a_crossed_limit_is_named_the_largest_first(
    cell: Cell, sizes: tuple[float, float], rate: float, named: list[str]
) -> None:
    names = ("EX0C", "EX0S")
    lever = np.zeros((1, 3, 2))
    lever[0, :2, :] = np.eye(2)
    followed = SimpleNamespace(
        **{"machine": [0, 1], "names": names, "units": ("mm", "mm"), "families": ("location", "location")},
        selection=SimpleNamespace(label=lambda name: name),
    )
    nights_before = [
        {
            **{"night": f"2026-10-{day:02d}", "kind": "check", "limits": [{"what": "volume", "passed": True}], "alarms": []},
            "state": {"day": float(day)},
            "parameters": {name: {"value": 0.0, "std": 2e-4, "seen": True} for name in names},
        }
        for day in (1, 2)
    ]
    after = SimpleNamespace(mean=np.array(sizes), std=np.array([2e-4, 2e-4]), day=3.0, rates=np.full(2, rate))
    found = behind(Known(cell, cast(Frame, followed), lever), nights_before[::-1], cast(State, after), {"what": "volume"})
    assert [x["parameter"] for x in found] == named
    limit = {"what": "volume", "value": 41.0, "unit": "µm", "limit": 30.0, "passed": False}
    told = headline({"status": "complete", "verdict": "out_of_limits", "alarms": [], "limits": [limit], "behind": found})
    assert all(x["text"] in told for x in found)


def test_since_when_says_which_nights_were_not_measured(tmp_path: Path) -> None:
    missing = {"kind": "none", "verdict": "not_measured", "touches": 0, "parameters": {}}
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(1), "touch\n1\n", knowledge(1))
        tonight = 20727.083  # 2026-10-01 02:00 UTC
        assert since(history, "M", tonight + 1).words == "last night"
        history.add_night(kept(2, status="failed", headline="not measured: no answer", **missing))
        history.add_night(kept(3, status="missed", headline="no measurement: no night began", **missing))
        found = since(history, "M", tonight + 3)
        assert (found.date, found.words) == ("2026-10-01", "2026-10-01 (2 nights not measured)")
        for days, told in ((30, "(29 nights not measured)"), (365, "(364 nights not measured: look whether the date")):
            assert told in since(history, "M", tonight + days).words, "also those that are not on record one by one"
        assert "(51 nights" in since(history, "M", tonight + 364, every_days=7).words
        before = known_before("M", cast(Ports, SimpleNamespace(past=history)))
    assert before["last_measured"] == "2026-10-01"
    record = night(**before)
    text = message(record, (), ())[1]
    assert "2 nights before were not measured" in record["headline"]
    assert "2026-10-03: no measurement: no night began" in text and "2026-10-02: not measured: no answer" in text


def test_a_morning_without_a_measurement_says_what_to_do_who_and_since_when() -> None:
    nothing = {"kind": "none", "status": "failed", "verdict": "not_measured", "touches": 0, "planned": 0}
    failed = {"check": "control", "passed": False, "found": "no answer", "do": "see that the control is on, and at the right port"}
    text = message(night(**nothing, why="preflight: no answer", preflight=[failed], last_measured="2026-10-02"), (), ())[1]
    assert "owner: Ann Meier" in text and "2026-10-02" in text and "right port. Nothing was moved." in text
    assert "nothing was measured\n" in text and "none night" not in text and "files in" not in text
    assert "what to do" in message(night(**nothing, why="the line is dead"), (), ())[1]


def test_a_message_carries_the_hash_by_which_a_shortened_history_shows() -> None:
    assert "18 entries, the newest is " + "ab" * 32 in message(night(), (), (), (18, "ab" * 32))[1]


def test_who_has_answered_is_shown_instead_of_how_to_answer() -> None:
    alarm = {"id": "2026-10-04-1", "text": "it moved", "since": "2026-10-03", "sigmas": 9.0, "instead": [], "owner": "Ann"}
    alarm |= {"on_part": "x", "do": "y", "cause": "axis_location", "parameter": "EX0C"}
    record = night(verdict="changed", alarms=[alarm])
    assert "to answer: tango history decide 2026-10-04-1 -C " in message(record, (), ())[1]
    text = message(record, (), (), None, [Decision("2026-10-04-1", "repaired", "Bo", "clamp", None, "2026-10-04T08:00:00Z")])[1]
    assert "to answer" not in text and re.search(r"answered: repaired by Bo, 2026-10-04: clamp", text)


def test_who_has_an_alarm_is_asked_for_what_comes_of_it_and_not_to_take_it_again() -> None:
    alarm = {"id": "2026-10-01-1", "text": "it moved", "since": "2026-09-30", "sigmas": 9.0, "instead": [], "night": "2026-10-01"}
    alarm |= {"on_part": "x", "do": "y", "cause": "axis_location", "parameter": "EX0C", "now": "", "total": None}
    asked = message(night(standing=[alarm | {"owner": "", "decision": None}]), (), ())[1]
    assert "to answer: tango history decide 2026-10-01-1" in asked and "--action acknowledge --owner NAME" in asked
    taken = message(night(standing=[alarm | {"owner": "Ann Meier", "decision": "acknowledge"}]), (), ())[1]
    assert "acknowledge --owner" not in taken
    assert re.search(
        r"when it has been put right: tango history decide 2026-10-01-1 .*--action repaired --owner 'Ann Meier'", taken
    )


@pytest.mark.parametrize(
    ("action", "until", "stands"),
    [("acknowledge", None, True), ("accept", None, False), ("repaired", None, False), ("ignore", "2026-10-20", False)],
)
def test_an_alarm_stands_until_it_is_accepted_repaired_or_for_a_while_ignored(
    tmp_path: Path, action: str, until: str | None, stands: bool
) -> None:
    alarm = {"id": "2026-10-02-1", "cause": "axis_location", "parameter": "EX0C", "size": 0.02, "text": "it moved since last night"}
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(2, alarms=[{**alarm, "since": "2026-10-01"}]))
        day = 20727.083 + 2
        (open_one,) = standing(history, "M", day, {}, "check")
        assert open_one["text"] == "it moved since 2026-10-01" and open_one["decision"] is None
        history.decide("M", Decision("2026-10-02-1", action, "Ann", until=until, utc="2026-10-02T08:00:00Z"))
        assert bool(standing(history, "M", day, {}, "check")) == stands
        assert bool(standing(history, "M", day + 30, {}, "check")) == (stands or until is not None)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("then", "verdict", "measured"),
    [(3, "changed", True), (3, "doubtful", False), (2, "changed", True)],  # 2: that night itself was a full one
)
def test_a_change_without_a_cause_asks_for_a_full_measurement_until_there_is_one(
    tmp_path: Path, then: int, verdict: str, measured: bool
) -> None:
    alarm = {"id": "2026-10-02-1", "cause": "unknown", "parameter": "several", "size": 0.0, "text": "it is not as it was"}
    alarm |= {"since": "2026-10-01", "on_part": "Not known before a full run.", "do": "Run the full measurement."}
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(2, alarms=[alarm], kind="full" if then == 2 else "check"))
        if then != 2:
            history.add_night(kept(then, kind="full", verdict=verdict))
        (told,) = standing(history, "M", 20727.083 + 4, {}, "check")
        assert ("Run the full" not in told["do"] and "Not known" not in told["on_part"]) == measured
        assert (f"2026-10-0{then}" in told["on_part"]) == measured
        (tonight,) = standing(history, "M", 20727.083 + 4, {"EX0C": {"value": 0.0}}, "full")
        assert "2026-10-05" in tonight["on_part"] and "answered" in tonight["do"]
        (doubted,) = standing(history, "M", 20727.083 + 4, {}, "full")
        assert doubted["do"] == told["do"]  # a full night in doubt has found nothing


def test_a_night_in_doubt_leaves_an_alarm_as_large_as_it_was_seen_last(tmp_path: Path) -> None:
    """A drift that has grown to three times its first size is not told with that first size because tonight knows nothing."""

    def known(micrometers: float) -> dict[str, Any]:
        return {"EX0C": {"value": micrometers * 1e-3, "change": 0.005, "std": 3e-4, "unit": "mm"}}

    alarm = {"id": "2026-10-02-1", "cause": "axis_location", "parameter": "EX0C", "size": 0.005, "std": 3e-4, "unit": "mm"}
    alarm |= {"text": "it moved", "since": "2026-10-01", "on_part_um": 10.0}
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(2, alarms=[alarm], parameters=known(105.0)))
        history.add_night(kept(3, parameters=known(115.0)))
        (told,) = standing(history, "M", 20727.083 + 4, {}, "check")
    assert told["total"] == pytest.approx(0.015, abs=1e-4)
    assert re.search(r"it was \+?15\.0 ± .* µm in the night ending 2026-10-03", str(told["now"]))


def test_what_is_ignored_is_said_all_the_same(tmp_path: Path) -> None:
    alarm = {"id": "2026-10-02-1", "cause": "axis_location", "parameter": "EX0C", "size": 0.02, "std": 0.001, "unit": "mm"}
    alarm |= {"text": "it moved", "since": "2026-10-01"}
    state = cast(Any, None)
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(2, alarms=[alarm]))
        assert ignored(history, "M", state, state, alarm, 20727.083 + 3) is None
        history.decide("M", Decision("2026-10-02-1", "ignore", "Ann", until="2026-10-20", utc="2026-10-02T08:00:00Z"))
        told = ignored(history, "M", state, state, alarm, 20727.083 + 3)
        assert told is not None and not told["beyond"] and told["seen"] == "+20.0 ± 1.0 µm"
        assert ignored(history, "M", state, state, alarm | {"parameter": "EY0C"}, 20727.083 + 3) is None
        assert ignored(history, "M", state, state, alarm, 20727.083 + 30) is None
        larger = ignored(history, "M", state, state, alarm | {"size": 0.035}, 20727.083 + 3)
        assert larger is not None and larger["beyond"]
    record = night(ignored=[told], change={"p_value": 1e-9})
    assert headline(record).startswith("no alarm, as Ann ignores it until 2026-10-20: it moved")


def test_half_a_night_and_what_the_diagnosis_cannot_explain_are_doubtful_and_say_so() -> None:
    half = believed(
        NightDoubt("doubtful", ("40 of 74 touches are missing",), incomplete=True), {}, [{"cause": "stylus", "text": "t"}], False
    )
    assert not half.believed and "taken by themselves the touches would say: t" in half.reasons
    left = believed(NightDoubt("trustworthy"), {"verdict": "unexplained", "unexplained": [{"text": "waves along X."}]}, [], False)
    assert left.verdict == "doubtful" and left.believed and "waves along X" in left.reasons[0]
    part = {"shape": "no pattern", "text": "the residuals follow X."}
    for size, noise in ((0.4, 0.7), (0.8, 0.1), (1.9, 2.2)):
        told = {"verdict": "unexplained", "noise_um": noise, "unexplained": [part | {"amplitude_um": size}]}
        small = believed(NightDoubt("trustworthy"), told, [], False)
        assert small.verdict == "trustworthy" and small.believed and not small.reasons  # by chance, and too small for parts
    for sizes in ((1.2,), (0.8, 0.8), (0.0,)):
        told = {"verdict": "unexplained", "noise_um": 0.7, "unexplained": [part | {"amplitude_um": s} for s in sizes]}
        assert believed(NightDoubt("trustworthy"), told, [], False).verdict == "doubtful", sizes
    one = believed(
        NightDoubt("trustworthy"),
        {"verdict": "unexplained", "unexplained": [{"shape": "near", "text": "step or time."}]},
        [],
        False,
    )
    assert one.verdict == "trustworthy" and one.believed  # a name or a shape: one of both explains every touch
    knocked = believed(NightDoubt("trustworthy"), {}, [{"cause": "axis_location", "text": "t", "instead": []}], False)
    assert knocked.believed and knocked.verdict == "trustworthy"


def test_a_limit_that_is_crossed_comes_before_what_has_changed() -> None:
    limit = {"what": "volume", "value": 75.9, "unit": "µm", "low": 74.0, "high": 77.8, "limit": 60.0, "passed": False}
    alarm = {"id": "1", "text": "C axis has moved along X by +20 µm", "since": "2026-10-03", "sigmas": 40.0, "rate_per_day": None}
    alarm |= {"on_part": "Parts are off.", "do": "Ask.", "owner": "Ann", "unit": "mm", "size": 0.02}
    record = night(verdict="out_of_limits", alarms=[alarm], limits=[limit])
    assert record["headline"] == "volume is 75.9 µm, 60 µm are allowed: C axis has moved along X by +20 µm"
    subject, text = message(record, (), ())
    assert "OUT OF LIMITS, HAS CHANGED" in subject and text.index("BEYOND 60") < text.index("* C axis has moved") < text.index(
        "since the night ending 2026-10-04"  # as on the page: the night that found it
    )
    assert text.count("BEYOND") == 1


@pytest.mark.long
@pytest.mark.parametrize("walk", [1.9, 4.0])  # times the scatter; the smaller one by chance on one quiet night of a trunnion
def test_a_night_that_is_as_predicted_has_not_wandered(root: Path, monkeypatch: pytest.MonkeyPatch, walk: float) -> None:
    """By chance, the readings of a quiet run look like a drift that the machine's errors could make as well."""
    folder = root / "examples" / "trunnion"
    cell, truth = read_cell(folder), read_world(folder / "world.yaml")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, truth, seed=4)
    quiet = estimate(cell.machine, cell.artefact, readings, cell.terms)
    by_chance = replace(quiet, sigma=3e-3, noise=Noise(quiet.sigma, walk=walk * quiet.sigma))
    monkeypatch.setattr("tango_cnc.noise.honest", lambda result: by_chance)
    alone, agreed = (_judged(cell, readings, quiet, "full", agrees) for agrees in (False, True))
    assert alone.verdict == "doubtful" and alone.walk == pytest.approx(walk) and ("wandered" in alone.wandered) == (walk > 3)
    assert agreed.verdict == "trustworthy" and not agreed.wandered and agreed.walk == 0


@pytest.mark.long
def test_a_first_night_is_not_in_doubt_by_a_drift_that_nobody_can_tell_from_none(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing predicts the first night. A drift that errors of the machine could make as well comes out large by chance."""
    folder = root / "examples" / "trunnion"
    cell, truth = read_cell(folder), read_world(folder / "world.yaml")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, truth, seed=4)
    quiet = estimate(cell.machine, cell.artefact, readings, cell.terms)
    by_chance = replace(quiet, sigma=3e-3, noise=Noise(quiet.sigma, walk=0.7 * quiet.sigma, chance=2.9e-3))
    monkeypatch.setattr("tango_cnc.noise.honest", lambda result: by_chance)
    assert _judged(cell, readings, quiet, "full").verdict == "trustworthy"
    scattered = replace(by_chance, noise=Noise(quiet.sigma, walk=0.7 * quiet.sigma))  # the same scatter, and no drift to explain it
    monkeypatch.setattr("tango_cnc.noise.honest", lambda result: scattered)
    assert _judged(cell, readings, quiet, "full").verdict == "doubtful"


def test_a_change_behind_a_limit_that_is_an_open_alarm_is_said_once() -> None:
    """ "+22 µm since the 12th; alarm of the 12th: +20 µm since the 12th" read as two movements."""
    text = {size: say("changed.unnamed", name="EY0C", size=size, since="2026-10-03") for size in ("+20 µm", "+22 µm")}
    one = {"parameter": "EY0C", "since": "2026-10-03", "night": "2026-10-04", "owner": "Ann", "decision": None, "now": ""}
    limit = {"what": "volume", "value": 85.5, "unit": "µm", "limit": 60.0, "passed": False}
    alarm = one | {"id": "2026-10-04-1", "text": text["+20 µm"]}
    behind = [one | {"what": "volume", "text": text["+22 µm"]}, {"what": "volume", "parameter": "EX0C", "text": "C axis is off"}]
    more = {"verdict": "out_of_limits", "limits": [limit], "standing": [alarm], "behind": behind, "end_utc": "2026-10-09T02:04:00Z"}
    record = night(**more)
    assert record["headline"] == (
        f"volume is 85.5 µm, 60 µm are allowed: alarm of 2026-10-04: {text['+22 µm']}; "
        "nobody has answered the alarm of 2026-10-04; C axis is off"
    )
    dated = text["+22 µm"].replace("2026-10-03", "the night ending 2026-10-04")
    assert f"alarm of 2026-10-04: {dated}; Bo has it; C axis is off" in as_decided(
        record, [Decision("2026-10-04-1", "acknowledge", "Bo", "", None, "2026-10-09T08:00:00Z")]
    )
    other = night(**{**more, "standing": [alarm | {"since": "2026-10-01"}]})["headline"]
    assert "+22 µm" in other and "+20 µm" in other  # another movement of the same axis


def test_a_line_of_an_alarm_says_what_was_decided_since() -> None:
    told = {
        "id": "2026-10-04-1",
        "text": "it moved",
        "since": "2026-10-03",
        "sigmas": 9.0,
        "instead": [],
        "owner": "Ann",
        "now": "",
    }
    told |= {"on_part": "x", "do": "y", "cause": "axis_location", "parameter": "EX0C", "night": "2026-10-04", "decision": None}
    record = night(verdict="changed", standing=[told])

    def line(*actions: str) -> str:
        decisions = [Decision("2026-10-04-1", action, "Bo", "", None, "2026-10-05T08:00:00Z") for action in actions]
        return next(x for x in message(record, (), (), None, decisions)[1].splitlines() if x.startswith("* alarm of 2026-10-04"))

    assert "alarm of 2026-10-04, not answered: it moved" in line()
    assert "alarm of 2026-10-04, repaired: it moved" in line("acknowledge", "repaired")
    assert "Bo has acknowledged it" in line("acknowledge") and "not answered" not in line("acknowledge")


def test_the_headline_of_a_night_says_who_has_answered_since() -> None:
    told = {"id": "a-1", "text": "it moved", "night": "2026-10-04", "now": "", "owner": "Ann", "decision": None}
    record = {"standing": [told], "verdict": "changed", "limits": [], "alarms": [], "end_utc": "2026-10-05T02:04:00Z"}
    record = night(**record) | {"headline": headline(night(**record))}

    def said(*decisions: Decision) -> str:
        return as_decided(record, decisions)

    def by(action: str, utc: str = "2026-10-05T08:00:00Z", until: str | None = None, alarm: str = "a-1") -> Decision:
        return Decision(alarm, action, "Bo", "", until, utc)

    assert said() == record["headline"] and said().endswith("nobody has answered the alarm of 2026-10-04")
    assert said(by("acknowledge")).endswith("; Bo has it")
    assert said(by("acknowledge"), by("repaired")).endswith("; Bo has repaired it (2026-10-05)")
    assert said(by("accept")).endswith("; Bo has accepted it (2026-10-05)")
    assert said(by("ignore", until="2026-11-01")).endswith("; Bo ignores it until 2026-11-01")
    assert said(by("repaired", alarm="a-2")) == said() == said(by("repaired", utc="2026-10-05T01:00:00Z"))
    assert as_decided({**record, "headline": "by hand"}, (by("repaired"),)) == "by hand"


def test_the_headline_counts_only_alarms_that_are_still_open() -> None:
    told = {"text": "it moved", "night": "2026-10-04", "now": "", "owner": "Ann", "decision": None}
    standing_ones = [told | {"id": f"a-{n}"} for n in (1, 2, 3)]
    record = night(standing=standing_ones, verdict="changed", end_utc="2026-10-05T02:04:00Z")

    def said(*closed: str, action: str = "accept") -> str:
        return as_decided(record, [Decision(alarm, action, "Bo", "", None, "2026-10-05T08:00:00Z") for alarm in closed])

    assert said().endswith("more open alarms: 2") and said("a-1", "a-2").endswith("more open alarms: 1")
    assert said("a-2").endswith("more open alarms: 1") and "more open" not in said("a-1", "a-2", "a-3")
    assert said("a-2", action="acknowledge").endswith("more open alarms: 2")


def test_beyond_a_limit_the_headline_names_the_gravest_alarm_that_stands_and_counts_the_others() -> None:
    limit = {"what": "volume", "value": 75.9, "unit": "µm", "limit": 60.0, "passed": False}
    told = {"night": "2026-10-04", "now": "", "owner": "Ann", "decision": None}
    standing_ones = [told | {"id": "a-1", "text": "C has moved by +20 µm"}, told | {"id": "a-2", "text": "it drifts"}]
    record = night(standing=standing_ones, limits=[limit], verdict="out_of_limits", end_utc="2026-10-05T02:04:00Z")
    begins = "volume is 75.9 µm, 60 µm are allowed: alarm of 2026-10-04: C has moved by +20 µm; "
    assert record["headline"] == f"{begins}nobody has answered the alarm of 2026-10-04; more open alarms: 1"

    def said(alarm: str) -> str:
        return as_decided(record, [Decision(alarm, "accept", "Bo", "", None, "2026-10-05T08:00:00Z")])

    assert said("a-1") == f"{begins}Bo has accepted it (2026-10-05); more open alarms: 1"
    assert said("a-2").endswith("nobody has answered the alarm of 2026-10-04")
    knocked = night(**{**record, "alarms": [told | {"id": "a-3", "text": "A has moved", "parameter": "EZ0A"}]})
    assert knocked["headline"] == "volume is 75.9 µm, 60 µm are allowed: A has moved; more open alarms: 2"
    plain = night(**{**knocked, "limits": [], "verdict": "changed"})
    assert plain["headline"] == "A has moved; more open alarms: 2"


def test_a_headline_counts_no_alarm_that_it_names_behind_the_limit_and_says_who_has_it() -> None:
    """Two open alarms, both named, and "more open alarms: 1" behind them; the one of an earlier night without who has it."""
    limit = {"what": "volume", "value": 75.9, "unit": "µm", "limit": 60.0, "passed": False}
    told = {"night": "2026-10-04", "now": "", "owner": "Ann", "decision": None, "parameter": "EY0C", "since": "2026-10-03"}
    old = told | {"id": "a-1", "text": "C has moved by +20 µm"}
    behind = [told | {"what": "volume", "text": "C has moved by +21 µm"}]
    new = told | {"id": "a-2", "text": "it is warmer", "parameter": "temperature", "since": "2026-10-04"}
    more = {"limits": [limit], "behind": behind, "verdict": "out_of_limits", "end_utc": "2026-10-05T02:04:00Z"}
    record = night(**more, alarms=[new], standing=[old])
    begins = "volume is 75.9 µm, 60 µm are allowed: alarm of 2026-10-04: C has moved by +21 µm; "
    assert record["headline"] == f"{begins}nobody has answered the alarm of 2026-10-04; it is warmer"

    def said(*alarms: str) -> str:
        return as_decided(record, [Decision(alarm, "acknowledge", "Bo", "", None, "2026-10-05T08:00:00Z") for alarm in alarms])

    assert said() == record["headline"] and said("a-1") == f"{begins}Bo has it; it is warmer"
    assert said("a-1", "a-2") == f"{begins}Bo has it; it is warmer; Bo has it"
    two = [*behind, {**behind[0], "parameter": "EX0C", "text": "C along X"}]
    quiet = night(**{**more, "behind": two}, standing=[old, {**old, "id": "a-3", "parameter": "EX0C", "text": "C along X"}])
    assert quiet["headline"].count("nobody has answered") == 2 and "more open" not in quiet["headline"]


@pytest.mark.parametrize(
    ("known", "order"), [("out_of_limits", "Make no parts"), ("doubtful", "Make no parts"), ("good", "Measure")]
)
def test_the_mail_of_a_night_without_a_measurement_begins_as_its_page(known: str, order: str) -> None:
    """91 µm the night before, 75 allowed: "Measure the first part before you go on" in the mail, "Make no parts" on the page."""
    told = {"verdict": "not_measured", "status": "failed", "kind": "none", "last_measured": "2026-10-04", "last_verdict": known}
    text = message(night(**told, why="no answer"), (), ())[1]
    assert text.splitlines()[1].startswith(order), text


def test_a_list_of_nights_keeps_the_knock_of_the_night_that_found_it() -> None:
    """Three errors stood behind the limit every night; the list said the same of all nights and left the knock out."""
    limit = {"what": "volume", "value": 75.9, "unit": "µm", "limit": 60.0, "passed": False}
    parts = {p: changed(p, "+3 µm", "last week") for p in ("EY0C", "EB0C")}
    behind = [{"what": "volume", "parameter": p, "text": text} for p, text in parts.items()]
    quiet = night(limits=[limit], behind=behind, verdict="out_of_limits")["headline"]
    alarm = {"id": "1", "parameter": "EX0C", "text": changed("EX0C", "+20 µm")}
    knocked = night(limits=[limit], behind=behind, verdict="out_of_limits", alarms=[alarm])["headline"]
    assert shortened([quiet, knocked, quiet, quiet])[1] == knocked and shortened([quiet, quiet])[1] != quiet


def test_the_headline_of_a_crossed_limit_begins_with_what_made_it_and_not_with_what_is_new() -> None:
    limit = {"what": "volume", "value": 45.2, "unit": "µm", "limit": 40.0, "passed": False}
    alarm = {"text": "C tilted", "parameter": "EB0C"}
    behind = {"what": "volume", "parameter": "EY0C", "text": "most of it comes from EY0C"}
    told = headline(night(verdict="out_of_limits", alarms=[alarm], limits=[limit], behind=[behind]))
    assert "40 µm are allowed: most of it comes from EY0C; C tilted" in told
    own = headline(night(verdict="out_of_limits", alarms=[alarm], limits=[limit], behind=[behind | {"parameter": "EB0C"}]))
    assert "40 µm are allowed: C tilted" in own


def test_what_stands_behind_a_limit_is_told_once() -> None:
    about: dict[str, Any] = {
        "text": "it moved",
        "on_part": "x",
        "do": "y",
        "cause": "axis_location",
        "instead": [],
        "rate_per_day": None,
    }
    alarm = about | {"id": "a-1", "since": "2026-10-03", "sigmas": 9.0, "owner": "Ann", "parameter": "EX0C"}
    limit = {"what": "volume", "value": 70.0, "unit": "µm", "limit": 60.0, "passed": False}
    for name, times in (("EX0C", 1), ("EB0Z", 2)):
        causes = [about | {"what": "volume", "parameter": name}]
        text = message(night(verdict="out_of_limits", alarms=[alarm], limits=[limit], behind=causes), (), ())[1]
        assert "behind volume: it moved" in text and text.count("what to do: y") == times


def test_the_command_that_answers_names_the_cell_and_counts_have_their_number() -> None:
    assert (
        answer("2026-10-04-1", "/cells/big mill")
        == "tango history decide 2026-10-04-1 -C '/cells/big mill' --action acknowledge --owner NAME"
    )
    assert (
        answer("2026-10-04-1", ".", "x.db") == "tango history decide 2026-10-04-1 --history x.db --action acknowledge --owner NAME"
    )
    assert "history: 1 entry, " + "ab" * 32 in message(night(), (), (), (1, "ab" * 32))[1]


def test_a_night_whose_history_cannot_be_read_does_not_say_that_it_never_measured() -> None:
    nothing = {"kind": "none", "status": "failed", "verdict": "not_measured", "why": "disk I/O error"}
    assert "was never measured by a night" in message(night(**nothing), (), ())[1]
    assert "cannot be read" in (text := message(night(**nothing, unread=True), (), ())[1]) and "never measured" not in text


@pytest.mark.parametrize(("now", "gone"), [(0.0, True), (0.02, False)])
def test_an_alarm_that_has_gone_again_is_not_found_again(tmp_path: Path, now: float, gone: bool) -> None:
    alarm = {"id": "2026-10-02-1", "cause": "axis_location", "parameter": "EX0C", "size": 0.02, "text": "it moved", "do": "ask"}
    numbers = {"std": 0.0002, "unit": "mm", "seen": True}
    with opened(tmp_path / "history.db") as history:
        then = numbers | {"value": 0.02, "change": 0.02}
        history.add_night(kept(2, alarms=[{**alarm, "since": "2026-10-01"}], parameters={"EX0C": then}))
        (told,) = standing(history, "M", 20727.083 + 2, {"EX0C": numbers | {"value": now}}, "full")
    assert bool(told["confirmed"]) != gone and told["do"].startswith("Ask who was" if gone else "ask") and bool(told["now"])
