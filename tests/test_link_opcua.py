"""A control with an OPC UA server, played by a server of asyncua: program put and compared, records taken one by one."""

import itertools
import json
import re
import struct
import threading
from dataclasses import replace
from urllib.parse import unquote

import pytest
from support.linkparts import job
from support.opcua import FOLDER, MARK, Gone, R, control
from support.parameters import SIGMAS, estimate
from support.profiles import spoken
from support.remote import PROGRAM, free_port
from support.runs import STRATEGY, Result
from support.simulated_runs import agree

from postprocessors import mark_of
from tango_cnc.commands.init import write_example
from tango_cnc.link.client import Begun, Failed, Touched
from tango_cnc.link.nodes import STANDARD, read_nodes
from tango_cnc.link.protocols import opcua
from tango_cnc.link.transport import open_port, parse
from tango_cnc.records import InputError, LinkError


@pytest.fixture(scope="module")
def running():
    with control(free_port()) as one:
        yield one


@pytest.fixture
def server(running):
    running.anew()
    return running


@pytest.fixture
def looked(monkeypatch):
    """→ is set when the run has seen what stood in the variables before, and its program lies at the control."""
    seen, looks, look = threading.Event(), itertools.count(), opcua.Client._look

    def looking(self):
        if next(looks):
            seen.set()
        return look(self)

    monkeypatch.setattr(opcua.Client, "_look", looking)
    return seen


def opened(server, more=""):
    return open_port(parse(f"{server.url}{more}", opcua.OPTIONS))


def asked(line, request):
    line.write(request + b"\n")
    return line.read(0.0).decode().strip()


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", (folder / "world.yaml").read_text()))
    return folder


@pytest.mark.few(0)
def test_a_program_is_put_read_back_and_replaced_only_when_it_is_ours(server):
    line = opened(server, f"?program={FOLDER}&name=TANGO.MPF")
    put = b"put " + PROGRAM.hex().encode()
    first = asked(line, put)
    assert re.fullmatch("PUT [0-9a-f]{64}", first) and asked(line, put) == first
    assert bytes(server.files["TANGO.MPF"]) == PROGRAM
    server.spoil = lambda data: data.replace(b"8700", b"8701")
    assert asked(line, put) != first  # what came back is not what was put
    server.keep("PART.MPF", b"O17 (PART 17)\nM30\n")
    other = opened(server, f"?program={FOLDER}&name=PART.MPF")
    assert "is%20no%20program%20of" in asked(other, put)
    assert bytes(server.files["PART.MPF"]) == b"O17 (PART 17)\nM30\n"
    line.close()
    other.close()


def full(data):
    raise OSError("no space")


@pytest.mark.few(0)
@pytest.mark.parametrize("spoil", [full, lambda data: data[:50]], ids=["refused", "without a word"])
def test_a_program_that_was_cut_off_is_erased_and_keeps_no_later_one_out(server, spoil):
    line = opened(server, f"?program={FOLDER}&name=CUT.MPF")
    put = b"put " + PROGRAM.hex().encode()
    server.spoil = spoil
    said = unquote(asked(line, put))
    if spoil is full:
        assert said.startswith("! the program cannot be put at the control: ") and said.endswith("the file is empty")
    else:
        assert said.startswith("PUT ")
    assert bytes(server.files["CUT.MPF"]) == b""
    server.spoil = lambda data: data
    server.files["CUT.MPF"][:] = PROGRAM[:30]  # of a computer that was switched off, before the name of the program
    good = asked(line, put)
    assert good.startswith("PUT ") and good != said and bytes(server.files["CUT.MPF"]) == PROGRAM
    line.close()


