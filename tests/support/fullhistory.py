"""Nights whose history, of SQLite or of a PostgreSQL server, is on a real disk that fills up while the machine measures.

`python -m support.fullhistory REPOSITORY FOLDER DATABASE`, where FOLDER is a small tmpfs, prints a JSON line a night.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from support.fulldisk import fill
from support.postgres import programs
from support.years import Year, bench
from tango_cnc.files import read_cell, read_world
from tango_cnc.history import opened
from tango_cnc.nightly import Measured, Ports, PreflightPoint, night

PORT = 54329  # of a socket in the folder: no network


@dataclass
class Filling:
    """A control; while it measures, the disk of the history fills up."""

    year: Year
    disk: Path
    now: bool = False

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        return self.year.control.preflight(kind, touches)

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        if self.now:
            fill(self.disk)
        return self.year.control.measure(kind, touches)


@contextmanager
def place(database: str, folder: Path) -> Iterator[tuple[str, Callable[[], None]]]:
    """sqlite or postgresql, small disk → where the history is, and what starts its server again where that has died."""
    if database == "sqlite":
        yield str(folder / "history.db"), lambda: None
        return
    data, bin_ = folder / "data", programs()
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": "/"}
    initdb = [bin_ / "initdb", "-D", data, "-U", "tango", "--auth=trust", "-E", "UTF8", "--no-sync", "--wal-segsize=1"]
    subprocess.run([str(word) for word in initdb], check=True, **quiet)
    options = f"-p {PORT} -k {folder} -c listen_addresses= -c max_wal_size=8MB -c min_wal_size=4MB -c shared_buffers=2MB"
    start = [str(word) for word in (bin_ / "pg_ctl", "-D", data, "-w", "-l", folder / "log", "-o", options, "start")]
    subprocess.run(start, check=True, **quiet)
    try:
        yield (
            f"postgresql://tango@/postgres?host={folder}&port={PORT}",
            lambda: subprocess.run(start, check=False, **quiet) and None,
        )
    finally:
        subprocess.run([str(bin_ / "pg_ctl"), "-D", str(data), "-m", "immediate", "stop"], check=False, **quiet)


def main(repository: Path, folder: Path, database: str) -> None:
    """repository, small disk, database → four nights: one before, two on a full disk, one with room again."""
    with place(database, folder) as (where, restart):
        cell = read_cell(repository / "examples" / "hu40t")
        cell = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::4]))
        year = Year(bench(cell, read_world(repository / "examples" / "hu40t" / "world.yaml")), 1, rates={})
        control = Filling(year, folder)
        for number in range(4):
            control.now = number in (1, 2)
            if number == 3:
                (folder / "filler").unlink()
                restart()
            year.steps = 0
            with opened(where) as history:  # as every night does
                world = Ports(year.clock, year.disk, control, year.mail, history, year.analysis, year.lock())
                record = night(year.name, "/cells/m", year.settings, world)
            told = {key: record[key] for key in ("status", "touches", "why")} | {"trouble": record.get("trouble")}
            print(json.dumps(told | {"message": year.heard[-1], "start": record["start_utc"]}), flush=True)
            year.clock.moment += timedelta(days=1)
        with opened(where) as history:
            nights = history.nights(year.name)
            whole = [s.readings is not None and s.knowledge is not None for s in map(history.night, (n.entry for n in nights))]
            print(json.dumps({"verify": history.verify(), "nights": [n.start_utc for n in nights][::-1], "whole": whole}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
