"""A Heidenhain control over LSV2: a server from the facts of pyLSV2; spoken to only while nothing moves."""

import re
import subprocess
import sys
import threading
import time
from urllib.parse import unquote

import pytest
from support.linkparts import job
from support.lsv2 import Control, serving
from support.lsv2_person import PROGRAM as PLACE
from support.lsv2_person import Person
from support.parameters import SIGMAS, estimate
from support.profiles import spoken
from support.remote import free_port, listening, ssh_server
from support.runs import STRATEGY, Result
from support.simulated_runs import agree

from tango_cnc.commands.init import write_example
from tango_cnc.link.protocols import lsv2
from tango_cnc.link.transport import _lsv2, foreseen, open_port, parse
from tango_cnc.records import InputError

PROGRAM = b"0 BEGIN PGM TANGO MM\r\n1 ; PROGRAM 4BC33F4A4AB1 PLAN 98C4F7B8ADCC\r\n" + b"2 L Z+100 R0 FMAX\r\n" * 400
OLD = b"TANGO START 0A 1\r\nP1 H1 X1\r\nTANGO END 1\r\n"
RECORDS = "TNC:\\TANGO.TXT"
NEW = b"TANGO START 0B 1\r\nP1 H1 X2\r\n"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(_lsv2, "BETWEEN", 0.01)


@pytest.fixture
def control():
    return Control()


@pytest.fixture
def port(control):
    with serving(control) as number:
        yield number


def opened(port, more=""):
    return open_port(parse(f"lsv2://127.0.0.1:{port}/TNC:/TANGO.TXT{more}", lsv2.OPTIONS))


def asked(line, request):
    line.write(request + b"\n")
    return line.read(0.0).decode("latin-1").strip().replace("\x01", "")


def put(program=PROGRAM):
    return b"put " + program.hex().encode()


def test_opening_the_port_says_nothing_to_the_control(control, port):
    opened(port).close()
    assert control.joined == [] and control.heard == []


def test_a_record_file_is_read_from_where_it_ended(control, port):
    control.files[RECORDS] = OLD
    line = opened(port)
    assert asked(line, b"look") == (OLD.decode() + "LOOK").strip()  # nobody said open
    line = opened(port)
    assert asked(line, b"open").startswith("OPEN TNC640%20340595%2008")
    assert asked(line, b"look") == "LOOK"
    control.files[RECORDS] += NEW[:-5]
    assert asked(line, b"look") == "TANGO START 0B 1\r\nLOOK"
    control.files[RECORDS] = OLD + NEW + b"P2 H1"
    assert asked(line, b"look") == "P1 H1 X2\r\nLOOK"
    control.files[RECORDS] = NEW  # begun anew
    assert asked(line, b"look") == NEW.decode() + "LOOK"
    for _ in range(3000):  # the server notices a little later that the line was closed
        if control.talking == 0:
            break
        time.sleep(0.02)
    assert control.talking == 0


def test_a_record_file_of_somebody_else_is_refused_before_a_program_is_put(control, port):
    control.files[RECORDS] = b"my measurements of last year\r\n"
    said = asked(opened(port), b"open")
    assert said.startswith("! ") and "without%20a%20record%20of%20a%20TANGO%20program" in said
    assert control.files[RECORDS] == b"my measurements of last year\r\n"


def test_who_started_the_control_first_reads_from_the_last_start_mark(control, port):
    control.files[RECORDS] = OLD + NEW
    line = opened(port, "?from=last")
    asked(line, b"open")
    assert asked(line, b"look") == NEW.decode() + "LOOK"


def test_a_line_of_the_file_is_never_an_answer(control, port):
    line = opened(port)
    control.files[RECORDS] = b"\x01STILL\r\n"
    line.write(b"look\n")
    assert line.read(0.0) == b"?STILL\r\n\x01LOOK\n"


