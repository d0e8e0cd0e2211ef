"""The whole history once more: the same model gives the same nights, what was cut off goes on, and Dask gives the same."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.histories import record
from support.nights_parts import Event, Story, again, files_of, nights

from tango_cnc.cli import tango
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.records import InputError

NIGHTS = 4


@pytest.fixture(scope="module")
def cells(root: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two machines, four nights each; the third night of each is knocked by 20 µm."""
    found = []
    for name in ("one", "two"):
        folder = tmp_path_factory.mktemp("cells") / name
        shutil.copytree(root / "examples" / "trunnion", folder)
        yaml = folder / "machine.yaml"
        lines = yaml.read_text(encoding="utf-8").splitlines()
        yaml.write_text("\n".join(f"name: {name}" if x.startswith("name:") else x for x in lines) + "\n", encoding="utf-8")
        cell, truth = read_cell(folder), read_world(folder / "world.yaml")
        with opened(folder / "history.db") as history:
            story = Story((Event(3, {"EY0C": 0.020}),), wander=0.0)
            list(nights(cell, truth, history, NIGHTS, len(found), story, Nightly(diagnose=False)))
        found.append(folder)
    return found


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    distributed = pytest.importorskip("distributed", reason="needs the extra 'fleet' (pip install tango-cnc[fleet])")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1", "silence_logs": 50}
    with distributed.LocalCluster(processes=True, **options) as own:
        yield own.scheduler_address


def told(file: Path, machine: str) -> list[tuple[object, ...]]:
    with opened(file, create=False) as history:
        assert history.verify() == ()
        seen = [history.night(n.entry) for n in history.nights(machine)]
    values = [tuple(round(p["value"], 12) for p in (s.record.get("parameters") or {}).values()) for s in seen]
    return [(s.night.start_utc, s.night.kind, s.night.verdict, s.readings, v) for s, v in zip(seen, values, strict=True)]


@pytest.mark.long
def test_the_same_model_gives_the_same_nights_and_goes_on_where_it_was_cut_off(cells: list[Path], tmp_path: Path) -> None:
    before = (cells[0] / "history.db").read_bytes()
    first = again(cells[:1], None, tmp_path, map, most=2)  # as if it had been killed after two nights
    assert [(d.machine, d.nights, d.added) for d in first] == [("one", NIGHTS, 2)]
    rest = CliRunner().invoke(tango, ["fleet", str(cells[0]), "--again", str(tmp_path)], standalone_mode=False)
    assert rest.exception is None and "as they were" in rest.output
    (none,) = again(cells[:1], None, tmp_path, map)
    assert (none.added, none.differ, none.alarms_then, none.alarms_now) == (0, 0, 1, 1)
    now, then = told(tmp_path / "one.db", "one"), told(cells[0] / "history.db", "one")
    assert [row[:4] for row in now] == [row[:4] for row in then]
    for a, b in zip(now, then, strict=True):
        assert a[4] == pytest.approx(b[4], abs=1e-7)
    assert (cells[0] / "history.db").read_bytes() == before


@pytest.mark.long
def test_another_model_is_seen_in_every_night(cells: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "one"
    shutil.copytree(cells[0], folder)
    settings = folder / "tango.yaml"
    lines = [x for x in settings.read_text(encoding="utf-8").splitlines() if not x.startswith("terms:")]
    settings.write_text("\n".join([*lines, "terms: S2"]) + "\n", encoding="utf-8")
    (done,) = again([folder], None, tmp_path / "out", map)
    assert done.added == NIGHTS
    with opened(tmp_path / "out" / "one.db", create=False) as now, opened(cells[0] / "history.db", create=False) as then:
        assert len(now.parameters("one")) < len(then.parameters("one"))


@pytest.mark.long
def test_dask_gives_what_one_process_gives(cells: list[Path], scheduler: str, tmp_path: Path) -> None:
    words = ["fleet", *map(str, cells), "--again", str(tmp_path / "dask"), "--dask", scheduler]
    found = CliRunner().invoke(tango, words, standalone_mode=False)
    assert found.exception is None, found.exception
    again(cells, None, tmp_path / "here", map)
    for name in ("one", "two"):
        assert told(tmp_path / "dask" / f"{name}.db", name) == told(tmp_path / "here" / f"{name}.db", name)


def test_machines_whose_names_fold_to_one_have_files_of_their_own() -> None:
    names = ["Fräse", "Fröse", "Fr-se", "mill", "MILL", "HU40T-like"]
    files = files_of(names)
    assert len({file.casefold() for file in files}) == len(names) and files == files_of(names)
    assert files[2] == "Fr-se.db" and files[5] == "HU40T-like.db" and files_of(["mill"]) == ("mill.db",)
    assert files_of(["Fröse", "Fräse"]) == (files[1], files[0])  # whatever else is called with them
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", file) for file in files)


def test_a_last_night_of_days_ago_is_named_by_its_date(tmp_path: Path) -> None:
    today = f"{datetime.now().astimezone():%Y-%m-%d}"
    moved = "EX0C moved by +19.8 µm since last night"
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(3, "old", headline=moved))
        own = {
            "night": today,
            "start_utc": f"{datetime.now(UTC):%Y-%m-%dT00:00:00Z}",
            "end_utc": f"{datetime.now(UTC):%Y-%m-%dT00:00:01Z}",
        }
        history.add_night(record(3, "new", headline=moved, **own))
    lines = CliRunner().invoke(tango, ["fleet", "--history", str(tmp_path / "history.db")], standalone_mode=False).output
    flat = {name: " ".join(line.split()) for line in lines.splitlines() for name in ("old", "new") if line.startswith(name)}
    assert "since the night before 2026-10-03" in flat["old"] and "last night" not in flat["old"]
    assert "since last night" in flat["new"]


@pytest.mark.few(0)
def test_what_cannot_be_estimated_again_is_refused(root: Path, tmp_path: Path) -> None:
    cell = root / "examples" / "trunnion"
    with pytest.raises(InputError, match="two cells"):
        again([cell, cell], None, tmp_path, map)
    for words, told_ in ((["--again", "x"], "no cell"), (["--dask", "tcp://x:1", str(cell)], "without --again")):
        assert told_ in str(CliRunner().invoke(tango, ["fleet", *words], standalone_mode=False).exception)
    assert not (tmp_path / "x").exists()
