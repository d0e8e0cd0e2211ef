"""What keeps a run from a motion that nobody can vouch for, and from a reading that was none: a guard a test."""

import random
from dataclasses import replace
from types import SimpleNamespace

import pytest
from support.guards import MARKED, PROGRAM, played, resting
from support.linkfaults import Bus, Ledger, Turns, post, resident, scene
from support.linkparts import MARK as NAME
from support.linkparts import FakeClock, job, machine, plan
from support.sessions import Run, after_the_program, printed

from sim_controller.motion import Motion
from sim_controller.protocols.modbus import (
    BEGUN,
    COUNT_OF,
    ECHO,
    HEARD,
    LONG,
    MARK,
    POINT,
    RECORD,
    REQUEST,
    STATUS,
    TAKEN,
    TICK,
    Registers,
)
from tango_cnc.link import measure as measuring
from tango_cnc.link import rest
from tango_cnc.link._dialogue import Stop
from tango_cnc.link.client import Begun, Identified, Touched
from tango_cnc.link.measure import Wanted, measure
from tango_cnc.link.protocols import dnc, modbus
from tango_cnc.link.transport import open_port, parse
from tango_cnc.link.trust import Distrust, Leeway, judge
from tango_cnc.records import LinkError

FIRST = plan().touches[0]
RECORDS = (
    "P1 H1 X20.0000 Y0.0000 Z50.0000 B0.0000 C0.0000",
    "P2 H1 X0.0000 Y30.0000 Z50.0000 B0.0000 C0.0000",
    "P3 H1 X-5.0000 Y5.0000 Z70.0000 B30.0000 C-90.0000",
)


class Spoilt(Bus):
    """Registers that obey, until the `n`-th request that begins so; `does` then changes them and says whether it is answered."""

    def __init__(self, device, clock, begins, n, does):
        super().__init__(device, clock, random.Random(0), {})
        self.begins, self.left, self.does, self.asked = begins, n, does, []

    def _answer(self, code, address, *words):
        self.asked.append((code, address))
        answer = super()._answer(code, address, *words)
        if (code, address, *words)[: len(self.begins)] == self.begins:
            self.left -= 1
            if self.left == 0 and not self.does(self._device):
                return "- no answer"
        return answer


def stopped(tmp_path, monkeypatch, begins, n, does):
    """→ why a run touch by touch ended, the ledger of the machine, commands that it was given after the fault"""
    clock, ledger, lines = FakeClock(), Ledger(), []
    cell, made, rig = scene()
    commands = []

    def note(event, **data):
        ledger.note(event, **data)
        if event == "command":
            commands.append(data["code"])

    def happened(device):
        commands.clear()
        return does(device)

    def opened(address, **how):
        lines.append(Spoilt(Registers(Motion(rig, note), note, clock=clock), clock, begins, n, happened))
        return lines[-1]

    monkeypatch.setattr(measuring, "time", SimpleNamespace(monotonic=clock))
    monkeypatch.setattr(measuring, "open_port", opened)
    monkeypatch.setattr("tango_cnc.link.journal.os.fsync", lambda handle: None)
    wanted = Wanted("modbus+tcp://localhost:1/1", "dnc", "fanuc", tmp_path / "readings.csv")
    with pytest.raises(LinkError) as error:
        measure(cell, made, wanted, post, lambda step: None, lambda part, program: None)
    return str(error.value), ledger, commands


MOVED = 4323  # code of the command
ASKED, BLOCK = (16, REQUEST), (3, 0, ECHO + LONG)


def restarted(device):
    """Off and on again: its registers are as new, and so is what it believes of its axes."""
    device.words[:] = Registers(device.motion, ticket=4711).words
    return False


def jogged(device):
    device.motion.rapid({"X": device.motion.position[0] + 30.0})
    device._here()
    return False


def opened_door(device):
    device.words[STATUS] = 3
    return True


def driven_by_another(device):
    device.words[BEGUN], device.words[1] = 77, 77
    return False


