"""What a run does when the user wants an end, when registers never come to rest, and when a control contradicts itself."""

import random

import numpy as np
import pytest
from support.grbl import driven
from support.guards import MARKED, PROGRAM, played, resting
from support.linkfaults import Bus, scene
from support.linkparts import FakeClock, job
from support.modbus import edited
from support.sessions import GOOD, Run, after_the_program, printed

from sim_controller.languages.grbl import switched_on
from sim_controller.motion import Motion
from sim_controller.protocols.modbus import COUNT_OF, ECHO, FLAG, MARK, POINT, POSITION, RECORD, STATUS, Registers
from tango_cnc.link.client import Failed, Refused, Task, Touched
from tango_cnc.link.journal import Journal, read_journal
from tango_cnc.link.protocols import dnc, grbl, modbus
from tango_cnc.link.session import Session, listen
from tango_cnc.records import InputError, LinkError


class Board:
    """A transport with a simulated grbl behind it."""

    chunk = 256

    def __init__(self, motion, clock):
        self._control, self._clock, self._came, self._answer = switched_on(motion), clock, "", ""

    def write(self, data):
        self._came += data.decode("ascii")
        return len(data)

    def read(self, timeout):
        self._clock.seconds += 0.01
        if self._came == "?":
            self._came, lines = "", self._control.report()
        elif "\n" in self._came:
            line, _, self._came = self._came.partition("\n")
            lines = self._control.line(line)
        else:
            return b""
        return "".join(f"{line}\r\n" for line in lines).encode("ascii")


def interrupted(tmp_path, protocol, wishes):
    """grbl or modbus, Ctrl-C pressed so often once the probe is to come clear → error, remarks, plan, motion, entries."""
    _, made, truth = scene(turning=False)
    motion, clock, remarks = Motion(truth), FakeClock(), []
    numbers = tuple(touch.number for touch in made.touches)
    task = Task(made, "", "M", made.machine.names, (99.0,) * (len(numbers) + 1), numbers, summed=False)
    client = {"grbl": grbl, "modbus": modbus}[protocol].Client(task, {})
    line = Board(motion, clock) if protocol == "grbl" else Bus(Registers(motion, clock=clock), clock, random.Random(0), {})
    journal = Journal(tmp_path / "run.journal")

    def stop():
        read = sum(entry.kind == "reading" for entry in journal.entries) >= 3
        return (wishes if remarks else 1) if read else 0

    def watch(step):
        remarks.extend([step.remark] if step.remark and "stopping" in step.remark else [])

    with pytest.raises(LinkError) as error:
        Session(task, client, journal, watch, clock=clock, now=clock.now, stop=stop).run(line)
    journal.close()
    return str(error.value), remarks, made, motion, read_journal(tmp_path / "run.journal")[0]


@pytest.mark.few(1)
@pytest.mark.parametrize("protocol", ["grbl", "modbus"])
def test_the_first_ctrl_c_draws_the_probe_clear_and_the_second_ends_at_once(tmp_path, protocol, monkeypatch):
    monkeypatch.setattr("tango_cnc.link.journal.os.fsync", lambda handle: None)
    clear = {}
    for wishes in (1, 2):
        folder = tmp_path / str(wishes)
        folder.mkdir()
        said, remarks, made, motion, entries = interrupted(folder, protocol, wishes)
        assert remarks == ["stopping: the probe is drawn clear first"]
        assert [entry.touch for entry in entries if entry.kind == "reading"] == [1, 2, 3]
        linear = [made.machine.column(name) for name in made.machine.linear]
        clear[wishes] = np.abs(motion.position[linear] - np.array(made.touches[2].over)[linear]).max() < 1e-3
        assert said.startswith("stopped by the user; the probe has been drawn clear" if wishes == 1 else "stopped by the user. ")
    assert clear == {1: True, 2: False}


@pytest.mark.parametrize(("first", "times"), [(b"hello\r\n", 1), (b"\r\nGrbl 1.1h ['$' for help]\r\n", 2)])
def test_what_is_asked_first_is_asked_again_after_a_banner_only(first, times):
    class Other:
        chunk, heard, left = 256, b"", [first]

        def write(self, data):
            self.heard += data
            return len(data)

        def read(self, timeout):
            return self.left.pop() if self.left else b""

    clock, line = iter(range(1000)), Other()
    line.left = [first]
    listen(line, b"$I\n", 50, lambda: next(clock))
    assert line.heard == b"$I\n" * times


@pytest.mark.parametrize(("flag", "kind"), [(0, Touched), (1, Touched), (2, Touched), (3, Refused)])
def test_a_miss_and_an_early_contact_of_a_program_are_handed_over_too(flag, kind):
    """run=program: the start mark is record 6, the first touch record 7."""
    looks = []

    def happens(words, n):
        if words[STATUS] == 1:
            looks.append(n)
            words[MARK : MARK + 3], words[COUNT_OF], words[FLAG] = MARKED, 3, flag
            words[RECORD], words[POINT] = (6, 0) if len(looks) < 8 else (7, 1)

    events, _ = played(PROGRAM, happens, resting(record=5), most=60)
    found = next(event for event in events if isinstance(event, Touched | Refused))
    assert isinstance(found, kind)
    assert found.flag == flag if kind is Touched else "flag 3; it is 0, 1 or 2" in found.why


