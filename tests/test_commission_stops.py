"""A commissioning that breaks off proves nothing that it did not get to: no move without a record, no blame without a text."""

from __future__ import annotations

import io
import json
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.controls import golden
from support.profiles import spoken
from support.proof_parts import keys_of

from postprocessors import load, unverified
from tango_cnc import commission
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.commission import _with_text
from tango_cnc.commands.init import write_example
from tango_cnc.commission.experiments.records import coarse
from tango_cnc.commission.timing import expected
from tango_cnc.files import read_cell
from tango_cnc.files.commissioning import Proof, add_proofs, read_commissioning
from tango_cnc.records import Plan


@cache
def air() -> Plan:
    return commission.air(golden())


def records(count: int, step: float = 0.0) -> dict[int, tuple[int, Mapping[str, float]]]:
    """how many moves were made, mm to which the control stores a position → their records."""
    made, found = air(), {}
    for touch in made.touches[:count]:
        place = dict(zip(made.machine.names, touch.end, strict=True))
        found[touch.number] = (0, {n: round(v / step) * step if step and n in made.machine.linear else v for n, v in place.items()})
    return found


def said_yes() -> dict[str, dict[str, bool]]:
    return {belief: dict.fromkeys(each, True) for belief, each in commission.questions(air()).items()}


def verdicts(what: commission.Seen) -> dict[str, str]:
    return {judged.experiment.belief: judged.verdict.verdict for judged in commission.judge(what)}


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_yes_to_a_move_without_a_record_proves_nothing(count: int) -> None:
    what = commission.Seen(air(), records(count), count > 0, False, answers=said_yes())
    found = verdicts(what)
    assert (found["directions"], found["sense"], found["orientation"]) == ("OPEN", "OPEN", "OPEN")
    assert found["override"] == ("OPEN" if count == 0 else "PASS")
    asked = commission.answerable(commission.questions(air()), what)
    assert set(asked.get("directions", {})) == {name for name, q in commission.questions(air())["directions"].items()
                                               if q.moves[0] <= count}  # fmt: skip
    assert "sense" not in asked and "orientation" not in asked


def test_a_no_to_a_move_without_a_record_blames_nobody() -> None:
    no = {belief: dict.fromkeys(each, False) for belief, each in commission.questions(air()).items()}
    found = verdicts(commission.Seen(air(), records(0), True, False, answers=no))
    assert "FAIL" not in found.values()


def test_every_yes_counts_where_all_moves_were_made() -> None:
    found = verdicts(commission.Seen(air(), records(len(air().touches)), True, True, answers=said_yes()))
    assert {found[belief] for belief in ("directions", "sense", "orientation", "override")} == {"PASS"}


def test_a_stop_without_a_text_blames_no_probe() -> None:
    """Soft limits, a wrong feed, a rotary axis not in place: they all look the same from here."""
    what = commission.Seen(air(), {}, True, False)
    assert "FAIL" not in verdicts(what).values()
    with_text = verdicts(replace(what, said="MC3088 STYLUS NOT TOUCHED"))
    assert [belief for belief, verdict in with_text.items() if verdict == "FAIL"] == ["alive"]


@pytest.mark.parametrize(("text", "word"), [
    ("OT0500 + OVERTRAVEL ( SOFT 1 ) Z", "soft limits"),
    ("CANCEL Z travel exceeded", "the wrong way round"),
    ("LIMIT SWITCH C+", "nearer: true in machine.yaml"),
    ("65006 TANGO RECORD COULD NOT BE WRITTEN", "extdev.ini"),
    ("12550 NAME NOT DEFINED", "machine_axes"),
    ("PS0035 CAN NOT COMMAND G31", "feed of approach"),
    ("SW0100 PARAMETER WRITE", "list of alarms"),
    ("Z stands at 32.3800 after it was sent to 656.8300: the control has ended the move by itself, and has met nothing", "-t 1"),
])  # fmt: skip
def test_a_stop_that_is_no_belief_has_advice_too(text: str, word: str) -> None:
    assert "FAIL" not in verdicts(commission.Seen(air(), {}, True, False, said=text)).values()
    assert word in commission.stopped_by(text) and text in commission.stopped_by(text)