@pytest.mark.few(0)
def test_what_cannot_be_erased_is_said(server, monkeypatch):
    line = opened(server, f"?program={FOLDER}&name=KEPT.MPF")
    server.keep("KEPT.MPF", PROGRAM)
    server.spoil, content = full, type(line)._content
    monkeypatch.setattr(type(line), "_content", lambda self, file, most: content(self, file, most) or PROGRAM[:1])
    said = unquote(asked(line, b"put " + PROGRAM.hex().encode()))
    assert said.endswith("a part of it may lie there: delete it, and start nothing")
    line.close()


def test_variables_are_read_in_one_request_and_taken_is_written_in_its_own_type(server):
    line = opened(server)
    server.put(R["record"], 7)
    assert "record=7.0" in asked(line, b"get")
    assert asked(line, b"take 7") == "TAKE" and server.read(R["taken"]) == 7.0
    assert asked(line, b"ask").startswith("ASK ")
    line.close()


def test_a_boolean_is_no_number_of_a_record(server, monkeypatch):
    """It counted as 0 or 1, and the run ended with a record that nobody understood."""
    line = opened(server)
    monkeypatch.setattr(line, "_values", lambda names: [True] * len(names))
    assert "record (ns=2;s=/Channel/Parameter/R[u1,700]): found True; allowed: a number" in unquote(asked(line, b"get"))
    line.close()


def test_a_connection_is_kept_and_one_that_broke_is_opened_anew(server, monkeypatch):
    line = opened(server)
    opens, again = [], type(line)._open
    monkeypatch.setattr(type(line), "_open", lambda self: opens.append(1) or again(self))
    assert asked(line, b"ask").startswith("ASK ") and "record=" in asked(line, b"get") and not opens
    line.close()
    assert "record=" in asked(line, b"get") and len(opens) == 1
    line.close()


@pytest.mark.few(0)
def test_a_run_brings_the_program_and_takes_every_record(server, cell):
    server.put(R["record"], 65533)  # counted on from runs of before, and from 65535 to 0
    server.put(R["taken"], 65533)
    with server.attended(cell):
        result = Result("run", "-C", cell, "--port", f"{server.url}?program={FOLDER}", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)
    assert server.read(R["record"]) == server.read(R["taken"]) == (65533 + 9) % 65536  # 7 touches and two marks
    assert "FreeOpcUa" in json.loads((cell / "readings.json").read_text())["controller"]["identity"]


@pytest.mark.few(0)
def test_a_siemens_program_gives_its_records_through_r_parameters(server, cell):
    """The program of the post, executed by a control of its language; nothing prints."""
    text = (cell / "tango.yaml").read_text()
    (cell / "tango.yaml").write_text(spoken(text, "post: siemens\n  handshake: R700"))
    with server.attended(cell, family="siemens"):
        result = Result("run", "-C", cell, "--port", f"{server.url}?program={FOLDER}", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)
    assert server.read(R["record"]) == server.read(R["taken"]) == 9  # 7 touches and two marks
    assert "WRITE(" not in bytes(server.files["TANGO.MPF"]).decode()


def test_a_siemens_program_without_handshake_is_refused_before_anything_is_sent(server, cell):
    text = (cell / "tango.yaml").read_text()
    (cell / "tango.yaml").write_text(spoken(text, "post: siemens"))
    result = Result("run", "-C", cell, "--port", f"{server.url}?program={FOLDER}", "--timeout", "20")
    assert result.code == 2 and "state handshake: R700 under controller" in result.err
    assert not server.files.get("TANGO.MPF")


def test_another_program_is_not_taken(server, cell, looked):
    def person():
        looked.wait(60)
        for place, number in enumerate(MARK):
            server.put(number, 10 + place)
        server.put(R["count"], 7)
        server.put(R["point"], 0)
        server.put(R["record"], 1)

    threading.Thread(target=person).start()
    result = Result("run", "-C", cell, "--port", server.url, "--timeout", "20")
    assert result.code == 3 and "the control runs program 000A000B000C with 7 touches" in result.err
    assert server.read(R["taken"]) == 0


