"""Before `tango commission` sends anything it asks for a hand at stylus and handwheel: a no ends it, and nothing moves."""

from __future__ import annotations

import io
import re
import socket
import sys
from pathlib import Path

import pytest
import yaml
from support.controls import golden
from support.dialects import EVERY
from support.profiles import spoken
from support.proof_parts import keys_of, remedy_here

from postprocessors import load
from tango_cnc import commission
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell
from tango_cnc.files.commissioning import Proof, add_proofs, read_commissioning

HAND = "signal come and go"
WAY = "away from the table?"


class Terminal(io.StringIO):
    """A standard input that a person sits at."""

    def isatty(self) -> bool:
        return True


def called(cell: Path, answers: str, monkeypatch: pytest.MonkeyPatch, *more: str) -> tuple[int, bool]:
    """cell, what the person types → exit status, and whether anything was sent to the control."""
    monkeypatch.setattr(sys, "stdin", Terminal(answers))
    with socket.create_server(("127.0.0.1", 0)) as control:
        control.settimeout(0.3)
        turning = "?orient=m19" if "grbl" in (cell / "tango.yaml").read_text(encoding="utf-8") else ""
        port = f"socket://127.0.0.1:{control.getsockname()[1]}{turning}"
        given = ["commission", "-C", str(cell), *([] if "--program" in more else ["--port", port]), *more]
        code = guarded(tango.main, given, prog_name="tango", standalone_mode=False)
        try:
            return code, control.accept()[0].recv(1) != b""
        except TimeoutError:
            return code, False


def cell_of(folder: Path, name: str) -> Path:
    """folder, dialect → the cell of an example with that control, as far as it needs no more than its name."""
    write_example(folder, "hu40t")
    file = folder / "tango.yaml"
    file.write_text(spoken(file.read_text(encoding="utf-8"), f"post: {name}"), encoding="utf-8")
    return folder


@pytest.mark.few(1)
@pytest.mark.parametrize("name", sorted(EVERY))
@pytest.mark.parametrize(("answers", "belief"), [("n\n", "alive"), ("y\nn\n", "directions")])
def test_a_no_by_hand_fails_the_belief_and_nothing_is_sent(
    tmp_path: Path, name: str, answers: str, belief: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A dead probe beside a reversed Z, inches or a hidden offset: the first move of the program touched the table."""
    cell = cell_of(tmp_path / "cell", name)
    assert called(cell, answers, monkeypatch) == (1, False)
    said = capsys.readouterr()
    assert "Nothing was sent" in said.err and "Start?" not in said.err, said
    (proof,) = read_commissioning(cell)
    assert (proof.belief, proof.verdict) == (belief, "FAIL") and "before anything was sent" in proof.found
    assert not list(cell.glob("readings*"))


@pytest.mark.few(0)
def test_what_is_proven_is_not_asked_and_a_yes_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = cell_of(tmp_path / "cell", "fanuc")
    assert called(cell, "y\ny\nn\n", monkeypatch)[1] is False
    said = capsys.readouterr().err
    assert said.index(HAND) < said.index(WAY) < said.index("Start?") and "docs/controls/fanuc.md" in said
    known = keys_of(read_cell(cell), load("fanuc"))
    add_proofs(cell, "fanuc", [Proof(b, "PASS", "seen", profile=known[b]) for b in ("alive", "directions")])
    assert called(cell, "n\n", monkeypatch)[1] is False
    said = capsys.readouterr().err
    assert HAND not in said and WAY not in said and "Start?" in said


@pytest.mark.few(0)
def test_a_program_that_somebody_else_starts_has_the_questions_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called(cell_of(tmp_path / "cell", "siemens"), "", monkeypatch, "--program") == (0, False)
    said = capsys.readouterr().out
    assert HAND in said and WAY in said and "do not start it" in said


def test_up_is_the_way_that_leads_away_from_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called(cell_of(tmp_path / "cell", "fanuc"), "", monkeypatch, "--program") == (0, False)
    (name,) = re.findall(r"Jog ([XYZ]) by 1 mm towards (plus|minus)", capsys.readouterr().out)
    made = commission.air(golden())
    column = made.machine.column(name[0])
    up = made.touches[0].over[column] - made.touches[0].standoff[column]
    assert name[0] in next(iter(made.moves)).target and name[1] == ("plus" if up > 0 else "minus")


@pytest.mark.parametrize("name", sorted(EVERY))
def test_a_stop_that_blames_frames_names_the_mirror_image_and_what_to_change(name: str) -> None:
    """A mirrored Z looks like a frame: the first move goes down, and something is met."""
    made = commission.air(golden())
    what = commission.Seen(made, {}, True, False, said="PROBE MET SOMETHING ON ITS WAY OR A FRAME IS ACTIVE")
    (failed,) = [j for j in commission.judge(what) if j.verdict.verdict == "FAIL"]
    assert failed.experiment.belief == "frames"
    assert "mirror image of this axis" in failed.verdict.found and "directions" in failed.verdict.found
    assert "mirror image of it is on: switch it off at the control" in failed.experiment.advice
    remedies = load(name).remedies
    assert ("A mirror image here:" in remedy_here(load(name), "frames")) == ("mirror" in remedies)


@pytest.mark.few(0)
@pytest.mark.parametrize("first", [1, 2])
def test_the_stylus_that_has_to_be_in_the_spindle_is_named_before_anything_moves(
    first: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the other one, 80 mm longer, the first guarded move met the table before a finger had proven the probe."""
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    machine = yaml.safe_load((cell / "machine.yaml").read_text())
    length = machine["probe"]["length"]
    (cell / "machine.yaml").write_text(yaml.safe_dump({**machine, "styli": [{"length": length + 80}]}))
    strategy = yaml.safe_load((cell / "strategy.yaml").read_text())
    strategy["indexations"] = [{**each, "stylus": first} for each in strategy["indexations"]]
    (cell / "strategy.yaml").write_text(yaml.safe_dump(strategy))
    right = length if first == 1 else length + 80
    for command in ("commission", "locate"):
        code = guarded(tango.main, [command, "-C", str(cell), "--program"], prog_name="tango", standalone_mode=False)
        before = [line for line in capsys.readouterr().out.splitlines() if line.startswith("before it: ")]
        assert code == 0 and before[0].startswith(f"before it: Probe with stylus {first} ({right:g} mm) in the spindle and on."), (
            before
        )
