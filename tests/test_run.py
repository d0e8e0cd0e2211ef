"""`tango run` against a scripted control on a TCP port: it reads the tape, then prints what its script says."""

import contextlib
import csv
import hashlib
import json
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.runs import (
    STRATEGY,
    Control,
    Result,
    cell,  # noqa: F401  fixtures
    readings,
    run,
)

from postprocessors import BLANK, mark_of
from tango_cnc.cli import tango
from tango_cnc.commands.run import resuming
from tango_cnc.duration import duration
from tango_cnc.files import read_cell
from tango_cnc.files.origin import look_up
from tango_cnc.link.entries import ProgramSent, Reading
from tango_cnc.link.journal import read_journal
from tango_cnc.link.rest import durations, repeatable
from tango_cnc.plan import last_motion, plan
from tango_cnc.plausible.data import remarks
from tango_cnc.records import InputError


def reading(touch, status="ok"):
    return Reading(touch, "5", (0.0,), 1.0, status, None, None, (0,), "")


def test_a_run_writes_the_program_sends_exactly_that_and_records_every_touch(cell):
    control = Control(cell)
    result = run(cell, control)
    assert (result.code, result.out) == (0, f"7 touches → {cell / 'readings.csv'}\n")
    assert result.err.endswith(f"Next: tango estimate -C {cell}\n")
    assert control.tape.decode() == (cell / "program" / "O7700.nc").read_text()
    got, made = readings(cell), plan(read_cell(cell))
    assert list(got.touch) == [1, 2, 3, 4, 5, 6, 7]
    assert got.facet == tuple(touch.facet for touch in made.touches)
    assert np.abs(np.linalg.norm(got.position[:, :3] - [touch.contact[:3] for touch in made.touches], axis=1) - 0.01).max() < 1e-4
    known = last_motion(made) != 0
    assert (got.direction[known] == last_motion(made)[known]).all()
    assert "7/7" in result.err
    assert "last +10.0 µm" in result.err


def test_readings_json_says_where_the_readings_come_from(cell):
    run(cell, Control(cell))
    origin = json.loads((cell / "readings.json").read_text())
    mark = re.search(r"PROGRAM ([0-9A-F]{12}) PLAN ([0-9A-F]{12})", (cell / "program" / "O7700.nc").read_text())
    assert (origin["program_hash"], origin["plan_hash"]) == (mark[1], mark[2])
    assert origin["machine"] == read_cell(cell).machine.name
    assert origin["controller"]["post"] == "fanuc"
    assert origin["start_utc"].endswith("+00:00")
    assert origin["tool_version"]
    assert (origin["ok"], origin["miss"], origin["missing"], origin["refused"]) == (7, 0, [], [])


def test_a_control_that_stops_leaves_a_partial_file_and_the_old_readings_alone(cell):
    (cell / "readings.csv").write_text("yesterday's")
    result = run(cell, Control(cell, stop=4), "--timeout", "0.4")
    assert result.code == 3
    assert "silent for longer than" in result.err
    assert "4 of 7 touches are recorded, touch 5 was due" in result.err
    assert re.search(rf"readings\.partial\.csv; \"tango run -C {cell} --port '\S+' --timeout 0\.4 --resume\"", result.err)
    assert (cell / "readings.csv").read_text() == "yesterday's"
    assert len(readings(cell, "readings.partial.csv")) == 4
    assert json.loads((cell / "readings.partial.json").read_text())["missing"] == [5, 6, 7]
    assert look_up(cell / "readings.partial.csv").known, "and which program and cell they are of"


def test_a_run_that_is_broken_off_names_the_command_that_goes_on_with_it_wherever_it_is_told(cell):
    """With all that its plan depends on: without it the cell makes another plan, and the rest of the run is refused."""
    how = "'tango run --resume --obstructed warn'"
    said = run(cell, Control(cell, stop=4, hang_up=True), "--obstructed", "warn").err
    assert re.search(rf"\"tango run -C {cell} --port '\S+' --resume --obstructed warn\" makes", said), said
    here = how.replace("run ", f"run -C {cell} ")
    assert f"go on with {here}" in _told(cell, "estimate")
    partial = cell / "readings.partial.csv"
    run_of_it = json.loads(partial.with_suffix(".json").read_text())
    assert f"For the office: {how} makes them" in next(
        r.text for r in remarks(read_cell(cell), readings(cell, partial.name), run_of_it)
    )
    for file in (partial, partial.with_suffix(".json")):
        file.unlink()
    assert f"{here} goes on with it" in _told(cell, "estimate")  # a computer that lost its power leaves the journal alone
    (cell / "strategy.yaml").write_text(STRATEGY.replace("[5, 7]", "[7, 5]"))
    assert re.search(
        rf"tango run -C {cell} --port '\S+' --resume --obstructed warn\" goes on with it", run(cell, Control(cell), "--resume").err
    )


