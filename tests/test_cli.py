"""The command line as a whole: help for every command, near misses, exit codes, and no traceback for anybody."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import click
import pytest
from support.runs import STRATEGY

from tango_cnc import commands
from tango_cnc.cli import FOR, PLACE, guarded, tango
from tango_cnc.commands.init import examples

COMMANDS = tango.list_commands(click.Context(tango))


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    assert call("init", tmp_path / "cell") == 0
    return tmp_path / "cell"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(name, "--help") == 0
    text = capsys.readouterr().out
    assert text.startswith(f"Usage: tango {name}")
    command = tango.get_command(click.Context(tango), name)
    assert command is not None and command.help and command.help.splitlines()[0].endswith((".", "?"))
    for option in command.params:
        assert isinstance(option, click.Argument) or option.help, f"--{option.name} has no help"  # type: ignore[attr-defined]


def test_overview_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("--help") == 0
    text = capsys.readouterr().out
    assert all(f"  {name} " in text for name in COMMANDS)


def test_misspelt_command_is_answered_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("estimat") == 2
    assert "Did you mean 'estimate'?" in capsys.readouterr().err


def test_misspelt_option_is_answered_with_the_nearest(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("estimate", "-C", cell, "--reading", "x") == 2
    assert "--readings" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("plan", "shop/cell"), "The folder of the cell goes behind -C: tango plan -C shop/cell"),
        (("check", "-c", "cell"), "The folder of the cell goes behind -C: tango check -C DIR"),
        (("estimate", "a", "b"), "tango estimate -C a"),
        (("ports", "cell"), ""),
        (("run", "serial:///dev/ttyUSB0"), "The port goes behind --port: tango run --port serial:///dev/ttyUSB0"),
    ],
)
def test_a_cell_that_is_given_without_its_option(arguments: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*arguments) == 2
    text = capsys.readouterr().err
    assert said in text and bool(re.search("goes behind|-C a", text)) == bool(said)


@pytest.mark.long
def test_exit_status_0_and_results_on_stdout(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert call("simulate", "-C", cell, "--json", "-") == 0
    assert json.loads(capsys.readouterr().out)["format"] == "tango-simulation/1"
    assert call("estimate", "-C", cell, "--json", "-") == 0
    assert json.loads(capsys.readouterr().out)["format"] == "tango-estimate/1"


@pytest.mark.long
def test_exit_status_1_when_terms_cannot_be_seen(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("check", "-C", cell, "--terms", "S3,EZ0Z") == 1
    assert "EZ0Z" in capsys.readouterr().out


def test_exit_status_2_for_wrong_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("estimate", "-C", tmp_path) == 2
    assert "no such file" in capsys.readouterr().err


def test_a_file_where_a_folder_should_be_is_a_sentence(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("plan", "-C", cell, "--out", cell / "machine.yaml" / "programs") == 2
    assert "machine.yaml is a file; allowed: a file in a folder" in capsys.readouterr().err
    assert call("init", cell / "machine.yaml" / "new") == 2
    assert "machine.yaml/new: Not a directory; check the path" in capsys.readouterr().err


def test_exit_status_3_when_the_port_does_not_open(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "strategy.yaml").write_text(STRATEGY, encoding="utf-8")
    assert call("run", "-C", cell, "--port", "serial:///dev/there-is-no-such-port", "--yes") == 3
    assert "there-is-no-such-port" in capsys.readouterr().err
    assert not (cell / "readings.csv").exists()


@pytest.mark.long
def test_every_message_is_one_for_people_in_a_real_process(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tango_cnc", "check", "-C", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("tango: ") and "Traceback" not in done.stderr


@pytest.mark.long
def test_output_into_a_closed_pipe_is_no_error(cell: Path) -> None:
    command = f"{sys.executable} -m tango_cnc simulate -C {cell} --json - | true"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("name", examples())
def test_init_never_overwrites(name: str, tmp_path: Path) -> None:
    assert call("init", tmp_path / "cell", "--example", name) == 0
    before = {file.name: file.read_bytes() for file in (tmp_path / "cell").iterdir()}
    assert call("init", tmp_path / "cell", "--example", name) == 2
    assert {file.name: file.read_bytes() for file in (tmp_path / "cell").iterdir()} == before


def test_every_command_has_its_place_in_the_list_and_says_what_it_is_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("--help") == 0
    shown, places = capsys.readouterr().out, dict[str, list[str]]()
    for name in COMMANDS:
        file = Path(commands.__path__[0], f"{name.replace('-', '_')}.py")
        text = file.read_text(encoding="utf-8")
        first = f'"""`tango {name}`: what it is for."""'
        assert FOR.match(text), f"{file.name}: the first line has to be like {first}"
        found = PLACE.search(text)
        assert found and found[1] in commands.GROUPS, f'{file.name}: state PLACE = "GROUP 50" with one of {commands.GROUPS}'
        assert re.search(rf"^  {name}\b", shown, re.MULTILINE), f"{name} is missing in tango --help"
        places.setdefault(found[0], []).append(file.name)
    twice = {place: files for place, files in places.items() if len(files) > 1}
    taken = ", ".join(sorted(place.partition('"')[2].rstrip('"') for place in places))
    assert not twice, f"tango_cnc/commands/: two commands state the same place: {twice}; take a number between those of: {taken}"


@pytest.mark.parametrize(
    "arguments",
    [
        ("iso230", "--tool-length", "nan"),
        ("iso230", "--tool-length", "inf"),
        ("predict", "--test", "laser-X", "--tool-length", "nan"),
        ("predict", "--test", "laser-X", "--tool-length", "-1"),
        ("predict", "--test", "circle-XY", "--radius", "nan"),
        ("predict", "--test", "laser-X", "--instrument-um", "nan"),
        ("uncertainty", "--factor", "nan"),
        ("uncertainty", "--factor", "-2"),
        ("verify", "--limit-um", "inf"),
    ],
)
def test_what_is_no_number_is_refused_before_anything_is_computed(
    cell: Path, arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(arguments[0], "-C", cell, *arguments[1:]) == 2
    assert arguments[-2] in capsys.readouterr().err


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        ("locate --agrees 0,3", "A number is written with a point: 0.3"),
        ("locate --agrees 0.3mm", "A number stands without its unit: tango locate --help says which it has"),
        ("locate --agrees much", "Error: "),
        ("design --minutes 30,5", "A number is written with a point: 30.5"),
        ("design --minutes 30min", "A number stands without its unit: tango design --help says which it has"),
        ("design --within 1.000,5", "A number is written without signs between its thousands: 1000.5"),
        ("plan --split 3,5", "This is a whole number: 3 or 4"),
        ("run --split 3.0", "This is a whole number: 3"),
        ("run --until EX0C=1,5", "Numbers are written with a point and without a unit"),
        ("design --goal EX0C=1.5um", "Numbers are written with a point and without a unit"),
        ("design --volume 0:1,5:2", "Numbers are written with a point and without a unit"),
        ("design --facets table:100mm,50", "Numbers are written with a point and without a unit"),
        ("run --until EX0C=0,EA0C=5", "tango: --until: found 'EX0C=0'; allowed"),
    ],
)
def test_a_number_with_a_comma_or_a_unit_says_how_it_is_written(
    cell: Path, typed: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command, *options = typed.split()
    assert call(command, "-C", cell, *options) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(says)