def test_a_record_of_a_program_whose_registers_never_come_to_rest_ends_the_run():
    def happens(words, n):
        if words[STATUS] == 1:
            words[MARK : MARK + 3], words[COUNT_OF], words[POINT], words[RECORD] = MARKED, 3, 0, 6
            words[POSITION] = n

    events, _ = played(PROGRAM, happens, resting(record=5))
    assert events[-1].why.startswith("record 6 has not been taken, and no two of 4 readings of the registers in a row agree")
    assert "go on changing: position." in events[-1].why


def test_a_touch_whose_registers_never_come_to_rest_is_no_reading():
    """Half old and half new, at each look another place: the touch is refused, and the next one is made."""
    _, made, truth = scene(turning=False)
    numbers = tuple(touch.number for touch in made.touches)
    client = modbus.Client(Task(made, "", "M", made.machine.names, (99.0,) * (len(numbers) + 1), numbers), {})
    device, events, looks = Registers(Motion(truth)), [], []
    bus = Bus(device, FakeClock(), random.Random(0), {})
    while sum(isinstance(event, Touched | Refused) for event in events) < 2:
        request = client.bytes_to_send(1 << 16)
        code, _, *values = map(int, request.split())
        bus.write(request)
        answer = bus.read(0.0).decode().split()
        if code == 3 and values[0] > ECHO and device.words[FLAG] and not any(isinstance(event, Refused) for event in events):
            looks.append(request)
            answer[1 + POSITION + 1] = str(len(looks))
        events += client.receive((" ".join(answer) + "\n").encode())
    first, second = (event for event in events if isinstance(event, Touched | Refused))
    assert first.why.startswith(
        "touch 1: no two of 4 readings of the registers in a row agree, as these go on changing: position. "
    )
    assert len(looks) == 16  # four times four
    assert isinstance(second, Touched) and second.number == 2


def test_a_layout_without_the_command_still_drives_touch_by_touch(tmp_path):
    own = edited(tmp_path, ", run: 5002}", "}")
    assert modbus.Client(job(), {"run": "touches", "layout": own}).sent[1] > 0


class Contradicts:
    """A simulated grbl, of which some lines are answered otherwise."""

    def __init__(self, control, spoils):
        self._control, self._spoils = control, spoils

    def line(self, text):
        return [self._spoils(text, line) for line in self._control.line(text)]

    def report(self):
        return [self._spoils("?", line) for line in self._control.report()]


@pytest.mark.few(0)
def test_a_contact_that_is_none_when_it_is_asked_for_once_more_is_no_reading():
    """The same place with the other flag: the line has changed one of the two answers."""
    _, made, truth = scene(turning=False)
    flipped = []

    def spoils(text, line):
        if text == "$#" and line.startswith("[PRB:") and line.endswith(":1]") and not flipped:
            flipped.append(line)
            return line.replace(":1]", ":0]")
        return line

    events, _ = driven(made, Contradicts(switched_on(Motion(truth)), spoils), lambda sent: len(sent) > 150)
    told = [event for event in events if isinstance(event, Touched | Refused)]
    assert flipped and isinstance(told[0], Refused) and "asked once more, the control says H0" in told[0].why
    assert told[0].text.startswith("P1 H1") and [event.number for event in told[1:]][:1] == [2]


def test_a_grbl_that_reports_work_positions_moves_nothing():
    _, made, truth = scene(turning=False)
    control = Contradicts(switched_on(Motion(truth)), lambda text, line: line.replace("MPos", "WPos"))
    events, sent = driven(made, control)
    assert events[-1] == Failed("the control reports work positions: set $10=1, so that it reports machine positions")
    assert not any("G38" in line or "G0" in line for line in sent)


@pytest.mark.parametrize("sign", ["\x13", "\x11", "ü", "\x1b"])
def test_a_program_with_a_character_that_stops_the_line_is_not_sent(sign):
    with pytest.raises(InputError, match=r"program line 2: found '.*'; allowed: printable ASCII"):
        dnc.tape(f"O1\n(GR{sign}N)\nM30\n")
    assert dnc.tape("O1\n(GR\tN)\nM30\n")


@pytest.mark.parametrize("text", ["", "\n", " \n\n"])
def test_an_empty_program_is_not_sent(text):
    with pytest.raises(InputError, match="the program is empty"):
        dnc.tape(text)


def test_a_journal_without_a_byte_can_be_resumed_and_is_whole_afterwards(tmp_path):
    """The computer lost its power between making the file and writing its first line."""
    (tmp_path / "run.journal").write_bytes(b"")
    assert read_journal(tmp_path / "run.journal") == ([], 0)
    run = Run(tmp_path, after_the_program(printed(*GOOD)), resume=True)
    assert run.error == ""
    assert [entry.touch for entry in run.kinds("reading")] == [1, 2, 3]
