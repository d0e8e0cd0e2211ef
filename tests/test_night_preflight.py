"""Before anything moves: how warm the machine is, and a look that keeps nothing."""

from __future__ import annotations

import http.server
import importlib
import shutil
import socketserver
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.bodies import YOKE, trunnion
from support.controls import GOLDEN, golden
from support.histories import record
from support.nights_parts import RealControl, nights_of, twin, warm
from support.runs import Result

from sim_controller.simulate import simulate
from tango_cnc.cli import tango
from tango_cnc.files import read_cell, readings_text
from tango_cnc.files.nightly import Nightly, read_nightly
from tango_cnc.history import opened
from tango_cnc.link.layout import read_layout
from tango_cnc.plan import plan
from tango_cnc.records import Cell, InputError, LinkError, Obstacle, Plan, World

BED = '<Streams><Temperature dataItemId="t1" name="bed">{}</Temperature></Streams>'
ASKED = Nightly(sensor="bed", temperature=(20.0, 24.0))
PATIENT = Nightly(sensor="bed", temperature=(20.0, 24.0), warm_up_minutes=30.0)


@dataclass
class Agent:
    """An MTConnect agent that says one temperature."""

    bed: float | str
    url: str = ""


@pytest.fixture
def agent() -> Iterator[Agent]:
    says = Agent(21.5)

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(BED.format(says.bed).encode())

        def log_message(self, *_: Any) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        says.url = f"http://127.0.0.1:{server.server_port}/current"
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        yield says
        server.shutdown()


@pytest.fixture
def cell(tmp_path: Path, agent: Agent) -> Path:
    shutil.copytree(GOLDEN, tmp_path / "cell")
    sensors = f"every: 0.5\nold: 0.5\nsensors:\n  bed: {{mtconnect: '{agent.url}', item: bed}}\n"
    (tmp_path / "cell" / "sensors.yaml").write_text(sensors, encoding="utf-8")
    return tmp_path / "cell"


@pytest.mark.parametrize(
    ("bed", "settings", "passed", "first", "said"),
    [
        (21.5, ASKED, True, False, "bed 21.5 °C, 20 … 24 °C are asked for"),
        (17.0, ASKED, False, False, "cold: bed 17.0 °C"),
        (17.0, PATIENT, True, True, "it warms up first, 30 min at most"),
        (31.0, PATIENT, False, False, "bed 31.0 °C"),
        ("UNAVAILABLE", PATIENT, False, False, "bed said nothing for 0.5 s"),
    ],
)
def test_a_night_begins_on_a_machine_as_warm_as_it_asks_for(
    cell: Path, agent: Agent, bed: float | str, settings: Nightly, passed: bool, first: bool, said: str
) -> None:
    agent.bed = bed
    point, cold = warm(cell, settings)
    assert (point.check, point.passed, cold) == ("warm", passed, first) and said in point.found
    assert passed or point.do


@pytest.mark.few(0)
def test_a_temperature_that_no_sensor_tells_is_named(cell: Path) -> None:
    with pytest.raises(InputError, match=r"sensor 'head' of nightly\.yaml is not in sensors\.yaml; allowed: bed"):
        warm(cell, Nightly(sensor="head", temperature=(20.0, 24.0)))
    (cell / "sensors.yaml").unlink()
    with pytest.raises(InputError, match=r"no sensor measures it: name one in sensors\.yaml"):
        warm(cell, ASKED)
    found = RealControl(read_cell(cell), ASKED, golden(), None, "now", "socket://127.0.0.1:9").preflight("full", ())
    assert [p.passed for p in found if p.check == "warm"] == [False]


@pytest.mark.parametrize("name", ["EXOC", "volme"])
def test_a_limit_of_what_no_night_follows_is_refused_as_it_would_never_be_crossed(name: str) -> None:
    with pytest.raises(InputError, match=rf"nightly\.yaml: limits: found '{name}'.*allowed: volume"):
        nights_of(read_cell(GOLDEN), Nightly(limits={"volume": 30.0, name: 25.0}), golden(), deep=False)


