"""What tests share is what each of them would have made, and a worker keeps nothing back that somebody has to know."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import cells, rigs
from support.quiet import said

from postprocessors import load, program
from sim_controller.languages.rs274 import Control, default_profile
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.simulate import simulate
from tango_cnc.files import read_cell
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import InputError, World

CELL = Path(__file__).parent / "golden" / "cell"


def test_a_cell_that_is_known_is_the_one_in_its_files(monkeypatch: pytest.MonkeyPatch) -> None:
    known = read_cell(CELL)
    assert read_cell(CELL).strategy is known.strategy
    monkeypatch.setattr(cells, "anew", True)
    read = read_cell(CELL)
    assert read.strategy is not known.strategy and read == known


def test_a_file_that_was_changed_is_read(tmp_path: Path) -> None:
    for file in CELL.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    known, file = read_cell(tmp_path), tmp_path / "machine.yaml"
    file.write_text(file.read_text(encoding="utf-8").replace("travel: [-350, 350]", "travel: [-340, 350]"), encoding="utf-8")
    changed = read_cell(tmp_path)
    assert changed.machine != known.machine and changed.artefact == known.artefact
    file.write_text("name: nothing\n", encoding="utf-8")
    with pytest.raises(InputError):
        read_cell(tmp_path)


def readings(cell_world: World) -> np.ndarray:
    cell = read_cell(CELL)
    return simulate(cell.machine, cell.artefact, cell.strategy, cell_world).position


def test_a_simulated_machine_that_is_known_reads_and_meets_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    world, made = World({"EX0C": -0.03}, {"EXt": 0.01}, noise=0.001, seed=4), plan(read_cell(CELL))

    def records() -> bytes:
        text: list[bytes] = []
        motion = Motion(rig(made.machine, made.artefact, world))
        control = Control(motion, default_profile(made.machine), text.append, lambda event, **data: None, ())
        control.run(list(program(load("linuxcnc"), made, {}, plan_hash(made))[2]()), False)
        return b"".join(text)

    first, again = records(), records()
    known = readings(world)
    assert rig(made.machine, made.artefact, world) is rig(made.machine, made.artefact, world)
    assert any(rigs.MET.values()), "nothing is remembered"
    monkeypatch.setattr(rigs, "anew", True)
    assert records() == first == again and first.count(b" H1 ") == len(made.touches)
    assert np.array_equal(readings(world), known)
    monkeypatch.setattr(rigs, "anew", False)
    readings(world)[:] = 0.0
    assert np.array_equal(readings(world), known), "readings that somebody else changes"
    assert not np.array_equal(readings(World(seed=4)), known)


@pytest.mark.parametrize(
    ("report", "sent"),
    [
        ({"when": "call"}, True),
        ({"when": "call", "outcome": "failed"}, True),
        ({"when": "setup"}, False),
        ({"when": "setup", "outcome": "failed"}, True),
        ({"when": "setup", "outcome": "skipped"}, True),
        ({"when": "setup", "duration": 0.2}, True),
        ({"when": "teardown"}, False),
        ({"when": "teardown", "outcome": "failed"}, True),
        ({"when": "teardown", "sections": [("Captured log", "…")]}, True),
    ],
)
def test_what_a_worker_keeps_to_itself_is_a_step_that_has_passed(report: dict[str, object], sent: bool) -> None:
    usual = {"outcome": "passed", "sections": [], "duration": 0.01}
    assert said("testreport", {"data": usual | report}) is sent
    assert said("runtest_protocol_complete", {}) and said("internal_error", {}) and not said("logstart", {})
