"""Where a position was copied from row to row there is no fit; the remedy that is named then works."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.commands import called

from tango_cnc.cli import tango

FIRST, LAST = 22, 46


@pytest.fixture
def copied(tmp_path: Path, root: Path) -> Path:
    folder = Path(shutil.copytree(root / "examples" / "trunnion", tmp_path / "cell"))
    assert CliRunner().invoke(tango, ["simulate", "-C", str(folder)]).exit_code == 0
    source = folder / "simulated.csv"
    with source.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows[FIRST - 1 : LAST]:
        row["Y"] = rows[FIRST - 1]["Y"]
    with source.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return folder


@pytest.mark.long
def test_copied_positions_are_called_that_and_can_be_left_out(copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = called(capsys, "estimate", "-C", copied)
    assert code == 1 and "so the position was copied" in out + err and "chips" not in out + err
    code, out, err = called(capsys, "estimate", "-C", copied, "--exclude-outliers")
    assert code == 0, out + err
    assert "touches excluded: " in err and "ISO figures are withheld" in out