def test_a_warm_up_without_a_temperature_is_refused(cell: Path) -> None:
    (cell / "nightly.yaml").write_text("nightly: 1\nwarm_up_minutes: 30\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"nightly\.yaml.*warm_up_minutes.*a temperature as well"):
        read_nightly(cell)


@dataclass
class Warming(RealControl):
    """A machine that is 2 K warmer after every run; its runs are noted instead of made."""

    agent: Agent = field(default_factory=lambda: Agent(20.0))
    runs: list[str] = field(default_factory=list)

    def _run(self, own: object, made: Plan, target: Path) -> dict[str, Any]:
        self.runs.append(target.name)
        if target.name == "readings.csv":
            raise LinkError("far enough for this test")
        self.agent.bed = float(self.agent.bed) + 2.0
        return {}


@pytest.mark.long
def test_a_cold_machine_runs_its_program_until_it_is_warm_and_is_measured_then(cell: Path, agent: Agent) -> None:
    agent.bed = 17.0
    control = Warming(read_cell(cell), PATIENT, golden(), None, "now", "socket://127.0.0.1:9", agent=agent)
    control.preflight("full", ())
    with pytest.raises(LinkError, match="far enough"):
        control.measure("full", ())
    assert control.runs == ["warm-up-1.csv", "warm-up-2.csv", "readings.csv"] and agent.bed == 21.0


@dataclass
class Measuring(RealControl):
    """A control whose run leaves a file of readings."""

    def _run(self, own: object, made: Plan, target: Path) -> dict[str, Any]:
        of = self.cell
        touched = simulate(of.machine, of.artefact, of.strategy, World(noise=0.0007), seed=1)
        target.write_text(readings_text(touched), encoding="utf-8")
        return {}


@pytest.mark.parametrize("simulated", [True, False])
def test_a_night_on_a_simulated_control_says_so(cell: Path, simulated: bool) -> None:
    assert (
        Measuring(read_cell(cell), Nightly(), golden(), None, "now", "none:", simulated).measure("full", ()).simulated == simulated
    )


@pytest.mark.long
def test_a_machine_that_stays_cold_is_not_measured(cell: Path, agent: Agent) -> None:
    agent.bed = 10.0
    short = Nightly(sensor="bed", temperature=(20.0, 24.0), warm_up_minutes=1e-6)
    control = Warming(read_cell(cell), short, golden(), None, "now", "socket://127.0.0.1:9", agent=agent)
    control.preflight("full", ())
    with pytest.raises(LinkError, match=r"cold: bed 10\.0 °C after 1e-06 min of warm-up, 20 °C are asked for"):
        control.measure("full", ())
    assert control.runs == []


@pytest.mark.long
def test_a_dry_run_leaves_no_file(cell: Path) -> None:
    before = sorted(cell.rglob("*"))
    looked = Result("nightly", "-C", cell, "--dry-run", "--port", "socket://127.0.0.1:9")
    assert looked.code == 1 and "nothing was moved, nothing was kept" in looked.out
    assert sorted(cell.rglob("*")) == before


def test_a_history_without_a_night_says_what_adds_one(cell: Path) -> None:
    with opened(cell / "history.db"):
        pass
    assert f"it holds no night yet; 'tango nightly -C {cell}' adds one" in Result("history", "list", "-C", cell).err


HELLO = "HELLO ACK tango 1.1\r\nESTOP OFF\r\nMACHINE ON\r\nPROGRAM_STATUS {}\r\n"


class Answers(socketserver.BaseRequestHandler):
    """A control that says one thing to whoever asks."""

    says = b""

    def handle(self) -> None:
        self.request.recv(4096)
        self.request.sendall(self.says)
        while self.request.recv(4096):
            pass


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("state", "passed", "said"),
    [("IDLE", True, "PROGRAM_STATUS IDLE"), ("RUNNING", False, "it says PROGRAM_STATUS RUNNING: a program is running")],
)
def test_a_control_that_runs_a_program_is_left_alone(cell: Path, state: str, passed: bool, said: str) -> None:
    says = type("Says", (Answers,), {"says": HELLO.format(state).encode()})
    with socketserver.TCPServer(("127.0.0.1", 0), says) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        port = f"linuxcnc://127.0.0.1:{server.server_address[1]}?file=/tmp/tango.ngc&log=/tmp/tango-readings.txt"
        points = RealControl(read_cell(cell), Nightly(), golden(), None, "now", port).preflight("full", ())
        server.shutdown()
    (found,) = [p for p in points if p.check == "control"]
    assert found.passed == passed and said in found.found and bool(found.do) != passed


def registers(**values: int) -> bytes:
    """status and probe → what a control with the usual layout answers: no name, then its registers."""
    layout = read_layout("")
    block = [0] * layout.block[1]
    for name, value in values.items():
        block[layout.registers[name] - layout.block[0]] = value
    return f"!\n3 {' '.join(str(word) for word in block)}\n".encode()


