"""Rules of one line each, in links, read-back and posts, that no other test would miss by default."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from support import controls
from support.linkparts import MARK, job

from postprocessors import load, unverified
from tango_cnc.link import measure
from tango_cnc.link.client import Begun, Ended
from tango_cnc.link.protocols import dnc, file, linuxcnc, lsv2
from tango_cnc.link.transport import open_port, parse
from tango_cnc.readback.languages.klartext import cycle_444
from tango_cnc.readback.twins import Twin, stopped_short
from tango_cnc.records import LinkError


def test_an_end_is_noticed_in_the_main_thread_and_handlers_are_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with measure._signals() as asked:
        assert asked() == 0
        os.kill(os.getpid(), signal.SIGTERM)
        assert asked() == 1
    assert signal.getsignal(signal.SIGTERM) is before


def test_another_thread_takes_no_signals() -> None:
    """Python refuses handlers there: a run of `tango serve` would end at once."""
    found: list[Any] = []

    def inside() -> None:
        with measure._signals() as asked:
            found.append((asked(), signal.getsignal(signal.SIGTERM)))

    before = signal.getsignal(signal.SIGTERM)
    worker = threading.Thread(target=inside)
    worker.start()
    worker.join()
    assert found == [(0, before)]


@pytest.mark.parametrize("log", ["TANGO START 0A0A0A0A 3", f"TANGO START {MARK} 2"])
def test_the_log_of_another_program_ends_a_run_of_linuxcnc(log: str) -> None:
    client = linuxcnc.Client(job(), {})
    client._running = True
    with pytest.raises(Exception, match="the log is of another program, or of another run"):
        client._logged(log)


def test_a_second_start_mark_is_another_run() -> None:
    client = linuxcnc.Client(job(), {})
    client._running = True
    client._logged(f"TANGO START {MARK} 3")
    assert isinstance(client._events[-1], Begun)
    with pytest.raises(Exception, match="the log is of another program, or of another run"):
        client._logged(f"TANGO START {MARK} 3")


@pytest.mark.parametrize(
    ("data", "right", "said"),
    [
        (b"", False, "no control has answered by LSV2"),
        (f"! {quote('login refused')}".encode(), False, "login refused"),
        (b"RUNS", False, "the control says that its program runs: nothing more was asked; try again when it stands"),
        (b"OPEN iTNC%20530", True, "LSV2: iTNC 530; its disk can be read"),
    ],
)
def test_what_a_control_says_by_lsv2_of_itself(data: bytes, right: bool, said: str) -> None:
    assert lsv2.Client.told(data, {}) == (right, [said])


def test_silence_is_too_long_when_it_is_longer_than_allowed_and_not_before() -> None:
    task = job(start_patience=5.0)
    waiting = file.Client(task, {})
    assert waiting._waited(5.0) is None and waiting._waited(0.5) == 5.0
    waiting._begun, waiting._silence = True, 0.0
    assert waiting._waited(task.patience[0]) is None and waiting._waited(0.5) == task.patience[0]
    waiting._counted(Ended(MARK), "TANGO END")
    assert waiting._waited(1e6) is None  # behind the end


def test_a_contact_of_cycle_444_is_where_the_probe_was_less_the_offset() -> None:
    twin = Twin("1", "nothing", {}, dict.fromkeys("XYZ", 0.0) | {"X": 10.0}, {"X": 4.0, "Y": -1.0, "Z": 0.0})
    cycle_444.contact(twin)
    assert [twin.shared[parameter] for parameter in cycle_444.CONTACT.values()] == [6.0, 1.0, 0.0]


def test_who_has_said_where_the_tool_length_ends_is_not_asked_again() -> None:
    def asked(**given: Any) -> set[str]:
        return {text for text in unverified(load("heidenhain"), given) if "444" in text or text.startswith("length_ends")}

    assert asked(cycle=4) == set() and len(asked(cycle=444, length_ends="pole")) > 3
    (more,) = asked(cycle=444) - asked(cycle=444, length_ends="pole")
    assert more.startswith("length_ends = pole: the tool length of the probe ends at the pole of its ball")


@pytest.mark.parametrize(
    ("key", "value"),
    [("frame_check", False), ("metric_check", False), ("gate", "none")],
)
def test_a_siemens_program_has_no_stop_that_nothing_jumps_to(key: str, value: Any) -> None:
    made = controls.golden()
    for options in ({}, {key: value}):
        lines = controls.lines_of("siemens", made, **options)
        jumps = {word for line in lines for word in line.split() if word.startswith("TG_STOP_") and not word.endswith(":")}
        labels = {line.rstrip(":") for line in lines if line.startswith("TG_STOP_") and line.endswith(":")}
        assert jumps == labels and len(labels) == (9 if options else 10)


@pytest.mark.parametrize(("way", "short"), [(1.0, 0), (1.001, 4)])
def test_a_protected_move_is_stopped_short_where_it_is_longer_than_that(way: float, short: int) -> None:
    """By 1 mm in X, met or not, and by 1 mm on its line; one of 1 mm can only meet something at its very end."""
    base = Twin("", "", {"X": way}, {"X": way}, {})
    found = [twin.what for twin in stopped_short(base, {"X": way}, {"X": 0.0}, 1.0, latches=True)]
    assert len(found) == short + 1 and found[-1] == "a protected move has met something at its very end"


def test_a_file_that_is_no_serial_port_is_said_to_be_none(tmp_path: Path) -> None:
    """pyserial says "Could not configure port: (25, 'Inappropriate ioctl for device')"."""
    (tmp_path / "port").touch()
    with pytest.raises(LinkError, match=r"does not open: it is not a serial port, or takes none of these settings \(Inapp"):
        open_port(parse(f"serial://{tmp_path}/port", dnc.OPTIONS))
