"""Somebody changes a file of the cell between two nights: the morning says which key, before it says what the machine did."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from support.histories import knowledge, record

from tango_cnc.files.origin import changes
from tango_cnc.history import opened
from tango_cnc.nightly.edited import asked, edited
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.night import _edited
from tango_cnc.nightly.ports import Disk, Ports
from tango_cnc.nightly.words import headline
from tango_cnc.report import morning

MACHINE = "name: M\ntopology: wCAYfXZ(S)t\nprobe: {length: 252.3, tip_radius: 3.0}\n"
ARTEFACT = "scale_bar: {balls: [1, 2], length: 200.0}\nfacets: {1: {point: [160, -100, -48], normal: [1, 0, 0]}}\n"
BEFORE = {"machine.yaml": MACHINE, "artefact.yaml": ARTEFACT}
TONIGHT = "2026-10-04T020000Z"


def disk(then: dict[str, str], now: dict[str, str]) -> Disk:
    """Cell of the night before and of tonight → a disk that keeps both beside their readings."""
    kept = {"2026-10-03T020000Z": then, TONIGHT: now}
    read = lambda stamp, name: json.dumps({"cell": kept[stamp]}) if stamp in kept else None  # noqa: E731
    return cast(Disk, SimpleNamespace(read=read))


def found(tmp_path: Path, now: dict[str, str], terms: object = None, before: dict[str, Any] | None = None) -> dict[str, Any]:
    with opened(tmp_path / "history.db") as history:
        own = {"artefacts": {"folder": "nights/2026-10-03T020000Z"}, **(before or {})}
        history.add_night(record(3, **own), "touch\n1\n", knowledge(3))
        return edited(history, disk(BEFORE, now), "M", TONIGHT, terms)


@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        ("artefact.yaml", "length: 200.0", "length: 200.03", "artefact.yaml (scale_bar.length 200.0 → 200.03)"),
        ("machine.yaml", "length: 252.3", "length: 252.7", "machine.yaml (probe.length 252.3 → 252.7)"),
        ("machine.yaml", ", tip_radius: 3.0", "", "machine.yaml (probe.tip_radius 3.0 → –)"),
        ("artefact.yaml", "[160, -100, -48]", "[160, -100, -4.8]", "(facets.1.point 160, -100, -48 → 160, -100, -4.8)"),
    ],
)
def test_the_key_that_was_changed_is_named_with_what_it_was_and_is(
    tmp_path: Path, file: str, old: str, new: str, told: str
) -> None:
    now = {**BEFORE, file: BEFORE[file].replace(old, new)}
    text = found(tmp_path, now)["edited"]["text"]
    assert told in text and "since the night ending 2026-10-03" in text


def test_what_means_the_same_is_no_change(tmp_path: Path) -> None:
    now = {name: f"# a note\n{text}".replace("200.0", "200.00") for name, text in BEFORE.items()}
    assert found(tmp_path, now) == {} and changes(BEFORE, {}) == {}


def test_terms_that_were_changed_are_named(tmp_path: Path) -> None:
    assert found(tmp_path, BEFORE, ["S3"], {"terms": ["S3"]}) == {}
    (tmp_path / "history.db").unlink()
    assert "tango.yaml (terms S3 → S2, EYX2)" in found(tmp_path, BEFORE, ["S2", "EYX2"], {"terms": ["S3"]})["edited"]["text"]


@pytest.mark.few(0)
def test_the_edit_comes_first_in_headline_what_to_do_and_page(tmp_path: Path) -> None:
    changed = found(tmp_path, {**BEFORE, "artefact.yaml": ARTEFACT.replace("200.0", "200.03")})
    alarm = {"id": "1", "text": "the table has moved", "do": "Look for a knock.", "cause": "table", "parameter": "table"}
    alarm |= {"since": "2026-10-03", "sigmas": 9.0, "size": 0.02, "std": 0.001, "unit": "mm", "on_part": "x", "on_part_um": 20.0}
    alarm |= {"owner": "Ann", "decision": None, "rate_per_day": None}
    rest = {"limits": [], "preflight": [], "status": "complete", "machine_time_s": 60.0, "planned": 1, "cell": "c"}
    night = asked(record(4, verdict="changed", alarms=[alarm]) | rest | changed)
    night["headline"] = headline(night)
    assert (
        str(night["headline"]).startswith("somebody has changed artefact.yaml (scale_bar.length")
        and "table has moved" in night["headline"]
    )
    assert str(night["alarms"][0]["do"]).startswith("Look first whether what was changed in the files")
    assert "scale_bar.length 200.0 → 200.03" in message(night, (), ())[1]
    assert "Somebody has changed artefact.yaml" in morning.render(night)


def test_a_night_in_doubt_has_the_edit_as_its_first_reason(tmp_path: Path) -> None:
    changed = found(tmp_path, {**BEFORE, "machine.yaml": MACHINE.replace("3.0", "6.0")})
    doubt = {"verdict": "doubtful", "reasons": ["the touches do not fit"]}
    night = asked(record(4, verdict="doubtful", plausible=doubt) | {"alarms": []} | changed)
    assert [str(r) for r in night["plausible"]["reasons"]] == [str(changed["edited"]["text"]), "the touches do not fit"]
    assert "somebody has changed machine.yaml (probe.tip_radius 3.0 → 6.0)" in headline(night)


def test_a_night_that_is_refused_names_the_edit(tmp_path: Path) -> None:
    """The facet that proves the probe was 10 mm from the plan, and people were sent to find the table again."""
    (tmp_path / "tango.yaml").write_text("machine: machine.yaml\nartefact: a.yaml\nstrategy: s.yaml\n", encoding="utf-8")
    (tmp_path / "machine.yaml").write_text(MACHINE.replace("252.3", "262.3"), encoding="utf-8")
    for name in ("a.yaml", "s.yaml"):
        (tmp_path / name).write_text("name: x\n", encoding="utf-8")
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(3, artefacts={"folder": "nights/2026-10-03T020000Z"}), "touch\n1\n", knowledge(3))
        world = cast(Ports, SimpleNamespace(past=history, disk=disk(BEFORE, {})))
        refused = {"preflight": [{"check": "gate", "passed": False, "found": "facet 101 is 10 mm off", "do": "find it"}]}
        edit = _edited("M", str(tmp_path), world, TONIGHT, refused)
        assert "machine.yaml (probe.length 252.3 → 262.3)" in edit["edited"]["text"]
        rest = {"verdict": "not_measured", "limits": [], "planned": 0, "machine_time_s": 0.0, "touches": 0, "why": "refused"}
        night = record(4) | rest | refused | edit | {"status": "failed"}
        assert "machine.yaml (probe.length 252.3 → 262.3)" in message(night | {"headline": headline(night)}, (), ())[1]
        assert _edited("M", str(tmp_path), world, TONIGHT, {"preflight": [], "moved": True}) == {}
