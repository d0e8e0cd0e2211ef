"""What stood in English on translated pages: reasons of doubt, compensations, checks before the start, rows of the auditor."""

from __future__ import annotations

import json
from pathlib import Path

from support.nights import knock, night
from support.translated import english, other, shop  # noqa: F401

from tango_cnc.report.decimals import decimals, decimals_of_page
from tango_cnc.report.morning import render
from tango_cnc.report.texts import Texts, texts, texts_of
from tango_cnc.texts import carried, joined, revived, say

GERMAN = Texts({key: texts()(key) for key in texts().keys} | {"number.decimal": ","})


def test_a_night_with_its_checks_and_its_auditor_is_in_one_language(shop: Path) -> None:
    """✓ program: plan 026B18D13C67, 226 touches, read back; cell, plan, program, readings; several."""
    said = say("preflight.world.plan_touches_read_back", plan_hash="026B18D13C67", count=226)
    points = [{"check": "program", "passed": True, "found": joined("; ", (said,)), "do": ""}]
    alarm = {**knock("2026-11-09"), "cause": "unknown", "parameter": "several", "text": say("changed.unknown"), "on_part": ""}
    reason = say("judging.of_another", file="readings.csv", then="'M2'", now="'M1'")
    hashes = dict.fromkeys(("cell", "plan", "program", "readings"), "0" * 64)
    more = {"preflight": points, "hashes": hashes, "plausible": {"verdict": "doubtful", "reasons": [reason]}, "versions": {}}
    alarm |= {"do": say("changed.unknown"), "instead": []}
    record = night("HU40T-like", 8, "doubtful", alarms=[alarm], **more)
    record |= {"headline": say("changed.unknown"), "change": {}, "next": {}}
    read = revived(json.loads(json.dumps(carried(record))))
    assert english(render(read, folder=shop), "HU40T-like", "M2", "M1", "026B18D13C67", "bed") == []


def test_a_language_has_its_own_decimal_sign() -> None:
    """7.1 K and 52.4 µm in a German sentence; what is no number, or is typed, stays as it is."""
    stays = "tango_cnc 0.1.0 127.0.0.1:8193 a.b 2026-11-30 02:00 v1.5 'tango report --limit-um 20.5' world.2.yaml"
    assert decimals(f"+19.8 ± 0.4 µm (−0.5 … 1.25), 3.2e-10. {stays}", GERMAN) == f"+19,8 ± 0,4 µm (−0,5 … 1,25), 3,2e-10. {stays}"
    page = '<svg width="1.5"><style>a{b:1.5em}</style><text x="2.5">2.5 µm</text></svg><code>x --limit 1.5</code>'
    assert decimals_of_page(page, GERMAN) == page.replace("2.5 µm", "2,5 µm")
    assert decimals("1.5", texts()) == "1.5" and decimals_of_page(page, texts()) is page


def test_a_file_of_texts_may_state_it(tmp_path: Path) -> None:
    (tmp_path / "texts.toml").write_text('[number]\ndecimal = ","\n', encoding="utf-8")
    record = night("HU40T-like", 8, "changed", alarms=[{**knock("2026-11-09"), "text": "C has moved by 22.6 µm"}])
    assert "22,6" in render(record, folder=tmp_path) and decimals("1.5", texts_of(tmp_path)) == "1,5"


def test_the_state_of_a_compensation_is_a_sentence_of_the_page(shop: Path) -> None:
    """kept as far as seen: this run does not see whether the control uses … Read the files back from the control …"""
    from tango_cnc.report.page import of_compensation
    from tango_cnc.report.units import Units

    c = {"target": "siemens", "date": "2026-11-21", "rows": (("rms", 23.0, 3.0, 2.4), ("p95", 40.0, 6.0, None))}
    c |= {"event": "kept as far as seen", "left": 26.41, "rows_not_met": True, "reason": None}
    told = of_compensation(c, Units(), texts_of(shop))
    assert english(told["state"], "µm") == [] and "26.4 µm" in told["state"] and other("kept as far as seen") in told["state"]
    plain = of_compensation(c, Units(), texts())
    assert plain["date"] == "Sat 21 Nov 2026" and plain["state"].startswith("kept as far as seen. This run does not see all")
    back = of_compensation({**c, "event": "rolled back", "reason": "sign", "left": None, "rows_not_met": False}, Units(), texts())
    assert back["state"].startswith("rolled back: sign.")