@pytest.mark.parametrize(
    ("protocol", "data", "said"),
    [
        ("grbl", b"<Idle|MPos:0,0,0>\r\n", ""),
        ("grbl", b"<Run|MPos:0,0,0>\r\n", "its state is Run, not Idle"),
        ("grbl", b"<Hold:0|MPos:0,0,0>\r\n", "its state is Hold, not Idle"),
        ("linuxcnc", HELLO.format("PAUSED").encode(), "it says PROGRAM_STATUS PAUSED: a program is running"),
        ("modbus", registers(status=0, probe=0), ""),
        ("modbus", registers(status=1, probe=0), "its status is busy, not idle"),
        ("modbus", registers(status=3, probe=0), "its status is door, not idle"),
        ("modbus", registers(status=0, probe=1), "the probe signal is on"),
        ("modbus", b"!\n", ""),
        ("dnc", b"anything", ""),
    ],
)
def test_a_control_that_is_busy_says_so_in_the_words_of_its_link(protocol: str, data: bytes, said: str) -> None:
    client = importlib.import_module(f"tango_cnc.link.protocols.{protocol}").Client
    assert client.busy(data, {}) == said


@pytest.mark.long
def test_what_the_first_move_may_meet_is_in_the_findings_as_nobody_brings_the_axes_near(root: Path) -> None:
    def program(cell: Cell) -> str:
        control = RealControl(replace(cell, folder=root / "examples" / "trunnion"), Nightly(), plan(cell), None, "now", "none:")
        (point,) = (p for p in control.preflight("full", ()) if p.check == "program")
        assert point.passed, point.found
        return point.found

    free = trunnion(indexations=1)
    assert "first place" not in program(free)
    clamp = Obstacle("box", low=(-20.0, 170.0, -70.0), high=(20.0, 262.0, -50.0))
    one = free.strategy.indexations[0]
    tilted = tuple(replace(one, position={**one.position, "A": angle}, facets=("13",)) for angle in (0.0, 0.5))
    beside = trunnion(*YOKE)
    beside = replace(
        beside,
        artefact=replace(beside.artefact, obstacles=(clamp,)),
        strategy=replace(beside.strategy, indexations=tilted),
    )
    found = program(beside)
    assert "On the way to the first place" in found and "may be met by" in found
    assert "Bring the axes near that place before you start" in found


@pytest.mark.few(0)
def test_a_machine_that_has_the_name_of_another_one_in_its_history_is_not_measured(root: Path, tmp_path: Path) -> None:
    """A copied folder: each of the two was compared with the other, and called changed by what differs between machines."""
    for name in ("one", "two"):
        shutil.copytree(root / "examples" / "trunnion", tmp_path / name)
        (tmp_path / name / "nightly.yaml").write_text("nightly: 1\nhistory: ../fleet.db\n", encoding="utf-8")
    own = read_cell(tmp_path / "one").machine.name
    with opened(tmp_path / "fleet.db") as history:
        assert twin(history, own, tmp_path / "two") is None
        history.add_night(record(1, own, cell=str(tmp_path / "one")))
        assert twin(history, own, tmp_path / "one") is None
        assert twin(history, own, tmp_path / "two") == tmp_path / "one"
        asked = partial(twin, history, own, tmp_path / "two")
        control = RealControl(read_cell(tmp_path / "two"), Nightly(), golden(), None, "now", "socket://127.0.0.1:9", twin=asked)
        point = control.preflight("full", ())[0]
        assert (point.check, point.passed) == ("name", False) and str(tmp_path / "one") in point.found
        found = CliRunner().invoke(tango, ["fleet", str(tmp_path / "one"), str(tmp_path / "two")], standalone_mode=False)
        assert found.return_value == 1 and f"{tmp_path / 'two'}: not in the list" in found.output and "another name" in found.output
        (tmp_path / "two" / "nightly.yaml").write_text("nightly: 1\n", encoding="utf-8")  # a history of its own
        assert twin(history, own, tmp_path / "two") is None
        (tmp_path / "two" / "nightly.yaml").write_text("nightly: 1\nhistory: ../fleet.db\n", encoding="utf-8")
        (tmp_path / "one").rename(tmp_path / "moved")  # the cell was moved: its folder is there no more
        assert twin(history, own, tmp_path / "moved") is None
