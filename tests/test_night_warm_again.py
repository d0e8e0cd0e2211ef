"""A machine that was warm and is as warm as before: its alarm has gone again, and says how warm the machine is by now."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.nights import knock, night
from support.nights_parts import Event, Story, nights
from support.spoilt import simulated

from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.nightly.doubt import NightDoubt
from tango_cnc.nightly.last_known import as_known_last
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.warmth import as_sure_as, as_warm_as, with_warmth
from tango_cnc.report.faults import faults
from tango_cnc.report.plain import plain
from tango_cnc.report.texts import texts
from tango_cnc.report.tonight import is_gone
from tango_cnc.report.units import Units
from tango_cnc.state.effect import moved_on_parts, on_parts
from tango_cnc.texts import say


@pytest.fixture(scope="module")
def mornings(root: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Warm on night 3, as before on night 4 and 5."""
    cell, truth = read_cell(root / "examples" / "hu40t"), read_world(root / "examples" / "hu40t" / "world.yaml")
    cell = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::4]))
    story = Story((Event(3, warmer=7.0), Event(4, warmer=-6.6), Event(5, warmer=0.3)), simulated.THIRTY.warm, 0.1)
    with opened(tmp_path_factory.mktemp("warm") / "history.db") as history:
        return [r for r, _ in nights(cell, truth, history, 5, 2, story, Nightly(diagnose=False, check_minutes=2))]


@pytest.mark.few(0)
def test_the_alarm_of_a_warm_night_has_gone_when_the_machine_is_as_warm_as_before(mornings: list[dict[str, Any]]) -> None:
    warm, cold = mornings[2], mornings[4]
    assert [a["cause"] for a in warm["alarms"]] == ["temperature"], warm["headline"]
    (alarm,) = [a for a in cold["standing"] if a["cause"] == "temperature"]
    assert is_gone(alarm["now"]) and "the machine is at 2" in alarm["now"] and "Have the alarm closed while" in alarm["do"]
    assert abs(alarm["total"]) < 0.3 * alarm["size"]
    text = " ".join(message(cold, (), ())[1].split())
    assert "gone again: the machine is at" in text and "STILL CHANGED" not in message(cold, (), ())[0]
    told = faults(cold, cold["standing"], {}, Units(), texts())
    assert told[0]["gone"] and "about as warm as before" in told[0]["text"] and "Ask who" not in told[0]["todo"]


@pytest.mark.few(0)
def test_what_warm_does_to_parts_is_that_of_the_alarms_of_an_axis(root: Path, mornings: list[dict[str, Any]]) -> None:
    """The tip after the best set-up is off by less than a part, which is set up once."""
    cell = read_cell(root / "examples" / "trunnion")
    alone = on_parts(cell, "EY0C", 0.0142)
    assert alone is not None and moved_on_parts(cell, {"EY0C": 0.0142, "facet 1": 1.0}) == pytest.approx(alone.worst)
    assert moved_on_parts(cell, {"EY0C": 0.0142, "EX0S": 0.0057}) == pytest.approx(30.6, abs=0.05)
    warm = mornings[2]["alarms"][0]
    assert warm["on_part_um"] > 1.2 * warm["size"] * 1e3


def test_one_that_is_still_warm_says_how_warm() -> None:
    alarm = {"cause": "temperature", "size": 0.02, "do": "Wait.", "warmer": {"then": 19.0, "kelvin": 7.0, "celsius": 26.0}}
    hot = as_warm_as([alarm], 25.0)[0]
    assert (
        "the machine is at 25.0 °C, +6.0 K from 19.0 °C before" in hot["now"] and hot["do"] == "Wait." and not is_gone(hot["now"])
    )
    assert as_warm_as([alarm], None) == [alarm] and as_warm_as([alarm | {"cause": "scale"}], 19.0)[0]["cause"] == "scale"
    assert is_gone(as_warm_as([alarm], 18.0)[0]["now"])