@pytest.mark.parametrize("secure", [True, False])
def test_a_program_is_put_and_read_back_and_nothing_else_is_done(control, port, secure):
    control.secure = secure
    line = opened(port, "?program=TNC:/TANGO/")
    assert re.fullmatch("PUT [0-9a-f]{64}", asked(line, put()))
    assert control.files == {"TNC:\\TANGO\\TANGO.H": PROGRAM}
    other = PROGRAM.replace(b"L Z+100", b"L Z+101")
    assert asked(line, put(other)).startswith("PUT ")  # one of ours is replaced
    assert control.files["TNC:\\TANGO\\TANGO.H"] == other
    assert control.acted() == []
    assert {one.command for one in control.heard} <= {
        *("A_LG", "A_LO", "R_VR", "R_PR", "R_CI", "C_CC", "R_RI", "R_FI", "R_FL", "T_OK", "C_FD", "C_FL", "S_FL", "T_FD")
    }
    assert max(len(one.data) for one in control.heard) <= 248


@pytest.mark.parametrize(
    ("place", "what", "why"),
    [
        ("TNC:/PART.H", {"files": {"TNC:\\PART.H": b"0 BEGIN PGM PART MM\r\n"}}, "is no program of 'tango plan'"),
        ("TNC:/NONE/X.H", {}, "the control refuses /TNC:/NONE/X.H: LSV2_ERROR_T_ER_NO_DIR|refuses .*NONE"),
        ("TNC:/tango.txt", {}, "program and records are one file"),
        ("TNC:/X.H", {"space": 3000}, "the control refuses"),
        ("TNC:/X.H", {"in_use": {"TNC:\\X.H"}, "files": {"TNC:\\X.H": PROGRAM}}, "the control refuses"),
        ("TNC:/X.H", {"logins": ("INSPECT",)}, "the control refuses|no right|FILE"),
    ],
)
def test_a_program_that_cannot_go_there_is_a_sentence_and_nothing_of_others_is_lost(control, port, place, what, why):
    for name, value in what.items():
        setattr(control, name, value)
    before = {name: text for name, text in control.files.items() if name != "TNC:\\X.H"}
    line = opened(port, f"?program={place}")
    said = asked(line, put())
    assert said.startswith("! ") and re.search(why, said.replace("%20", " ").replace("%27", "'").replace("%3A", ":")), said
    assert {name: text for name, text in control.files.items() if name != "TNC:\\X.H"} == before


def test_one_file_for_program_and_records_is_refused_before_anybody_is_asked():
    with pytest.raises(InputError, match="which is the file of the records"):
        foreseen(parse("lsv2://127.0.0.1:1/TNC:/TANGO.TXT?program=TNC:/tango.txt", lsv2.OPTIONS))


def test_a_program_that_was_cut_off_is_taken_away(control, port, monkeypatch):
    line = opened(port, "?program=TNC:/X.H")
    control.space = 3000
    assert unquote(asked(line, put())).endswith("; the part of it that lay there was taken away")
    assert control.files == {}
    control.space, left = 10**9, [_lsv2.TRIES]

    def cut(command):  # each of the tries, within the program
        if command != "S_FL" or not left[0]:
            return ""
        left[0] -= 1
        control.files["TNC:\\X.H"] = PROGRAM[:200]
        return "hangup"

    control.fault = cut
    assert unquote(asked(line, put())).endswith("; the part of it that lay there was taken away")
    assert control.files == {}
    assert asked(line, put()).startswith("PUT ") and control.files == {"TNC:\\X.H": PROGRAM}


def test_a_part_is_left_alone_where_it_cannot_be_taken_away_or_the_program_runs(control, port):
    for what in ({"in_use": {"TNC:\\X.H"}}, {"state": 0}):
        line = opened(port, "?program=TNC:/X.H")
        control.files, control.space = {}, 3000

        def cut(command, what=what):
            if command == "S_FL":
                vars(control).update(what)
            return ""

        control.fault = cut
        said = unquote(asked(line, put()))
        assert said.endswith("; a part of it may lie there: delete it, and start nothing") and control.files
        assert not [one for one in control.heard if one.command == "C_FD"] or "in_use" in what
        control.in_use, control.state, control.fault = set(), 7, lambda command: ""
        control.heard.clear()


