"""Ethernet DPRNT, as docs/link.md says: the control has the program, prints into a TCP connection, and nothing is sent to it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from support.runs import STRATEGY, Result
from support.simulated_runs import agree, controller

from tango_cnc.commands.init import write_example

PAGE = (Path(__file__).parent.parent / "docs" / "link.md").read_text(encoding="utf-8").partition("## Ethernet DPRNT")[2]
# What the control of the recipe is set to: how it pads and ends what it prints, how fast it skips, that it reads macros ahead.
HAAS = ["macros_ahead=true", "numbered=XYZABC", "padding=bare", "overflow=expanded", "line_end=cr", "fastest_skip=2500"]
CONTROLS = {"haas": ("O07700.nc", HAAS), "fanuc": ("O8700.nc", [])}


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", (folder / "world.yaml").read_text()))
    return folder


def port_of(url):
    """→ the port of the page, with the address of this control."""
    said = re.search(r"socket://[\w.]+:\d+(\?\S*?program=stored\S*?)[`\s]", PAGE)
    assert said is not None
    return f"{url}{said[1]}"


def stated(cell, post):
    """→ the cell with that dialect; the program that the person carries to the control."""
    text = (cell / "tango.yaml").read_text()
    (cell / "tango.yaml").write_text(text.replace("post: fanuc", f"post: {post}"))
    assert Result("plan", "-C", cell).code == 0
    (program,) = (cell / "program").glob("*.nc")
    return program


@pytest.mark.few(0)
@pytest.mark.parametrize("post", ["haas", pytest.param("fanuc", marks=pytest.mark.long)])
def test_a_control_that_prints_into_tcp_is_read_and_nothing_is_sent(cell, tmp_path, post):
    program = stated(cell, post)
    options = [word for text in CONTROLS[post][1] for word in ("--set", text)]
    ledger = tmp_path / "ledger.jsonl"
    tcp = ["--protocol", "dprnt", "--tcp", "127.0.0.1:0", "--start", str(program), "--ledger", str(ledger), *options]
    with controller(cell, *tcp) as url:
        result = Result("run", "-C", cell, "--port", port_of(url), "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)
    assert "input" not in {json.loads(line)["event"] for line in ledger.read_text().splitlines()}


@pytest.mark.long
def test_a_program_that_a_run_waits_for_is_started(cell, tmp_path):
    """Nobody states which: a protocol whose program a person brings is tried under its own name."""
    stated(cell, "haas")
    options = [word for text in HAAS for word in ("--set", text)]
    with controller(cell, "--protocol", "dprnt", "--tcp", "127.0.0.1:0", *options) as url:
        result = Result("run", "-C", cell, "--port", port_of(url), "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)


@pytest.mark.long
def test_the_program_of_another_plan_at_the_control_gives_no_reading(cell, tmp_path):
    program = stated(cell, "haas")
    old = tmp_path / "old.nc"
    old.write_bytes(program.read_bytes())
    (cell / "strategy.yaml").write_text(STRATEGY.replace("standoff: 10", "standoff: 11"))
    options = [word for text in HAAS for word in ("--set", text)]
    with controller(cell, "--protocol", "dprnt", "--tcp", "127.0.0.1:0", "--start", str(old), *options) as url:
        result = Result("run", "-C", cell, "--port", port_of(url), "--timeout", "3")
    assert result.code == 3 and "another program" in result.err
    assert not (cell / "readings.csv").exists()