def test_an_error_that_went_back_with_the_temperature_asks_nobody_who_was_there() -> None:
    """ "See whether it goes back with the temperature" was its order; then both were back, and "Ask who was at the machine"."""
    gone = say("night.alarms.gone_again_left", told="+0.4 ± 0.3 µm")
    alarm = {"cause": "axis_location", "size": -0.0038, "do": say("night.gone_do"), "now": gone}
    alarm |= {"warmer": {"then": 22.0, "kelvin": -3.5, "celsius": 18.5}}
    (back,) = as_warm_as([alarm], 22.5)
    assert "about as warm as before it (22.5 °C, 22.0 °C then)" in back["do"] and "Ask who" not in back["do"]
    assert as_warm_as([alarm], 19.0) == [alarm]  # it is still cold, and the error has gone all the same
    assert as_warm_as([alarm], 22.5, False) == [alarm]  # no sensor says so tonight
    still = alarm | {"now": say("night.alarms.still_there", told="-3.8 µm")}
    assert as_warm_as([still], 22.5) == [still]


@pytest.mark.parametrize("believed", [True, False])
def test_one_that_is_as_far_off_on_the_other_side_has_not_gone(believed: bool) -> None:
    """3.5 K colder, then 6 K warmer than usual: "gone again", and "about as warm as before, and 15 µm is left"."""
    alarm = {"cause": "temperature", "size": 0.0137, "do": "Wait.", "warmer": {"then": 22.0, "kelvin": -3.5, "celsius": 18.5}}
    (told,) = as_warm_as([alarm], 28.0, believed)
    assert not is_gone(told["now"]) and "ended" not in told and told["do"] == "Wait."
    assert "28.0 °C" in told["now"] and "+6.0 K from 22.0 °C before" in told["now"] and "off the other way" in told["now"]
    assert is_gone(as_warm_as([alarm], 23.0, believed)[0]["now"])


@pytest.mark.few(0)
def test_parts_in_question_end_with_the_first_night_that_found_it_gone(mornings: list[dict[str, Any]]) -> None:
    """ "between 2026-11-16 … and the day on which it went back": that day was on record, and had no date."""
    first, later = mornings[3], mornings[4]
    for record in (first, later):
        (alarm,) = [a for a in record["standing"] if a["cause"] == "temperature"]
        assert alarm["gone_by"] == first["night"]
        assert f"and {first['night']}, the first night without it again" in " ".join(message(record, (), ())[1].split())
        assert "the first night without it again" in faults(record, record["standing"], {}, Units(), texts())[0]["on_part"]


def test_without_a_sensor_that_is_believed_it_stays_gone_and_says_from_when_that_is() -> None:
    alarm = {"cause": "temperature", "size": 0.02, "do": "Wait.", "warmer": {"then": 19.0, "kelvin": 7.0, "celsius": 26.0}}
    cold, hot = (as_warm_as([alarm], at, False)[0] for at in (19.5, 25.0))
    assert (
        is_gone(cold["now"])
        and "was at 19.5 °C when its sensor was last believed" in cold["now"]
        and "Have the alarm closed" in cold["do"]
    )
    assert not is_gone(hot["now"]) and "was at 25.0 °C when its sensor was last believed" in hot["now"] and hot["do"] == "Wait."


def test_an_alarm_names_the_night_that_its_size_is_counted_from() -> None:
    """+4.0 µm since the 12th and 1.1 K since the 13th were 3.6 µm/K; the machine does 2."""

    def night(number: int, celsius: float) -> dict[str, Any]:
        return {"night": f"2026-11-{number}", "temperatures": {"bed": {"mean": celsius, "first": celsius, "last": celsius}}}

    alarm = {"cause": "axis_location", "parameter": "EY0C", "size": 0.004, "std": 3e-4, "unit": "mm", "do": "Ask.", "instead": []}
    alarm |= {"text": "C axis has moved", "since": "2026-11-12", "rate_per_day": 0.002}
    known, heard = {"EY0C": {"value": 0.1, "unit": "mm", "std": 1e-4}}, {"bed": {"state": "heard"}}
    told = with_warmth(alarm, known, heard, 21.47, [night(13, 20.37), night(12, 19.37)])
    assert told["warmer"]["night"] == "2026-11-12" and "2.1 K warmer (bed 21.5 °C) than on 2026-11-12" in told["do"]