@pytest.mark.few(0)
def test_a_start_mark_that_a_reset_control_has_left_is_none_of_this_start(server, cell):
    """The control was reset while it waited with its start mark, and is started again with the same program."""
    assert Result("plan", "-C", cell).code == 0
    mark = mark_of(next((cell / "program").glob("O*")).read_text())
    for place, number in enumerate(MARK):
        server.put(number, int(mark[4 * place : 4 * place + 4], 16))
    server.put(R["count"], 7)
    server.put(R["record"], 5)
    server.put(R["taken"], 4)
    with server.attended(cell):
        result = Result("run", "-C", cell, "--port", f"{server.url}?program={FOLDER}", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)
    assert server.read(R["record"]) == server.read(R["taken"]) == 5 + 9


def test_a_program_that_is_begun_again_after_a_touch_ends_the_run(server, cell, looked):
    def person():
        looked.wait(60)
        mark = mark_of(bytes(server.files["TANGO.MPF"]).decode())
        place = "X- 70.0000 Y 0.0000 Z 70.0000 B 0.0000 C 0.0000 S 0.0000"
        try:
            for line in (f"TANGO START {mark} 7", f"P1 H1 {place} K 0.0000", f"TANGO START {mark} 7"):
                server.printed(line.encode())
        except Gone:
            pass

    server.left.clear()
    threading.Thread(target=person).start()
    result = Result("run", "-C", cell, "--port", f"{server.url}?program={FOLDER}", "--timeout", "20")
    server.left.set()
    assert result.code == 3 and "the control began the program a second time" in result.err


def test_an_alarm_ends_the_run_in_the_words_of_the_control(server, cell):
    server.alarm.write_value(2)
    server.text.write_value("10720 software limit")
    result = Result("run", "-C", cell, "--port", server.url, "--timeout", "20")
    assert result.code == 3 and "the control is in alarm: 10720 software limit" in result.err


def test_link_test_says_what_the_server_is_and_which_variable_is_missing(server, cell, tmp_path):
    result = Result("link-test", "-C", cell, "--port", server.url)
    assert result.code == 0 and "every variable has a value; the last record is 0, taken 0" in result.out
    (tmp_path / "nodes.yaml").write_text(STANDARD.read_text().replace("R[u1,704]", "R[u1,9704]"))
    result = Result("link-test", "-C", cell, "--port", f"{server.url}?nodes={tmp_path / 'nodes.yaml'}", "--seconds", "1")
    assert result.code == 1 and "count (ns=2;s=/Channel/Parameter/R[u1,9704]) has no good value: BadNodeIdUnknown" in result.out


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("R[u1,704]", "R[u1,703]", "is there twice"),
        ("ns=2;s=/Channel/Parameter/R[u1,704]", "R704", "a NodeId"),
        ('  X: "', '  W: "', "axes X Y Z"),
    ],
)
def test_a_file_of_nodes_that_is_wrong_is_named_with_its_line(tmp_path, old, new, why):
    (tmp_path / "nodes.yaml").write_text(STANDARD.read_text().replace(old, new))
    with pytest.raises(InputError, match=rf"nodes\.yaml:\d+.*{why}"):
        read_nodes(str(tmp_path / "nodes.yaml"))


def test_nobody_there_is_said_at_once():
    with pytest.raises(LinkError, match="does not open"):
        open_port(parse(f"opcua://127.0.0.1:{free_port()}", opcua.OPTIONS))