@pytest.mark.parametrize("fault", ["hangup", "half", "error", "silent"])
def test_a_connection_that_breaks_once_is_made_again(control, port, fault, monkeypatch):
    monkeypatch.setattr(_lsv2, "PATIENCE", 0.3)
    for at in (1, 4, 9, 20):
        left = [at]

        def once(command, left=left):
            left[0] -= 1
            return fault if left[0] == 0 else ""

        control.fault = once
        line = opened(port, "?program=TNC:/X.H")
        assert asked(line, put()).startswith("PUT "), at
    assert control.files["TNC:\\X.H"] == PROGRAM


def test_telegrams_that_come_in_small_pieces_are_put_together(control, port):
    control.fault = lambda command: "bytes"
    control.files[RECORDS] = b""
    line = opened(port)
    asked(line, b"open")
    control.files[RECORDS] = NEW * 20
    assert asked(line, b"look").count("P1 H1 X2") == 20


@pytest.mark.parametrize("fault", ["hangup", "half", "silent"])
def test_a_control_that_never_answers_is_a_sentence_in_time(control, port, fault, monkeypatch):
    """pyLSV2 alone waits for ever for the rest of a telegram when the line was closed in it."""
    monkeypatch.setattr(_lsv2, "PATIENCE", 0.2)
    control.fault = lambda command: fault
    began = time.monotonic()
    assert asked(opened(port), b"open").startswith("! ")
    assert time.monotonic() - began < 60


def test_a_running_program_is_asked_for_nothing_more(control, port):
    line = opened(port)
    asked(line, b"open")
    control.moving = lambda: True
    control.heard.clear()
    assert asked(line, b"look") == "RUNS"
    assert "R_FL" not in {one.command for one in control.heard}


def test_nobody_answers_where_no_control_is(tmp_path):
    line = opened(1)
    assert "! " in asked(line, b"open")


def test_a_url_without_a_file_is_refused_with_an_example():
    with pytest.raises(InputError, match=r"lsv2://192\.168\.1\.20/TNC:/TANGO\.TXT"):
        parse("lsv2://192.168.1.20", lsv2.OPTIONS)


def test_a_resumed_run_speaks_to_nobody_before_somebody_says_that_nothing_moves():
    client = lsv2.Client(job(quiet=30.0), {"program": "TNC:/"})
    assert client.bytes_to_send(99) == b"still\n" and "nothing may move" in client.before
    client.receive(b"\x01STILL\n")
    assert client.bytes_to_send(99) == b"open\n"


@pytest.mark.parametrize("login", ["INSPECT", "FILE"])
def test_a_control_that_asks_for_a_password_gets_the_one_of_the_port(control, port, login, monkeypatch):
    control.users = {login: "807667"}
    monkeypatch.setenv("CELL_WORD", "807667")
    monkeypatch.setenv("OTHER_WORD", "123")
    assert asked(opened(port, "?password=env:CELL_WORD"), b"open").startswith("OPEN TNC640")
    for more, why in (("?password=env:OTHER_WORD", f"(login {login}) with this password"), ("", "state password=env:NAME")):
        said = asked(opened(port, more), b"open").replace("%20", " ").replace("%28", "(").replace("%29", ")").replace("%3D", "=")
        assert said.startswith("! ") and why in said.replace("%3A", ":") and "123" not in said, said


def test_a_password_that_nobody_asks_for_does_not_go_out(control, port, monkeypatch):
    monkeypatch.setenv("CELL_WORD", "807667")
    assert asked(opened(port, "?password=env:CELL_WORD"), b"open").startswith("OPEN ")
    assert not any(b"807667" in one.data for one in control.heard)