USELESS = (0.1, 0.0254, 0.0127, 0.0125, 0.01, 0.007, 0.005)


@pytest.mark.parametrize(("step", "verdict"), [*((s, "FAIL") for s in USELESS), *((s, "PASS") for s in (0.00254, 0.001, 0.0))])
def test_positions_in_steps_that_are_useless_are_no_records(step: float, verdict: str) -> None:
    whole = air()
    away = tuple(replace(t, end=tuple(v + 0.0037 * (t.number + i) for i, v in enumerate(t.end))) for t in whole.touches)
    made = replace(whole, touches=away)  # not round numbers, as on a machine whose pivots are not
    names = made.machine.names
    found: dict[int, tuple[int, Mapping[str, float]]] = {}
    for touch in made.touches:
        place = dict(zip(names, touch.end, strict=True))
        found[touch.number] = (0, {n: round(v / step) * step if step and n in made.machine.linear else v for n, v in place.items()})
    assert verdicts(commission.Seen(made, found, True, True))["records"] == verdict


@pytest.mark.few(0)
@pytest.mark.parametrize("draws", [12, pytest.param(200, marks=pytest.mark.long)])
@pytest.mark.parametrize("places", [3, 4])
def test_few_places_of_a_fine_control_are_multiples_of_something_and_no_coarse_steps(places: int, draws: int) -> None:
    """Three moves from a place that is no round number, as where three beliefs are left to prove."""
    made, rng = air(), np.random.default_rng(places)
    linear = [made.machine.column(n) for n in made.machine.linear]
    for _ in range(draws):
        start = np.array(made.touches[0].end)
        start[linear] = rng.uniform(-300, 300, 3)
        ends = [start + 5.0 * (np.arange(len(start)) == column) for column in linear]
        few = replace(made, touches=tuple(replace(t, end=tuple(e)) for t, e in zip(made.touches, ends, strict=False)))
        found = {t.number: (0, dict(zip(made.machine.names, np.round(t.end, places), strict=True))) for t in few.touches}
        assert coarse(commission.Seen(few, found, True, True)) is None


def test_moves_that_took_no_time_prove_no_pace() -> None:
    made = air()
    found = {t.number: (0, dict(zip(made.machine.names, t.end, strict=True))) for t in made.touches}
    needed = expected(made, 3000.0)
    clock = dict(zip(found, np.cumsum([needed[n] for n in found]), strict=True))
    for speed, verdict in ((1.0, "PASS"), (0.8, "PASS"), (0.0, "OPEN")):
        times = {number: speed * float(at) for number, at in clock.items()}
        assert verdicts(commission.Seen(made, found, True, True, times=times))["pace"] == verdict


def test_an_alarm_of_the_program_is_known_by_its_number() -> None:
    """The text may not be on the screen any more."""
    for number, belief in (
        ("65001", "alive"),
        ("65005", "rotary"),
        ("65008", "frames"),
        ("alarm 65009", "frames"),
        ("65010", "miss"),
    ):
        said = _with_text(number, load("siemens"), {})
        found = verdicts(commission.Seen(air(), {}, True, False, said=said))
        assert [name for name, verdict in found.items() if verdict == "FAIL"] in ([belief], []), (number, said, found)
        assert number in said and len(said) > 20
    assert _with_text("65108", load("siemens"), {"alarm": 65101}).startswith("65108: A TRANSFORMATION")
    assert _with_text("65001", load("fanuc"), {}) == "65001" and _with_text("nothing", load("siemens"), {}) == "nothing"


def test_an_end_mark_behind_records_that_were_not_believed_is_an_end_mark() -> None:
    every = records(len(air().touches))
    assert verdicts(commission.Seen(air(), every, True, False, marked=True))["end"] == "PASS"
    assert verdicts(commission.Seen(air(), every, True, False))["end"] == "FAIL"


