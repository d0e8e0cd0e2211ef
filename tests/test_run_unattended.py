"""A run that nobody is asked about: what a person has proven wrong of the control ends it before anything is sent."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from support.common_parts import dialect
from support.controls import GOLDEN, golden
from support.nights_parts import RealControl
from support.proof_parts import keys_of

from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell
from tango_cnc.files.commissioning import Proof, add_proofs
from tango_cnc.files.nightly import Nightly


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(GOLDEN, tmp_path / "cell"))


def tried(folder: Path, belief: str, verdict: str) -> None:
    """A try of one belief goes into the cell, as 'tango commission' would write it."""
    cell = read_cell(folder)
    assert cell.controller is not None
    key = keys_of(cell, dialect(cell))[belief]
    add_proofs(folder, cell.controller.post, [Proof(belief, verdict, "X ran the other way", profile=key)])


def run(folder: Path, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int | None, str]:
    code = guarded(tango.main, ["run", "-C", str(folder), "--port", "socket://127.0.0.1:9", "--yes", *more], standalone_mode=False)
    return code, capsys.readouterr().err


def test_what_is_proven_not_to_be_so_ends_a_run_that_nobody_is_asked_about(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tried(folder, "directions", "FAIL")
    code, said = run(folder, capsys)
    assert code == 2 and "It is NOT so: X ran the other way" in said and "Nothing was sent" in said
    assert "commissioning.yaml" in said and f"'tango commission -C {folder} --port socket://127.0.0.1:9' tries it again" in said
    assert not (folder / "program").exists() and not (folder / "readings.journal").exists()
    code, said = run(folder, capsys, "--simulated")
    assert code == 3, "no machine is there that could break: it is the port that nobody listens at"
    assert said.count("It is NOT so: X ran the other way") == 1 and "only because of --simulated" in said
    assert "not proven on this control" not in said


@pytest.mark.few(0)
def test_what_is_not_proven_is_said_and_ends_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tried(folder, "directions", "PASS")
    code, said = run(folder, capsys)
    assert code == 3 and "not proven on this control: " in said and "NOT so" not in said
    tried(folder, "directions", "FAIL")
    tried(folder, "directions", "PASS")  # mended and tried again
    assert run(folder, capsys)[0] == 3


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("verdict", "asked", "passed"), [("FAIL", False, False), ("FAIL", True, False), ("PASS", True, True), ("PASS", False, None)]
)
def test_a_night_never_goes_on_with_what_is_proven_not_to_be_so(
    folder: Path, verdict: str, asked: bool, passed: bool | None
) -> None:
    tried(folder, "directions", verdict)
    control = RealControl(read_cell(folder), Nightly(commissioned=asked), golden(), None, "20261101T020000Z")
    points = [p for p in control.preflight("full", ()) if p.check == "commissioned"]
    assert [p.passed for p in points] == ([] if passed is None else [passed])
    assert all(p.passed or ("X ran the other way" in str(p.found) and "tango commission" in str(p.do)) for p in points)


def test_a_plan_of_a_control_with_something_that_is_not_so_leads_to_a_try(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tried(folder, "directions", "FAIL")
    assert guarded(tango.main, ["plan", "-C", str(folder)], standalone_mode=False) in (0, None)
    assert f"Next: tango commission -C {folder}, then tango run" in capsys.readouterr().err
