"""A temperature sensor that speaks and is not to be believed is named, and the others count in its place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tango_cnc.nightly.mail import message
from tango_cnc.nightly.sensors import by_how_much, counted, how_warm, see_to_it_first, states, told
from tango_cnc.records import Readings
from tango_cnc.texts import instead, say


def read(**sensors: float) -> Readings:
    count = 4
    nothing = np.zeros((count, 1))
    ones = np.ones(count, dtype=np.int64)
    return Readings(
        ("X",),
        np.arange(1, count + 1),
        np.arange(count, dtype=float),
        (1,) * count,
        nothing,
        nothing,
        ("ok",) * count,
        ones,
        ones,
        temperatures={name: value + np.linspace(0.0, 0.1, count) for name, value in sensors.items()},
    )


def follow(*each: Readings, wait: int = 1) -> list[dict[str, Any]]:
    """readings of nights, days before the last one → their records, newest first, as far as sensors go."""
    records: list[dict[str, Any]] = []
    for day, readings in enumerate(each, 1):
        last = day == len(each) and wait > 1
        night = "2026-12-28" if last else f"2026-10-{day:02d}"
        records.insert(0, {"night": night, "sensors": states(readings, records, night)})
    return records


SHOP = (19.4, 20.4, 21.5, 21.2, 19.7, 18.6)


def four(bed: float, t: float | None = None) -> Readings:
    t = bed if t is None else t
    return read(bed=bed, table=t - 0.4, air=t + 1.0, bar=t - 0.5)


NIGHTS = [four(t) for t in SHOP]


def doubts(record: dict[str, Any]) -> list[str]:
    return [n for n, s in record["sensors"].items() if s["state"] == "doubted"]


@pytest.mark.parametrize("said", [66.13, 0.0, 85.0, -40.0, 292.1])
def test_a_sensor_that_leaves_the_others_is_in_doubt_and_they_count(said: float) -> None:
    records = follow(*NIGHTS, four(said, 18.96))
    bed = records[0]["sensors"]["bed"]
    assert doubts(records[0]) == ["bed"] and bed["by"] == ["air", "bar", "table"] and bed["since"] == "2026-10-06"
    assert bed["counts"] == pytest.approx(18.96 + 0.05, abs=0.01) and bed["mean"] == pytest.approx(said + 0.05)
    filled = counted(four(said, 18.96), records[0]["sensors"]).temperatures["bed"]
    assert float(filled.mean()) == pytest.approx(bed["counts"], abs=1e-3)
    found = told(records[0]["sensors"], "bed", records[0]["night"])
    assert f"bed says {said + 0.05:.1f} °C and is not believed" in found["text"] and "rests on air, bar, table" in found["text"]
    assert (found["rests"], found["doubted"]) == ("others", ["bed"]) and "its unit, its cable" in found["text"]
    scale = {"cause": "scale", "do": "Check the scale.", "instead": ["temperature"]}
    asked, knocked = see_to_it_first([scale, scale | {"instead": []}], found)
    assert asked["do"].startswith("See first whether the temperature sensor says the truth (bed)")
    assert knocked["do"] == "Check the scale." and knocked["instead"] == []  # three others are believed, and it is a knock
    # it says so every night, and is believed again when it is right again
    more = follow(*NIGHTS, *[four(said + k, 18.96) for k in (0.0, 0.4, -0.3)], four(19.14))
    assert [doubts(r) for r in more[1:4]] == [["bed"]] * 3 and more[1]["sensors"]["bed"]["since"] == "2026-10-06"
    assert doubts(more[0]) == []


def test_degrees_fahrenheit_without_a_unit_are_said_to_be_that() -> None:
    records = follow(*NIGHTS, four(66.13, 18.96))
    assert "read in °F it would be 19.0 °C" in told(records[0]["sensors"], "bed", "2026-10-07")["text"]
    assert "read in" not in told(follow(*NIGHTS, four(85.0, 18.96))[0]["sensors"], "bed", "2026-10-07")["text"]


def test_two_sensors_that_contradict_leave_the_one_in_doubt_that_has_jumped() -> None:
    nights = [read(bed=t, air=t + 1.0) for t in SHOP]
    assert doubts(follow(*nights, read(bed=38.0, air=20.0))[0]) == ["bed"]
    assert doubts(follow(*nights, read(bed=19.0, air=0.0))[0]) == ["air"]
    assert doubts(follow(read(bed=68.0, air=20.0))[0]) == ["bed"]  # the first night of both
    assert doubts(follow(read(bed=68.0, air=20.0, bar=19.0))[0]) == ["bed"]


def test_a_sensor_alone_that_jumps_as_no_shop_does_is_in_doubt_and_what_it_said_last_counts() -> None:
    nights = [read(bed=t) for t in SHOP]
    newest = follow(*nights, read(bed=66.1))[0]
    assert newest["sensors"]["bed"]["state"] == "doubted" and newest["sensors"]["bed"]["counts"] == pytest.approx(18.65)
    found = told(newest["sensors"], None, newest["night"])
    assert (found["rests"], found["doubt"]) == ("earlier", True) and "no shop does that" in found["text"]
    assert doubts(follow(*nights, read(bed=66.1), wait=60)[0]) == []  # of a shop that stood still nobody knows
    everything = follow(*NIGHTS, four(66.1))[0]  # an agent that now speaks another unit
    assert sorted(doubts(everything)) == ["air", "bar", "bed", "table"]


def test_what_shops_and_spindles_do_is_no_doubt() -> None:
    warm = [four(t) for t in (18.0, 26.0, 14.0, 30.0, 12.0, 32.0)]  # a hall without heating
    assert not any(doubts(r) for r in follow(*NIGHTS, *warm))
    first = read(spindle=36.0, bed=21.0)
    hot = [read(spindle=s, bed=20.0 + s / 100) for s in (36.0, 21.0, 22.0, 39.0, 20.5, 21.0, 41.0, 21.0, 40.0)]
    assert not any(doubts(r) for r in follow(first, *hot))
    rng = np.random.default_rng(5)
    records: list[dict[str, Any]] = []
    for day in range(150):
        t = 20.0 + 8 * np.sin(day / 58) + rng.normal(0, 2)
        readings = read(bed=t, air=t + rng.normal(1, 3), spindle=t + float(rng.choice([1.0, 9.0])) + rng.normal(0, 1))
        records = [{"night": "2026-10-01", "sensors": states(readings, records)}, *records[:39]]
        assert doubts(records[0]) == []


def test_an_alarm_names_the_sensor_whose_degrees_it_states() -> None:
    alarm = {"cause": "temperature", "text": say("changed.temperature", size="16.0 µm")}
    records = follow(*NIGHTS)
    for r in records:
        r["temperatures"] = {"bed": r["sensors"]["bed"]}
        r["volume"] = {"celsius": r["sensors"]["bed"]["mean"]}
    hot = states(four(26.0), records)
    found = how_warm(alarm, hot, 26.0, records, "bed")
    assert "K warmer (bed 26.0 °C) than" in found["text"] and found["warmer"]["sensors"] == ["bed"]
    every = by_how_much(hot, 26.0, 20.0, "2026-10-06")
    assert str(every[1]["sensor"]) == "mean of bed, table, air, bar" and len(every[0]) == 4
    silent = states(four(float("nan"), 26.0), records)
    assert str(by_how_much(silent, 26.0, 20.0, "2026-10-06", "bed")[1]["sensor"]) == "bed, by what air, bar, table has changed,"


@pytest.mark.parametrize("said", ["-300", "1e9", "69.58 FAHRENHEIT"])
def test_a_sensor_that_says_what_is_no_temperature_is_not_called_silent(said: str) -> None:
    records = follow(*NIGHTS)
    sensors = states(four(float("nan"), 20.0), records, "2026-10-07", {"bed": said, "air": "7"})
    found = told(sensors, "bed", "2026-10-07")
    assert f"temperature sensor bed speaks, and says {said}," in found["text"] and "said nothing" not in found["text"]
    assert "night ending 2026-10-06" in found["text"] and found["doubted"] == ["bed"] and sensors["air"]["state"] == "heard"
    silent = told(states(four(float("nan"), 20.0), records, "2026-10-07"), "bed", "2026-10-07")
    assert "has said nothing since the night ending 2026-10-06" in silent["text"] and "doubted" not in silent


def test_a_mail_says_once_that_no_location_is_to_be_entered_and_not_of_what_has_gone() -> None:
    parts = {
        "cause": "axis_location",
        "parameter": "EY0C",
        "unit": "mm",
        "size": 0.004,
        "std": 3e-4,
        "rate_per_day": 0.002,
        "id": "x",
    }
    alarm = parts | {"since": "2026-11-12", "night": "2026-11-14", "sigmas": 8.0, "text": say("changed.unknown"), "instead": []}
    alarm |= {
        "on_part": "",
        "on_part_um": 8.0,
        "owner": None,
        "decision": None,
        "now": "",
        "total": None,
        "utc": "",
        "steady": True,
    }
    words = {"kelvin": "2.1", "sensor": "bed", "now": "21.5", "night": "2026-11-12", "then": "19.4", "follows": ""}
    warm = say("night.sensors.warmer_do", do=say("night.drift_do", name="EY0C"), **words)
    plain = say("cause.axis_location.do")
    gone = say("night.alarms.gone_again_left", told="-0.1 µm")

    def lines(**more: Any) -> int:
        record = {
            "format": "tango-night/1",
            "machine": "M",
            "cell": ".",
            "night": "2026-11-20",
            "kind": "check",
            "status": "complete",
        }
        record |= {"verdict": "changed", "alarms": [], "standing": [alarm | more], "preflight": [], "limits": [], "headline": "x"}
        record |= {
            "parameters": {},
            "touches": 1,
            "planned": 1,
            "machine_time_s": 1.0,
            "artefacts": {"folder": "x"},
            "start_utc": "",
            "why": "",
            "folder": "",
        }
        return " ".join(message(record, (), ())[1].split()).count("Enter no new location")

    assert lines(do=warm) == 1 and lines(do=plain) == 1 and lines(do=plain, now=gone) == 0


def test_a_compensation_keeps_its_date_where_the_night_of_an_alarm_is_dated() -> None:
    """Written on the morning after the night before: its date became 'the night ending' a day later."""
    text = say(
        "changed.after_compensation_given", text=say("changed.drift", moved="x", rate="y"), number=1, target="s", date="2026-11-21"
    )
    assert "on 2026-11-21" in instead(text, "2026-11-21", "the night ending 2026-11-22")


@pytest.mark.parametrize(("unit", "per_kelvin", "zero"), [("°F", 1.8, 32.0), ("K", 1.0, 273.15)])
def test_a_sensor_in_another_unit_from_its_first_night_is_named_and_believed_once_it_is_right(
    unit: str, per_kelvin: float, zero: float
) -> None:
    """69 "°C" were believed for 17 nights, and the right 19.6 °C for none: "no shop does that"."""
    records = follow(*(read(bed=t * per_kelvin + zero) for t in SHOP), read(bed=19.6), read(bed=20.1))
    for r in reversed(records[2:]):
        assert doubts(r) == ["bed"] and "counts" not in r["sensors"]["bed"]
        text = told(r["sensors"], None, r["night"])["text"]
        assert (
            "is not believed: no machine is so warm at night" in text
            and f"(read in {unit} it would be" in text
            and "its unit" in text
        )
    assert not doubts(records[0]) and not doubts(records[1])
    before = [
        {"night": f"2026-10-{n:02d}", "temperatures": {"bed": dict.fromkeys(("mean", "first", "last"), 69.0)}} for n in (2, 1)
    ]
    assert states(read(bed=19.6), before, "2026-10-03")["bed"]["state"] == "heard"  # of a history of before
    assert "unit" not in str(follow(read(bed=20.5, spindle=62.0))[0])  # a spindle that is hot beside a bed that is not
