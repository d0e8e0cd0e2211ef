"""Long plans as several programs: each whole and safe of itself, and run one after the other into the same readings."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.runs import STRATEGY, Result
from support.simulated_runs import agree, controller

from postprocessors import Post, companions, load, mark_of, names, of_part, program, settings
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell
from tango_cnc.plan import plan, plan_hash, split
from tango_cnc.program import parts
from tango_cnc.readback import check
from tango_cnc.records import InputError, Plan

GOLDEN = Path(__file__).parent / "golden"


@cache
def golden() -> Plan:
    """Three indexations of 3, 2 and 1 touches."""
    return plan(read_cell(GOLDEN / "cell"))


@pytest.mark.parametrize(
    ("most", "parts"),
    [
        (1, [[1, 2, 3], [4, 5], [6]]),  # an indexation is never cut
        (3, [[1, 2, 3], [4, 5, 6]]),
        (4, [[1, 2, 3], [4, 5, 6]]),
        (5, [[1, 2, 3, 4, 5], [6]]),
        (6, [[1, 2, 3, 4, 5, 6]]),
    ],
)
def test_a_plan_is_cut_between_indexations_only(most: int, parts: list[list[int]]) -> None:
    assert [[touch.number for touch in part.touches] for part in split(golden(), most)] == parts


def test_two_indexations_with_the_table_as_it_was_are_not_cut_apart() -> None:
    cell = read_cell(GOLDEN / "cell")
    first, *others = cell.strategy.indexations
    twice = plan(replace(cell, strategy=replace(cell.strategy, indexations=(first, first, *others))))
    assert [len(part.touches) for part in split(twice, 3)] == [6, 3]


def test_nothing_is_no_program() -> None:
    with pytest.raises(InputError, match="split: found 0; allowed: 1 touch a program or more"):
        split(golden(), 0)


def test_every_part_begins_with_one_axis_upwards_and_ends_where_it_may_turn() -> None:
    turning = np.array([turn.before for turn in golden().turns])
    for part in split(golden(), 3):
        first, *_ = moves = list(part.moves)
        assert first.kind == "retract" and list(first.target) == ["Z"]
        assert moves[-1].kind == "retract"
        assert moves[-1].target["Z"] >= turning[:, 2].min() - 1e-6


@pytest.mark.few(2)
@pytest.mark.parametrize("post", names())
def test_every_part_is_a_program_of_its_own_that_is_read_back(post: str) -> None:
    dialect, whole = load(post), golden()
    parts = split(whole, 3)
    found = []
    for number, part in enumerate(parts, 1):
        given = of_part(dialect, {}, (number, len(parts)))
        name, mark, lines = program(dialect, part, given, plan_hash(whole), (number, len(parts)))
        text = "\n".join(lines()) + "\n"
        assert f"PLAN {plan_hash(whole)} PART {number} OF 2" in text
        assert mark_of(text) == mark
        assert not check(lines, part, settings(dialect, given), companions(dialect, whole, given), written_in=dialect.language)
        found.append((name, mark))
    assert len({name for name, _ in found}) == len({mark for _, mark in found}) == 2


@pytest.mark.few(0)
def test_plan_writes_all_parts_and_one_plan_csv(tmp_path: Path) -> None:
    shutil.copytree(GOLDEN / "cell", tmp_path / "cell")
    result = Result("plan", "-C", tmp_path / "cell", "--split", 3, "--json", "-")
    assert result.code == 0, result.err
    programs = json.loads(result.out)["programs"]
    assert [(p["first"], p["last"], p["touches"]) for p in programs] == [(1, 3, 3), (4, 6, 3)]
    folder = tmp_path / "cell" / "program"
    assert sorted(file.name for file in folder.iterdir()) == ["O7700.nc", "O7705.nc", "plan.csv"]
    assert (folder / "plan.csv").read_text() == (GOLDEN / "plan.csv").read_text()
    whole = Result("plan", "-C", tmp_path / "cell")
    assert "O7705.nc is an earlier program of this plan. It was left as it is: delete it" in whole.err


@pytest.mark.few(0)
def test_programs_of_another_plan_are_named_whatever_their_ending_and_of_a_resumed_run_too(tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(GOLDEN / "cell", folder)
    assert Result("plan", "-C", folder, "--post", "linuxcnc").code == 0
    again = Result("plan", "-C", folder)
    assert "delete it" not in again.err, "another control, the same plan"
    (folder / "program" / "rest").mkdir()
    (folder / "program" / "tango.ngc").rename(folder / "program" / "rest" / "tango.ngc")
    strategy = (folder / "strategy.yaml").read_text()
    (folder / "strategy.yaml").write_text(strategy.replace("standoff: 10", "standoff: 11"))
    other = Result("plan", "-C", folder, "--post", "siemens").err
    assert "O7700.nc is of another plan" in other and "rest/tango.ngc is of another plan" in other


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    """All 393 touches of HU40T."""
    folder = tmp_path_factory.mktemp("thesis") / "cell"
    write_example(folder, "hu40t")
    return plan(read_cell(folder), "warn")


SMALL = [name for name in names() if "memory" in settings(load(name), {})]


@pytest.mark.few(0)
@pytest.mark.parametrize("post", [n if n == "fanuc" else pytest.param(n, marks=pytest.mark.long) for n in SMALL])
def test_a_program_too_long_for_the_control_is_split_unless_the_profile_says_none(post: str, whole: Plan) -> None:
    dialect = load(post)
    found = parts(dialect, whole, {})
    sizes = [length(dialect, part, (i, len(found))) for i, part in enumerate(found, 1)]
    assert max(sizes) <= 512_000
    assert len(found) == {"fagor": 3, "okuma": 1}.get(post, 2)
    assert [touch.number for part in found for touch in part.touches] == [touch.number for touch in whole.touches]
    assert parts(dialect, whole, {"memory": "none"}) == (whole,)


@pytest.mark.few(0)
@pytest.mark.parametrize("post", [name for name in names() if name not in SMALL])
def test_where_no_memory_is_small_nothing_is_split_and_a_short_program_stays_whole(post: str, whole: Plan) -> None:
    assert post not in SMALL and parts(load(post), whole, {}) == (whole,)
    assert length(load(post), whole, (1, 1)) <= 512_000
    assert parts(load("fanuc"), golden(), {}) == (golden(),)


@pytest.mark.campaign
@pytest.mark.parametrize("post", names())
def test_the_page_says_how_long_it_is(post: str, whole: Plan) -> None:
    page = (Path(__file__).parent.parent / "docs" / "dialects.md").read_text(encoding="utf-8")
    sizes = page[page.index("The 393 touches of HU40T in kB:") :].split("\n\n")[0].replace("\n", " ")
    said = re.search(rf"(?i)\b{post}\b[^0-9]* (\d+)", sizes)
    assert said is not None and length(load(post), whole, (1, 1)) / 1000 == pytest.approx(float(said[1]), rel=0.01)


def length(post: Post, part: Plan, of: tuple[int, int]) -> int:
    """Characters of a program as they arrive on the control."""
    return len("\r\n".join(program(post, part, of_part(post, {}, of), plan_hash(part), of)[2]())) + 2


def test_an_indexation_longer_than_the_memory_is_refused_by_its_touches() -> None:
    with pytest.raises(InputError, match=r"controller.memory: found 5 kB; touches 1 … 3 are of one indexation.*none where"):
        parts(load("fanuc"), golden(), {"memory": 5})
    with pytest.raises(InputError, match=r"controller.memory: found 'no'; allowed: a whole number, or none"):
        parts(load("fanuc"), golden(), {"memory": "no"})


@pytest.mark.few(0)
def test_plan_and_dry_run_split_what_the_cell_says_is_too_long(tmp_path: Path) -> None:
    shutil.copytree(GOLDEN / "cell", tmp_path / "cell")
    file = tmp_path / "cell" / "tango.yaml"
    file.write_text(file.read_text().replace("post: fanuc", "post: fanuc, memory: 12"))
    programs = json.loads(Result("plan", "-C", tmp_path / "cell", "--json", "-").out)["programs"]
    assert [(p["first"], p["last"]) for p in programs] == [(1, 3), (4, 6)]
    assert all((tmp_path / "cell" / "program" / Path(p["program"]).name).stat().st_size < 12_000 for p in programs)
    assert "part 2 of 2: touches 4 … 6" in Result("plan", "-C", tmp_path / "cell", "--dry-run").out


def test_a_dry_run_shows_the_parts() -> None:
    result = Result("plan", "-C", GOLDEN / "cell", "--dry-run", "--split", 3)
    assert [line for line in result.out.splitlines() if "part" in line] == [
        "part 1 of 2: touches 1 … 3",
        "part 2 of 2: touches 4 … 6",
    ]
    assert Result("plan", "-C", GOLDEN / "cell", "--dry-run", "--json", "-").code == 2


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    write_example(tmp_path / "cell", "hu40t")
    (tmp_path / "cell" / "strategy.yaml").write_text(STRATEGY)
    world = (tmp_path / "cell" / "world.yaml").read_text()
    (tmp_path / "cell" / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    return tmp_path / "cell"


@pytest.mark.few(0)
def test_parts_are_run_one_after_the_other_into_the_same_readings(cell: Path) -> None:
    with controller(cell, "--tcp", "127.0.0.1:0", once=False) as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "10", "--split", "3")
    assert result.code == 0, result.err
    assert (
        "part 1 of 3: 3 touches" in result.err and "part 2 of 3: 2 touches" in result.err and "part 3 of 3: 2 touches" in result.err
    )
    assert agree(cell)
    told = json.loads((cell / "readings.json").read_text())
    assert [segment["touches"] for segment in told["segments"]] == [3, 2, 2]
    assert len({segment["program_hash"] for segment in told["segments"]}) == 3
    followed = Result("run", "-C", cell, "--watch")
    assert followed.code == 0 and "part 3 of 3 has ended: end mark" in followed.err


@pytest.mark.long
def test_a_run_in_parts_that_stops_is_resumed_in_parts(cell: Path) -> None:
    with controller(cell, "--tcp", "127.0.0.1:0", "--fault", "stop-after=4", once=False) as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "1", "--split", "3")
    assert result.code == 3
    assert Result("run", "-C", cell, "--watch").code == 3
    with controller(cell, "--tcp", "127.0.0.1:0", once=False) as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "10", "--split", "3", "--resume")
    assert result.code == 0, result.err
    assert agree(cell)


def test_a_part_alone_is_not_sent_as_if_it_were_the_plan(cell: Path) -> None:
    assert Result("plan", "-C", cell, "--split", 3).code == 0
    result = Result("run", "-C", cell, "--program", cell / "program" / "O7705.nc", "--port", "socket://127.0.0.1:1")
    assert result.code == 2
    whole = f"found part 2 of 3; a part alone is no whole plan: 'tango run -C {cell} --port socket://127.0.0.1:1' without --program"
    assert whole in result.err
