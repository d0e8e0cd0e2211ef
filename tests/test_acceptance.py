"""The page that a person signs: decisions, what stops them, and what ISO/IEC 17025 asks for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tango_cnc.acceptance import Order, made, page, read_order
from tango_cnc.acceptance.sheet import PEOPLE
from tango_cnc.files import read_cell
from tango_cnc.iso230.signed import OnPart, Sheet
from tango_cnc.iso230.trajectory import Reference
from tango_cnc.judgement import Judgement
from tango_cnc.records import InputError
from tango_cnc.report.pdf import available, compiled, quoted

MACHINE = read_cell(Path(__file__).parents[1] / "examples" / "hu40t").machine
GOOD = Judgement("trustworthy")
CERTIFICATE = dict.fromkeys(("of", "number", "date", "value", "uncertainty", "issued_by"), "x")
CONDITIONS = {"machine_temperature": "20 °C", "table_temperature": "20 °C", "air_temperature": "20 °C", "warm_up": "2 h"}
ORDER = Order({"straightness EXZ": 10.0}, dict.fromkeys(PEOPLE, "x"), CONDITIONS, (CERTIFICATE,), remarks="none")


def sheet(value: float | None, half: float = 1.96, sigma: float = 0.0007) -> Sheet:
    """One straightness with standard uncertainty half / 1.96."""
    interval = None if value is None else (value - half, value + half)
    text = "" if value is not None else "EXZ cannot be told from EBZ"
    figure = OnPart("straightness", "EXZ", "µm", value, interval, (0.0, 100.0), "", text=text)
    return Sheet((figure,), Reference({}, 300.0, (0.0, 0.0, 0.0)), sigma, 1e6)


def verdict(value: float | None, **changed: float) -> str:
    return made(ORDER, sheet(value, **changed), GOOD, MACHINE, (), "1", "2026-01-01").rows[0].verdict


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (8.30, "conforms"),
        (8.40, "undecided"),
        (11.6, "undecided"),
        (11.7, "does not conform"),
        (-8.3, "conforms"),
        (None, "not stated"),
    ],
)
def test_the_guard_band_is_1_65_standard_uncertainties(value: float | None, expected: str) -> None:
    assert verdict(value) == expected


def test_nothing_conforms_where_the_touches_scatter_more_than_was_stated() -> None:
    assert verdict(1.0, sigma=MACHINE.probe.repeatability) == "conforms"
    assert verdict(1.0, sigma=1.1 * MACHINE.probe.repeatability) == "not stated"


def test_nothing_conforms_on_a_doubtful_result() -> None:
    doubtful = replace(GOOD, verdict="doubtful", reasons=("why",))
    found = made(ORDER, sheet(1.0), doubtful, MACHINE, (), "1", "2026-01-01")
    assert not found.conforms
    assert "why" in found.stands


def test_every_clause_that_nothing_answers_is_named() -> None:
    assert not made(ORDER, sheet(1.0), GOOD, MACHINE, (), "1", "2026-01-01").missing
    bare = Order(ORDER.limits, {}, {}, ())
    missing = " ".join(made(bare, sheet(1.0), GOOD, MACHINE, (), "1", "2026-01-01").missing)
    for clause in ("laboratory", "customer", "authorised", "conditions", "traceability", "method"):
        assert clause in missing


def test_a_limit_on_a_figure_that_does_not_exist_is_refused() -> None:
    with pytest.raises(InputError, match="allowed: straightness EXZ"):
        made(replace(ORDER, limits={"straightness EXQ": 1.0}), sheet(1.0), GOOD, MACHINE, (), "1", "2026-01-01")


def test_a_wrong_key_names_its_line(tmp_path: Path) -> None:
    file = tmp_path / "acceptance.yaml"
    file.write_text("limits: {straightness EXZ: 10}\nlaboratry: x\n", encoding="utf-8")
    with pytest.raises(InputError, match="laboratry"):
        read_order(file)


@pytest.mark.skipif(not available(), reason="typst is not installed")
def test_names_that_look_like_markup_stay_text() -> None:
    hostile = replace(ORDER, people=ORDER.people | {"customer": '#panic("no") $ " \\ *'})
    found = made(hostile, sheet(1.0), GOOD, MACHINE, (), "1", "2026-01-01")
    assert compiled(page.typst(found, quoted)).startswith(b"%PDF")
