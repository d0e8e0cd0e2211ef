"""The first programs on a machine: nobody knows the table better than to 20 mm and 3 degrees, and nothing is hit in the air."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.controls import run_on
from support.few import every

from postprocessors import load, program
from sim_controller.languages import macro_b
from tango_cnc import commission, locate
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.commission import above
from tango_cnc.files import read_cell
from tango_cnc.files.write import artefact_text
from tango_cnc.plan import plan_hash
from tango_cnc.records import Artefact, Axis, Cell, InputError

EXAMPLES = sorted(
    folder.name for folder in (Path(__file__).parent.parent / "examples").iterdir() if (folder / "tango.yaml").exists()
)
WANTED = frozenset({"rollover", "rotary", "frames"})


@cache
def cell_of(example: str) -> Cell:
    return read_cell(Path(__file__).parent.parent / "examples" / example)


def tango_exits(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


def elsewhere(cell: Cell, seed: int, within: float) -> Artefact:
    """cell, seed, mm → its table as far away as it may be: straight up for an even seed, anywhere for an odd one; turned by all."""
    rng = np.random.default_rng(seed)
    turn, way = rng.normal(size=(2, 3))
    by = np.array([0.0, 0.0, 1.0]) if seed % 2 == 0 else way / np.linalg.norm(way)
    return locate.moved(cell.artefact, within * by, np.radians(locate.turned(within)) * turn / np.linalg.norm(turn))


def met(cell: Cell, within: float, seed: int) -> list[str]:
    """cell, mm that its moves in the air allow, seed → what they hit where the table stands 20 mm and 3° elsewhere."""
    made = above.flight(cell, commission.MOST, WANTED, within).plan
    lines = list(program(load("fanuc"), made, {"gate": "none", "misses": 20}, plan_hash(made))[2]())[1:-1]
    ran = run_on(
        lambda motion, punch, note: macro_b.Control(motion, macro_b.default_profile(made.machine), punch, note),
        lines,
        made,
        elsewhere(cell, seed, 20.0),
    )
    return [str(data["surface"]) for event, data in ran.events if event == "collision"]


@pytest.mark.few(1)
@pytest.mark.parametrize("example", every(EXAMPLES, 3))
def test_a_table_that_stands_elsewhere_is_not_hit(example: str) -> None:
    assert [met(cell_of(example), 20.0, seed) for seed in range(4)] == [[]] * 4


@pytest.mark.few(0)
@pytest.mark.parametrize("example", every(["trunnion", "huron", "split"], 3))
def test_moves_for_a_table_in_its_place_would_hit_it(example: str) -> None:
    assert [hit for seed in range(4) for hit in met(cell_of(example), 0.0, seed)]


def low(cell: Cell, room: float) -> Cell:
    """cell, mm → the same with a Z that ends so much above the highest place of its moves in the air of a table in its place."""
    made = above.flight(cell, commission.MOST, WANTED, 0.0).plan
    column = made.machine.column("Z")
    places = [touch.over for touch in made.touches] + [turn.before for turn in made.turns] + [turn.after for turn in made.turns]
    end = max(place[column] for place in places) + room

    def ended(axis: Axis) -> Axis:
        return replace(axis, travel=(axis.limits[0], end)) if axis.name == "Z" else axis

    return replace(cell, machine=replace(cell.machine, axes=tuple(ended(axis) for axis in cell.machine.axes)))


@pytest.mark.few(0)
def test_where_the_travel_ends_the_table_may_be_less_far_and_it_is_said() -> None:
    short = low(cell_of("trunnion"), 12.0)
    with pytest.raises(InputError, match="--within: found 20 mm, by which the table may stand elsewhere"):
        above.flight(short, commission.MOST, WANTED, 20.0)
    found = above.flight(short, commission.MOST, WANTED, None)
    assert found.within == 5.0
    assert "measure its place, to 5 mm" in above.said(found)
    none = above.flight(low(cell_of("trunnion"), 0.5), commission.MOST, WANTED, None)
    assert none.within == 0.0 and "leave no room" in above.said(none)


@pytest.mark.few(0)
def test_a_table_off_its_place_has_touches_that_cannot_be_made_and_is_commissioned_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Turned by 2° in its file, as somebody has measured it: its plan refuses two touches, and here nobody makes them."""
    write_example(tmp_path / "cell", "trunnion")
    cell = read_cell(tmp_path / "cell")
    (tmp_path / "cell" / "artefact.yaml").write_text(
        artefact_text(locate.moved(cell.artefact, np.zeros(3), np.radians([2.0, 0, 0])))
    )
    assert tango_exits("plan", "-C", tmp_path / "cell") == 2
    assert "touches cannot be made with a straight probe" in capsys.readouterr().err
    assert tango_exits("commission", "-C", tmp_path / "cell", "--program") == 0


def test_the_touching_program_takes_the_table_to_be_in_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_example(tmp_path / "cell", "trunnion")
    assert tango_exits("commission", "-C", tmp_path / "cell", "--touch", "--within", "5") == 2
    assert "--within: found --touch too" in capsys.readouterr().err