def _told(cell, command):
    return CliRunner().invoke(tango, [command, "-C", str(cell)], catch_exceptions=True).exception.args[0]


@pytest.mark.parametrize(
    ("stated", "how"),
    [
        ((None, None, None, None), "--resume"),
        (("EX0C=0.06,EA0C=1", None, None, None), "--resume --until EX0C=0.06,EA0C=1"),
        ((None, None, 2, Path("a b.csv")), "--resume --stylus 2 --readings 'a b.csv'"),
    ],
)
def test_what_goes_on_with_a_run_states_its_goal_its_stylus_and_its_file(stated, how):
    assert resuming(*stated) == how


def test_a_control_that_hangs_up_is_said_to_have_done_so(cell):
    result = run(cell, Control(cell, stop=2, hang_up=True))
    assert result.code == 3
    assert "2 of 7 touches are recorded, touch 3 was due" in result.err


def test_resume_makes_the_missing_touches_and_ends_with_what_one_run_would_have_given(cell):
    run(cell, Control(cell))
    whole = readings(cell)
    run(cell, Control(cell, stop=4), "--timeout", "0.4")
    control = Control(cell)
    result = run(cell, control, "--resume")
    assert result.code == 0
    facets = [text.decode() for text in re.findall(rb"\(TOUCH \d+ FACET (\d+)\)", control.tape)]
    assert facets == ["3", "7", "3", "5", "5", "7"]  # touches 1, 3 and 4 once more, then 5, 6 and 7
    resumed = readings(cell)
    assert list(resumed.touch) == list(whole.touch)
    assert resumed.facet == whole.facet
    assert np.array_equal(resumed.position, whole.position)
    assert (np.diff(resumed.time) >= 0).all()
    assert not (cell / "readings.partial.csv").exists()
    origin = json.loads((cell / "readings.json").read_text())
    assert [segment["touches"] for segment in origin["segments"]] == [7, 3]
    assert origin["repeated"] == [{"touch": number, "status": "ok", "moved_mm": 0.0} for number in (1, 3, 4)]


@pytest.mark.few(0)
def test_resume_makes_a_touch_whose_record_was_not_believed(cell):
    def edit(number, line):
        return line.replace("P3 H1 X", "P3 H1 X,") if number == 3 else line

    result = run(cell, Control(cell, edit=edit))
    assert result.code == 3
    assert "the record of touch 3 was not believed or not received" in result.err
    control = Control(cell)
    assert run(cell, control, "--resume").code == 0
    facets = [text.decode() for text in re.findall(rb"\(TOUCH \d+ FACET (\d+)\)", control.tape)]
    assert facets == ["3", "5", "7", "7"]  # touches 4, 6 and 7 once more, then touch 3
    assert list(readings(cell).touch) == [1, 2, 4, 5, 6, 7, 3]


def test_resume_on_a_table_that_was_moved_is_refused_before_anything_new_is_measured(cell):
    run(cell, Control(cell, stop=4), "--timeout", "0.4")
    result = run(cell, Control(cell, proud=0.05), "--resume")
    assert result.code == 3
    assert "touch 1 was repeated and is 40 µm away, 20 µm are allowed" in result.err
    assert "Run without --resume" in result.err
    assert "makes the missing touches" not in result.err
    assert list(readings(cell, "readings.partial.csv").touch) == [1, 2, 3, 4]


def test_three_touches_are_repeated_where_the_machine_stands_and_before_and_look_in_different_directions(cell):
    made = plan(read_cell(cell))
    entries = [reading(n) for n in (1, 2, 3)]
    assert repeatable(entries, made) == (1, 2, 3)
    assert repeatable([*entries, reading(4, status="miss")], made) == (1, 2, 3)
    assert repeatable([*entries, reading(4)], made) == (1, 3, 4)
    fewer = [reading(n) for n in (1, 2)]
    assert repeatable(fewer, made) == (1, 2)
    assert repeatable([], made) == ()


