"""What a warm bar does to scales: worked out by hand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from tango_cnc.cli import tango
from tango_cnc.iso230.temperature import Known, Thermal, read_thermal, scale
from tango_cnc.records import InputError


def test_a_steel_bar_3_k_warm_on_a_machine_at_5_k() -> None:
    thermal = Thermal(Known(23, 0.1), Known(25, 0.2), Known(11.5e-6, 0.5e-6), Known(10e-6, 1e-6))
    assert scale(thermal, at_reference=False).value == pytest.approx(34.5e-6)
    found = scale(thermal, at_reference=True)
    assert found.value == pytest.approx(34.5e-6 - 50e-6)
    by_hand = (11.5 * 0.1) ** 2 + (0.5 * 3) ** 2 + (10 * 0.2) ** 2 + (1 * 5) ** 2 + (0.5 * 0.1) ** 2 + (1 * 0.2) ** 2
    assert found.std == pytest.approx(by_hand**0.5 * 1e-6)


def test_a_temperature_without_uncertainty_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "temperature.yaml"
    file.write_text("bar: 23\nmachine: [20, 0.1]\n", encoding="utf-8")
    with pytest.raises(InputError, match="bar"):
        read_thermal(file)


def test_scales_are_shifted_and_straightness_is_not(tmp_path: Path) -> None:
    runner, cell = CliRunner(), tmp_path / "cell"
    assert runner.invoke(tango, ["init", str(cell)]).exit_code == 0
    assert runner.invoke(tango, ["simulate", "-C", str(cell)]).exit_code == 0

    def told() -> tuple[str, dict[str, dict[str, object]]]:
        data = json.loads(
            runner.invoke(tango, ["iso230", "-C", str(cell), "--readings", str(cell / "simulated.csv"), "--json", "-"]).stdout
        )
        return data["temperature"], {f"{f['kind']} {f['name']}": f for f in data["figures"]}

    state, before = told()
    assert state == "not stated"
    (cell / "temperature.yaml").write_text("bar: [23, 0.1]\nmachine: [20, 0.1]\n", encoding="utf-8")
    state, after = told()
    assert state == "20 °C"
    one, two = before["positioning gain EXX"]["value"], after["positioning gain EXX"]["value"]
    assert isinstance(one, float) and isinstance(two, float)
    assert two - one == pytest.approx(34.5, abs=0.01)
    assert before["straightness EXZ"] == after["straightness EXZ"]
