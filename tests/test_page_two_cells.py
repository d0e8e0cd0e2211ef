"""Two cells on one server: a command names its cell, and folders with one machine name have series of their own."""

from __future__ import annotations

import html
import re
import shlex
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.nights import knock, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.history import opened
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

M = "HU40T-like"


def seen(path: str, *places: Path) -> str:
    with TestClient(create(Settings(places)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        return client.get(path).text


@pytest.mark.few(0)
def test_the_command_of_the_alarms_finds_its_alarm_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two machines whose timers start at one moment have alarms of one name: the command must say which."""
    records = [night(M, 0), night(M, 1, "changed", alarms=[knock("2026-10-25")])]
    places = [cell(tmp_path / name, name, records=[{**r, "machine": name} for r in records]) for name in ("A one", "B")]
    asked = seen("/alarms", *places)
    commands = re.findall("<code>(tango history decide .*?)</code>", asked)
    assert len(commands) == 2 and len(set(commands)) == 2
    for name in ("A one", "B"):  # a command that is typed where the server was started finds nothing
        assert f"in the folder that holds the folder {name} of this machine:" in asked
    monkeypatch.chdir(tmp_path)
    for command in commands:
        done = CliRunner().invoke(tango, shlex.split(html.unescape(command))[1:])
        assert done.exit_code == 0, done.output
    assert "No alarm is open." not in seen("/alarms", *places) and "NAME" in seen("/alarms", *places)  # acknowledged, each its own


def test_folders_with_one_machine_name_have_series_of_their_own(tmp_path: Path) -> None:
    places = [cell(tmp_path / name, M, records=[night(M, 0)]) for name in ("one", "two")]
    lines = [x for x in seen("/metrics", *places).splitlines() if x.startswith("tango_machine_")]
    series = Counter(line.rpartition(" ")[0] for line in lines)
    assert len(lines) > 8 and max(series.values()) == 1, series.most_common(2)
    assert all(f'machine="{M}",cell="' in line for line in lines)
    alone = [x for x in seen("/metrics", places[0]).splitlines() if x.startswith("tango_machine_nights")]
    assert alone == [f'tango_machine_nights{{machine="{M}"}} 1']


def test_the_command_for_a_machine_of_a_shared_history_names_a_history(tmp_path: Path) -> None:
    with opened(tmp_path / "all.db") as history:
        for stored in (night(M, 0), night(M, 1, "changed", alarms=[knock("2026-10-25")])):
            history.add_night(stored)
    with TestClient(
        create(Settings((), str(tmp_path / "all.db"))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)
    ) as client:
        asked = client.get("/alarms").text
    assert f"--history HISTORY --machine {M} --action" in asked and "in place of HISTORY:" in asked and str(tmp_path) not in asked