@contextlib.contextmanager
def a_process_that_has_recorded(count, folder, control):
    """`tango run` as a process of its own, at the moment when its journal has that many readings."""
    command = [sys.executable, "-c", "from tango_cnc.cli import main; main()", "run", "-C", str(folder), "--port", control.url]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        until, recorded = time.monotonic() + 120, 0  # a busy machine may need long to start a process
        while recorded < count and time.monotonic() < until and process.poll() is None:
            with contextlib.suppress(InputError):
                recorded = sum(entry.kind == "reading" for entry in read_journal(folder / "readings.journal")[0])
            time.sleep(0.02)
        assert recorded >= count, f"{recorded} readings after two minutes"
        yield process
        process.kill()


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_with_a_sentence_and_a_partial_file(cell, number):
    with a_process_that_has_recorded(4, cell, Control(cell, stop=4)) as process:
        process.send_signal(number)
        _, err = process.communicate(timeout=120)
    assert process.returncode == 3
    assert "tango: stopped by the user. 4 of 7 touches are recorded, touch 5 was due." in err
    assert "Traceback" not in err
    assert list(readings(cell, "readings.partial.csv").touch) == [1, 2, 3, 4]


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX")
def test_a_killed_run_is_resumed_from_its_journal(cell):
    with a_process_that_has_recorded(4, cell, Control(cell, stop=4)) as process:
        process.kill()
    assert not (cell / "readings.partial.csv").exists()
    assert run(cell, Control(cell), "--resume").code == 0
    assert list(readings(cell).touch) == [1, 2, 3, 4, 5, 6, 7]


def test_resume_after_the_cell_has_changed_is_refused(cell):
    run(cell, Control(cell, stop=4), "--timeout", "0.4")
    (cell / "strategy.yaml").write_text(STRATEGY.replace("C: 90", "C: 80"))
    result = Result("run", "-C", cell, "--resume")
    assert result.code == 2
    assert "Readings of two plans do not go together" in result.err


def test_resume_of_a_complete_run_sends_nothing(cell):
    run(cell, Control(cell))
    before = (cell / "readings.csv").read_text()
    result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:1", "--resume")
    assert result.code == 0
    assert "nothing was sent" in result.err
    assert (cell / "readings.csv").read_text() == before


def test_resume_without_a_run_is_refused(cell):
    result = Result("run", "-C", cell, "--resume")
    assert result.code == 2
    assert "there is no run to resume" in result.err


def test_a_new_run_keeps_the_journal_of_the_old_one(cell):
    run(cell, Control(cell, stop=4), "--timeout", "0.4")
    run(cell, Control(cell))
    journals = sorted(cell.glob("readings*.journal"))
    counts = [sum(entry.kind == "reading" for entry in read_journal(file)[0]) for file in journals]
    assert sorted(counts) == [4, 7]


@pytest.mark.few(0)
def test_the_journal_says_how_long_its_plan_takes(cell):
    """What 'tango check' predicts: before five touches have shown its pace, pages and terminals say that."""
    run(cell, Control(cell))
    segment = next(e for e in read_journal(cell / "readings.journal")[0] if isinstance(e, ProgramSent))
    checked = Result("check", "-C", cell, "--json", "-")
    predicted = json.loads(checked.out)["predicted_time_s"]
    predicted.pop("prove the probe alive")  # comes before the touches
    assert segment.expected_s == pytest.approx(sum(predicted.values()), abs=0.1)


def test_nobody_listening_changes_nothing_but_the_program(cell):
    before = {file.name for file in cell.iterdir()}
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
    result = Result("run", "-C", cell, "--port", url)
    assert result.code == 3
    assert "does not open: Connection refused" in result.err
    assert {file.name for file in cell.iterdir()} - before == {"program"}


def test_a_port_that_cannot_be_meant_changes_nothing(cell, monkeypatch):
    def planned(*_):
        raise AssertionError("a minute of planning before it is said")

    monkeypatch.setattr("tango_cnc.plan.plan", planned)
    before = {file.name for file in cell.iterdir()}
    result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:70000")
    assert result.code == 2
    assert "allowed: host:port, port 1 … 65535" in result.err
    assert {file.name for file in cell.iterdir()} == before


@pytest.mark.parametrize(
    ("edit", "why"),
    [
        (lambda text: text.replace("F180.", "F280.", 1), "was changed after tango plan wrote it"),
        (lambda text: "%\nO1\nM30\n%\n", "carries no mark"),
    ],
)
def test_a_program_that_tango_did_not_write_is_not_sent(cell, edit, why):
    Result("plan", "-C", cell)
    file = cell / "program" / "O7700.nc"
    (cell / "other.nc").write_text(edit(file.read_text()))
    result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:1", "--program", cell / "other.nc")
    assert result.code == 2
    assert why in result.err
    assert "other.nc: the program" in result.err and "nothing was sent" in result.err


