"""Every target that has a length says its unit; a control that counts in inches gets no millimeters without it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.compensated import ROOT, first

from tango_cnc.cli import guarded, tango
from tango_cnc.compensate import loop, propose, targets

BESIDE = ("centroid", "iso230", "value_sheet")


@pytest.fixture(scope="module")
def mill(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cell whose control counts in inches."""
    folder = tmp_path_factory.mktemp("cells") / "mill"
    shutil.copytree(ROOT / "examples" / "three_axis_calibrated", folder)
    assert CliRunner().invoke(tango, ["simulate", "-C", str(folder)]).exit_code == 0
    file = folder / "tango.yaml"
    file.write_text(file.read_text().replace("  post: fanuc", "  post: fanuc\n  position_unit: inch"))
    return folder


@pytest.mark.few(1)
@pytest.mark.parametrize("target", targets.names())
def test_a_control_in_inches_gets_no_millimeters_without_their_unit(
    mill: Path, target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = guarded(tango, ["compensate", "-C", str(mill), "--target", target, "--dry-run"], standalone_mode=False)
    said = capsys.readouterr()
    if target in BESIDE:
        assert status == 0 and "inch" not in said.err, said.err
    else:
        assert status != 0 and "position_unit: inch" in said.err and "divided by 25.4" in said.err, said.err


@pytest.mark.few(1)
@pytest.mark.parametrize("target", ["linuxcnc", "haas", "fanuc", "siemens"])
def test_the_steps_of_a_compensation_say_the_unit(target: str, tmp_path: Path) -> None:
    made = propose(first("trunnion"), target)
    kept = loop.store(tmp_path, made, "2026-01-02T03:04:05Z", tmp_path / "c")
    assert any("Lengths in these files are in millimeters" in text for text in kept.record["steps"])
    assert "millimeters" in (tmp_path / "c" / loop.STEPS).read_text()
