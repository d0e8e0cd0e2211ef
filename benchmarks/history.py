"""A history of ten thousand runs: listing, one machine's trend, the fleet; each beside the database's driver alone.

python benchmarks/history.py [--runs 10000] [--url postgresql://…]

Without a URL: SQLite in a temporary folder, then PostgreSQL, Debian's, with a server of its own (apt install postgresql).
Exit status 1 when the list or the trend takes longer than is promised.
"""

from __future__ import annotations

import argparse
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tango_cnc.history import History, Knowledge, opened

MACHINES, PARAMETERS, UNKNOWNS = 20, 17, 60
LISTED, SIGNS, QUARTER = 200, 30, 90  # machines of a list of machines, nights of each in it, nights of a machine's curve
LONG = 80  # points of a preflight, with which a record is as long as that of a real night (10 kB)


def fill(history: History, runs: int) -> None:
    """Runs of twenty machines, with readings of 70 touches and the covariance of 60 unknowns each."""
    rng = np.random.default_rng(1)
    names = [f"E{a}{b}{c}" for a in "XYZABC" for b in "0XY" for c in "BCS"][:PARAMETERS]
    csv = "touch,time_s,facet\n" + "".join(f"{i},{4.5 * i:.6f},{i % 26}\n" for i in range(1, 71))
    root = np.tril(rng.normal(size=(UNKNOWNS, UNKNOWNS))) * 1e-4
    knowledge = Knowledge(tuple(f"u{i}" for i in range(UNKNOWNS)), rng.normal(size=UNKNOWNS), root @ root.T)
    for run in range(runs):
        day = run // MACHINES
        date = np.datetime_as_string(np.datetime64("2025-01-01") + day)
        record = {
            **{"format": "tango-night/1", "machine": f"machine {run % MACHINES:02d}", "cell": "/cells", "night": date},
            **{"start_utc": f"{date}T02:00:00Z", "end_utc": f"{date}T02:06:00Z", "duration_s": 360.0, "kind": "check"},
            **{"status": "complete", "verdict": "good", "headline": "nothing has changed", "touches": 70},
            "alarms": [{"id": f"{date}-{run}"}] if run % 500 == 0 else [],
            "limits": [{"what": "volume", "passed": None if run % 3 == 0 else True}],
            "preflight": [{"check": "disk", "passed": True, "found": "100000 MB free" * 4, "do": ""}] * LONG,
            "parameters": {n: {"value": float(rng.normal()), "std": 1e-3, "unit": "mm"} for n in names},
        }
        history.add_night(record, csv, knowledge)


def seconds(call: Callable[[], Any]) -> float:
    """→ s, the best of five."""
    best = np.inf
    for _ in range(5):
        begin = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - begin)
    return float(best)


def measured(place: str | Path, runs: int) -> bool:
    """file or URL, how many runs → prints a table; whether the promises are kept."""
    with opened(place) as history:
        begin = time.perf_counter()
        fill(history, runs)
        added = (time.perf_counter() - begin) / runs
        name, parameter = history.machines()[0], history.parameters(history.machines()[0])[0]

        def floor(sql: str) -> Callable[[], Any]:
            if isinstance(place, Path):
                plain = sqlite3.connect(place)
                return lambda: plain.execute(sql).fetchall()
            import psycopg

            connection = psycopg.connect(place)
            return lambda: connection.execute(sql).fetchall()

        of_one = f"SELECT start_utc, value, std FROM night_parameter WHERE machine_id = 1 AND name = '{parameter}'"
        rows = [
            ("list of all runs", lambda: history.nights(), "SELECT * FROM night ORDER BY start_utc DESC", 0.3),
            (
                "list of the last 100",
                lambda: history.nights(last=100),
                "SELECT * FROM night ORDER BY start_utc DESC LIMIT 100",
                0.3,
            ),
            ("trend of one parameter", lambda: history.trend(name, parameter), of_one, 0.5),
            ("one night whole", lambda: history.night(1), "SELECT json FROM night_record WHERE entry_id = 1", np.inf),
            (
                *("fleet", lambda: history.fleet("2026-11-23T06:00:00+00:00")),
                *("SELECT max(start_utc) FROM night GROUP BY machine_id", np.inf),
            ),
        ]
        entries = [n.entry for n in history.nights()]
        listed = [entries[SIGNS * i : SIGNS * (i + 1)] for i in range(min(LISTED, len(entries) // SIGNS))]
        like = "SELECT entry_id FROM night_record WHERE entry_id <= {} AND json LIKE '%\"passed\":null%'"
        rows += [  # whether a night is certain to be within its limit, by its record; pages ask about no night twice
            ("signs of a list", lambda: [history.unsure(own) for own in listed], like.format(SIGNS * len(listed)), 0.3),
            ("signs of one machine", lambda: history.unsure(entries[:QUARTER]), like.format(QUARTER), 0.5),
        ]
        kind = "SQLite" if isinstance(place, Path) else "PostgreSQL"
        print(f"{runs} runs of {MACHINES} machines, {kind}; adding one takes {added * 1e3:.1f} ms")
        print(f"{'':24} {'ms':>8} {'driver alone':>13} {'ratio':>6}")
        kept = True
        for what, ours, sql, promise in rows:
            a, b = seconds(ours), seconds(floor(sql))
            kept &= a < promise
            late = "" if a < promise else f"   longer than {promise * 1e3:.0f} ms"
            print(f"{what:24} {a * 1e3:8.1f} {b * 1e3:13.1f} {a / b:6.1f}{late}", flush=True)
    return kept


def main() -> int:
    """Prints a table for each database; → exit status."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--url")
    asked = parser.parse_args()
    if asked.url:
        return 0 if measured(asked.url, asked.runs) else 1
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    from support.postgres import database, server

    with tempfile.TemporaryDirectory() as folder:
        kept = measured(Path(folder) / "history.db", asked.runs)
    with server() as url:
        kept &= measured(database(url), asked.runs)
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
