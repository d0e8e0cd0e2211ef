"""grbl: the simulated control keeps to the facts of its sources, and whole runs over TCP and over a serial line."""

import re
import sys

import pytest
from linkparts import job
from test_run import STRATEGY, Result, readings
from test_run_simulated import agree, controller

from sim_controller.interpreters.grbl import switched_on
from sim_controller.motion import Motion
from sim_controller.probing import rig
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, read_world
from tango_cnc.link.grbl import Client
from tango_cnc.records import InputError

posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    return folder


@pytest.fixture
def control(cell):
    parts = read_cell(cell)
    return lambda **options: switched_on(Motion(rig(parts.machine, parts.artefact, read_world(cell / "world.yaml"))), **options)


def test_a_whole_run_over_tcp(cell):
    with controller(cell, "--protocol", "grbl", "--tcp", "127.0.0.1:0") as url:
        result = Result("run", "-C", cell, "--port", f"{url}?orient=m19", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)


@posix
def test_a_whole_run_over_a_serial_line(cell):
    with controller(cell, "--protocol", "grbl", "--pty") as url:
        result = Result("run", "-C", cell, "--port", f"{url}?orient=m19", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)


def test_a_run_that_an_alarm_stops_leaves_what_was_measured(cell):
    with controller(cell, "--protocol", "grbl", "--tcp", "127.0.0.1:0", "--fault", "alarm-after=4") as url:
        result = Result("run", "-C", cell, "--port", f"{url}?orient=m19", "--timeout", "20")
    assert (result.code, "ALARM:3" in result.err) == (3, True), result.err
    assert len(readings(cell, "readings.partial.csv")) == 3


def test_a_plan_that_turns_the_spindle_needs_a_word_for_it(cell):
    result = Result("run", "-C", cell, "--port", "grbl+socket://127.0.0.1:1")
    assert result.code == 2
    assert "orient=m19" in result.err


def test_options_that_mean_nothing_are_refused():
    with pytest.raises(InputError, match="feed"):
        Client(job(), {"feed": "fast"})


def test_the_simulated_control_answers_a_miss_as_grbl_does(control):
    one = control()
    assert one.line("G38.3 X10 F100") == ["[PRB:10.000,0.000,800.000,0.000,0.000:0]", "ok"]
    assert one.line("G38.2 X20 F100") == ["ALARM:5", "[PRB:20.000,0.000,800.000,0.000,0.000:0]", "ok"]
    assert one.line("G0 X0") == ["error:9"]
    assert one.line("$X")[-1] == "ok"
    assert one.line("G0 X0") == ["ok"]


def test_the_simulated_control_answers_an_empty_line_with_an_ok_of_its_own(control):
    assert control().line("") == ["ok"]


def test_the_simulated_control_reports_inches_whatever_g21_says(control):
    one = control(inches=True)
    one.line("G21")
    assert one.line("G38.3 X25.4 F100")[0].startswith("[PRB:1.0000,")


def test_the_same_place_is_no_target(control):
    one = control()
    assert one.line("G38.3 X0 F100") == ["error:33"]
    assert one.line("") == ["ok"]
    assert one.line("G38.3 X1") == ["[PRB:1.000,0.000,800.000,0.000,0.000:0]", "ok"], "F stays"