@pytest.mark.system("sshd", "ssh-keygen", "ssh")
@pytest.mark.long
def test_a_control_behind_an_ssh_tunnel_is_one_of_this_computer(control, port, tmp_path):
    """Controls with user administration: the tunnel of docs/link.md, over a real sshd."""
    server, here = ssh_server(tmp_path, tmp_path), free_port()
    away = ("-o", "StrictHostKeyChecking=no", "-o", f"UserKnownHostsFile={tmp_path / 'known'}", "-i", tmp_path / "user")
    user, _, rest = server._url.removeprefix("sftp://").partition("@")
    at = rest.partition(":")[2].partition("/")[0]
    command = ["ssh", "-N", "-L", f"{here}:127.0.0.1:{port}", *away, "-p", at, f"{user}@127.0.0.1"]
    with subprocess.Popen([str(word) for word in command], stdin=subprocess.DEVNULL) as tunnel:
        try:
            listening(here, tunnel)
            line = opened(here, "?program=TNC:/")
            assert asked(line, b"open").startswith("OPEN TNC640") and asked(line, put()).startswith("PUT ")
        finally:
            tunnel.terminate()
            server.stop()
    assert control.files["TNC:\\TANGO.H"] == PROGRAM


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "tango.yaml").write_text(spoken((folder / "tango.yaml").read_text(), "post: heidenhain"))
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", (folder / "world.yaml").read_text()))
    return folder


def ran(cell, port, person, monkeypatch, *more):
    """→ the result of a run while the person is there."""
    monkeypatch.setattr(_lsv2, "Person", lambda: person)
    with person.there():
        return Result("run", "-C", cell, "--port", f"lsv2://127.0.0.1:{port}/TNC:/TANGO.TXT?program=TNC:/", *more)


@pytest.mark.few(0)
def test_a_whole_run_is_spoken_to_only_while_nothing_moves(control, port, cell, monkeypatch):
    control.files[RECORDS] = OLD
    person = Person(control, cell)
    result = ran(cell, port, person, monkeypatch)
    assert result.code == 0, result.err
    assert agree(cell)
    assert (control.while_moving(), control.acted(), len(person.programs), person.pressed) == (0, [], 1, 1)
    assert person.programs[0] == (cell / "program" / "TANGO.H").read_bytes() == control.files[PLACE]
    assert "start it there; press Enter here when" in result.err


@pytest.mark.long
def test_a_run_that_was_stopped_is_resumed_and_nothing_is_lost(control, port, cell, monkeypatch):
    person = Person(control, cell, cut=330)
    enter = person.asked

    def asked(timeout):  # Enter once more after the emergency stop, then Ctrl-C
        if person.pressed == 1:
            raise KeyboardInterrupt
        return enter(timeout)

    monkeypatch.setattr(person, "asked", asked)
    assert ran(cell, port, person, monkeypatch).code != 0
    assert "reading" in (cell / "readings.journal").read_text()
    again = Person(control, cell)
    again.programs = list(person.programs)
    again._ran.set()  # the person says first that nothing moves
    result = ran(cell, port, again, monkeypatch, "--resume")
    assert result.code == 0, result.err
    assert agree(cell) and control.while_moving() == 0 and again.pressed == 2


@pytest.mark.few(0)
def test_a_password_is_in_no_file_and_no_output_of_a_run(control, port, cell, monkeypatch):
    control.users = {"FILE": "geheim807667"}
    monkeypatch.setenv("CELL_WORD", "geheim807667")
    monkeypatch.setenv("OTHER_WORD", "geheim-other")
    more = ("--transcript", cell / "talk.txt", "--json", cell / "events.json")
    url = f"lsv2://127.0.0.1:{port}/TNC:/TANGO.TXT?program=TNC:/&password="
    person = Person(control, cell)
    monkeypatch.setattr(_lsv2, "Person", lambda: person)
    wrong = Result("run", "-C", cell, "--port", url + "env:OTHER_WORD", *more)
    assert wrong.code == 3 and "does not let this computer in (login FILE) with this password" in wrong.err
    with person.there():
        right = Result("run", "-C", cell, "--port", url + "env:CELL_WORD", *more)
    assert right.code == 0, right.err
    everything = wrong.err + wrong.out + right.err + right.out
    everything += "".join(file.read_text(errors="replace") for file in cell.rglob("*") if file.is_file())
    assert "env:CELL_WORD" in everything and "geheim" not in everything