@pytest.mark.few(0)
def test_who_has_the_password_is_let_in_and_nobody_else_and_it_is_shown_to_nobody(cell, tmp_path, monkeypatch):
    monkeypatch.setenv("CELL_WORD", "geheim9")
    monkeypatch.setenv("OTHER_WORD", "falsch7")
    with control(free_port(), word="geheim9") as server, server.attended(cell):
        url = f"{server.url}?program={FOLDER}&user=anna&password=env:CELL_WORD"
        result = Result("run", "-C", cell, "--port", url, "--timeout", "20", "--transcript", tmp_path / "said.txt")
        assert result.code == 0, result.err
        for wrong in (url.replace("CELL_WORD", "OTHER_WORD"), url.replace("anna", "otto"), server.url):
            refused = Result("link-test", "-C", cell, "--port", wrong, "--seconds", "1")
            assert refused.code == 2 and "the control refuses the login" in refused.err + refused.out, refused.err
            assert "falsch7" not in refused.err + refused.out
    files = [*cell.rglob("*"), tmp_path / "said.txt"]
    assert not [file for file in files if file.is_file() and b"geheim9" in file.read_bytes()]


def test_a_machine_with_an_axis_that_has_no_node_is_refused(tmp_path):
    (tmp_path / "nodes.yaml").write_text("".join(text for text in STANDARD.read_text().splitlines(True) if "  C: " not in text))
    with pytest.raises(InputError, match="C is missing"):
        opcua.Client(job(), {"nodes": str(tmp_path / "nodes.yaml")})


@pytest.mark.long
def test_a_whole_strategy_gives_the_parameters_of_the_simulated_machine(server, tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "trunnion")
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", (folder / "world.yaml").read_text()))
    with server.attended(folder):
        result = Result("run", "-C", folder, "--port", f"{server.url}?program={FOLDER}", "--timeout", "60")
    assert result.code == 0, result.err
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv").code == 0
    true, got = estimate(folder, "simulated.csv"), estimate(folder, "readings.csv")
    away = [abs(p["value"] - true["parameters"][n]["value"]) / max(p["std"], 1e-12) for n, p in got["parameters"].items()]
    print(f"\nresidual {got['residual']['rms_um']:.3f} µm rms, {len(away)} parameters within {max(away):.1f} standard deviations")
    assert got["residual"]["rms_um"] < 1.0 and max(away) < SIGMAS


@pytest.mark.parametrize("line", ["SET {all}", "GET {less}", "GET {all} more=1", "GET", "SET"])
def test_an_answer_that_does_not_hold_every_variable_is_none(line):
    nodes = read_nodes()
    words = [f"{name}=0" for name in nodes.looked_at]
    whole = " ".join(words)
    assert opcua._values(f"GET {whole}", nodes) == dict.fromkeys(nodes.looked_at, 0.0)
    with pytest.raises(ValueError, match="not all variables were read"):
        opcua._values(line.format(all=whole, less=" ".join(words[1:])), nodes)


@pytest.mark.parametrize(
    ("taken", "record", "point", "begins"),
    [
        (3, 4, 0, True),  # the control was started first: its start mark waits
        (4, 4, 0, False),  # of the start before, and taken: the next record begins this one
        (3, 4, 1, False),  # a touch of the start before
    ],
)
def test_who_started_the_control_first_has_a_start_mark_that_waits(taken, record, point, begins):
    """What stands there before the run and has been taken, or is no start mark, belongs to the start before."""
    task, nodes = job(), read_nodes()
    mark = task.mark.rjust(12, "0")
    values = dict.fromkeys(nodes.looked_at, 0) | {f"mark{i}": int(mark[4 * i : 4 * i + 4], 16) for i in range(3)}
    values |= {"count": len(task.numbers), "taken": taken, "record": record, "point": point}
    client, events = opcua.Client(task, {}), []
    for _ in range(12):
        request = client.bytes_to_send(1 << 16).decode().strip()
        if request.startswith("take "):
            values["taken"] = int(request.removeprefix("take "))
        answers = {"ask": "ASK here", "get": "GET " + " ".join(f"{name}={value}" for name, value in values.items())}
        events += client.receive(f"{answers.get(request, 'TAKE')}\n".encode())
    assert any(isinstance(event, Begun) for event in events) is begins
    assert values["taken"] == (record if begins else taken)


