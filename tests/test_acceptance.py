"""The page that a person signs: decisions, what stops them, what contradicts the cell, and what ISO/IEC 17025 asks for."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import pytest
import yaml

from tango_cnc.acceptance import Order, Signed, Source, made, page, read_order
from tango_cnc.acceptance.covered import Covered, of_figure
from tango_cnc.acceptance.fitting import other_bar
from tango_cnc.acceptance.order import CONDITIONS, PEOPLE
from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell
from tango_cnc.iso230.signed import Budget, OnPart, Sheet
from tango_cnc.iso230.temperature import USUAL, Known, Thermal
from tango_cnc.iso230.trajectory import Reference
from tango_cnc.judgement import Judgement
from tango_cnc.records import InputError
from tango_cnc.report.pdf import available, compiled, quoted

CELL = read_cell(Path(__file__).parents[1] / "examples" / "hu40t")
TODAY = date(2026, 11, 23)
GOOD, MEASURED = Judgement("trustworthy"), Source("", text="readings.csv, measured")
STATED = 0.0007  # mm, what the budget allows a touch to scatter
BAR = {
    **{"of": "scale bar", "number": "C-123", "date": "2026-01-10", "value": "304.6686 mm", "uncertainty": "1.0 µm", "k": 2},
    **{"issued_by": "NN"},
}
WRITTEN: dict[str, Any] = {
    "limits": {"straightness EXZ": 10},
    **dict.fromkeys(PEOPLE, "none"),
    "performed": "2026-11-23",
    "remarks": "none",
    "conditions": dict.fromkeys(CONDITIONS, "20 °C") | {"warm_up": "2 h"},
    "certificates": [BAR],
}


def order(folder: Path, **changed: Any) -> Order:
    """acceptance.yaml with every key, some of them changed."""
    file = folder / "acceptance.yaml"
    file.write_text(yaml.safe_dump(WRITTEN | changed, allow_unicode=True), encoding="utf-8")
    return read_order(file, TODAY)


def sheet(value: float | None, half: float = 1.96, sigma: float = STATED) -> Sheet:
    """One straightness with standard uncertainty half / 1.96 and a budget."""
    interval = None if value is None else (value - half, value + half)
    text = "" if value is not None else "EXZ cannot be separated from EBZ"
    figure = OnPart("straightness", "EXZ", "µm", value, interval, (0.0, 100.0), "", text=text)
    at, budget = Reference({}, 300.0, (0.0, 0.0, 0.0)), Budget((), (), ("drift",), ("drift",))
    return Sheet((figure,), at, sigma, 1e6, budget=budget, expected=STATED)


def signed(folder: Path, shown: Sheet, judgement: Judgement = GOOD, source: Source = MEASURED, **changed: Any) -> Signed:
    return made(order(folder, **changed), shown, judgement, CELL, source, (), (), "1", TODAY)


def test_nothing_conforms_by_readings_that_are_older_than_the_compensation_in_the_control(tmp_path: Path) -> None:
    """They are of a machine that is no more: it may be better now, or worse."""
    older = replace(MEASURED, older="compensation 1 (siemens) is in the control and not in these readings, as they ended before")
    found = signed(tmp_path, sheet(1.0), source=older)
    assert found.rows[0].verdict == "not stated" and not found.conforms
    assert "compensation 1 (siemens)" in found.stands and "Measure again" in found.stands


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
def test_the_guard_band_is_1_65_standard_uncertainties(tmp_path: Path, value: float | None, expected: str) -> None:
    assert signed(tmp_path, sheet(value)).rows[0].verdict == expected


@pytest.mark.parametrize(
    ("least", "most", "limit", "expected", "guard"),
    [
        (0.0, 3.4, 0.3, "undecided", 2.0),  # noise alone may show this curve, so the range may be nothing
        (1.2, 3.4, 1.1, "does not conform", 0.8),
        (1.2, 3.4, 1.3, "undecided", 0.8),
        (1.2, 3.4, 3.3, "undecided", 1.4),
        (1.2, 3.4, 3.5, "conforms", 1.4),
    ],
)
def test_a_range_has_the_guard_bands_of_its_own_shape(
    tmp_path: Path, least: float, most: float, limit: float, expected: str, guard: float
) -> None:
    """A range is skew: 1.65 standard uncertainties either way would reject at 0.3, and conform at 3.3."""
    shown = sheet(2.0, half=1.5)
    figures = (replace(shown.figures[0], interval=(0.0, 3.5), bounds=(least, most)),)
    (row,) = signed(tmp_path, replace(shown, figures=figures), limits={"straightness EXZ": limit}).rows
    assert row.verdict == expected
    assert row.guard == pytest.approx(guard)
    assert row.decided == (least, most) and page.cells(row)[3] == f"{least:.2f} … {most:.2f}"


@pytest.mark.few(6)
@pytest.mark.parametrize("value", [-13.0, -2.0, 0.4, 3.0, 8.3, 12.0])
@pytest.mark.parametrize("limit", [0.1, 2.0, 10.0])
def test_the_interval_that_is_printed_is_the_one_that_decides(tmp_path: Path, value: float, limit: float) -> None:
    """Conforms: all of it within the limit. Does not: none of it, and never where it contains 0."""
    (row,) = signed(tmp_path, sheet(value), limits={"straightness EXZ": limit}).rows
    low, high = (float(v) for v in page.cells(row)[3].split(" … "))
    within, beyond = -limit <= low and high <= limit, low >= limit or high <= -limit
    assert row.verdict == ("conforms" if within else "does not conform" if beyond else "undecided")
    assert row.expanded is not None and (high - low) / 2 <= row.expanded
    (written,) = page.as_json(signed(tmp_path, sheet(value), limits={"straightness EXZ": limit}))["figures"]
    assert written["decided_by"] == list(row.decided or ())


@pytest.mark.parametrize(("kind", "name"), [("positioning gain", "EXX"), ("parameter", "EXX1"), ("volumetric", "VX")])
def test_what_changes_with_temperature_is_not_stated_without_one(tmp_path: Path, kind: str, name: str) -> None:
    shown = sheet(1.0)
    figures = (replace(shown.figures[0], kind=kind, name=name, expands=True),)
    (row,) = signed(tmp_path, replace(shown, figures=figures), limits={f"{kind} {name}": 10}).rows
    assert row.verdict == "not stated" and "temperature.yaml" in row.why
    warm = Thermal(Known(20.5, 0.1), Known(20.2, 0.3), USUAL, USUAL)
    stated = replace(shown, figures=figures, thermal=warm, temperature="20 °C")
    assert signed(tmp_path, stated, limits={f"{kind} {name}": 10}).rows[0].verdict == "conforms"


def test_nothing_conforms_where_the_touches_scatter_more_than_the_budget_allows_for(tmp_path: Path) -> None:
    assert signed(tmp_path, sheet(1.0)).conforms
    found = signed(tmp_path, sheet(1.0, sigma=1.1 * STATED))
    assert not found.conforms
    assert "scatter" in found.stands


@pytest.mark.parametrize(
    ("shown", "judgement", "source", "words"),
    [
        (sheet(1.0), replace(GOOD, verdict="doubtful", reasons=("why",)), MEASURED, "why"),
        (sheet(1.0), GOOD, Source("origin unknown: nothing beside readings.csv"), "origin unknown"),
        (sheet(1.0), GOOD, Source("readings of the simulated machine"), "simulated"),
        (replace(sheet(1.0), budget=None, expected=None), GOOD, MEASURED, "uncertainty.yaml"),
    ],
)
def test_nothing_conforms_and_the_page_says_why(
    tmp_path: Path, shown: Sheet, judgement: Judgement, source: Source, words: str
) -> None:
    found = signed(tmp_path, shown, judgement, source)
    assert not found.conforms
    assert {row.verdict for row in found.rows} == {"not stated"}
    assert words in found.stands
    assert words in page.typst(found, repr)


def test_nothing_conforms_by_a_budget_that_leaves_out_what_every_machine_has(tmp_path: Path) -> None:
    found = made(order(tmp_path), sheet(1.0), GOOD, CELL, MEASURED, ("lobing",), (), "1", TODAY)
    assert not found.conforms
    assert "lobing" in found.stands


def test_every_clause_that_nothing_answers_is_named(tmp_path: Path) -> None:
    assert not signed(tmp_path, sheet(1.0)).missing
    bare = tmp_path / "bare.yaml"
    bare.write_text("limits: {straightness EXZ: 10}\n", encoding="utf-8")
    missing = " ".join(made(read_order(bare, TODAY), sheet(1.0), GOOD, CELL, MEASURED, (), (), "1", TODAY).missing)
    for clause in ("laboratory", "contact", "authorised", "conditions", "traceability", "method", "performed", "external"):
        assert clause in missing
    for clause in ("specification", "7.8.8", "adjustment", "supplied by the customer"):
        assert clause in missing


def test_the_head_of_a_sheet_says_what_it_lacks(tmp_path: Path) -> None:
    assert page.headline(signed(tmp_path, sheet(1.0))) == "All figures conform."
    bare = tmp_path / "bare.yaml"
    bare.write_text("limits: {straightness EXZ: 10}\n", encoding="utf-8")
    found = made(read_order(bare, TODAY), sheet(1.0), GOOD, CELL, MEASURED, (), (), "1", TODAY)
    head = page.headline(found)
    assert found.conforms and "must not be signed" in head and "traceability" in head
    assert head in page.typst(found, repr) and page.as_json(found)["headline"] == head


def test_a_clause_that_is_answered_in_part_names_what_is_not_stated(tmp_path: Path) -> None:
    part = tmp_path / "part.yaml"
    stated = "laboratory: Measuring room\nsigned_by: A. Person\nconditions: {air_temperature: 20 °C, warm_up: 1 h}\n"
    part.write_text("limits: {straightness EXZ: 10}\n" + stated, encoding="utf-8")
    found = made(read_order(part, TODAY), sheet(1.0), GOOD, CELL, MEASURED, (), (), "1", TODAY)
    assert set(found.lacks) == set(found.missing) == set(page.as_json(found)["lacks"])
    assert found.lacks["7.8.2.1 b) laboratory"] == "write address into part.yaml"
    assert found.lacks["7.8.2.1 o) authorised by"] == "write role into part.yaml"
    assert (
        found.lacks["7.8.4.1 b) conditions"] == "write conditions.machine_temperature, conditions.table_temperature into part.yaml"
    )


@pytest.mark.parametrize("key", ["signed_by", "contact", "specification", "adjustment", "replaces"])
@pytest.mark.parametrize("blank", ["   ", "-", "…", None])
def test_a_dash_is_nobody(tmp_path: Path, key: str, blank: str | None) -> None:
    assert signed(tmp_path, sheet(1.0), **{key: blank}).missing


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"value": "250.0000 mm"}, "304.6686 mm"),
        ({"value": "304.6686"}, "unit"),
        ({"uncertainty": "500 µm"}, "100 µm"),
        ({"uncertainty": "3 µm"}, "0.5 µm"),
        ({"k": 1}, "0.5 µm"),
        ({"of": "voltmeter"}, "scale bar, calibrated facets"),
        ({"of": "calibrated facets"}, "no facet"),
        ({"of": "tip"}, "twice tip_radius"),
        ({"date": "2031-01-10"}, "not to come"),
        ({"date": "yesterday"}, "2026-01-10"),
        ({"issued_by": " "}, "a text"),
    ],
)
def test_a_certificate_that_is_not_that_of_the_fit_is_refused(tmp_path: Path, changed: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        signed(tmp_path, sheet(1.0), certificates=[BAR | changed])


def test_a_certificate_without_its_coverage_factor_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'k'"):
        order(tmp_path, certificates=[{key: value for key, value in BAR.items() if key != "k"}])


@pytest.mark.parametrize(
    ("certificate", "words"),
    [
        (BAR | {"date": "1998-01-10"}, "1998"),
        (BAR | {"valid_until": "2026-11-22"}, "valid until"),
        ({"of": "CMM", "number": "M-1", "date": "2026-01-10", "uncertainty": "1 µm", "k": 2, "issued_by": "NN"}, "scale bar"),
    ],
)
def test_a_certificate_that_is_old_or_of_something_else_traces_nothing(
    tmp_path: Path, certificate: dict[str, Any], words: str
) -> None:
    found = signed(tmp_path, sheet(1.0), certificates=[certificate])
    assert found.missing == ("7.8.4.1 c) traceability",)
    assert words in found.lacks["7.8.4.1 c) traceability"]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"performed": "sometime"}, "a date"),
        ({"performed": "2031-01-01"}, "not to come"),
        ({"performed": "1999-01-01"}, "2026-11-22"),
        ({"performed": "2026-11-21"}, "2026-11-22 23:52"),  # no local time of that moment is of the 21st
        ({"laboratory": {"a": 1}}, "a text"),
        ({"conditions": {"machine_temperature": "warm"}}, "temperature"),
        ({"conditions": {"machine_temperature": "68 °F"}}, "temperature"),
        ({"limits": {"straightness EXZ": 0.01}}, "is written 10"),
        ({"limits": {"straightness EXZ": 1e9}}, "every machine"),
        ({"limits": {"straightness EXQ": 1.0}}, "allowed: straightness EXZ"),
        ({"laboratry": "x"}, "laboratry"),
    ],
)
def test_what_no_measurement_can_be_is_refused(tmp_path: Path, changed: dict[str, Any], words: str) -> None:
    night = datetime(2026, 11, 22, 23, 52, tzinfo=UTC)
    ran = Source("", (night, night))
    with pytest.raises(InputError, match=words):
        signed(tmp_path, sheet(1.0), source=ran, **changed)


@pytest.mark.parametrize(("machine", "bar"), [(35.0, 20.0), (20.0, 35.0)])
def test_conditions_on_the_page_are_those_of_temperature_yaml(tmp_path: Path, machine: float, bar: float) -> None:
    warm = Thermal(Known(bar, 0.1), Known(machine, 0.3), USUAL, USUAL)
    with pytest.raises(InputError, match=r"temperature\.yaml says 35 °C"):
        signed(tmp_path, replace(sheet(1.0), thermal=warm))
    fine = signed(tmp_path, replace(sheet(1.0), thermal=Thermal(Known(20.5, 0.1), Known(20.2, 0.3), USUAL, USUAL)))
    assert "bar 20.5 ± 0.1 °C, 11.5 ± 2 µm/m/K" in fine.checklist["7.8.4.1 b) conditions"]


@pytest.mark.parametrize(
    ("then", "now", "before", "stops", "remarks"),
    [
        (304.6686, 304.6786, None, True, False),
        (304.6586, 304.6686, "304.6586 mm", False, True),
        (304.6586, 304.6686, "304.6500 mm", True, False),
        (304.66861, 304.6686, None, False, False),
    ],
)
def test_a_bar_that_has_another_length_since_the_run_decides_nothing(
    tmp_path: Path, then: float, now: float, before: str | None, stops: bool, remarks: bool
) -> None:
    """The certificate was changed with it, so both agreed; a bar that was certified after the run says so."""
    wanted = order(tmp_path, certificates=[BAR | ({} if before is None else {"before": before})])
    why, said = other_bar(wanted, [("scale_bar.length", then, now)])
    assert bool(why) == stops and bool(said) == remarks
    assert not stops or (f"was {then:.4f} mm" in why and f"before: {then:.4f} mm" in why)
    assert not remarks or ("by certificate C-123" in said and f"{then:.4f}" in said)
    assert other_bar(wanted, [("scale_bar.uncertainty", 1e-3, 2e-3)]) == ("", "")


@pytest.mark.long
def test_simulated_readings_under_another_name_conform_to_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = tmp_path / "cell"

    def call(*arguments: object) -> int:
        return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)

    assert call("init", cell) == 0
    assert call("simulate", "-C", cell) == 0
    (cell / "simulated.csv").rename(cell / "readings.csv")
    changed = {"limits": {"straightness EXZ": 100}, "performed": date.today().isoformat()}
    certificate = BAR | {"date": "2024-01-10", "valid_until": "2100-01-01"}
    (cell / "acceptance.yaml").write_text(yaml.safe_dump(WRITTEN | changed | {"certificates": [certificate]}), encoding="utf-8")
    capsys.readouterr()
    assert call("accept", "-C", cell, "--json", "-") == 1
    data = json.loads(capsys.readouterr().out)
    assert "origin unknown" in data["stands"]
    assert "no readings.origin.json beside readings.csv" in data["stands"] and "measure with 'tango run'" in data["stands"]
    assert {f["why"] for f in data["figures"] if f["verdict"] == "not stated" and f["value"] is not None} == {data["stands"]}
    assert {f["verdict"] for f in data["figures"]} == {"not stated"}
    (cell / "simulated.origin.json").rename(cell / "readings.origin.json")
    assert call("accept", "-C", cell, "--json", "-") == 1
    assert "simulated" in json.loads(capsys.readouterr().out)["stands"]


@pytest.mark.skipif(not available(), reason="typst is not installed")
def test_names_that_look_like_markup_stay_text(tmp_path: Path) -> None:
    found = signed(tmp_path, sheet(1.0), customer='#panic("no") $ " \\ *')
    assert compiled(page.typst(found, quoted)).startswith(b"%PDF")


def test_a_limit_on_an_axis_alone_is_answered_with_the_figures_of_that_axis(tmp_path: Path) -> None:
    shown = sheet(1.0)
    more = (*shown.figures, *(replace(shown.figures[0], kind=kind, name="EXX") for kind in ("positioning", "reversal")))
    with pytest.raises(InputError) as raised:
        signed(tmp_path, replace(shown, figures=more), limits={"EXX": 10, "EYY": 10})
    said = str(raised.value)
    assert "found 'EXX', 'EYY'; allowed: positioning EXX, reversal EXX, 'parameter NAME'" in said and "straightness" not in said


def test_pages_are_counted_and_where_no_interval_stands_no_statement_is_made(tmp_path: Path) -> None:
    doubtful = replace(sheet(1.0), budget=None, expected=None)
    assert "No statement of conformity is made" in page.typst(signed(tmp_path, doubtful), repr)
    assert "page 1 of 1" not in page.typst(signed(tmp_path, sheet(1.0)), repr)


def test_a_withheld_figure_says_why_where_nothing_stands(tmp_path: Path) -> None:
    found = signed(tmp_path, sheet(None), replace(GOOD, verdict="doubtful", reasons=("why",)))
    assert "EXZ cannot be separated from EBZ" in page.typst(found, repr)


@pytest.mark.parametrize(("expanded", "places"), [(None, 3), (0.014, 3), (0.14, 2), (1.4, 1), (9.96, 0), (25.0, 0), (140.0, 0)])
def test_an_uncertainty_has_two_significant_digits_and_its_value_as_many(expanded: float | None, places: int) -> None:
    assert page.digits(expanded) == places


@pytest.mark.parametrize(("half", "shown"), [(0.588, ["5.12", "0.60"]), (5.88, ["5.1", "6.0"]), (58.8, ["5", "60"])])
def test_value_and_uncertainty_on_the_page_end_at_one_digit(tmp_path: Path, half: float, shown: list[str]) -> None:
    (row,) = signed(tmp_path, sheet(5.123, half)).rows
    cells = page.cells(row)
    assert [cells[2], cells[4]] == shown


def test_an_end_beside_the_limit_shows_on_which_side_it_is(tmp_path: Path) -> None:
    (row,) = signed(tmp_path, sheet(8.0)).rows
    for most, shown in ((10.00004, "10.00004"), (9.996, "9.996"), (10.0, "10.00"), (9.5, "9.50")):
        assert page.cells(replace(row, decided=(1.0, most)))[3] == f"1.00 … {shown}"


@pytest.mark.parametrize(("supplied", "disclaimed"), [("none", False), ("None.", False), ("the limits, and the tool", True)])
def test_what_the_customer_supplied_has_a_disclaimer(tmp_path: Path, supplied: str, disclaimed: bool) -> None:
    told = signed(tmp_path, sheet(1.0), supplied=supplied).checklist["7.8.2.2 supplied by the customer"]
    assert told.startswith(supplied) and ("does not answer for them" in told) == disclaimed


@pytest.mark.parametrize("kind", ["positioning", "volumetric", "parameter", "part"])
def test_whatever_feels_an_expansion_needs_a_thermometer(tmp_path: Path, kind: str) -> None:
    """A volume, a length of a part and a scale of the fit are at 20 °C as positioning is: it alone asked for one."""
    shown = replace(sheet(1.0), thermal=Thermal(Known(20.5, 0.1), Known(20.2, 0.3), USUAL, USUAL), temperature="20 °C")
    for expands in (True, False):
        one = replace(shown.figures[0], kind=kind, name="Q", expands=expands)
        found = signed(tmp_path, replace(shown, figures=(one,)), limits={f"{kind} Q": 10})
        assert ("7.8.4.1 c) traceability" in found.missing) == expands


def test_notes_on_the_fit_are_no_deviations_from_the_method(tmp_path: Path) -> None:
    bent, left = replace(GOOD, remarks=("bent axes leave no residual",)), replace(MEASURED, remarks=("3 left",))
    noted = signed(tmp_path, sheet(1.0), bent, left)
    assert noted.checklist["7.8.2.1 n) additions, deviations"] == "none; 3 left"
    assert "'parameter'" in noted.checklist["other: notes"] and "bent axes" in noted.checklist["other: notes"]
    assert "other: notes" not in signed(tmp_path, sheet(1.0)).checklist


@pytest.mark.few(1)
@pytest.mark.skipif(not available(), reason="typst is not installed")
@pytest.mark.parametrize("count", [8, 16, 28])
def test_a_sheet_of_many_figures_is_one_page(tmp_path: Path, count: int) -> None:
    """Its signature was alone on a second one; a long sheet has smaller letters."""
    shown, names = sheet(1.0), [f"EXZ{i}" for i in range(count)]
    figures = tuple(replace(shown.figures[0], name=name) for name in names)
    noted = replace(GOOD, remarks=("a note of some hundred letters on what these touches cannot show of this machine " * 4,))
    found = signed(tmp_path, replace(shown, figures=figures), noted, limits={f"straightness {name}": 10 for name in names})
    sizes: list[float] = []

    def noticed(source: str) -> bytes:
        sizes.append(float(source.partition("#set text(size: ")[2].partition("pt")[0]))
        return compiled(source)

    assert re.findall(rb"/Count (\d+)", page.one_page(found, quoted, noticed))[0] == b"1"
    assert sizes[-1] >= 6.5, "28 figures had letters of 5.5 pt, which few read"


def test_a_parameter_rests_on_the_terms_and_a_figure_does_not(tmp_path: Path) -> None:
    """The figures were judged by their own fit. A fit by the terms that is doubtful states no parameter."""
    shown, doubted = sheet(1.0), Judgement("doubtful", ("the residuals are no mere scatter",))
    figures = (*shown.figures, replace(shown.figures[0], kind="parameter", name="EXX1"))
    limits = {"straightness EXZ": 10, "parameter EXX1": 10}
    found = made(order(tmp_path, limits=limits), replace(shown, figures=figures), GOOD, CELL, MEASURED, (), (), "1", TODAY, doubted)
    by_name = {r.name: r for r in found.rows}
    assert by_name["straightness EXZ"].verdict == "conforms" and not found.stands
    assert by_name["parameter EXX1"].verdict == "not stated" and "no mere scatter" in by_name["parameter EXX1"].why


@pytest.mark.parametrize(
    ("kind", "name", "axes"),
    [
        ("straightness", "EXZ zone", "Z"),
        ("squareness", "EB(0X)Z", "XZ"),
        ("squareness", "Z to Y", "YZ"),
        ("tilt", "C rotating", "C"),
        ("positioning gain", "EYY − EXX", "XY"),
        ("volumetric", "VA", "XYZ"),
        ("parameter", "EY0C", ""),
    ],
)
def test_a_figure_is_of_the_axes_in_its_name(kind: str, name: str, axes: str) -> None:
    over = {axis: Covered(axis, "mm", 0.0, 100.0, (-5.0, 500.0), 9) for axis in "XYZC"}
    figure = OnPart(kind, name, "µm", 1.0, (0.0, 2.0), None, "")
    assert "".join(c.axis for c in of_figure(figure, over)) == axes
