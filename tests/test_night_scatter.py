"""A probe that scatters: its touches count for so much less, and a machine that has not changed has not changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from support.nights_parts import Event, Story, nights

from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import Decision, opened
from tango_cnc.nightly.mail import message
from tango_cnc.records import Cell, World
from tango_cnc.report.tonight import is_gone

FIRST = datetime(2026, 1, 1, 2, tzinfo=UTC)
SETTINGS = Nightly(diagnose=False)
QUIET = 6
TIMES = 13.0


def small(root: Path) -> tuple[Cell, World]:
    """Every fourth indexation of the example machine."""
    cell, truth = read_cell(root / "examples" / "hu40t"), read_world(root / "examples" / "hu40t" / "world.yaml")
    return replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::4])), truth


def off(record: Mapping[str, Any], now: World) -> list[float]:
    """→ how far each parameter is from the true one, in its own standard deviations."""
    told = record["parameters"]
    return [abs(told[name]["value"] - true) / told[name]["std"] for name, true in now.errors.items() if name in told]


@pytest.mark.long
@pytest.mark.parametrize("left", [0.0, 1.0])
def test_a_repair_is_measured_by_a_probe_that_scatters_as_far_as_that_goes(root: Path, tmp_path: Path, left: float) -> None:
    cell, truth = small(root)
    knock = {"EX0C": 0.04}
    with opened(tmp_path / "history.db") as history:
        *_, (found, now) = nights(cell, truth, history, QUIET, 1, Story((Event(QUIET, knock),)), SETTINGS, FIRST)
        (alarm,) = found["alarms"]
        history.decide(cell.machine.name, Decision(alarm["id"], "repaired", "Ann", "", None, found["end_utc"]))
        bad = replace(now, noise=TIMES * now.noise, errors={**now.errors, "EX0C": now.errors["EX0C"] - (1 - left) * 0.04})
        ((record, _),) = nights(cell, bad, history, 1, 51, Story(), SETTINGS, FIRST + timedelta(days=QUIET))
    assert alarm["parameter"] == "EX0C" and record["verdict"] == "changed"
    *machine, scatter = record["alarms"]
    assert scatter["cause"] == "noise_level" and scatter["text"] in message(record, (), ())[1]
    if left:
        (still,) = machine
        assert still["parameter"] == "EX0C" and abs(still["size"] - 0.04) < 4 * still["std"]
        assert "has not helped" in still["text"]
    else:
        (helped,) = record["repaired"]
        assert not machine and abs(helped["size"]) < 4 * helped["std"] and "in part" not in record["headline"]


@pytest.mark.few(0)
def test_a_probe_that_scatters_is_one_alarm_until_the_first_sound_night_and_no_machine_that_has_changed(
    root: Path, tmp_path: Path
) -> None:
    """Two nights of it were two alarms, "more open alarms: 1"; sound again, single touches "scatter by 8.56 µm" in the mail."""
    cell, truth = small(root)
    with opened(tmp_path / "history.db") as history:
        *_, (quiet, now) = nights(cell, truth, history, QUIET, 1, Story(), SETTINGS, FIRST)
        bad, day = replace(now, noise=TIMES * now.noise), FIRST + timedelta(days=QUIET)
        (found, then), (on, worse) = nights(cell, bad, history, 2, 51, Story(), SETTINGS, day)
        ((sound, last),) = nights(cell, replace(worse, noise=now.noise), history, 1, 61, Story(), SETTINGS, day + timedelta(days=2))
        bad = replace(last, noise=TIMES * now.noise)
        ((again, _),) = nights(cell, bad, history, 1, 71, Story(), SETTINGS, day + timedelta(days=3))
        unanswered = history.open_alarms(cell.machine.name)
    (first,), (second,) = found["alarms"], on["alarms"]
    assert (first["cause"], first["parameter"]) == ("noise_level", "probe")
    assert "single touches scatter by" in found["headline"] and "is usual" in found["headline"]
    assert found["residual"]["wider"] == pytest.approx(TIMES, rel=0.3) and found["change"]["p_machine"] > 1e-3
    assert max(off(quiet, truth)) < 4 and max(off(found, then)) < 4
    wide = [found["parameters"][name]["std"] / told["std"] for name, told in quiet["parameters"].items()]
    assert min(wide) > 1.0  # one night of such touches adds less than a night takes away
    assert not sound["alarms"] and "wider" not in sound["residual"] and max(off(sound, last)) < 4
    assert (second["id"], second["since"]) == (first["id"], first["since"]) and "goes_on" in second
    assert f"the alarm of {found['night']} goes on" in on["headline"] and "more open alarms" not in on["headline"]
    (standing,) = sound["standing"]
    assert standing["id"] == first["id"] and is_gone(standing["now"]) and "single touches scattered by" in standing["text"]
    subject, mail = message(sound, (), ())
    assert "STILL CHANGED" not in subject and "scattered by" in mail and "gone again: they scatter by" in mail
    assert "touches scatter by" not in mail.replace("they scatter by", "")
    (third,) = again["alarms"]
    assert third["id"] != first["id"] and "goes_on" not in third
    (older,) = again["standing"]
    assert is_gone(older["now"]) and len(unanswered) == 2
