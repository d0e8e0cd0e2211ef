"""`tango commission` on grblHAL itself: its own simulator, which TANGO_GRBLHAL names. docs/controls/grbl.md: how to build it.

TANGO_GRBLHAL=…/grblHAL_sim python -m pytest -m campaign tests/test_grblhal_commission.py
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.profiles import spoken

from tango_cnc.gate import TOUCH

BINARY = os.environ.get("TANGO_GRBLHAL", "")
pytestmark = [pytest.mark.campaign, pytest.mark.skipif(not BINARY, reason="TANGO_GRBLHAL names no simulator of grblHAL")]
HERE = Path(__file__).parent
KNOWN = {"alive", "frames", "mirror", "miss", "rotary", "records", "rollover", "widths", "append", "end"}
SPEED = 3  # times as fast as a clock
# mm/min, mm/s² of the linear axes, deg/min, deg/s² of the rotary ones: at its defaults nothing gets anywhere. Steps of 2.5 µm: its
# own of 4 µm are too coarse to measure with, and `records` says so.
SETTINGS = [f"$10{axis}=400" for axis in range(3)] + [
    f"$1{what}{axis}={linear if axis < 3 else rotary}"
    for what, linear, rotary in ((1, 24000, 7200), (2, 2000, 500))
    for axis in range(5)
]


@contextmanager
def grblhal(folder: Path, *left_on: str) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """folder for its settings, words left on → the running simulator, and the address of its line. A p to it is the probe."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    quiet = [word for letter in "sbg" for word in (f"-{letter}", os.devnull)]
    command = [BINARY, "-n", "-p", str(port), "-t", str(SPEED), "-e", str(folder / "EEPROM.DAT"), *quiet]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            deadline = time.monotonic() + 20
            while True:
                try:
                    line = socket.create_connection(("127.0.0.1", port), timeout=20)
                    break
                except ConnectionRefusedError:
                    assert time.monotonic() < deadline, "it does not listen"
                    time.sleep(0.1)
            with line, line.makefile("rb") as answers:
                time.sleep(1)  # it reads nothing in its first second
                for setting in ("$I", *SETTINGS, *left_on):
                    line.sendall(f"{setting}\n".encode())
                    while (answer := answers.readline().strip()) != b"ok":  # at first: error:7, it has found no settings
                        assert setting == "$I" or not answer.startswith(b"error"), (setting, answer)
            yield process, f"grbl+socket://127.0.0.1:{port}"
        finally:
            process.kill()


def commissioned(cell: Path, finger: bool, *left_on: str) -> tuple[int, dict[str, dict[str, object]], str]:
    """cell, whether somebody touches the stylus when asked, words left on → exit status, {belief: what was found}, what is said."""
    with grblhal(cell, *left_on) as (process, url):
        words = ["commission", "-C", cell, "--port", url, "--answers", "none", "--json", "-"]
        command = [sys.executable, "-m", "tango_cnc", *map(str, words)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as tango:
            assert tango.stderr is not None and tango.stdout is not None and process.stdin is not None
            said = ""
            for text in tango.stderr:
                said += text
                if finger and f"{TOUCH} NOW" in text:
                    for seconds in (3, 3):  # of the 7 s that the move takes here: a busy computer begins it late
                        time.sleep(seconds)
                        process.stdin.write(b"p")
                        process.stdin.flush()
            out = tango.stdout.read()
        beliefs = {each["belief"]: each for each in json.loads(out)["beliefs"]} if out else {}
        return tango.returncode, beliefs, said


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(HERE / "golden" / "cell", tmp_path / "cell")
    settings, strategy = tmp_path / "cell" / "tango.yaml", tmp_path / "cell" / "strategy.yaml"
    settings.write_text(spoken(settings.read_text(), "post: grbl"))
    strategy.write_text(strategy.read_text().replace("S: 90", "S: 0"))  # it knows no M19
    return tmp_path / "cell"


def test_grblhal_says_what_is_known_of_it(cell: Path) -> None:
    """`feed` and what a person has to see stay open: there is nothing to look at. Its clock is not ours, so `pace` says nothing."""
    code, found, said = commissioned(cell, finger=True)
    assert {belief for belief, each in found.items() if each["verdict"] == "FAIL"} <= {"pace"}, said
    assert code == (found["pace"]["verdict"] == "FAIL"), said
    assert {belief for belief, each in found.items() if each["verdict"] == "PASS"} - {"pace"} == KNOWN, said
    frames, rotary = found["frames"]["value"], found["rotary"]["value"]
    assert isinstance(frames, float) and frames < 0.003, "it reports to 1 um and goes in steps of 2.5 um"
    assert isinstance(rotary, float) and rotary < 0.004


def test_where_nobody_is_heard_it_says_so(cell: Path) -> None:
    code, found, said = commissioned(cell, finger=False)
    assert code == 1, said
    assert [belief for belief, each in found.items() if each["verdict"] == "FAIL"] == ["alive"], said


def test_where_a_mirror_image_was_left_on_nothing_moves(cell: Path) -> None:
    """Its G51 acts on machine positions and distances alike; $G says it."""
    code, found, said = commissioned(cell, False, "G51 Z-1")
    assert code == 1 and "G51 is on" in said
    assert [belief for belief, each in found.items() if each["verdict"] == "FAIL"] == ["mirror"], said