@pytest.mark.parametrize(
    ("does", "why"),
    [
        (restarted, "it has been switched off and on"),
        (driven_by_another, "another program drives it as well"),
        (jogged, "X moved since the last command was done"),
    ],
)
def test_a_control_that_was_away_is_looked_at_before_it_moves_again(tmp_path, monkeypatch, does, why):
    """Its silence is short enough for the request to be put again; what happened in it is asked for all the same."""
    said, _, commands = stopped(tmp_path, monkeypatch, ASKED, 4, does)
    assert why in said
    assert commands == []


def test_a_door_that_opens_when_a_move_has_been_acknowledged_is_seen_before_the_next_one(tmp_path, monkeypatch):
    """The block that is read last says it; the state that was read before it does not."""
    said, _, commands = stopped(tmp_path, monkeypatch, BLOCK, 30, opened_door)
    assert "its door is open" in said
    assert commands == []


def deaf(device):
    """A register that keeps another value than was written."""
    write = device.write
    device.write = lambda address, values: write(address, [*values[:8], values[8] ^ 1, *values[9:]] if len(values) > 8 else values)
    return True


def beside(device):
    """Axes that end up a millimetre from where they were sent."""
    target = device._target
    device._target = lambda: {name: value + (name == "X") for name, value in target().items()}
    return True


def absent_minded(device):
    """A control that speaks of another touch than the one that was made."""
    perform = device._perform

    def performed(command):
        found = perform(command)
        device.words[POINT] = 99
        return found

    device._perform = performed
    return True


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("does", "why", "given"),
    [
        (deaf, "the control does not take commands", [MOVED]),
        (beside, "X stands at", [MOVED]),
        (absent_minded, "the control speaks of touch 99 where touch", None),
    ],
)
def test_what_a_control_made_of_a_target_is_compared(tmp_path, monkeypatch, does, why, given):
    """The third target is still written rightly, and its move made: the first wrong thing is the last."""
    said, _, commands = stopped(tmp_path, monkeypatch, ASKED, 4, does)
    assert why in said
    assert given is None or commands == given


def test_nothing_is_asked_for_while_a_command_of_before_is_open():
    _, requests = played({}, lambda words, n: None, resting(status=1))
    assert set(requests) == {"3"}


def test_nothing_is_asked_for_while_another_program_is_there():
    """Its run was cut off, or it is alive: who is alive tells the control so, again and again."""

    def alive(words, n):
        words[TICK] = words[HEARD] = 100 + n // 4

    events, requests = played({}, alive, resting(heard=100))
    assert "another program drives this control" in events[-1].why
    assert set(requests) == {"3"}


def test_a_run_that_was_cut_off_is_waited_for_until_the_control_no_longer_minds_it():
    def passing(words, n):
        words[TICK] = 100 + n

    _, requests = played({}, passing, resting(heard=100))
    assert 10 <= requests.index("16") <= 15


def test_a_record_that_was_skipped_ends_the_run():
    def happens(words, n):
        words[RECORD] = 7 if words[STATUS] == 1 else 5

    events, _ = played(PROGRAM, happens, resting(record=5))
    assert "record 7 came where record 6 was due" in events[-1].why


def test_records_are_counted_on_from_the_run_before():
    def happens(words, n):
        if words[STATUS] == 1 and n > 12:
            words[MARK : MARK + 3], words[COUNT_OF], words[POINT], words[RECORD] = MARKED, 3, 0, 0

    events, _ = played(PROGRAM, happens, resting(record=65535))
    assert [type(event).__name__ for event in events] == ["Identified", "Begun"]


def test_what_is_taken_has_to_stand_in_the_registers():
    def happens(words, n):
        if words[STATUS] == 1:
            words[MARK : MARK + 3], words[COUNT_OF], words[POINT], words[RECORD] = MARKED, 3, 0, 6

    events, _ = played(PROGRAM, happens, resting(record=5), keeps=(TAKEN,))
    assert "what was written to taken is not in the registers afterwards" in events[-1].why