def test_round_numbers_are_no_coarse_steps() -> None:
    whole = air()
    round_ones = replace(whole, touches=tuple(replace(t, end=tuple(round(v) for v in t.end)) for t in whole.touches))
    found = {t.number: (0, dict(zip(whole.machine.names, t.end, strict=True))) for t in round_ones.touches}
    assert verdicts(commission.Seen(round_ones, found, True, True))["records"] == "PASS"


class Terminal(io.StringIO):
    """A person who has typed already."""

    def isatty(self) -> bool:
        return True


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


def cell_of(folder: Path) -> Path:
    write_example(folder, "hu40t")
    return folder


@pytest.mark.few(0)
def test_where_no_control_is_nothing_is_proven(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell, file = cell_of(tmp_path / "cell"), tmp_path / "TANGO.TXT"
    file.write_text("")
    (cell / "tango.yaml").write_text(spoken((cell / "tango.yaml").read_text(), "post: siemens"))
    code = call("commission", "-C", cell, "--port", f"file://{file}", "--answers", "yes", "--timeout", "0.5")
    out = capsys.readouterr()
    assert code == 3, out
    assert {proof.verdict for proof in read_commissioning(cell)} == {"OPEN"}
    assert "0 of" in out.err and "--said" in out.err and "run --resume" not in out.err


@pytest.mark.long
def test_a_port_that_does_not_open_leaves_the_proofs_as_they_were(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = cell_of(tmp_path / "cell")
    journal = cell / "commissioning" / "readings.journal"
    for text in (None, "of an earlier try\n"):
        if text is not None:
            journal.write_text(text)
        code = call("commission", "-C", cell, "--port", "serial:///dev/ttyNONE", "--answers", "yes", "--timeout", "0.5")
        out = capsys.readouterr()
        assert code == 3 and "ttyNONE" in out.err and "no run to resume" not in out.err, out
        assert not read_commissioning(cell)


@contextmanager
def simulated(cell: Path, *options: object) -> Iterator[str]:
    """cell, options → the port of its simulated control."""
    command = [sys.executable, "-m", "sim_controller", "--cell", cell, "--tcp", "127.0.0.1:0", "--speed", "0", *options]
    with subprocess.Popen([str(c) for c in command], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


@pytest.mark.long
def test_at_a_control_that_stops_early_only_what_was_seen_is_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The axis numbers are wrong: it stops at the fourth move. Nobody is asked about what comes after it."""
    cell = cell_of(tmp_path / "cell")
    monkeypatch.setattr(
        sys, "stdin", Terminal("y\ny\ny\n\n" + "y\n" * 20)
    )  # by hand; start; nothing on the screen; yes to everything
    with simulated(cell, "--set", "axes=X,Y,Z,C,B") as port:
        code = call("commission", "-C", cell, "--port", port, "--timeout", "4")
    out = capsys.readouterr()
    assert code in (1, 3), out
    last = {proof.belief: proof.verdict for proof in read_commissioning(cell)}
    assert last["sense"] != "PASS" and last["orientation"] == "OPEN" and last["end"] == "OPEN", (last, out)


@pytest.mark.long
def test_a_control_that_goes_on_beside_a_hand_makes_one_small_move_and_has_failed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The person says that the stylus is held, and the control does not notice it: the program comes to its end."""
    cell, ledger = cell_of(tmp_path / "cell"), tmp_path / "ledger"
    monkeypatch.setattr(sys, "stdin", Terminal("y\n" * 30))
    with simulated(cell, "--ledger", ledger, "--deflected-goes-on") as port:
        assert call("commission", "-C", cell, "--port", port, "--timeout", "4", "--no-dial") == 1
    said = capsys.readouterr()
    assert {p.belief: p.verdict for p in read_commissioning(cell)}["deflected"] == "FAIL", said
    assert "ends 0.5 mm above" in said.err and "let go if it moves more than 1 mm" in said.err and "not received" not in said.err
    text = next((cell / "commissioning" / "program").glob("O7700*")).read_text()
    assert "G0" not in text.partition("POPEN")[2] and "F3000" not in text, "no turn, and nothing fast"


@pytest.mark.few(1)
@pytest.mark.parametrize(("proven", "feed"), [((), "F1000."), (("directions",), "F3000.")])
def test_until_the_directions_are_proven_nothing_is_fast(tmp_path: Path, proven: tuple[str, ...], feed: str) -> None:
    """Where machine.yaml has Z the wrong way round the first move, up, goes down."""
    cell = cell_of(tmp_path / "cell")
    known = keys_of(read_cell(cell), load("fanuc"))
    add_proofs(cell, "fanuc", [Proof(belief, "PASS", "seen", profile=known[belief]) for belief in proven])
    assert call("commission", "-C", cell, "--program") == 0
    (text,) = [file.read_text() for file in (cell / "commissioning" / "program").glob("O*.nc")]
    assert max(re.findall(r" F(\d+)\.", text), key=int) == feed[1:-1]


@pytest.mark.long
def test_where_only_the_held_stylus_is_left_the_axes_are_first_brought_to_where_its_move_begins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = cell_of(tmp_path / "cell")
    known = keys_of(read_cell(cell), load("fanuc"))
    add_proofs(cell, "fanuc", [Proof(b, "PASS", "tried", profile=known[b]) for b in known if b != "deflected"])
    monkeypatch.setattr(sys, "stdin", Terminal("y\n" * 30))
    with simulated(cell, "--deflected-goes-on") as port:
        assert call("commission", "-C", cell, "--port", port, "--timeout", "4") == 1
    said = capsys.readouterr().err
    assert -1 < said.find("touch 1: miss") < said.find("Now a program of its own"), said
    assert {proof.belief: proof.verdict for proof in read_commissioning(cell)}["deflected"] == "FAIL"


@pytest.mark.long
def test_locate_asks_before_anything_moves_and_says_what_is_not_proven(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cell, ledger = cell_of(tmp_path / "cell"), tmp_path / "ledger"
    with simulated(cell, "--ledger", ledger) as port:
        monkeypatch.setattr(sys, "stdin", Terminal("n\n"))
        assert call("locate", "-C", cell, "--port", port) != 0
        said = capsys.readouterr().err
        assert "not proven on this control: the skip signal" in said and "20 mm" in said and "Start?" in said
        time.sleep(0.3)
        assert not ledger.exists() or not any(json.loads(line).get("event") == "contact" for line in ledger.open())
        assert call("locate", "-C", cell, "--port", port, "--yes") == 0
        said = capsys.readouterr()
        assert "Start?" not in said.err and "9/9" in said.err and "about X" in said.out


@pytest.mark.long
def test_a_run_asks_before_anything_is_sent_and_says_what_is_not_proven(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = cell_of(tmp_path / "cell")
    monkeypatch.setattr(sys, "stdin", Terminal("n\n"))
    with socket.create_server(("127.0.0.1", 0)) as control:
        assert call("run", "-C", cell, "--port", f"socket://127.0.0.1:{control.getsockname()[1]}") not in (0, 3)
        assert control.accept()[0].recv(1) == b"", "opened and closed again, nothing sent"
    said = capsys.readouterr().err
    assert "not proven on this control: the skip signal" in said and "Start?" in said and not (cell / "readings.csv").exists()


@pytest.mark.long
def test_a_run_of_another_post_is_not_gone_on_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Another dialect has other frames and another rounding; the file of the readings would name one of them for all."""
    from tango_cnc.files import read_cell
    from tango_cnc.link.entries import ProgramSent
    from tango_cnc.link.journal import Journal
    from tango_cnc.plan import plan, plan_hash

    cell = cell_of(tmp_path / "cell")
    made = plan(read_cell(cell))
    journal = Journal(cell / "readings.journal")
    controller = {"post": "mazak", "port": "socket://127.0.0.1:1"}
    numbers = tuple(touch.number for touch in made.touches)
    journal.add(ProgramSent("2026-11-23T06:00:00.000+00:00", "1", made.machine.name, controller, plan_hash(made), "0", numbers))
    journal.close()
    assert call("run", "-C", cell, "--port", "socket://127.0.0.1:1", "--resume", "--yes") == 2
    said = capsys.readouterr().err
    assert "with post mazak; the cell now states fanuc" in said, said


TEXTS = ("CNC-PROBE PROBE (no contact)", "TNC TOUCH POINT INACCESSIBLE", "skip not reached: the probing move met nothing", "SW0100")


@pytest.mark.parametrize("said", TEXTS)
def test_a_probe_that_the_finger_did_not_stop_is_to_blame_whatever_the_alarm_says(said: str) -> None:
    """A control that makes an alarm of a miss says so at the slow move up as well, where nothing is recorded yet."""
    what = commission.Seen(air(), {}, True, False, said=said, unheard=True)
    assert [belief for belief, verdict in verdicts(what).items() if verdict == "FAIL"] == ["alive"]
    heard = verdicts(replace(what, unheard=False))
    assert [belief for belief, verdict in heard.items() if verdict == "FAIL"] == (["miss"] if said != "SW0100" else [])


def test_where_nobody_has_said_it_the_text_is_blamed_and_the_probe_named() -> None:
    what = commission.Seen(air(), {}, True, False, said=TEXTS[0])
    found = {judged.experiment.belief: judged.verdict for judged in commission.judge(what)}
    assert found["miss"].verdict == "FAIL" and "nobody knows yet whether the control hears the probe" in found["miss"].found
    assert found["alive"].verdict == "OPEN"
    later = {j.experiment.belief: j.verdict for j in commission.judge(replace(what, records=records(1)))}
    assert "nobody knows" not in later["miss"].found, "what is recorded shows that the probe was heard"


@pytest.mark.parametrize(("post", "text", "word", "key"), [
    ("fanuc", "115 ILLEGAL VARIABLE NUMBER #4008", "#4008", "length_check"),
    ("fanuc", "IMPROPER M-CODE M19", "M19", "orient"),
    ("fanuc", "PS0114 ILLEGAL EXPRESSION FORMAT IF[#4022EQ51.1]THEN#3000=86", "#4022", "must_be_off"),
    ("mitsubishi", "P34 G-CODE ERR G69", "G69", "reset"),
    ("mazak", "807 ILLEGAL FORMAT G69", "G69", "reset"),
    ("centroid", "906 line 12: bad G code G69", "G69", "reset"),
    ("siemens", "TRAFOOF", "TRAFOOF", "trafoof"),
    ("siemens", "12340 channel 1 block N10 number of parameters too large CYCLE800()", "CYCLE800", "cycle800"),
    ("heidenhain", "Undefined code word DIST", "DIST", "distance"),
    ("heidenhain", "Function FN 18 not permitted SYSREAD ID210 NR4", "ID210 and NR4", "scaling_check"),
    ("heidenhain", "NC function not permitted: PLANE RESET", "PLANE RESET", "plane_reset"),
])  # fmt: skip
def test_a_word_of_the_program_in_the_text_of_the_control_is_named_with_its_key(post: str, text: str, word: str, key: str) -> None:
    """Nothing is blamed: the text only names the word, and no experiment fails by it."""
    doubts = unverified(load(post), {})
    program = (
        "\n".join(d.partition(", e.g.")[0] for d in doubts)
        + "\nIF[#4022EQ51.1]THEN#3000=86\nIF[#4008NE49]THEN#3000=85\nPLANE RESET STAY\nID210 NR4"
    )
    told = commission.stopped_by(text, doubts, program)
    assert f"{word} {'are' if ' and ' in word else 'is'} in the program, from {key} under controller" in told, told
    assert "in the program, from" not in commission.stopped_by(text, doubts, "G1 X0"), "a word that the program does not have"


def test_a_text_without_a_word_of_the_program_names_none() -> None:
    doubts = unverified(load("heidenhain"), {})
    program = "\n".join(d for d in doubts if " = " in d)
    for text in (
        "Function of the program is locked",
        "Position of the axis in the table",
        "Tool call: no tool",
        "SW0100 PARAMETER",
    ):
        assert " in the program" not in commission.stopped_by(text, doubts, program)
