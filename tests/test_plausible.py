"""A result that must not be believed says so: in words, as JSON, by its exit status, and in every command that shows numbers."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest
from click.testing import CliRunner
from support.commands import called
from support.trust_parts import usable

from tango_cnc import judging
from tango_cnc.cli import tango
from tango_cnc.commands.estimate import sound_words
from tango_cnc.files import artefact_text, machine_text, read_artefact, read_cell, read_machine
from tango_cnc.judgement import Judgement
from tango_cnc.report.verdict import Check, worst_of
from tango_cnc.verify.held_out import HeldOut


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example cell with its readings; nobody changes it."""
    folder = tmp_path_factory.mktemp("plausible") / "cell"
    runner = CliRunner()
    assert runner.invoke(tango, ["init", str(folder)]).exit_code == 0
    result = runner.invoke(tango, ["simulate", "-C", str(folder)])
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture
def cell(measured: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(measured, tmp_path / "cell"))


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


def test_an_estimate_is_judged_by_its_own_terms_whatever_tango_yaml_states(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the larger set that is offered may be the one that was fitted."""
    seen: list[object] = []
    monkeypatch.setattr(judging, "honest", lambda result: result)
    monkeypatch.setattr(judging, "judge", lambda own, *rest, **more: seen.append(own.terms))
    own = read_cell(cell)
    judging.judged(own, cast("Any", None), ("S1",), fit=lambda: cast("Any", None))
    assert seen == [("S1",)] != [own.terms]


def turned_round(cell: Path) -> None:
    change(cell / "machine.yaml", "B: {kind: rotary, direction: [0, 1, 0]", "B: {kind: rotary, direction: [0, -1, 0]")


def readings_of(cell: Path) -> Path:
    return next(f for f in (cell / "readings.csv", cell / "simulated.csv") if f.exists())


def estimated(capsys: pytest.CaptureFixture[str], cell: Path, *more: str) -> tuple[int, dict[str, Any]]:
    code, out, _ = called(capsys, "estimate", "-C", cell, "--readings", readings_of(cell), "--json", "-", *more)
    return code, json.loads(out)


@pytest.mark.long
def test_a_sound_cell_is_trustworthy(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, data = estimated(capsys, cell)
    assert code == 0
    assert (data["verdict"], data["suspicions"], data["untrusted"]) == ("trustworthy", [], ["EY0S", "EYYb", "EZt"])
    assert any("cannot show a step of Y" in note and "EYYb" in note for note in data["remarks"])
    step = "topology: wCBXfZY(S)t\ntolerances: {step: 0.0003}"
    change(cell / "machine.yaml", "topology: wCBXfZY(S)t", step)  # positioning was measured: no step is larger
    assert estimated(capsys, cell)[1]["untrusted"] == []
    shown = called(capsys, "estimate", "-C", cell, "--readings", readings_of(cell))[1]
    assert shown.splitlines()[-1] == "trustworthy: nothing was found that speaks against these numbers"
    doubted = Judgement("trustworthy", untrusted=("EX0C",))
    assert sound_words(doubted).startswith("trustworthy, except EX0C:")


@pytest.mark.long
def test_an_axis_that_turns_the_other_way_is_implausible(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    turned_round(cell)
    code, data = estimated(capsys, cell)
    assert (code, data["verdict"]) == (1, "implausible")
    assert any("of 393 touches do not fit" in reason for reason in data["reasons"])
    first = data["suspicions"][0]
    assert (first["text"], first["file"], first["line"]) == ("the readings fit if B turns the other way", "machine.yaml", 7)


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    [
        ["compensate", "--target", "iso230", "--simulated"],
        pytest.param(["compensate", "part.ngc", "--simulated"], marks=pytest.mark.long),
        pytest.param(["predict", "part.ngc"], marks=pytest.mark.long),
    ],
)
def test_nothing_is_made_of_an_implausible_estimate(
    command: list[str], cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    turned_round(cell)
    monkeypatch.chdir(tmp_path)
    Path("part.ngc").write_text("G21 G90 G94\nG1 X0 Y0 Z100 F500\nG1 X10\nM2\n", encoding="utf-8")
    code, _, err = called(capsys, *command, "-C", cell, "--readings", readings_of(cell))
    assert code == 1 and "the estimate is implausible and is not used" in err
    assert not (cell / "compensations").exists()


def test_who_makes_something_of_a_doubtful_estimate_reads_why_it_is_doubtful(capsys: pytest.CaptureFixture[str]) -> None:
    usable(Judgement("doubtful", ("the table moved at touch 70",), ("30 °C",), untrusted=("EX0C",)), False, "compensate")
    err = capsys.readouterr().err
    assert "DOUBTFUL" in err and "the table moved at touch 70" in err and "not to be trusted: EX0C" in err and "note: 30 °C" in err


@pytest.mark.long
@pytest.mark.parametrize("command", ["estimate", "verify", "iso230", "report", "uncertainty"])
def test_every_command_that_shows_numbers_says_so(command: str, cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    turned_round(cell)
    more = {"report": ["--no-pictures"], "uncertainty": ["--trials", "1000"], "verify": ["--groups", "14"]}.get(command, [])
    code, out, _ = called(capsys, command, "-C", cell, "--readings", readings_of(cell), *more)
    assert code == 1 and "IMPLAUSIBLE: do not act on these numbers" in out
    if command == "report":
        page = (cell / "report.html").read_text(encoding="utf-8")
        assert "Do not use these numbers" in page and 'class="check good"' not in page
    if command == "estimate":
        assert called(capsys, command, "-C", cell, "--readings", readings_of(cell), "--despite")[0] == 0


def halved(cell: Path) -> None:
    file = readings_of(cell)
    head, *rows = file.read_text(encoding="utf-8").splitlines()
    file.write_text("\n".join([head, *rows[::2]]) + "\n", encoding="utf-8")


@pytest.mark.long
def test_half_of_the_readings_is_incomplete_and_not_used(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    halved(cell)
    code, data = estimated(capsys, cell)
    assert (code, data["verdict"], data["incomplete"]) == (1, "doubtful", True)
    (reason,) = (r for r in data["reasons"] if r.startswith("196 of 393 planned touches are missing"))
    assert reason.endswith(
        "197 are there; make the missing touches, or measure again. For the office: 'tango run --resume' makes them"
    )


@pytest.mark.long
def test_half_of_the_readings_is_used_when_told(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    halved(cell)
    assert estimated(capsys, cell, "--despite")[0] == 0


@pytest.mark.long
def test_half_of_the_readings_makes_no_new_strategy(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    halved(cell)
    code, _, err = called(capsys, "design", "-C", cell, "--goal", "check", "--minutes", "3", "--readings", readings_of(cell))
    assert code == 1 and "design --readings: the estimate is incomplete and is not used" in err


@pytest.mark.long
def test_a_report_on_half_of_the_readings_has_nothing_green(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    halved(cell)
    code, out, _ = called(capsys, "report", "-C", cell, "--readings", readings_of(cell), "--no-pictures", "--json", "-")
    data = json.loads(out)
    assert (code, data["overall"], data["verdict"]) == (1, "stop", "doubtful")
    assert 'class="check good"' not in (cell / "report.html").read_text(encoding="utf-8")


def test_nothing_is_green_beside_what_the_diagnosis_cannot_explain() -> None:
    good = Check("fit", "good", "1.0 ×", "fits")
    unexplained = Check("diagnosis", "look", "unexplained", "something acts", undermines=True)
    found = worst_of([good, unexplained])
    assert (found.level, found.worst) == ("look", unexplained)
    assert not any(c.level == "good" and not c.open for c in found.checks)
    assert not worst_of([good, replace(unexplained, undermines=False)]).checks[0].open


@pytest.mark.long
def test_touches_that_are_not_predicted_make_an_estimate_doubtful(
    cell: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(HeldOut, "ratio", property(lambda _: 1.7))
    _, data = estimated(capsys, cell)
    assert data["verdict"] == "doubtful"
    assert any("1.7 times as far off as predicted" in reason for reason in data["reasons"])


@pytest.mark.long
def test_terms_that_leave_most_of_the_errors_are_implausible(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, data = estimated(capsys, cell, "--terms", "S1")
    assert data["verdict"] == "implausible"
    assert any("at most 50 µm is plausible" in reason for reason in data["reasons"])


@pytest.mark.long
def test_who_knows_less_of_a_machine_states_it(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change(cell / "world.yaml", "EX0C: -0.1138", "EX0C: -1.4")
    assert called(capsys, "simulate", "-C", cell, "-o", readings_of(cell))[0] == 0
    assert estimated(capsys, cell)[1]["verdict"] == "implausible"
    with (cell / "machine.yaml").open("a", encoding="utf-8") as file:
        file.write("tolerances: {location: 2}\n")
    code, data = estimated(capsys, cell)
    assert (code, data["verdict"]) == (0, "trustworthy")


def test_tolerances_survive_being_written(cell: Path) -> None:
    with (cell / "machine.yaml").open("a", encoding="utf-8") as file:
        file.write("tolerances: {angle: 0.2, scale: 900, stylus: 3}\n")
    with (cell / "artefact.yaml").open("a", encoding="utf-8") as file:
        file.write("tolerances: {facet: 4, placement_angle: 2}\n")
    known = read_cell(cell)
    assert known.machine.tolerances.scale == pytest.approx(9e-4)
    (cell / "machine.yaml").write_text(machine_text(known.machine), encoding="utf-8")
    (cell / "artefact.yaml").write_text(artefact_text(known.artefact), encoding="utf-8")
    assert read_machine(cell / "machine.yaml").tolerances == known.machine.tolerances
    assert read_artefact(cell / "artefact.yaml").tolerances == known.artefact.tolerances


def test_a_tolerance_that_nobody_knows_is_refused(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (cell / "machine.yaml").open("a", encoding="utf-8") as file:
        file.write("tolerances: {pivot: 2}\n")
    code, _, err = called(capsys, "estimate", "-C", cell)
    assert code == 2 and "tolerances.pivot: found the unknown key 'pivot'" in err


@pytest.mark.long
def test_what_the_plan_left_out_is_not_missing(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = readings_of(cell)
    lines = source.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if not (line[0].isdigit() and int(line.split(",")[0]) % 6 == 0)]
    source.write_text("".join(kept), encoding="utf-8")
    assert any("planned touches are missing" in reason for reason in estimated(capsys, cell)[1]["reasons"])
    source.with_suffix(".json").write_text(
        json.dumps({"format": "tango-run/1", "left_out_touches": list(range(6, 394, 6))}), encoding="utf-8"
    )
    _, data = estimated(capsys, cell)
    assert not any("missing" in text for text in (*data["reasons"], *data["remarks"]))
