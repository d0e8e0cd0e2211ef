"""The first hour at a machine: what is asked, refused and handed out, and in which order."""

from __future__ import annotations

import importlib
import re
import shutil
from pathlib import Path

import click
import pytest
from support.controls import GOLDEN, golden, stating
from support.linkparts import job
from support.proof_parts import keys_of
from support.runs import Result
from support.simulated_runs import controller

from postprocessors import load
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.commission import experiments
from tango_cnc.files import read_cell
from tango_cnc.files.commissioning import Proof, add_proofs
from tango_cnc.link.client import Failed
from tango_cnc.link.protocols import dnc, file

SPLIT = "split"  # its strategy turns the spindle


def call(*words: object) -> int:
    return guarded(tango.main, [str(word) for word in words], prog_name="tango", standalone_mode=False)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A small cell without a control."""
    write_example(tmp_path / "cell", "trunnion")
    return tmp_path / "cell"


@pytest.fixture
def at_a_terminal(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A person sits there, who answers with what is in this list, and then no."""
    answers: list[str] = []

    def said(prompt: str) -> str:
        click.echo(prompt, err=True)
        return answers.pop(0) if answers else "n"

    for module in ("_written", "run", "commission"):
        monkeypatch.setattr(f"tango_cnc.commands.{module}.attended", lambda: True)
    monkeypatch.setattr(click.termui, "visible_prompt_func", said)
    return answers


@pytest.mark.few(0)
@pytest.mark.parametrize("words", [("locate",), ("commission", "--touch"), ("run",), ("commission",)], ids=" ".join)
def test_what_to_do_at_the_control_is_said_after_the_question_whether_to_start(
    cell: Path, capsys: pytest.CaptureFixture[str], at_a_terminal: list[str], words: tuple[str, ...]
) -> None:
    """ "The control has to have …TANGO.H now" stood before the warnings: who reads on starts it before having read them."""
    stating(cell, post="heidenhain", port=f"file://{cell.parent / 'RECORDS.TXT'}")
    at_a_terminal += ["y", "y"] if words == ("commission",) else []
    assert call(*words, "-C", cell) != 0
    said = capsys.readouterr().err
    assert "Start?" in said and "hand on feed hold" in said
    assert "has to have" not in said and "TANGO.A" not in said and "] 0/" not in said
    if words == ("run",):  # the others wait as long as their touches may take
        at_a_terminal.append("y")
        assert call(*words, "-C", cell, "--timeout", "0.5") == 3
        said = capsys.readouterr().err
        assert -1 < said.index("Start?") < said.index("TANGO.A in ") < said.index("the control has to have ")


WHERE = {  # command → where its work begins
    "run": "tango_cnc.plan.plan",
    "locate": "tango_cnc.locate.strategy",
    "commission": "tango_cnc.commission.above.flight",
    "commission --touch": "tango_cnc.commands._commission_touch.plan",
    "nightly": "tango_cnc.plan.plan",
    "nightly --dry-run": "tango_cnc.plan.plan",
    "link-test": "tango_cnc.link.transport.open_port",
}


@pytest.mark.parametrize("port", ["sockt://127.0.0.1:8193", "tcp//127.0.0.1:8193", "socket://127.0.0.1", "file:///tmp"])
@pytest.mark.parametrize("command", WHERE)
def test_a_port_that_no_run_can_use_is_refused_before_any_work(
    cell: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, command: str, port: str
) -> None:
    """The answer came after ten seconds of planning and a page of warnings; a night put itself on record."""
    stating(cell, post="fanuc", port="socket://127.0.0.1:8193", probe_state="none")
    (cell / "nightly.yaml").write_text("format: tango-nightly/1\nowner: Ann\n", encoding="utf-8")
    before = sorted(cell.rglob("*"))

    def worked(*_: object, **__: object) -> None:
        raise AssertionError("it has begun")

    importlib.import_module("tango_cnc.link.measure")  # else it would keep what stands in for the port
    monkeypatch.setattr(WHERE[command], worked)
    assert call(*command.split(), "-C", cell, "--port", port) == 2
    said = capsys.readouterr().err
    assert said.startswith("tango: port ") and said.count("\n") == 1, said
    assert sorted(cell.rglob("*")) == before


