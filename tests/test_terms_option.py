"""`--terms` means the same to every command that takes it: a learned shape is looked for in the cell."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from support.design_parts import option
from support.runs import STRATEGY

from tango_cnc.cli import tango
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_terms
from tango_cnc.files.learned import learned_text
from tango_cnc.records import InputError

FACTOR = {"covariate": "Y", "kind": "polynomial", "low": -200.0, "high": 200.0, "count": 1}
TWIST = {"factors": [FACTOR], "weight": "machine z", "values": [0.5, -0.2]}
ALSO = {"predict": ["--test", "circle-XY"], "compensate": ["--target", "siemens", "--simulated"]}
NAMES = [
    name
    for name, command in (
        (name, tango.get_command(click.Context(tango), name)) for name in tango.list_commands(click.Context(tango))
    )
    if command is not None and any("--terms" in p.opts for p in command.params)
]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("terms") / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY, encoding="utf-8")
    assert CliRunner().invoke(tango, ["simulate", "-C", str(folder), "--seed", "1"], standalone_mode=False).exit_code == 0
    return folder


def test_the_commands_that_take_terms_are_found() -> None:
    assert {"estimate", "verify", "predict", "iso230", "compensate", "design", "check", "report", "diagnose"} <= set(NAMES)


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"accept", "check"}))  # these want limits, a plan first
def test_every_command_looks_for_a_learned_shape_in_the_cell(name: str, cell: Path) -> None:
    asked = [name, "-C", str(cell), "--terms", "[S3, {cause: learned, name: twist}]", *ALSO.get(name, [])]
    error = CliRunner().invoke(tango, asked, standalone_mode=False).exception
    assert isinstance(error, InputError) and "which has no file in" in str(error)


def test_the_terms_that_a_design_prints_can_be_given_to_terms(tmp_path: Path) -> None:
    (tmp_path / "learned").mkdir()
    (tmp_path / "learned" / "twist.yaml").write_text(learned_text(TWIST), encoding="utf-8")
    terms = read_terms("[S3, EYX2, {cause: learned, name: twist}, {cause: thermal_drift, tau_s: 900}]", tmp_path)
    assert "values" not in option(terms) and read_terms(option(terms), tmp_path) == terms
    assert option(("S3", "EYX2")) == "S3,EYX2"