def test_a_start_mark_with_another_number_of_touches_is_of_another_program():
    assert "the control runs another program" in dnc.Client(job(), {}).receive(f"TANGO START {NAME} 4\n".encode())[0].why


def test_a_repeated_touch_that_meets_nothing_is_no_facet_that_stayed(tmp_path):
    Run(tmp_path, after_the_program(printed(*RECORDS[:1], end="")))
    missed = RECORDS[0].replace("H1 X20", "H0 X25")
    run = Run(tmp_path, after_the_program(printed(missed, *RECORDS[1:])), resume=True, this_job=job(again=1))
    assert "touch 1 was repeated and is miss" in run.error
    assert [entry.touch for entry in run.kinds("reading")] == [1]


def test_ten_records_in_a_row_end_a_run_and_nine_twice_do_not(tmp_path):
    bad = ["P9 H1 X1.0000"] * 9
    assert Run(tmp_path, after_the_program(printed(*bad, RECORDS[0], *bad, *RECORDS[1:]))).error == ""


def test_lines_behind_the_nuls_of_a_file_wait_for_what_the_nuls_stand_for(tmp_path):
    file = tmp_path / "records.txt"
    file.write_bytes(b"")
    port = open_port(parse(file.as_uri(), {"from": ("now", "last")}))
    file.write_bytes(b"P1 H1 X1\n" + b"\0" * 8 + b"\nP3 H1 X3\n")
    assert port.read(0) == b"P1 H1 X1\n"
    file.write_bytes(b"P1 H1 X1\nP2 H1 X2\nP3 H1 X3\n")
    assert port.read(0) == b"P2 H1 X2\nP3 H1 X3\n"


def contact(flag, **changed):
    planned = {"X": 20.0, "Y": 0.0, "Z": 50.0, "B": 0.0, "C": 0.0}
    return judge(Touched(1, flag, {**planned, **changed}, ""), FIRST, machine(), Leeway())


def test_a_contact_whose_flag_was_turned_into_a_0_is_no_miss():
    with pytest.raises(Distrust, match=r"5\.000 mm before the end of the search"):
        contact(0)
    with pytest.raises(Distrust, match=r"0\.510 mm before the end"):
        contact(0, X=24.49)


@pytest.mark.parametrize("changed", [{"X": 24.51}, {"X": 25.0}, {"X": 14.9}, {"Y": 0.6}, {"B": 0.2}])
def test_a_miss_stands_at_the_end_of_its_search_or_says_a_place_that_is_none_of_it(changed):
    assert contact(0, **changed).status == "miss"


def test_a_run_is_not_resumed_at_another_control_before_somebody_has_said_so(tmp_path, monkeypatch):
    """Nothing is asked for: the start mark of this one-way link comes later, and a machine that is driven has not moved yet."""
    names = iter(["grbl 1.1h", "grblHAL 1.1f", "grblHAL 1.1f"])

    class Named(dnc.Client):
        def receive(self, data):
            events = super().receive(data)
            named = [Identified(next(names))] if any(isinstance(event, Begun) for event in events) else []
            return [*named, *events]

    monkeypatch.setattr(dnc, "Client", Named)
    Run(tmp_path, after_the_program(printed(*RECORDS[:1], end="")))
    rest = job(original=(2, 3), plan=plan())
    second = Run(tmp_path, after_the_program(printed(*RECORDS)), resume=True, this_job=rest)
    assert "the control says it is 'grblHAL 1.1f', and the run was begun at 'grbl 1.1h'" in second.error
    assert [entry.touch for entry in second.kinds("reading")] == [1]
    again = Run(tmp_path, after_the_program(printed(*RECORDS)), resume=True)
    assert "the control says" not in again.error


