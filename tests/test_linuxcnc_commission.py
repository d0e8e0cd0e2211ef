"""`tango commission` on a real LinuxCNC: what it answers, beside what is known of it, and that it tries nothing twice."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.realcontrol import Control, linuxcnc

pytestmark = [pytest.mark.system("linuxcnc", "linuxcncrsh"), pytest.mark.long]
HERE = Path(__file__).parent
SLOW = (0.02, 1.0)  # mm/s upwards: the move that asks for a finger goes 0.5 mm/s
KNOWN = {
    "alive",
    "frames",
    "miss",
    "rotary",
    "records",
    "end",
    "widths",
    "rollover",
    "mirror",
}  # of LinuxCNC 2.9: G38.3, G53, LOG, #<_abs_x>, and that it has neither mirror image nor scaling


def hal(control: Control, *words: str) -> str:
    """words of halcmd → what it says."""
    home = {"HOME": str(control.folder), "RTAPI_FIFO_PATH": str(control.folder / ".rtapi_fifo")}
    more = {"RTAPI_UID": "65534"} if os.geteuid() == 0 else {}
    done = subprocess.run(
        ["halcmd", *words], capture_output=True, text=True, check=False, timeout=20, env={**os.environ, **home, **more}
    )
    return done.stdout.strip()


@contextmanager
def somebody(control: Control, dead: bool = False) -> Iterator[list[float]]:
    """control, whether the probe is not heard → within it, somebody touches the stylus as Z goes up slowly. Yields where."""
    over, found = threading.Event(), list[float]()

    def looks() -> None:
        before, seen, then = None, 0, time.monotonic()
        while not over.wait(0.4):
            text = hal(control, "getp", "joint.2.pos-cmd")
            height, since, then = float(text) if text else None, then, time.monotonic()
            if height is not None and before is not None:
                seen = seen + 1 if SLOW[0] < (height - before) / (then - since) < SLOW[1] else 0
            if height is not None and seen >= 3 and not found:
                found.append(height)
                if not dead:
                    hal(control, "setp", "finger.in1", "1")
                    time.sleep(0.5)
                    hal(control, "setp", "finger.in1", "0")
            before = height

    thread = threading.Thread(target=looks)
    thread.start()
    try:
        yield found
    finally:
        over.set()
        thread.join()


def tango(*arguments: object) -> tuple[int, str, str]:
    """arguments of the command → exit status, stdout, stderr."""
    done = subprocess.run(
        [sys.executable, "-m", "tango_cnc", *map(str, arguments)], capture_output=True, text=True, check=False, timeout=300
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(HERE / "golden" / "cell", tmp_path / "cell")
    (tmp_path / "cell" / "tango.yaml").write_text(
        "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
        "controller: {post: linuxcnc, log: log.txt, gate: none, positioning_feed: 24000}\n"
    )
    (tmp_path / "cell" / "world.yaml").write_text("{}\n")
    return tmp_path / "cell"


def test_a_real_control_says_what_is_known_of_it(cell: Path) -> None:
    with linuxcnc(cell) as control, somebody(control) as touched:
        tries = ("commission", "-C", cell, "--port", control.url, "--answers", "none", "--json", "-")
        code, out, err = tango(*tries)
        assert code == 0, out + err
        assert len(touched) == 1
        found = {belief["belief"]: belief for belief in json.loads(out)["beliefs"]}
        assert {name for name, belief in found.items() if belief["verdict"] == "PASS"} - {"pace"} == KNOWN, err
        assert found["pace"]["verdict"] in ("OPEN", "PASS")  # without iron nothing clamps: how fast it is, the computer decides
        assert (
            found["frames"]["value"] < 0.002 and found["rotary"]["value"] < 1e-4
        )  # mm, deg: a search that misses ends within 1 µm
        assert not control.contacts()
        _, listed, _ = tango("plan", "-C", cell, "--json", "-")
        assert not [text for text in json.loads(listed)["unverified"] if text.startswith(("probe_on", "wrapped", "clamp"))]


def test_where_nobody_is_heard_it_says_so(cell: Path) -> None:
    with linuxcnc(cell) as control, somebody(control, dead=True):
        code, out, err = tango("commission", "-C", cell, "--port", control.url, "--answers", "none", "--json", "-")
        assert code == 1, out + err
        failed = {b["belief"]: b["found"] for b in json.loads(out)["beliefs"] if b["verdict"] == "FAIL"}
        assert set(failed) == {"alive"} and "NOT TOUCHED" in failed["alive"], failed
        assert not control.contacts()