def test_each_touch_is_waited_for_as_long_as_it_may_take():
    """After the start mark it is the time of the first touch, not of another."""
    task, nodes = job(patience=(70.0, 20.0, 45.0, 90.0), start_patience=10.0), read_nodes()
    mark = task.mark.rjust(12, "0")
    values = dict.fromkeys(nodes.looked_at, 0) | {f"mark{i}": int(mark[4 * i : 4 * i + 4], 16) for i in range(3)}
    values |= {"count": len(task.numbers), "taken": 3, "record": 4}
    client = opcua.Client(task, {})
    for _ in range(12):
        request = client.bytes_to_send(1 << 16).decode().strip()
        if request.startswith("take "):
            values["taken"] = int(request.removeprefix("take "))
        answers = {"ask": "ASK here", "get": "GET " + " ".join(f"{name}={value}" for name, value in values.items())}
        client.receive(f"{answers.get(request, 'TAKE')}\n".encode())
    assert not client.elapsed(69.0)
    assert client.elapsed(2.0) == [Failed("the control has not put a record into its variables within 70 s")]


def single(value: float) -> float:
    """→ the same as a REAL of 32 bits holds it."""
    return struct.unpack("f", struct.pack("f", value))[0]


@pytest.mark.parametrize(
    ("off", "as_held", "fine"),
    [(0.0, float, True), (1e-3, float, False), (-2e-5, float, False), (0.0, single, True), (1e-3, single, False)],
)
def test_a_sum_is_that_of_the_very_numbers_in_the_variables(off, as_held, fine):
    """Nothing is rounded for print there: a micrometer off, which K of a printed record may be, is another number."""
    task, nodes = replace(job(), summed=True), read_nodes()
    client = opcua.Client(task, {})
    places = {letter: as_held(91.2347 * (i + 1)) for i, letter in enumerate(task.letters)}
    values = dict.fromkeys(nodes.looked_at, 0.0) | places | {"point": 1, "flag": 1}
    values["sum"] = as_held(sum(places.values()) + off)
    assert isinstance(client._record(values), Touched) is fine


def conversation(values, spoil):
    """variables, what somebody does to them after each `take` → why the run of this client ends, as its last event; or None."""
    client = opcua.Client(job(), {})
    for _ in range(20):
        request = client.bytes_to_send(1 << 16).decode().strip()
        if request.startswith("take "):
            values["taken"] = int(request.removeprefix("take "))
            spoil(values)
        answers = {"ask": "ASK here", "get": "GET " + " ".join(f"{name}={value}" for name, value in values.items())}
        for event in client.receive(f"{answers.get(request, 'TAKE')}\n".encode()):
            if isinstance(event, Failed):
                return event.why
    return None


def test_a_foreign_taken_right_after_ours_ends_the_run_and_is_not_written_over():
    """It was written over up to three times, and nobody heard of it."""
    task, nodes = job(), read_nodes()
    mark = task.mark.rjust(12, "0")
    values = dict.fromkeys(nodes.looked_at, 0) | {f"mark{i}": int(mark[4 * i : 4 * i + 4], 16) for i in range(3)}
    values |= {"count": len(task.numbers), "taken": 3, "record": 4}
    assert conversation(dict(values), lambda now: None) is None
    assert "another program takes the records" in conversation(dict(values), lambda now: now.update(taken=17))
    assert "does not stand there" in conversation(dict(values), lambda now: now.update(taken=3))  # nobody's: it is not kept


@pytest.mark.parametrize(("error", "why"), [(OSError("no route"), "no route"), (RuntimeError(), "RuntimeError")])
def test_a_line_that_is_lost_says_why_in_words_or_by_the_name_of_the_error(server, monkeypatch, error, why):
    def verb():
        raise error

    line = opened(server)
    monkeypatch.setattr("tango_cnc.link.transport._opcua.AGAIN", -1.0)
    try:
        with pytest.raises(LinkError, match=rf"cannot be reached any more: {why}$"):
            line._kept(verb)
    finally:
        line.close()
