"""Nights that come from no machine: any machine of the examples can be looked at, and whatever shows or exports them says so."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.histories import knowledge, record

from tango_cnc.cli import tango
from tango_cnc.history import Night, opened

SAID = "SIMULATED: these readings come from no machine"


def command(*words: str | Path) -> str:
    found = CliRunner().invoke(tango, [*map(str, words)], standalone_mode=False)
    assert found.exception is None, found.output
    return found.output


@pytest.fixture(scope="module")
def cell(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """→ a machine without a B axis, and four simulated nights in its history."""
    folder = tmp_path_factory.mktemp("cells") / "trunnion"
    shutil.copytree(root / "examples" / "trunnion", folder)
    (folder / "nightly.yaml").write_text("nightly: 1\nowner: Ann\nlimits: {volume: 100}\n", encoding="utf-8")
    command("history", "simulate", "-C", folder, folder / "history.db", "--nights", "4")
    return folder


def newest(cell: Path) -> Night:
    with opened(cell / "history.db") as history:
        return history.nights("trunnion", last=1)[0]


@pytest.mark.long
def test_nights_of_a_machine_without_a_b_axis_are_measured_and_know_its_limits(cell: Path) -> None:
    with opened(cell / "history.db") as history:
        records = history.records("trunnion")
    assert [r["status"] for r in records] == ["complete"] * 4
    assert all(r["limits"][0]["limit"] == 100 and r["owner"] == "Ann" for r in records)
    assert all(r["duration_s"] == pytest.approx(r["machine_time_s"], abs=1) and r["duration_s"] > 60 for r in records)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "words",
    [("list",), ("list", "--last", "1"), ("show",), ("plot",)],
    ids=lambda words: "-".join(words),
)
def test_what_shows_simulated_nights_says_so(cell: Path, words: tuple[str, ...]) -> None:
    assert SAID in command("history", *words, "-C", cell)


def test_the_cell_may_be_named_before_the_command_or_after_it(cell: Path) -> None:
    assert command("history", "-C", cell, "list") == command("history", "list", "-C", cell)


def test_status_and_fleet_say_so(cell: Path) -> None:
    assert SAID in command("nightly", "--status", "-C", cell)
    assert SAID in command("fleet", cell)


@pytest.mark.parametrize("ending", ["xml", "dfq"])
def test_certificate_and_measured_values_say_so(cell: Path, tmp_path: Path, ending: str) -> None:
    command("history", "export", tmp_path / f"x.{ending}", "-C", cell)
    text = (tmp_path / f"x.{ending}").read_text(encoding="utf-8")
    assert SAID in text and (
        ending != "xml" or (f"tango-simulated-{newest(cell).night}-4" in text and "trunnion (simulated)" in text)
    )


def test_of_a_machine_that_was_measured_only_the_simulated_nights_are_called_so(tmp_path: Path) -> None:
    more = {"limits": [], "preflight": [], "machine_time_s": 240.0, "planned": 74}
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(1, headline='a sentence with ,"simulated":true, in it', **more), "touch\n1\n", knowledge(1))
        history.add_night(record(2, simulated=True, **more), "touch\n2\n", knowledge(2))
        history.add_night(record(1, machine="N"), "touch\n1\n", knowledge(1))
        assert history.simulated("M") == {2} and history.simulated("N") == frozenset()
    where = ("--history", tmp_path / "history.db", "--machine", "M")
    command("history", "export", tmp_path / "x.csv", *where)
    with (tmp_path / "x.csv").open(encoding="utf-8", newline="") as file:
        assert [(row["night"], row["simulated"]) for row in csv.DictReader(file)] == [
            ("2026-10-01", "False"),
            ("2026-10-02", "True"),
        ]
    assert SAID not in command("history", "show", "1", *where) and SAID in command("history", "show", "2", *where)