def test_without_anybody_at_the_computer_the_run_ends_with_a_sentence(control, port, cell):
    result = Result("run", "-C", cell, "--port", f"lsv2://127.0.0.1:{port}/TNC:/TANGO.TXT?program=TNC:/")
    assert result.code == 3 and "nobody can say when nothing moves: run this in a terminal" in result.err


@pytest.mark.long
def test_enter_on_a_pipe_counts_as_often_as_it_was_pressed(control, port, cell):
    """A process of its own: two lines, each answers one question; the third finds the end of the input."""
    url = f"lsv2://127.0.0.1:{port}/TNC:/TANGO.TXT?program=TNC:/"
    command = [sys.executable, "-m", "tango_cnc", "run", "-C", cell, "--yes", "--port", url]
    done = subprocess.run([str(word) for word in command], input=b"\n\n", capture_output=True, timeout=60)
    text = done.stderr.decode()
    assert done.returncode == 3 and text.count("0 of 7 touches are in the record file, and no end mark") == 2, text
    assert "standard input has ended" in text and "Traceback" not in text


@pytest.mark.few(0)
def test_no_temperature_is_written_to_touches_that_were_made_long_before(control, port, cell, monkeypatch):
    (cell / "sensors.yaml").write_text('sensors:\n  bed: {mqtt: "mqtt://127.0.0.1:1/bed"}\n')
    monkeypatch.setattr("tango_cnc.link.measure.Watch.values", lambda self: {"bed": 21.0})
    result = ran(cell, port, Person(control, cell), monkeypatch)
    assert result.code == 0, result.err
    assert "21.0" not in (cell / "readings.csv").read_text()


def test_link_test_says_what_the_control_is(control, port, cell):
    result = Result("link-test", "-C", cell, "--port", f"lsv2://127.0.0.1:{port}/TNC:/TANGO.TXT", "--seconds", "2")
    assert result.code == 0 and "LSV2: TNC640 340595 08; its disk can be read" in result.out
    control.moving = lambda: True
    result = Result("link-test", "-C", cell, "--port", f"lsv2://127.0.0.1:{port}/TNC:/TANGO.TXT", "--seconds", "0.3")
    assert result.code == 1 and "its program runs: nothing more was asked" in result.out


@pytest.mark.long
def test_a_whole_strategy_gives_the_parameters_of_the_simulated_machine(control, port, tmp_path, monkeypatch):
    folder = tmp_path / "whole"
    write_example(folder, "trunnion")
    (folder / "tango.yaml").write_text(spoken((folder / "tango.yaml").read_text(), "post: heidenhain"))
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", (folder / "world.yaml").read_text()))
    person = Person(control, folder)
    result = ran(folder, port, person, monkeypatch)
    assert result.code == 0, result.err
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv").code == 0
    true, got = estimate(folder, "simulated.csv"), estimate(folder, "readings.csv")
    away = [abs(p["value"] - true["parameters"][n]["value"]) / max(p["std"], 1e-12) for n, p in got["parameters"].items()]
    print(f"\nlsv2: residual {got['residual']['rms_um']:.3f} µm rms, {len(away)} parameters within {max(away):.1f} of their std")
    assert got["terms"] == true["terms"] and got["residual"]["rms_um"] < 1.0 and max(away) < SIGMAS
    assert control.while_moving() == 0 and control.acted() == []


def test_the_judge_notices_a_client_that_looks_while_the_machine_moves(control, port):
    moves = threading.Event()
    control.moving = moves.is_set
    line = opened(port)
    asked(line, b"open")
    assert control.while_moving() == 0
    moves.set()
    asked(line, b"look")
    assert control.while_moving() > 0
