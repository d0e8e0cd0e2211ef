"""The timer of a cell: what the program says to type, typed."""

from __future__ import annotations

import codecs
import getpass
import shutil
import subprocess
import sys
import time
from datetime import date
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner

from tango_cnc.cli import tango
from tango_cnc.commands.init import write_example
from tango_cnc.nightly.install import advice, skipped, units
from tango_cnc.records import InputError


def written(cell: Path, kind: str) -> str:
    """cell → what is to be typed; its files are there."""
    folder = cell / "nights" / "timer"
    folder.mkdir(parents=True, exist_ok=True)
    files = units(kind, cell, "02:00", cell.name)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return advice(kind, list(files), folder)


def typed(command: str, folder: Path, **programs: str) -> None:
    """command, programs of the system as scripts → it has run."""
    tools = folder / "tools"
    tools.mkdir(exist_ok=True)
    for name, script in programs.items():
        (tools / name).write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        (tools / name).chmod(0o755)
    environment = {"PATH": f"{tools}:/usr/bin:/bin", "TABLE": str(folder / "table")}
    done = subprocess.run(["sh", "-c", command], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["mill", "big mill", "50% mill"])
def test_a_crontab_has_the_lines_of_a_cell_once_and_keeps_those_of_others(name: str, tmp_path: Path) -> None:
    table = tmp_path / "table"
    table.write_text(f"7 7 * * * backup\n0 2 * * * python -m tango_cnc nightly -C {tmp_path}/mill2 >> log\n", encoding="utf-8")
    script = 'if [ "$1" = -l ]; then cat "$TABLE"; else cat > "$TABLE.new"; mv "$TABLE.new" "$TABLE"; fi'
    for _ in range(2):
        typed(written(tmp_path / name, "cron"), tmp_path, crontab=script)
    lines = table.read_text(encoding="utf-8").splitlines()
    own = [line for line in lines if "tango_cnc" in line and "mill2" not in line and line[0] != "#"]
    assert len(own) == 2 and "--tell" in own[1]
    assert len(lines) == len(own) + 3 and sum(line.startswith("#") for line in lines) == 1  # the backup and the other mill


def test_a_password_of_the_cell_is_known_to_its_timers(tmp_path: Path) -> None:
    """A timer has none of what a shell has set: systemd and cron read a file of the cell, and no file is no mistake."""
    cell = tmp_path / "50% mill"
    written(cell, "cron")
    line = next(
        x for x in (cell / "nights" / "timer" / "tango-50--mill.cron").read_text(encoding="utf-8").splitlines() if x[0] == "0"
    )
    command = line.split(" ", 5)[5].replace("\\%", "%").replace(f"{sys.executable} -m tango_cnc", "sh -c env")
    assert "MAIL_PASSWORD" not in run_by(command, cell)
    (cell / "nights" / "timer" / "environment").write_text("MAIL_PASSWORD='s3 $cret'\n", encoding="utf-8")
    assert "MAIL_PASSWORD=s3 $cret\n" in run_by(command, cell)
    unit = units("systemd", Path("/cells/mill"), "02:00", "mill", "ann")["tango-mill.service"]
    assert "User=ann\n" in unit and "EnvironmentFile=-/cells/mill/nights/timer/environment\n" in unit


def run_by(command: str, cell: Path) -> str:
    """command of a line of cron, cell → what it leaves in the log of the nights."""
    log = cell / "nights" / "cron.log"
    log.unlink(missing_ok=True)
    subprocess.run(["sh", "-c", command], env={"PATH": "/usr/bin:/bin"}, check=True)
    return log.read_text(encoding="utf-8")


def test_a_task_of_windows_is_one_that_its_scheduler_takes(root: Path, tmp_path: Path) -> None:
    """Facts of Microsoft's schema 1.2: what stands where, and how the file is encoded (schtasks cannot switch to UTF-8)."""
    place = tmp_path / "Fräse & Co"
    shutil.copytree(root / "examples" / "trunnion", place)
    done = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--install", "windows", "--at", "03:30"])
    (file,) = (place / "nights" / "timer").glob("*.xml")
    assert file.read_bytes()[:2] == codecs.BOM_UTF16_LE and 'encoding="UTF-16"' in file.read_text(encoding="utf-16")
    task = ElementTree.fromstring(file.read_bytes())
    space = "{http://schemas.microsoft.com/windows/2004/02/mit/task}"
    assert task.tag == f"{space}Task" and {e.tag.removeprefix(space) for e in task} <= {"Triggers", "Settings", "Actions"}
    trigger = task.find(f"{space}Triggers/{space}CalendarTrigger")
    assert trigger is not None and [e.tag.removeprefix(space) for e in trigger] == ["StartBoundary", "ScheduleByDay"]  # a sequence
    assert trigger[0].text == "2026-01-01T03:30:00"
    known = (
        "MultipleInstancesPolicy StartWhenAvailable DisallowStartIfOnBatteries StopIfGoingOnBatteries ExecutionTimeLimit WakeToRun"
    )
    settings = task.find(f"{space}Settings")
    assert settings is not None and [e.tag.removeprefix(space) for e in settings] == known.split()
    assert f'-C "{place}"' in (task.findtext(f".//{space}Arguments") or "")
    assert f'/RU "{getpass.getuser()}" /RP *' in done.stdout  # without a password it runs only while somebody is logged on


def test_units_of_a_cell_with_a_space_in_its_name_are_copied(tmp_path: Path) -> None:
    place = tmp_path / "etc"
    place.mkdir()
    command = written(tmp_path / "big mill", "systemd").replace("/etc/systemd/system/", str(place))
    typed(command, tmp_path, sudo='exec "$@"', systemctl="exit 0")
    assert sorted(f.name for f in place.iterdir()) == ["tango-big-mill.service", "tango-big-mill.timer"]


@pytest.mark.few(2)
@pytest.mark.skipif(not hasattr(time, "tzset"), reason="the zone of a process can be set on POSIX only")
@pytest.mark.parametrize(
    ("zone", "at", "day"),
    [
        ("Europe/Berlin", "02:00", date(2027, 3, 28)),
        ("Europe/Berlin", "02:59", date(2027, 3, 28)),
        ("Europe/Berlin", "03:30", None),
        ("Europe/Berlin", "01:59", None),
        ("America/New_York", "02:00", date(2027, 3, 14)),
        ("Asia/Tokyo", "02:00", None),
        ("UTC", "02:00", None),
    ],
)
def test_a_time_that_one_day_does_not_have_is_said(
    zone: str, at: str, day: date | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """systemd leaves out what the clock leaves out: once a year a machine would not be measured, and nobody would know why."""
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        assert skipped(at, date(2026, 11, 29)) == day
        write_example(tmp_path / "cell", "trunnion")
        done = CliRunner().invoke(tango, ["nightly", "-C", str(tmp_path / "cell"), "--install", "systemd", "--at", at])
        assert done.exit_code == 0 and ("daylight saving" in done.output) == (day is not None)
        assert "daylight" not in CliRunner().invoke(tango, ["nightly", "-C", str(tmp_path / "cell"), "--install", "cron"]).output
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_time_of_day_without_a_timer_begins_no_night(tmp_path: Path) -> None:
    """Somebody who means "tonight at half past eleven" stands before a machine that moves at once."""
    write_example(tmp_path / "cell", "hu40t")
    done = CliRunner().invoke(tango, ["nightly", "-C", str(tmp_path / "cell"), "--at", "23:30"], standalone_mode=False)
    assert isinstance(done.exception, InputError) and "--at: found '23:30' without --install" in str(done.exception)
    assert not (tmp_path / "cell" / "nights").exists()
