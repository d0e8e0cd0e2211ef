"""What a warm bar does to scales: worked out by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tango_cnc.cli import tango
from tango_cnc.files import read_cell
from tango_cnc.iso230.expansion import feels, felt_by, stretches
from tango_cnc.iso230.onpart import asked
from tango_cnc.iso230.temperature import ASSUMED, Known, Thermal, read_thermal, scale
from tango_cnc.iso230.trajectory import reference
from tango_cnc.records import InputError
from tests.support import iso_warm

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_a_steel_bar_3_k_warm_on_a_machine_at_5_k() -> None:
    thermal = Thermal(Known(23, 0.1), Known(25, 0.2), Known(11.5e-6, 0.5e-6), Known(10e-6, 1e-6))
    assert scale(thermal, at_reference=False).value == pytest.approx(34.5e-6)
    found = scale(thermal, at_reference=True)
    assert found.value == pytest.approx(34.5e-6 - 50e-6)
    by_hand = (11.5 * 0.1) ** 2 + (0.5 * 3) ** 2 + (10 * 0.2) ** 2 + (1 * 5) ** 2 + (0.5 * 0.1) ** 2 + (1 * 0.2) ** 2
    assert found.std == pytest.approx(by_hand**0.5 * 1e-6)


def test_a_shop_of_which_nothing_is_stated() -> None:
    """Bar and machine each 20 °C ± 2 K with 11.5 ± 2 µm/m/K: two products of uncertain numbers."""
    one = (11.5 * 2) ** 2 + (2 * 2) ** 2
    assert scale(ASSUMED, at_reference=True).std == pytest.approx((2 * one) ** 0.5 * 1e-6)
    assert scale(ASSUMED, at_reference=True).value == 0


def test_what_feels_an_expansion() -> None:
    """All axes 1 % longer: a way of 200 mm grows by 2 mm, no way bends, nothing turns."""
    machine = read_cell(EXAMPLES / "three_axis").machine
    over = {"X": (-100.0, 100.0), "Y": (0.0, 50.0), "Z": (0.0, 10.0)}
    asks = asked(machine, stretches(machine), over, reference(machine, over))
    felt = felt_by(machine, over, reference(machine, over))
    grown = {
        a.name: abs(np.ptp(felt[a.kind, a.name])) if a.is_range else felt[a.kind, a.name]
        for a in asks
        if feels(a, felt[a.kind, a.name]) and a.name != "V"
    }
    corner = np.linalg.norm(felt["volumetric", "V"], axis=1).max()  # from the middle of the volume
    assert corner == pytest.approx(np.linalg.norm([100, 25, 5]))
    assert grown == pytest.approx(
        {"EXX M": 200, "EXX": 1, "EYY M": 50, "EYY": 1, "EZZ M": 10, "EZZ": 1, "VX": 200, "VY": 50, "VZ": 10}
    )


@pytest.mark.long
def test_a_bar_of_23_and_a_machine_of_25_degrees_of_which_nothing_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine at 20 °C is 23 µm/m away from what its bar shows: outside as read, inside at 20 °C."""
    monkeypatch.setattr(iso_warm, "FIXED", True)
    found = iso_warm.one("hu40t", iso_warm.FIRST + 2)  # of the first two, the gain of Z is at the limit, 15 µm/m, and withheld
    scales = {way: [inside for kind, _, inside in figures if kind.startswith("positioning")] for way, figures in found.items()}
    assert len(scales["20 °C, nothing stated"]) == 6 and all(scales["20 °C, nothing stated"])
    assert not all(scales["as read"])
    assert sum(scales["20 °C, stated"]) >= len(scales["20 °C, stated"]) - 1


def test_a_temperature_without_uncertainty_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "temperature.yaml"
    file.write_text("bar: 23\nmachine: [20, 0.1]\n", encoding="utf-8")
    with pytest.raises(InputError, match="bar"):
        read_thermal(file)


