"""Temperature sensors that fall silent, freeze or go away: the night says which, since when, and what its verdict rests on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.nights_parts import Event, Story, nights
from support.spoilt import simulated

from tango_cnc.cli import tango
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.files.readings import readings_text
from tango_cnc.history import opened
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.sensors import counted, how_warm, see_to_it_first, states, told
from tango_cnc.nightly.warmth import with_warmth
from tango_cnc.records import Array, InputError, Readings
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts
from tango_cnc.report.tonight import is_gone
from tango_cnc.texts import say

NAN = float("nan")


def read(**sensors: list[float]) -> Readings:
    count = len(next(iter(sensors.values()), [0.0] * 4))
    return Readings(
        ("X",),
        np.arange(1, count + 1),
        np.arange(count, dtype=float),
        (1,) * count,
        np.zeros((count, 1)),
        np.zeros((count, 1)),
        ("ok",) * count,
        np.ones(count, dtype=np.int64),
        np.ones(count, dtype=np.int64),
        temperatures={name: np.array(values) for name, values in sensors.items()},
    )


def follow(*each: Readings) -> list[dict[str, Any]]:
    """readings of nights, oldest first → their records, newest first, as far as sensors go."""
    records: list[dict[str, Any]] = []
    for day, readings in enumerate(each, 1):
        records.insert(0, {"night": f"2026-10-{day:02d}", "sensors": states(readings, records)})
    return records


LIVE = [read(bed=[20.0 + d, 20.1 + d, 20.2 + d, 20.3 + d], room=[22.0 + d] * 3 + [22.1 + d]) for d in (0.0, 0.3, 0.1, 0.7)]


def test_sensors_that_fell_silent_together_are_one_sentence() -> None:
    """Four times "temperature sensor … has said nothing since the night of …"."""
    names = ("air", "bar", "bed")
    seen = read(**{name: [20.0 + i, 20.1 + i, 20.2 + i, 20.3 + i] for i, name in enumerate(names)})
    (tonight, *_) = follow(seen, read(**{name: [NAN] * 4 for name in names}))
    text = told(tonight["sensors"], None, tonight["night"])["text"]
    assert text.startswith("temperature sensors air, bar, bed have said nothing since the night ending 2026-10-01.")
    assert text.count("have said nothing") == 1 and told(tonight["sensors"], None, tonight["night"])["sensors"] == list(names)


def test_a_night_whose_sensors_speak_says_nothing_of_them() -> None:
    newest = follow(*LIVE)[0]
    assert told(newest["sensors"], None, newest["night"]) == {} and told(newest["sensors"], "bed", newest["night"]) == {}
    assert counted(LIVE[-1], newest["sensors"]).temperatures["bed"] == pytest.approx(LIVE[-1].temperatures["bed"])


@pytest.mark.parametrize("gone", [False, True])
def test_a_silent_sensor_is_named_with_its_last_night_and_the_others_stand_for_it(gone: bool) -> None:
    tonight = read(**({} if gone else {"bed": [NAN] * 4}), room=[25.0, 25.0, 25.0, 25.4])
    records = follow(*LIVE, tonight, tonight)
    bed = records[0]["sensors"]["bed"]
    assert (bed["state"], bed["since"], bed["by"]) == ("silent", "2026-10-04", ["room"])
    before = LIVE[-1].temperatures
    assert bed["counts"] == pytest.approx(float(before["bed"].mean()) + 25.1 - float(before["room"].mean()), abs=1e-3)
    found = told(records[0]["sensors"], "bed", records[0]["night"])
    assert "temperature sensor bed" in found["text"] and "2026-10-04" in found["text"] and "rests on room" in found["text"]
    assert (found["rests"], found["sensors"], found["doubt"]) == ("others", ["bed"], False)
    # what is compared is that of the sensor that counts, and not the room, which is another temperature
    filled = counted(tonight, records[0]["sensors"]).temperatures["bed"]
    assert float(filled.mean()) == pytest.approx(bed["counts"], abs=1e-3) and float(np.ptp(filled)) == pytest.approx(0.4)


def test_a_sensor_beside_the_one_that_counts_is_named_and_nothing_rests_on_it() -> None:
    records = follow(*LIVE, read(bed=[20.0, 20.1, 20.2, 20.4], room=[NAN] * 4))
    found = told(records[0]["sensors"], "bed", records[0]["night"])
    assert found["rests"] == "sensors" and "room has said nothing" in found["text"] and "bed counts" in found["text"]


def test_without_any_voice_the_machine_is_taken_to_be_as_warm_as_the_sensor_said_last() -> None:
    records = follow(read(bed=[23.0, 23.1, 23.2, 23.3]), *[read(bed=[NAN] * 4)] * 3)
    found = told(records[0]["sensors"], None, records[0]["night"])
    assert (found["rests"], found["doubt"]) == ("earlier", True) and "(23.1 °C)" in found["text"]
    assert "2026-10-01" in found["text"]
    alarm = {"cause": "scale", "do": "Check the scale.", "instead": ["EXX"]}
    asked = see_to_it_first([alarm], found)[0]
    assert asked["instead"] == ["temperature", "EXX"] and asked["do"].startswith("See first whether the temperature sensor")
    knock = alarm | {"cause": "axis_location", "unit": "mm", "size": 0.060}  # 12 K would be needed
    assert see_to_it_first([knock], found)[0] == knock and see_to_it_first([knock | {"size": -0.018}], found)[0] != knock
    assert counted(read(bed=[NAN] * 4), records[0]["sensors"]).temperatures["bed"] == pytest.approx(np.full(4, 23.15))


def test_a_sensor_that_falls_silent_in_the_run_says_after_which_touch_and_what_it_said() -> None:
    records = follow(*LIVE, read(bed=[20.0, 20.1, 20.5, NAN], room=[22.0, 22.1, 22.0, 22.1]))
    found = told(records[0]["sensors"], "bed", records[0]["night"])
    assert "bed fell silent after touch 3 (20.5 °C)" in found["text"] and found["rests"] == "sensors"


def test_a_first_message_that_comes_late_is_no_silence() -> None:
    late = read(bed=[NAN, *np.linspace(20, 21, 20)], room=list(np.linspace(22, 23, 21)))
    newest = follow(*LIVE, late)[0]
    assert told(newest["sensors"], "bed", newest["night"]) == {}
    assert np.isfinite(counted(late, newest["sensors"]).temperatures["bed"]).all()


def test_a_frozen_sensor_is_found_on_the_second_morning_and_the_others_stand_for_it() -> None:
    stuck = [read(bed=[21.5] * 4, room=[22.0 + d] * 3 + [22.1 + d]) for d in (0.9, 1.7, 2.9)]
    records = follow(LIVE[1], *LIVE, *stuck)
    assert [r["sensors"]["bed"]["state"] for r in records[::-1]] == ["heard"] * 7 + ["frozen"]
    bed = records[0]["sensors"]["bed"]
    assert bed["since"] == "2026-10-06" and bed["counts"] == pytest.approx(21.5 + 2.9 - 1.7)
    text = told(records[0]["sensors"], "bed", records[0]["night"])["text"]
    assert "bed has said 21.500 °C at every touch since the night ending 2026-10-06" in text and "rests on room" in text
    again = follow(LIVE[1], *LIVE, *stuck, stuck[0])[0]["sensors"]["bed"]
    assert (again["state"], again["since"]) == ("frozen", "2026-10-06")


def test_a_coarse_sensor_that_often_says_the_same_is_not_called_frozen() -> None:
    """Whole degrees in a shop that is kept at one temperature: most nights are like the one before, and nothing is wrong."""
    rng = np.random.default_rng(3)
    degrees = 20.0 + (rng.random(400) < 0.1).cumsum() % 2
    records: list[dict[str, Any]] = []
    found = []
    for value in degrees:
        readings = read(bed=[float(value)] * 4)
        records = [{"night": "2026-10-01", "sensors": states(readings, records)}, *records[:39]]
        found.append(records[0]["sensors"]["bed"]["state"])
    assert found.count("frozen") <= 0.05 * len(found)


def test_an_alarm_of_temperature_says_how_warm_by_which_sensor_and_against_which_night() -> None:
    alarm = {"cause": "temperature", "text": say("changed.temperature", size="16.0 µm")}
    records = [
        {"night": "2026-10-19", "temperatures": {"bed": {"mean": 23.9, "first": 23.9, "last": 23.9}}},
        {"night": "2026-10-18", "temperatures": {"bed": {"mean": 20.2, "first": 20.2, "last": 20.2}}},
    ]
    found = how_warm(alarm, {"bed": {"state": "heard"}}, 24.1, records)
    assert "3.9 K warmer (bed 24.1 °C) than on 2026-10-18 (20.2 °C)" in found["text"] and "16.0 µm" in found["text"]
    assert found["warmer"]["kelvin"] == pytest.approx(3.9) and found["warmer"]["night"] == "2026-10-18"
    assert "5.1 K colder" in how_warm(alarm, {"bed": {"state": "heard"}}, 18.8, records)["text"]
    assert how_warm(alarm, {}, None, records) == alarm


Spoil = Callable[[int, Array], Array | None]


def spoilt(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, story: Story, count: int, spoil: Spoil) -> Any:
    """→ records of nights whose sensor `bed` says what `spoil` makes of it (None: no column), oldest first."""
    cell, truth = read_cell(root / "examples" / "hu40t"), read_world(root / "examples" / "hu40t" / "world.yaml")
    cell = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::4]))
    number, plain = iter(range(1, count + 1)), simulated._Machine.measure

    def measure(self: Any, kind: str, touches: Any) -> Any:
        found = plain(self, kind, touches)
        said = spoil(next(number), found.readings.temperatures["bed"])
        readings = replace(found.readings, temperatures={} if said is None else {"bed": said})
        return replace(found, readings=readings, text=readings_text(readings))

    monkeypatch.setattr(simulated._Machine, "measure", measure)
    settings = Nightly(diagnose=False, check_minutes=2)
    with opened(tmp_path / "history.db") as history:
        return [r for r, _ in nights(cell, truth, history, count, 2, story, settings)], history.verify()


@pytest.mark.few(0)
@pytest.mark.parametrize("way", ["silent", "gone", "frozen"])
def test_a_machine_at_another_temperature_than_its_first_night_is_not_called_changed_when_its_sensor_falls_silent(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    """Warm from night 3 on, and known to be; the sensor stops on night 6. Compared at 20 °C, it seemed to be another machine."""
    story = Story((Event(3, warmer=6.0),), simulated.THIRTY.warm, 0.1)
    last: list[float] = []

    def stop(number: int, values: Array) -> Array | None:
        if number < 6:
            last[:] = [float(values[-1])]
            return values
        return {"silent": np.full_like(values, np.nan), "gone": None, "frozen": np.full_like(values, last[0])}[way]

    records, wrong = spoilt(root, tmp_path, monkeypatch, story, 8, stop)
    assert wrong == () and [r["verdict"] for r in records[:2]] == ["good", "good"]
    assert [a["cause"] for a in records[2]["alarms"]] == ["temperature"]
    assert "K warmer (bed 2" in records[2]["headline"]
    assert not any(r["alarms"] for r in records[5:])
    assert records[7]["temperature"]["sensors"] == ["bed"] and records[7]["temperatures"] == {}
    text = " ".join(message(records[7], (), ())[1].split())
    assert "temperature sensor bed" in text and records[4]["night"] in text
    assert "emperature sensor bed" in context(records[7], [], None, texts())["warm"]


@pytest.mark.few(0)
def test_a_doubtful_sensor_does_not_bring_back_what_has_gone(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One sensor, in °F from night 5 on: the machine is taken to be as warm as it said last."""
    story = Story((Event(3, warmer=7.0), Event(4, warmer=-6.8)), simulated.THIRTY.warm, 0.1)
    records, _ = spoilt(root, tmp_path, monkeypatch, story, 5, lambda n, values: values * 1.8 + 32.0 if n >= 5 else values)
    last = records[-1]
    assert last["temperature"]["doubt"], last["temperature"]
    (alarm,) = [a for a in last["standing"] if a["cause"] == "temperature"]
    assert is_gone(alarm["now"]) and "last believed" in alarm["now"]
    assert "STILL CHANGED" not in message(last, (), ())[0]


