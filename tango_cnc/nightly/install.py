"""A timer of the system rather than a scheduler of our own: units for systemd, a line for cron, a task for Windows."""

from __future__ import annotations

import shlex
import sys
from datetime import UTC, date, datetime, time, timedelta
from pathlib import Path
from xml.sax.saxutils import escape

KINDS = ("systemd", "cron", "windows")
ENCODING = {"windows": "utf-16-le"}  # the only one that schtasks takes with names beyond ASCII, with its mark at the beginning
YEAR = 366  # days
ENVIRONMENT = Path("nights", "timer", "environment")  # of a cell: lines NAME=value, for ${NAME} in nightly.yaml


def units(kind: str, cell: Path, at: str, machine: str, user: str = "") -> dict[str, str]:
    """systemd, cron or windows, folder, time of day (02:00), machine, who the nights run as ('': root) → {name of file: text}.

    systemd and cron read `ENVIRONMENT` where there is one, so that a password of nightly.yaml is known to a timer, too.
    """
    name = "tango-" + "".join(c if c.isalnum() else "-" for c in machine.lower()).strip("-")
    command = [sys.executable, "-m", "tango_cnc", "nightly", "-C", str(cell)]
    if kind == "cron":
        hour, minute = at.split(":")
        values = shlex.quote(str(cell / ENVIRONMENT))
        known = f"set -a; [ ! -r {values} ] || . {values}; "  # a timer knows nothing of what a shell has set
        run = f"{known}{shlex.join(command)} >> {shlex.quote(str(cell / 'nights' / 'cron.log'))} 2>&1"
        line = f"{int(minute)} {int(hour)} * * * {_cron(run)}"
        retell = f"@reboot {_cron(known + shlex.join([*command, '--tell']))}"
        # It names the cell as the lines do, so that what `advice` takes out of the table before it adds them is all three.
        about = f"# {machine}: {_cron(shlex.join(command[2:]))} at {at}, and what could not be sent after a start of the computer"
        return {f"{name}.cron": f"{about}\n{line}\n{retell}\n"}
    if kind == "windows":
        return {f"{name}.xml": _WINDOWS.format(at=at, command=escape(command[0]), arguments=escape(_quoted(command[1:])))}
    run = " ".join(_systemd(part) for part in command)
    place = str(cell).replace("%", "%%")
    service = _SERVICE.format(
        machine=machine, run=run, folder=place, values=f"{place}/{ENVIRONMENT.as_posix()}", user=f"User={user}\n" if user else ""
    )
    return {f"{name}.service": service, f"{name}.timer": _TIMER.format(machine=machine, at=at)}


def advice(kind: str, names: list[str], folder: Path, user: str = "") -> str:
    """kind, names of the files, where they are, who the nights run as → what to do with them.

    Windows asks for a password: without one a task runs only while its user is logged on, and at night nobody is.
    """
    if kind == "cron":
        lines = _cron(shlex.join(["nightly", "-C", str(folder.resolve().parents[1])])) + " "  # as they stand, and no longer name
        known = f"crontab -l 2>/dev/null | grep -vF {shlex.quote(lines)}"
        return f"({known}; cat {shlex.quote(str(folder / names[0]))}) | crontab -    # in place of earlier lines of this cell"
    if kind == "windows":
        return f'schtasks /Create /F /TN "{Path(names[0]).stem}" /XML "{folder / names[0]}" /RU "{user}" /RP *'
    timer = next(name for name in names if name.endswith(".timer"))
    return (
        f"sudo cp {shlex.join(str(folder / name) for name in names)} /etc/systemd/system/ && sudo systemctl daemon-reload && "
        f"sudo systemctl enable --now {timer}"
    )


def skipped(at: str, today: date) -> date | None:
    """time of day, date → the next date within a year on which the clock of this computer has no such time, as daylight saving
    begins: systemd starts nothing then, and cron what it has missed; None where every day has it.
    """
    hour, minute = (int(part) for part in at.split(":"))
    for days in range(YEAR):
        wanted = datetime.combine(today + timedelta(days), time(hour, minute))
        if wanted.astimezone(UTC).astimezone().replace(tzinfo=None) != wanted:
            return wanted.date()
    return None


def _cron(command: str) -> str:
    return command.replace("%", "\\%")  # crontab(5): a bare one ends the command


def _systemd(part: str) -> str:
    escaped = part.replace("%", "%%").replace("$", "$$").replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"' if any(c in escaped for c in " \t\"'\\;") else escaped


def _quoted(parts: list[str]) -> str:
    return " ".join(f'"{part}"' if " " in part else part for part in parts)


_SERVICE = """\
[Unit]
Description=Night of {machine}
Wants=network-online.target
After=network-online.target

[Service]
Type=oneshot
{user}WorkingDirectory={folder}
EnvironmentFile=-{values}
ExecStart={run}
# Whatever became of it, somebody hears of it: what could not be sent is sent again.
ExecStopPost={run} --tell
# A verdict (1) is no failure of the service.
SuccessExitStatus=0 1
TimeoutStartSec=6h
KillSignal=SIGINT
"""
_TIMER = """\
[Unit]
Description=Nights of {machine}

[Timer]
OnCalendar=*-*-* {at}:00
# After a computer that was off the night is made up for only by hand: nobody may be at the machine by then.
Persistent=false
AccuracySec=1min

[Install]
WantedBy=timers.target
"""
_WINDOWS = """\
\ufeff<?xml version="1.0" encoding="UTF-16"?>
<Task version="1.2" xmlns="http://schemas.microsoft.com/windows/2004/02/mit/task">
  <Triggers>
    <CalendarTrigger>
      <StartBoundary>2026-01-01T{at}:00</StartBoundary>
      <ScheduleByDay><DaysInterval>1</DaysInterval></ScheduleByDay>
    </CalendarTrigger>
  </Triggers>
  <Settings>
    <MultipleInstancesPolicy>IgnoreNew</MultipleInstancesPolicy>
    <StartWhenAvailable>false</StartWhenAvailable>
    <DisallowStartIfOnBatteries>false</DisallowStartIfOnBatteries>
    <StopIfGoingOnBatteries>false</StopIfGoingOnBatteries>
    <ExecutionTimeLimit>PT6H</ExecutionTimeLimit>
    <WakeToRun>true</WakeToRun>
  </Settings>
  <Actions>
    <Exec>
      <Command>{command}</Command>
      <Arguments>{arguments}</Arguments>
    </Exec>
  </Actions>
</Task>
"""