def test_degrees_fahrenheit_are_refused_and_said_in_celsius(tmp_path: Path) -> None:
    file = tmp_path / "temperature.yaml"
    file.write_text("bar: [73.4, 0.1]\nmachine: [25, 0.3]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"bar\[0\].*73\.4 °F are 23\.0 °C"):
        read_thermal(file)


@pytest.mark.long
def test_scales_are_shifted_and_straightness_is_not(tmp_path: Path) -> None:
    runner, cell = CliRunner(), tmp_path / "cell"
    assert runner.invoke(tango, ["init", str(cell)]).exit_code == 0
    assert runner.invoke(tango, ["simulate", "-C", str(cell)]).exit_code == 0

    def told() -> tuple[str, dict[str, dict[str, object]]]:
        data = json.loads(
            runner.invoke(tango, ["iso230", "-C", str(cell), "--readings", str(cell / "simulated.csv"), "--json", "-"]).stdout
        )
        fitted = {f"fitted {f['kind']} {f['name']}": f for f in data["fitted"]}
        return data["temperature"], {f"{f['kind']} {f['name']}": f for f in data["figures"]} | fitted

    state, before = told()
    assert state == "20 °C, assumed"
    (cell / "temperature.yaml").write_text("bar: [23, 0.1]\nmachine: [20, 0.1]\n", encoding="utf-8")
    state, after = told()
    assert state == "20 °C"
    one, two = before["positioning gain EXX"]["value"], after["positioning gain EXX"]["value"]
    alone, shifted = (told["fitted positioning gain EXX"]["value"] for told in (before, after))
    assert isinstance(one, float) and isinstance(two, float) and isinstance(alone, float) and isinstance(shifted, float)
    assert two - one == pytest.approx(34.5, abs=0.01)
    assert shifted - alone == pytest.approx(34.5, abs=0.01), "fitted gains are at the same temperature as the others"
    assert before["straightness EXZ"] == after["straightness EXZ"]
    low, high = before["positioning gain EXX"]["interval"]
    assert high - low > 4 * 32, "nobody has stated a temperature: 2 K of bar and of machine are 33 µm/m"
    assert "positioning gain EYY − EXX" in before, "what both have in common is not in the difference"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("bar_expansion: [11.5e-6, 0.5]", "1.15e-05/K is written 11.5"),
        ("bar_expansion: [11.5, 0.5e-6]", "0.02 µm/m/K"),
        ("machine_expansion: [0, 0]", "0.02 µm/m/K"),
        ("machine_expansion: [1000, 1]", "at most 40"),
        ("machine: [20, 0]", "0.005 K"),
        ("machine: [293.15, 0.1]", "293.15 K are 20.0 °C"),
        ("machine: [.nan, 0.1]", "finite"),
        ("air: [68, 0.1]", "68 °F are 20.0 °C"),
    ],
)
def test_expansions_and_uncertainties_that_nothing_has_are_refused(tmp_path: Path, line: str, words: str) -> None:
    file = tmp_path / "temperature.yaml"
    given = {"bar": "[23, 0.1]", "machine": "[20, 0.1]"} | {line.split(":")[0]: line.split(": ")[1]}
    file.write_text("".join(f"{key}: {value}\n" for key, value in given.items()), encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_thermal(file)


def test_a_glass_ceramic_does_not_expand(tmp_path: Path) -> None:
    file = tmp_path / "temperature.yaml"
    file.write_text("bar: [23, 0.1]\nmachine: [20, 0.1]\nbar_expansion: [0, 0.05]\n", encoding="utf-8")
    assert scale(read_thermal(file), at_reference=False).value == 0


def _stated(folder: Path, text: str) -> Thermal:
    file = folder / "temperature.yaml"
    file.write_text(text, encoding="utf-8")
    return read_thermal(file)


def test_what_is_not_stated_is_as_warm_as_the_air_and_less_surely(tmp_path: Path) -> None:
    """Air at 24 °C: bar and machine of steel are 4 K too warm, each ± √(0.2² + 1.5²) K; their expansions differ by 2.8 µm/m/K."""
    by_air = _stated(tmp_path, "air: [24, 0.2]\n")
    assert (by_air.bar, by_air.machine, by_air.by_air) == (by_air.machine, by_air.bar, ("bar", "machine"))
    assert scale(by_air, at_reference=True).value == 0
    assert scale(by_air, at_reference=True).std * 1e6 == pytest.approx(27.4, abs=0.2)
    assert "air 24 ± 0.2 °C (bar and machine taken to be as warm)" in by_air.text
    assert "bar 25 ± 1.8 °C, " in _stated(tmp_path, "air: [25, 1]\n").text  # and no 1.80278
    stated = _stated(tmp_path, "air: [24, 0.2]\nbar: [21, 0.1]\nmachine: [23, 0.3]\n")
    assert stated.by_air == () and scale(stated, True) == scale(_stated(tmp_path, "bar: [21, 0.1]\nmachine: [23, 0.3]\n"), True)


def test_a_table_is_stated_without_a_cmm_and_its_metal_need_not_be_known(tmp_path: Path) -> None:
    found = _stated(tmp_path, "bar: [20, 0.1]\nmachine: [20, 0.1]\ntable: [25, 0.5]\n")
    assert found.table == Known(25.0, 0.5) and found.table_expansion == Known(17e-6, 6e-6) and found.cmm is None
    assert "table 25 ± 0.5 °C, 17 ± 6 µm/m/K" in found.text


@pytest.mark.parametrize(
    "text", ["machine: [20, 0.1]\n", "table: [20, 0.1]\n", "bar: [20, 0.1]\nmachine: [20, 0.1]\ncmm: [20, 0.1]\n"]
)
def test_a_temperature_that_nothing_tells_is_asked_for(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match="air"):
        _stated(tmp_path, text)