@pytest.mark.few(0)
def test_the_names_of_alarms_are_names_of_trends(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What to do about a drift of the scales was 'tango history plot scales', which no history had as a parameter."""
    spoilt(root, tmp_path, monkeypatch, Story((), {}, 0.1), 2, lambda number, values: values)
    place = ["--history", str(tmp_path / "history.db"), "--machine", "HU40T-like"]
    found = CliRunner().invoke(tango, ["history", "plot", "scales", "temperature", *place])
    assert found.exit_code == 0 and all(name in found.output for name in ("EXX", "EYY", "EZZ", "temperature", "°C")), found.output
    refused = CliRunner().invoke(tango, ["history", "plot", "temperature", "--smooth", *place])
    assert isinstance(refused.exception, InputError) and "allowed: parameters" in str(refused.exception)


@pytest.mark.few(0)
def test_one_error_that_follows_the_bed_is_said_to_go_with_the_temperature(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """2 µm/K and a bed that is never as warm as the night before: each morning named a knock, and none the temperature."""
    steps = {3: 3.0, 4: -5.0, 5: 3.0, 6: 4.0}
    story = Story(tuple(Event(night, warmer=k) for night, k in steps.items()), {"EX0C": 2e-3}, 0.1)
    records, _ = spoilt(root, tmp_path, monkeypatch, story, 6, lambda number, values: values)
    alarms = [(i, a) for i, r in enumerate(records, 1) for a in r["alarms"] if a["parameter"] == "EX0C"]
    assert len(alarms) > 2
    for number, a in alarms:
        assert a["instead"][0] == "temperature" and a["warmer"]["night"] == a["since"]
        assert a["warmer"]["kelvin"] == pytest.approx(a["size"] / 2e-3, abs=0.5)
        text = " ".join(message(records[number - 1], (), ())[1].split())
        assert f"K {'warmer' if a['size'] > 0 else 'colder'} (bed" in text and "goes back with the temperature" in text
    last = alarms[-1][1]
    assert last["warmer"]["per_kelvin"] == pytest.approx(2e-3, rel=0.2) and "it has gone with the temperature, +" in last["do"]
    assert "it goes with the temperature: +1." in last["text"] and "it goes with the temperature" in records[-1]["headline"]


def test_what_has_gone_with_the_temperature_before_tonight_is_named_with_it() -> None:
    """One night alone on a warmer machine lies on a line with all nights before it, whatever it is: tonight is not asked."""
    warm = (20.0, 21.5, 19.0, 22.0, 20.5)

    def night(number: int, celsius: float, own: float) -> dict[str, Any]:
        bed = {"bed": {"mean": celsius, "first": celsius, "last": celsius}}
        return {
            "night": f"2026-10-{number:02d}",
            "temperatures": bed,
            "parameters": {"EX0C": {"value": own, "unit": "mm", "std": 1e-4}},
        }

    alarm = {"cause": "axis_location", "parameter": "EX0C", "size": 0.008, "std": 5e-4, "unit": "mm", "do": "Ask.", "instead": []}
    alarm |= {"text": "C axis has moved along X"}
    known, heard = {"EX0C": {"value": 0.109, "unit": "mm", "std": 1e-4}}, {"bed": {"state": "heard"}}
    follows = [night(18 - i, c, 0.1 + 2e-3 * (c - 20.0)) for i, c in enumerate(reversed(warm))]
    told = with_warmth(alarm, known, heard, 24.5, follows)
    assert "it goes with the temperature: +2.0 µm/K over the last 5 nights" in told["text"] and told["cause"] == "axis_location"
    knocked = with_warmth(alarm | {"size": 0.016}, known, heard, 24.5, follows)
    assert "goes with" not in knocked["text"] and knocked["instead"] == ["temperature"]  # 16 µm where 8 are due
    still = [night(18 - i, 20.0 + 0.1 * (i % 2), 0.1) for i in range(5)]
    assert "goes with" not in with_warmth(alarm, known, heard, 24.5, still)["text"]


def test_a_knock_on_a_machine_that_is_a_little_warmer_is_no_matter_of_temperature() -> None:
    bed = {"bed": {"mean": 20.0, "first": 20.0, "last": 20.0}}
    alarm = {"cause": "axis_location", "parameter": "EX0C", "size": 0.020, "unit": "mm", "do": "Ask.", "instead": []}
    known = {"EX0C": {"value": 0.1, "unit": "mm", "std": 1e-4}}
    before = [{"night": "2026-10-18", "temperatures": bed}]
    heard = {"bed": {"state": "heard"}}
    assert with_warmth(alarm, known, heard, 21.5, before) == alarm  # 13 µm/K
    assert with_warmth(alarm, known, heard, 20.5, before) == alarm
    assert with_warmth(alarm, known, heard, 26.0, before)["instead"] == ["temperature"]
    assert with_warmth(alarm | {"parameter": "facet 3"}, known, heard, 26.0, before)["instead"] == []
