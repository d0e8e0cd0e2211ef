"""Temperature columns of readings in another unit, or against temperature.yaml: named, and never used in silence."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from tango_cnc.cli import tango
from tango_cnc.files import read_cell, read_readings, readings_text
from tango_cnc.iso230.columns import columns, said
from tango_cnc.iso230.temperature import Known, Thermal

EXAMPLE = Path(__file__).parents[1] / "examples" / "three_axis"
STATED = Thermal(Known(23, 0.1), Known(25, 0.2), Known(11.5e-6, 0.5e-6), Known(10e-6, 1e-6), air=Known(22.0, 0.5))


def one(low: float, high: float, thermal: Thermal | None = None, name: str = "air") -> tuple[str, bool]:
    (found,) = columns({name: np.linspace(low, high, 30)}, thermal)
    return found.unit, found.believed


@pytest.mark.parametrize(
    ("low", "high", "unit", "believed"),
    [
        (18, 26, "", True),
        (65, 71, "°F", False),
        (55, 60, "°F", False),
        (85, 92, "°F", False),
        (291, 295, "K", False),
        (-270, -260, "", False),
        (400, 500, "", False),
        (-5, 2, "", True),
        (33, 38, "", True),
    ],
)
def test_what_no_workshop_has_is_not_believed(low: float, high: float, unit: str, believed: bool) -> None:
    assert one(low, high) == (unit, believed)


def test_what_is_stated_is_what_is_expected() -> None:
    """A cell in the cold: 45 °F are 7 °C, and 45 °C would be believed of nothing there."""
    cold = Thermal(Known(7, 0.5), Known(7, 0.5), Known(11.5e-6, 2e-6), Known(11.5e-6, 2e-6))
    assert one(44, 46, cold) == ("°F", False)
    assert one(6, 8, cold) == one(45, 60, cold, "spindle_1") == ("", True)
    assert one(290, 295, None, "spindle_1") == ("K", False)


def test_a_column_far_from_what_is_stated_gets_a_word() -> None:
    (text,) = said({"bar": np.full(9, 26.0)}, STATED)
    assert "T_bar says 26.0 °C" in text and "23 ± 0.1 °C of the bar" in text
    assert said({"bar": np.full(9, 23.9), "spindle": np.full(9, 34.0)}, STATED) == ()
    (text,) = said({"bed": np.full(9, 32.0)}, STATED)
    assert "within 5 K" in text and "32.0 °C" in text
    assert said({"bed": np.full(9, 27.0)}, STATED) == ()
    assert said({"bed": np.full(9, 27.0)}, None) == ()
    (text,) = said({"air": np.array([71.0, 72.5, np.nan])}, STATED)
    assert "read in °F it would be 21.7 to 22.5 °C" in text


def run(*words: str) -> str:
    done = CliRunner().invoke(tango, list(words))
    return done.output


@pytest.mark.few(0)
@pytest.mark.parametrize("unit", ["°C", "°F"])
def test_micrometres_per_kelvin_are_not_those_of_degrees_fahrenheit(tmp_path: Path, unit: str) -> None:
    """A machine that goes 3 µm/K; the logger of the air writes °F: it was 1.7 µm/K without a word."""
    folder = tmp_path / "etve"
    assert CliRunner().invoke(tango, ["init", str(tmp_path / "cell"), "--example", "three_axis"]).exit_code == 0
    run("capability", "etve", "-C", str(tmp_path / "cell"), "--cell", str(folder), "--repetitions", "40")
    assert CliRunner().invoke(tango, ["simulate", "-C", str(folder)]).exit_code == 0
    cell = read_cell(folder)
    plain = read_readings(folder / "simulated.csv", cell.machine, cell.artefact)
    rng = np.random.default_rng(4)
    warm = 20 + 1.5 * np.sin(2 * np.pi * plain.time / plain.time.max()) + rng.normal(0, 0.02, len(plain))
    moved = plain.position.copy()
    moved[:, :3] += 3e-3 * (warm - 20)[:, None]
    told = warm if unit == "°C" else 1.8 * warm + 32
    rows = replace(plain, position=moved, temperatures={"air": told})
    (folder / "readings.csv").write_text(readings_text(rows), encoding="utf-8")
    data = json.loads(CliRunner().invoke(tango, ["capability", "etve", "-C", str(folder), "--json", "-"]).stdout)
    found = next(iter(data["results"].values()))
    said_there = run("capability", "etve", "-C", str(folder))
    if unit == "°C":
        assert abs(abs(found["per_kelvin"]) - 3e-3) < 4 * found["per_kelvin_std"] + 1e-4 and data["sensors_doubted"] == []
        assert "T_air" not in said_there
        return
    assert found["per_kelvin"] == 0 and "read in °F it would be" in data["sensors_doubted"][0]
    assert "it takes no part" in said_there


@pytest.mark.few(0)
@pytest.mark.parametrize("command", ["estimate", "iso230"])
def test_the_commands_say_it(tmp_path: Path, command: str) -> None:
    folder = tmp_path / "cell"
    assert CliRunner().invoke(tango, ["init", str(folder), "--example", "three_axis"]).exit_code == 0
    assert CliRunner().invoke(tango, ["simulate", "-C", str(folder)]).exit_code == 0
    lines = (folder / "simulated.csv").read_text().splitlines()
    (folder / "readings.csv").write_text("\n".join([f"{lines[0]},T_air", *(f"{line},70.5" for line in lines[1:])]) + "\n")
    (folder / "temperature.yaml").write_text(yaml.safe_dump({"bar": [21.0, 0.1], "machine": [22.0, 0.3], "air": [21.5, 0.3]}))
    text = run(command, "-C", str(folder), "--despite")
    assert "column T_air says 70.5 °C, and temperature.yaml states 21.5 °C; read in °F it would be 21.4 °C" in " ".join(
        text.split()
    )
