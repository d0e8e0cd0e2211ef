"""Faults on purpose: the same seed gives the same ones, and each kind does what its name says."""

import pytest
from support.effect_parts import Tape
from support.simulated_runs import controller

from sim_controller.faults import KINDS, LINE_KINDS, WORDS, Disturbance, faults, line_faults
from tango_cnc.link.transport import open_port, parse
from tango_cnc.records import InputError

DATA = bytes(range(256)) * 8


def arrived(chances, seed, pieces=8):
    one = Disturbance(chances, seed)
    step = len(DATA) // pieces
    found = [piece for i in range(pieces) for piece in one(DATA[i * step : (i + 1) * step])]
    return found, one.happened, one.rest()


def test_the_same_seed_gives_the_same_faults():
    chances = dict.fromkeys(LINE_KINDS, 0.01)
    assert arrived(chances, 3) == arrived(chances, 3)
    assert arrived(chances, 3) != arrived(chances, 4)


def test_without_chances_everything_arrives_as_it_was_sent():
    found, happened, rest = arrived({}, 1)
    assert b"".join(piece for _, piece in found) + rest == DATA
    assert happened == {}


@pytest.mark.parametrize("kind", LINE_KINDS)
def test_each_kind_does_what_its_name_says(kind):
    found, happened, rest = arrived({kind: 0.02}, 1)
    got, count = b"".join(piece for _, piece in found) + rest, happened[kind]
    assert count > 10
    assert {
        "drop": len(got) == len(DATA) - count,
        "double": len(got) == len(DATA) + count,
        "flip": sum((a ^ b).bit_count() for a, b in zip(got, DATA, strict=False)) == count,
        "delay": got == DATA and sum(late > 0 for late, _ in found) == count,
        "late": got == DATA and sum(late > 1.0 for late, _ in found) == count,
        "split": got == DATA and len(found) > 8,
        "merge": got == DATA and len(found) < 8,
        "other": sum(a != b for a, b in zip(got, DATA, strict=True)) == count if len(got) == len(DATA) else None,
    }[kind]


def test_every_fault_of_the_machine_happens_after_its_touch():
    for name in KINDS:
        planned = faults([f"{name}=3"])
        assert [planned.after_touch(touch) for touch in (2, 3, 4)] == [None, WORDS[name], None]


@pytest.mark.parametrize("text", ["flip", "flip=x", "flip=2", "flop=0.1", "flip=-1"])
def test_a_chance_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="--line-fault"):
        line_faults([text])


def test_a_line_longer_than_the_buffer_does_not_stop_the_tape():
    """A control with 64 bytes ahead of execution: nothing but more of the line can complete it."""
    tape = Tape(64)
    tape.put(b"%\n" + b"G1 X1\n" * 10)
    assert tape.wants_pause
    lines = tape.lines()
    assert [next(lines) for _ in range(10)] == ["G1 X1"] * 10
    tape.put(b"(" + b"A" * 60)
    assert not tape.wants_pause
    assert tape.wants_more
    tape.put(b")\n%")
    assert next(lines) == "(" + "A" * 60 + ")"


@pytest.mark.long
def test_the_faults_of_a_line_are_asked_for_on_the_command_line(tmp_path):
    from tango_cnc.commands.init import write_example

    write_example(tmp_path / "cell", "hu40t")
    options = ["--protocol", "grbl", "--tcp", "127.0.0.1:0", "--line-fault", "drop=1", "--line-seed", "5"]
    with controller(tmp_path / "cell", *options) as url:
        port = open_port(parse(url, {}))
        port.write(b"$I\n")
        assert port.read(0.5) == b""
        port.close()