@pytest.mark.few(0)
def test_a_plan_for_another_post_says_what_has_to_be_stated_before_it_can_run(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It handed out 'tango commission', which tries the post of the cell and not that of the program."""
    stating(cell, post="fanuc", port="socket://127.0.0.1:8193", probe_state="none")
    where = cell / "tango.yaml"
    assert call("plan", "-C", cell, "--post", "haas") == 0
    said = capsys.readouterr().err
    first = f"Next: state post: haas under controller: in {where} in place of fanuc, then tango commission -C {cell}"
    assert first in said, said
    assert call("plan", "-C", cell, "--post", "fanuc") == 0
    assert f"Next: tango commission -C {cell}" in capsys.readouterr().err
    (cell / "tango.yaml").write_text("tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\n")
    assert call("plan", "-C", cell, "--post", "haas") == 0
    first = f"Next: state post: haas and its port under controller: in {where}, then tango commission"
    assert first in capsys.readouterr().err


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("port", "whole"),
    [
        ("grbl+socket://127.0.0.1:8411", "grbl+socket://127.0.0.1:8411?orient=m19"),
        ("/dev/ttyUSB0", "serial:///dev/ttyUSB0?orient=m19"),
        ("grbl+socket://127.0.0.1:8411?orient=refuse&feed=900", "grbl+socket://127.0.0.1:8411?feed=900&orient=m19"),
    ],
)
def test_a_plan_that_turns_the_spindle_of_a_grbl_is_answered_with_the_whole_url(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    at_a_terminal: list[str],
    port: str,
    whole: str,
) -> None:
    """'tango plan' was silent; 'tango commission' refused after a pushed stylus, a jog and a yes."""
    write_example(tmp_path / "cell", SPLIT)
    cell = stating(tmp_path / "cell", post="grbl", port=port)
    assert call("plan", "-C", cell) == 0
    said = capsys.readouterr().err
    assert f"turns the spindle; allowed: one angle S, or orient=m19 in the port's URL: {whole}" in said
    assert f"Next: correct controller.port in {cell / 'tango.yaml'}, then tango commission" in said
    assert call("commission", "-C", cell) == 2
    said = capsys.readouterr().err
    assert f"in the port's URL: {whole}" in said and said.count("\n") == 1
    stating(cell, post="grbl", port=whole)
    assert call("plan", "-C", cell) == 0
    said = capsys.readouterr().err
    assert "spindle" not in said and "Next: tango commission" in said


def test_of_a_machine_without_rotary_axes_nothing_is_said_of_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """'Rotary axes turn about the points that machine.yaml states' was not proven, of a machine that has none."""
    write_example(tmp_path / "cell", "three_axis")
    folder = stating(tmp_path / "cell", post="fanuc", port="socket://127.0.0.1:9", probe_state="none")
    cell = read_cell(folder)
    key = keys_of(cell, load("fanuc"))
    add_proofs(folder, "fanuc", [Proof(e.belief, "PASS", "seen", profile=key[e.belief]) for e in experiments() if not e.touches])
    assert call("locate", "-C", folder, "--yes") == 3
    said = capsys.readouterr().err
    assert "not proven" not in said and "commission" not in said


@pytest.mark.few(0)
def test_a_control_that_was_reset_is_not_asked_for_its_probe(tmp_path: Path) -> None:
    """ALARM:3, reset while moving, after good contacts: the text asked for a dead probe, and for a rule."""
    write_example(tmp_path / "cell", "trunnion")
    folder = stating(tmp_path / "cell", post="grbl", port="grbl+socket://127.0.0.1:1")
    with controller(folder, "--protocol", "grbl", "--tcp", "127.0.0.1:0", "--fault", "alarm-after=2") as url:
        stopped = Result("locate", "-C", folder, "--port", url, "--yes")
    assert stopped.code == 3 and "reset while moving" in stopped.err
    assert "What has reset the control" in stopped.err and "probe alive" not in stopped.err and "rule" not in stopped.err


@pytest.mark.few(1)
@pytest.mark.parametrize("words", [("run",), ("locate",), ("commission", "--touch")], ids=" ".join)
def test_an_axis_that_goes_the_other_way_is_no_question_at_a_terminal(
    cell: Path, capsys: pytest.CaptureFixture[str], at_a_terminal: list[str], words: tuple[str, ...]
) -> None:
    """ "It is NOT so: X goes the other way", and "Start? [y/N]" all the same; with --yes it was refused."""
    stating(cell, post="fanuc", port="socket://127.0.0.1:9", probe_state="none")
    made = read_cell(cell)
    assert made.controller is not None
    key = keys_of(made, load("fanuc"))
    add_proofs(cell, "fanuc", [Proof("directions", "FAIL", "X went the other way", profile=key["directions"])])
    assert call(*words, "-C", cell) == 2
    said = capsys.readouterr().err
    assert "It is NOT so: X went the other way" in said and "What to do: " in said and "nobody may go on with it" in said
    assert "Start?" not in said and not (cell / "program").exists()
    if words == ("run",):  # a stylus that hangs aside is seen by whoever is there
        add_proofs(cell, "fanuc", [Proof("directions", "PASS", "seen", profile=key["directions"])])
        stating(cell, post="fanuc", port=f"file://{cell.parent / 'R.TXT'}?link=file", probe_state="none")
        add_proofs(cell, "fanuc", [Proof("deflected", "FAIL", "it went on", profile=key["deflected"])])
        assert call(*words, "-C", cell) != 2
        said = capsys.readouterr().err
        assert "Start?" in said and "It is NOT so: it went on. What to do: " in said


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("typed", "times", "offered"), [(["", "maybe", "YES", "n"], 3, False), (["No"], 1, False), (["?", "Y"], 1, True)]
)
def test_enter_is_no_answer_to_whether_the_probe_is_heard(
    cell: Path, capsys: pytest.CaptureFixture[str], at_a_terminal: list[str], typed: list[str], times: int, offered: bool
) -> None:
    """Enter alone was 'not seen', and the program was offered as after a yes; 'yes', 'Y' and 'N' were refused."""
    stating(cell, post="heidenhain", port=f"file://{cell.parent / 'RECORDS.TXT'}")
    at_a_terminal += typed
    assert call("commission", "-C", cell) != 0
    said = capsys.readouterr().err
    assert said.count("does the control show the signal come and go") == times
    assert ("Start?" in said, "Nothing was sent" in said) == (offered, not offered)


@pytest.mark.few(1)
@pytest.mark.parametrize("words", [("run",), ("locate",), ("commission", "--touch"), ("commission",)], ids=" ".join)
@pytest.mark.parametrize("port", ["file://{cell}/not there/TANGO.TXT", "socket://127.0.0.1:9"])
def test_nobody_is_asked_whether_to_start_over_a_port_that_does_not_open(
    cell: Path, capsys: pytest.CaptureFixture[str], at_a_terminal: list[str], words: tuple[str, ...], port: str
) -> None:
    """'Start?', yes, 'the control has to have it now', and only then that nobody listens there."""
    url = port.format(cell=cell).replace(" ", "%20")
    stating(cell, post="fanuc", port=f"{url}{'?link=file' if url.startswith('file') else ''}", probe_state="none")
    at_a_terminal += ["y"] * 3
    assert call(*words, "-C", cell) == 3
    said = capsys.readouterr().err
    assert "Start?" not in said and "has to have" not in said and "Nothing was sent" in said


def test_a_program_that_is_started_before_the_answer_is_taken_and_an_old_one_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The question reads like the moment to press start: its start mark stood there before the yes, and was not seen."""
    cell, records = Path(shutil.copytree(GOLDEN, tmp_path / "cell")), tmp_path / "RECORDS.TXT"
    stating(cell, post="heidenhain", port=f"file://{records}")
    assert call("plan", "-C", cell) == 0
    said = re.search(r"PROGRAM ([0-9A-F]{12})", next(cell.glob("program/*.H")).read_text())
    assert said is not None
    start = f"TANGO START {said[1]} {len(golden().touches)}\n"
    records.write_text(f"{start}P1 H1 X0.0\n", encoding="ascii")  # of yesterday, and of this very program

    def presses(prompt: str) -> str:
        """The person: starts the control, and then answers."""
        records.write_text(records.read_text(encoding="ascii") + start, encoding="ascii")
        return "y"

    monkeypatch.setattr("tango_cnc.commands.run.attended", lambda: True)
    monkeypatch.setattr("tango_cnc.commands.run.start_patience", lambda someone: 0.5)
    for person, why in ((lambda prompt: "y", "no start mark was written within"), (presses, "no record was written within")):
        monkeypatch.setattr(click.termui, "visible_prompt_func", person)
        assert call("run", "-C", cell, "--timeout", "0.5") == 3
        assert why in capsys.readouterr().err


@pytest.mark.parametrize("client", [dnc.Client, file.Client])
def test_another_program_that_runs_may_be_moving(client: type[dnc.Client | file.Client]) -> None:
    task = job()
    talk = client(task, {"listen": "no"} if client is dnc.Client else {})
    talk.bytes_to_send(100_000)
    (said,) = talk.receive(b"TANGO START 0B80 3\n")
    assert isinstance(said, Failed) and "feed hold" in said.why and "look at the machine" in said.why
