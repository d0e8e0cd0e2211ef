"""What is left when programs are compensated on top of a target: never more than the target leaves alone."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.closing import SETTINGS
from support.compensated import example, measured

from tango_cnc.cli import tango
from tango_cnc.compensate import propose

ROOT = Path(__file__).parent.parent


@pytest.mark.long
def test_programs_on_top_leave_no_more_than_the_target_that_holds_reversal() -> None:
    cell, world = example("trunnion")
    found = propose(measured(cell, world), "siemens", SETTINGS.get("siemens", ())).fit
    assert found.rms_program.value <= 1.05 * found.rms_after.value


def made(name: str, folder: Path) -> tuple[Path, Path]:
    """example, folder → a copy of it with simulated readings, and a program."""
    cell = folder / name
    shutil.copytree(ROOT / "examples" / name, cell)
    CliRunner().invoke(tango, ["simulate", "-C", str(cell)], catch_exceptions=False)
    program = folder / "part.nc"
    program.write_text("G21 G90 G17 G54\nG0 X0. Y0. Z5. A0. C0.\nG1 X40. Y10. F500.\nM30\n")
    return cell, program


@pytest.mark.long
def test_words_are_not_moved_by_what_a_named_mistake_makes_wrong(tmp_path: Path) -> None:
    """The bar of a sister machine: the scales of all axes would go into every word."""
    cell, program = made("trunnion", tmp_path)
    asked = ["compensate", str(program), "-C", str(cell), "-o", str(tmp_path / "out.nc"), "--zero", "X=0,Y=0,Z=0", "--simulated"]
    assert CliRunner().invoke(tango, asked).exit_code == 0
    (tmp_path / "out.nc").unlink()
    artefact = cell / "artefact.yaml"
    text = artefact.read_text()
    length = re.search(r"scale_bar:.*?length: ([\d.]+)", text, re.DOTALL)
    assert length
    artefact.write_text(text[: length.start(1)] + f"{float(length[1]) + 0.03}" + text[length.end(1) :])
    refused = CliRunner().invoke(tango, asked)
    assert re.search(r"µm of what the words would be moved by come from E\w\w1", str(refused.exception))
    assert not (tmp_path / "out.nc").exists()
    assert CliRunner().invoke(tango, [*asked, "--despite"]).exit_code == 0 and (tmp_path / "out.nc").exists()
    foretold = ["predict", str(program), "-C", str(cell), "--zero", "X=0,Y=0,Z=0", "--fitted"]
    refused = CliRunner().invoke(tango, foretold)
    assert re.search(r"µm of what would be predicted come from E\w\w1.* Nothing was predicted", str(refused.exception))
    assert CliRunner().invoke(tango, [*foretold, "--despite"]).exit_code == 0


@pytest.mark.long
@pytest.mark.parametrize(("name", "said"), [("huron", True), ("trunnion", False)])
def test_a_program_says_what_a_spindle_that_was_never_turned_leaves(name: str, said: bool, tmp_path: Path) -> None:
    cell, program = made(name, tmp_path)
    asked = ["compensate", str(program), "-C", str(cell), "-o", str(tmp_path / "out.nc"), "--zero", "X=0,Y=0,Z=0", "--simulated"]
    done = CliRunner().invoke(tango, asked, catch_exceptions=False)
    assert done.exit_code == 0
    assert ("the spindle was never turned" in done.output and "stay beside the figures" in done.output) is said