def test_temperature_is_not_what_else_it_may_be_once_the_machine_is_as_warm_as_before() -> None:
    """One sensor in °F beside a knock; it is right again, and the machine as warm as in the night before the knock."""
    before = {"night": "2026-11-17", "temperatures": {"bed": {"mean": 20.2, "first": 20.2, "last": 20.2}}}
    do = say("night.sensors.do_doubted", do=say("cause.axis_location.do"), names="bed")
    alarm = {"cause": "axis_location", "since": "2026-11-17", "instead": ["temperature", "stylus"], "do": do, "size": 0.018}
    alarm |= {"now": say("night.alarms.still_there", told="+17.9 ± 0.3 µm")}
    (sure,) = as_sure_as([alarm], 19.9, [before])
    assert sure["instead"] == ["stylus"] and sure["do"] == say("cause.axis_location.do")
    gone = alarm | {"now": say("night.alarms.gone_again_left", told="0.1 µm")}
    for other, now in ((alarm, None), (alarm, 22.0), (gone, 19.9), (alarm | {"since": "2026-11-02"}, 19.9)):
        assert as_sure_as([other], now, [before]) == [other]


@pytest.mark.few(0)
def test_a_night_that_measured_nothing_says_that_a_warm_night_has_gone_again(root: Path, tmp_path: Path) -> None:
    cell, truth = read_cell(root / "examples" / "hu40t"), read_world(root / "examples" / "hu40t" / "world.yaml")
    cell = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::4]))
    story = Story((Event(3, warmer=7.0), Event(4, warmer=-6.6)), simulated.THIRTY.warm, 0.1)
    with opened(tmp_path / "history.db") as history:
        records = [r for r, _ in nights(cell, truth, history, 4, 2, story, Nightly(diagnose=False, check_minutes=2))]
        world = SimpleNamespace(past=history, happened=())
        day = float(records[-1]["state"]["day"]) + 1
        waiting, silent = as_known_last(world, str(records[0]["machine"]), day, "2099-01-01")  # type: ignore[arg-type]
    (alarm,) = [a for a in waiting if a["cause"] == "temperature"]
    assert is_gone(alarm["now"]) and "last believed" in alarm["now"] and not silent
    assert alarm["gone_by"] == records[-1]["night"] and alarm["do"] == say("night.sensors.warm_gone_do")


@pytest.mark.few(0)
def test_a_night_in_doubt_does_not_bring_back_a_warm_night_that_has_gone(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its touches are not believed; its sensor is, and says that the machine is as warm as before."""
    cell, truth = read_cell(root / "examples" / "hu40t"), read_world(root / "examples" / "hu40t" / "world.yaml")
    cell = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::4]))
    story, records = Story((Event(3, warmer=7.0), Event(4, warmer=-6.6)), simulated.THIRTY.warm, 0.1), list[dict[str, Any]]()
    doubt = NightDoubt("doubtful", ("something is missing",), believed=False)
    with opened(tmp_path / "history.db") as history:
        for record, _ in nights(cell, truth, history, 5, 2, story, Nightly(diagnose=False, check_minutes=2)):
            records.append(record)
            if len(records) == 4:
                monkeypatch.setattr("tango_cnc.nightly.analysis.believed", lambda *_: doubt)
    last = records[-1]
    (alarm,) = [a for a in last["standing"] if a["cause"] == "temperature"]
    assert last["verdict"] == "doubtful" and is_gone(alarm["now"]) and "the machine is at" in alarm["now"]
    assert alarm["gone_by"] == records[3]["night"]


def test_the_minus_of_a_temperature_is_that_of_a_length_on_a_page() -> None:
    told = plain("gone again: the machine is at 20.3 °C, -0.1 K from 20.4 °C before, -3 µm", Units(), texts())
    assert "−0.1 K" in told and "−3 µm" in told and "-" not in told


@pytest.mark.parametrize("cause", ["axis_location", "temperature"])
def test_what_has_gone_back_by_a_size_that_no_night_says_is_not_left_whole(cause: str) -> None:
    """It said that 20 µm of 20 µm is left."""
    alarm = knock("2026-11-02") | {"night": "2026-11-02", "cause": cause, "parameter": cause, "total": None, "decision": None}
    alarm |= {"now": say("night.alarms.gone_again_left", told="0.1 µm")}
    (told,) = faults(night("M", 10, "changed", standing=[alarm]), [alarm], {}, Units(), texts())
    assert told["gone"] and "is left" not in told["text"]
    assert "It has gone back since." in told["text"] or "about as warm as before." in told["text"]
