"""Who starts the program of a night: said before a timer is written, and asked of the link, not of a list of names."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from support.controls import GOLDEN, stating

import postprocessors as posts
from tango_cnc.cli import guarded, tango
from tango_cnc.link import protocols
from tango_cnc.link.measure import protocol_of

STORED = "socket://127.0.0.1:9?program=stored"


def call(*words: object) -> int:
    return guarded(tango.main, [str(word) for word in words], prog_name="tango", standalone_mode=False)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    return Path(shutil.copytree(GOLDEN, tmp_path / "shop floor" / "cell"))


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("post", "port", "offered"),
    [
        ("mach4", "file://{cell}/TANGO.TXT", "those of this control: modbus"),
        ("haas", STORED, "those of this control: dnc, modbus"),
        ("linuxcnc", "file://{cell}/TANGO.TXT", "those of this control: linuxcnc, modbus"),
        ("fanuc", "socket://127.0.0.1:9", None),
        ("fanuc", "modbus+tcp://127.0.0.1:9/1?run=program", None),
    ],
)
def test_a_night_that_a_person_would_have_to_start_is_refused_beforehand(
    cell: Path, capsys: pytest.CaptureFixture[str], post: str, port: str, offered: str | None
) -> None:
    """All was ok, the timer was written, and every night ended as not measured: no start mark came within 60 s."""
    url = port.format(cell=str(cell.parent).replace(" ", "%20"))
    state = {} if post in ("mach4", "linuxcnc") else {"probe_state": "none"}
    stating(cell, post=post, port=url, **state)
    assert call("nightly", "-C", cell, "--dry-run", "--json", "-") == 1
    points = {p["check"]: p for p in json.loads(capsys.readouterr().out)["preflight"]}
    installed = call("nightly", "-C", cell, "--install", "cron")
    said = capsys.readouterr().err
    if offered is None:
        assert "start" not in points and installed == 0
        return
    assert not points["start"]["passed"] and "a person starts the program" in points["start"]["found"]
    assert offered in points["start"]["do"] and "'tango nightly'" in points["start"]["do"]
    assert installed == 2 and "No timer was written" in said and offered in said
    assert not (cell / "nights" / "timer").exists()
    assert call("nightly", "-C", cell, "--dry-run", "--simulated", "--json", "-") in (0, 1)
    assert "a person starts" not in capsys.readouterr().out  # a simulated control starts it


def test_a_plc_that_starts_the_program_is_stated(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stating(cell, post="haas", port=STORED, probe_state="none")
    (cell / "nightly.yaml").write_text("nightly: 1\ncontrol_starts_within: 300\n", "utf-8")
    call("nightly", "-C", cell, "--dry-run", "--json", "-")
    points = {p["check"]: p for p in json.loads(capsys.readouterr().out)["preflight"]}
    assert points["start"]["passed"] and "the control starts the program by itself, within 300 s" in points["start"]["found"]
    assert call("nightly", "-C", cell, "--install", "cron") == 0


@pytest.mark.parametrize("name", posts.names())
def test_the_links_that_a_post_states_are_there(name: str) -> None:
    post = posts.load(name)
    assert post.links and {*post.links} <= {*protocols.names()}


def test_a_link_that_says_what_a_person_brings_begins_nothing_by_itself() -> None:
    begins = {name: protocols.load(name).Client.begins({}) for name in protocols.names()}
    assert {name for name, does in begins.items() if does} == {"dnc", "grbl", "linuxcnc", "modbus"}
    module, address = protocol_of(STORED, "dnc")
    assert not module.Client.begins(address.options)