def test_a_program_that_does_not_do_what_its_plan_says_is_not_sent(cell):
    """A mark that fits the text is no proof of it: the text itself is read back against the plan."""
    Result("plan", "-C", cell)
    text = (cell / "program" / "O7700.nc").read_text()
    old = mark_of(text)
    assert "G53 G0 C90." in text
    text = text.replace("G53 G0 C90.", "G53 G0 C80.", 1).replace(old, BLANK)
    text = text.replace(BLANK, hashlib.sha256(text.encode()).hexdigest()[:12].upper())
    (cell / "forged.nc").write_text(text)
    result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:1", "--program", cell / "forged.nc")
    assert result.code == 2
    assert "nothing was sent" in result.err


def test_a_program_of_another_plan_is_not_sent(cell):
    Result("plan", "-C", cell)
    (cell / "strategy.yaml").write_text(STRATEGY.replace("C: 90", "C: 80"))
    result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:1", "--program", cell / "program" / "O7700.nc")
    assert result.code == 2
    assert "The files of the cell have changed since" in result.err


def test_a_program_of_tango_plan_is_sent_as_it_is(cell):
    Result("plan", "-C", cell)
    control = Control(cell)
    assert run(cell, control, "--program", cell / "program" / "O7700.nc").code == 0
    assert control.tape.decode() == (cell / "program" / "O7700.nc").read_text()


def test_json_goes_to_stdout_alone(cell):
    result = run(cell, Control(cell), "--json", "-")
    *steps, end = [json.loads(line) for line in result.out.splitlines()]
    assert (end["event"], end["ok"]) == ("end", 7)
    touches = [step for step in steps if step["event"] == "touch"]
    assert [step["touch"] for step in touches] == [1, 2, 3, 4, 5, 6, 7]
    assert all(abs(step["deviation_um"] - 10) < 0.2 for step in touches)


def test_the_time_of_a_touch_counts_from_the_touch_before_it(cell):
    made = plan(read_cell(cell))
    seconds = durations(made)
    assert list(seconds) == [1, 2, 3, 4, 5, 6, 7]
    assert min(seconds.values()) > 10 / 3  # the measuring move alone
    parting = sum(duration(made).values()) - sum(seconds.values())
    assert 0 < parting < 30


def test_every_row_has_the_feed_of_its_measuring_move(cell):
    run(cell, Control(cell))
    with Path(cell / "readings.csv").open() as file:
        assert {row["feed"] for row in csv.DictReader(file)} == {"180"}


def test_a_run_is_followed_from_elsewhere(cell):
    control = Control(cell)
    assert run(cell, control).code == 0
    result = Result("run", "-C", cell, "--watch", "--json", "-")
    assert result.code == 0
    steps = [json.loads(line) for line in result.out.splitlines()]
    assert [step["touch"] for step in steps if step["event"] == "touch"] == [1, 2, 3, 4, 5, 6, 7]
    assert steps[-2]["remark"] == "the run has ended: end mark"
    assert steps[-1] == {"event": "end", "readings": str(cell / "readings.csv"), "complete": True}


def test_a_run_that_stopped_is_followed_to_where_it_stopped(cell):
    assert run(cell, Control(cell, stop=4, hang_up=True)).code == 3
    result = Result("run", "-C", cell, "--watch")
    assert result.code == 3
    assert "4/7" in result.err
    assert "stopped before its end" in result.err


def test_there_must_be_a_run_to_follow(cell):
    result = Result("run", "-C", cell, "--watch")
    assert result.code == 2
    assert "there is no run to follow" in result.err


@pytest.mark.few(0)
def test_a_facet_that_drifts_is_shown_while_it_happens(cell):
    """The first indexation comes again at the end; meanwhile everything has moved outwards by 5 µm."""
    text = STRATEGY.replace("{S: 90, B: 0, C: 0, facets: [5, 7]}", "{S: 0, B: 0, C: 0, facets: [3, 5]}")
    (cell / "strategy.yaml").write_text(text)
    control = Control(cell, proud=0.01)

    def later(number, line):
        control.proud = 0.015 if number >= 5 else 0.01
        return line

    control.edit = later
    result = run(cell, control, "--json", "-")
    assert result.code == 0, result.err
    drifts = {step["touch"]: step["drift_um"] for step in map(json.loads, result.out.splitlines()) if "drift_um" in step}
    assert drifts == {6: pytest.approx(5.0, abs=0.3), 7: pytest.approx(5.0, abs=0.3)}
