"""What scales as read mean for a part: a bar at 23 °C, reckoned by hand; the simulated machine reads it as a person would."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from tango_cnc.cli import tango

COMMANDS = (
    ("estimate",),
    ("compensate", "--target", "siemens", "--dry-run"),
    ("predict", "part.nc", "--zero", "X=0,Y=0,Z=60", "--tool-length", "150"),
    ("compensate", "part.nc", "-o", "out.nc", "--simulated", "--zero", "X=0,Y=0,Z=60", "--tool-length", "150"),
)
PART = "G21 G90 G54\nG0 X0. Y0. Z20. A0. C0.\nG1 Z5. F500.\nG1 X20.\nM30\n"


def test_every_command_that_says_what_scales_mean_is_asked(root: Path) -> None:
    files = (file for file in (root / "tango_cnc" / "commands").glob("[!_]*.py") if "_scales" in file.read_text(encoding="utf-8"))
    left = {file.stem for file in files} - {words[0] for words in COMMANDS}
    assert not left, f"tests/test_scales_said.py: COMMANDS: add the words of {', '.join(sorted(left))}"


@pytest.fixture(scope="module")
def cell(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scales") / "cell"
    shutil.copytree(root / "examples" / "trunnion", folder)
    assert CliRunner().invoke(tango, ["simulate", "-C", str(folder)]).exit_code == 0
    (folder / "part.nc").write_text(PART, encoding="utf-8")
    return folder


def said(cell: Path, words: tuple[str, ...]) -> str:
    command, *arguments = (str(cell / w) if w.endswith(".nc") else w for w in words)
    done = CliRunner().invoke(tango, [command, "-C", str(cell), "--readings", str(cell / "simulated.csv"), *arguments])
    assert done.exit_code == 0, done.output
    (line,) = (line for line in done.output.splitlines() if line.startswith("scales:"))
    return line


@pytest.mark.long
@pytest.mark.parametrize("words", COMMANDS, ids=lambda w: f"{w[0]} {w[1] if len(w) > 1 else ''}")
def test_scales_say_at_what_temperature_they_hold(cell: Path, words: tuple[str, ...]) -> None:
    """A steel bar (11.5 µm/m/K) at 23 °C is 34.5 µm/m too long. Aluminium at 23 °C shrinks by 69.0, of which 34.5 are wanted."""
    warm = cell / "temperature.yaml"
    warm.unlink(missing_ok=True)
    assert "temperature that it had during the run" in said(cell, words) and "is 11.5 µm/m too long" in said(cell, words)
    warm.write_text("bar: [23.0, 0.1]\nmachine: [25.0, 0.3]\nbar_expansion: [11.5, 0.6]\nmachine_expansion: [10.5, 1.0]\n")
    line = said(cell, words)
    assert "the scale bar at 23 °C" in line and "34.5 ± 4.3 µm/m (k = 2) farther" in line  # 2 √((11.5·0.1)² + (0.6·3)² + …)
    assert "An aluminium part cut at 23 °C is 34.5 µm/m too short" in line and re.search(r"adds 10.5 µm/m", line)


@pytest.mark.long
def test_below_20_degrees_each_sentence_says_which_way(cell: Path) -> None:
    """ "Moves −69.0 µm/m farther than commanded" and "is −69.0 µm/m too short" said the opposite of their numbers."""
    cold = "bar: [14.0, 0.1]\nmachine: [14.0, 0.3]\nbar_expansion: [11.5, 0.6]\nmachine_expansion: [10.5, 1.0]\n"
    (cell / "temperature.yaml").write_text(cold)
    line = said(cell, ("estimate",))
    assert "the machine moves 69.0 ± " in line and "(k = 2) less far than commanded" in line
    assert "A part cut at 20 °C is 69.0 µm/m too short" in line
    assert "An aluminium part cut at 14 °C is 69.0 µm/m too long" in line  # it grows by 138.0 to 20 °C, and 69.0 are wanted


@pytest.mark.long
def test_gains_without_a_calibrated_length_are_marked_as_relative(root: Path, tmp_path: Path) -> None:
    """The radii of its balls tell the scale of hu40t a little. Its three gains then share what nobody knows."""
    folder = tmp_path / "cell"
    shutil.copytree(root / "examples" / "hu40t", folder)
    artefact = folder / "artefact.yaml"
    artefact.write_text(re.sub(r"(?ms)^scale_bar:.*?^(?=\S)", "", artefact.read_text() + "\nend: 0\n").replace("end: 0\n", ""))
    run, readings = CliRunner(), ["-C", str(folder), "--readings", str(folder / "simulated.csv")]
    assert run.invoke(tango, ["simulate", "-C", str(folder)]).exit_code == 0
    told = run.invoke(tango, ["estimate", *readings]).output
    assert re.search(r"(?m)^EXX1 .*µm/m, relative$", told) and re.search(r"(?m)^EX0C .*µm$", told)
    assert "EXX1" in told.splitlines()[-2 if told.splitlines()[-1].startswith("Next") else -1]
    assert set(json.loads(run.invoke(tango, ["estimate", *readings, "--json", "-"]).stdout)["relative"]) == {"EXX1", "EYY1", "EZZ1"}