@pytest.mark.parametrize("drives", [True, False])
def test_a_computer_that_stood_still_asks_for_no_further_motion_and_reads_what_was_printed_meanwhile(tmp_path, monkeypatch, drives):
    """Ten minutes pass between two looks: the control is not to blame for that silence."""
    monkeypatch.setattr(dnc.Client, "drives", drives, raising=False)

    class Suspended(Run):
        def answer(self, written):
            answer = after_the_program(printed(*RECORDS))(written)
            if answer and not self.slept:
                self.slept, self.clock.seconds = True, self.clock.seconds + 600.0
            return answer

        def __init__(self):
            self.slept = False
            super().__init__(tmp_path, self.answer)

    run = Suspended()
    assert ("this computer stood still for 600 s" in run.error) == drives
    assert len(run.kinds("reading")) == 3


def test_a_program_that_the_control_has_already_is_not_sent(tmp_path):
    client = dnc.Client(job(program="100 % SURE\n"), {"program": "stored"})  # need not go over a line
    assert client.bytes_to_send(1000) == b""
    assert client.sent == (0, 0)
    events = client.receive(b"".join(line.encode() + b"\r\n" for line in (f"TANGO START {NAME} 3", *RECORDS, "TANGO END 3")))
    assert [type(event).__name__ for event in events] == ["Begun", "Touched", "Touched", "Touched", "Ended"]
    other = dnc.Client(job(), {"program": "stored"}).receive(b"TANGO START 0BAD0BAD 3\r\n")
    assert "the control runs another program" in other[0].why
    silent = dnc.Client(job(), {"program": "stored"})
    said = [event for _ in range(200) for event in silent.elapsed(4.0)]
    assert "start the program there" in said[0].why


@pytest.mark.few(0)
def test_parts_of_a_program_are_brought_one_after_the_other(tmp_path, monkeypatch):
    """run=program: the control has what was brought last; it is said which file, before the question whether to go on."""
    clock, ledger, order = FakeClock(), Ledger(), []
    cell, made, rig = scene()
    halves = [rest.rest_of(cell, made, (), tuple(range(a, a + 30))) for a in (1, 31)]
    parts = [replace(post(half)[0], file=f"O870{i}.nc") for i, half in enumerate(halves)]
    at_the_control, turns = [], Turns()
    motion = Motion(rig, ledger.note)

    def opened(address, **how):
        def started(motion, punch):
            resident(at_the_control[-1], motion, punch)

        device = Registers(motion, ledger.note, program=started, waited=turns.waited)
        return Bus(device, clock, random.Random(0), {}, turns)

    def brought(part, program):
        order.append("asked")
        at_the_control.append(program.text)

    monkeypatch.setattr(measuring, "time", SimpleNamespace(monotonic=clock))
    monkeypatch.setattr(measuring, "open_port", opened)
    monkeypatch.setattr(measuring, "said_before", lambda address: "the file is of yesterday")
    monkeypatch.setattr("tango_cnc.link.journal.os.fsync", lambda handle: None)
    wanted = Wanted("modbus+tcp://localhost:1/1?run=program", "dnc", "fanuc", tmp_path / "readings.csv")

    def seen(step):
        if step.remark and ("now" in step.remark or "part" in step.remark):
            order.append(step.remark)

    origin = measure(cell, made, wanted, lambda part: parts, seen, brought)
    assert (origin["ok"], origin["missing"]) == (60, [])
    assert order == [
        "part 1 of 2: 30 touches; the file is of yesterday",
        "asked",
        "the control has to have O8700.nc now: it is not sent",
        "part 2 of 2: 30 touches",
        "asked",
        "the control has to have O8701.nc now: it is not sent",
    ]


@pytest.mark.parametrize(
    ("letter", "away", "arrives"), [("X", 360.0, False), ("X", 0.0, True), ("C", 360.0, True), ("C", 1.0, False)]
)
def test_a_whole_turn_is_nothing_to_a_rotary_axis_alone(letter, away, arrives):
    """An axis of lengths that stands 360 mm off is not where it was sent."""
    layout = SimpleNamespace(value=lambda name, counts: counts / 1e4)
    client = SimpleNamespace(_layout=layout, _position=lambda block: {letter: 20.0 + away})
    try:
        modbus.Client._arrived(client, {letter: 200_000}, ())
    except Stop as stop:
        assert not arrives and f"{letter} stands at" in str(stop)
    else:
        assert arrives
