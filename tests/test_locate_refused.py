"""Touches that do not say where the table is: what was found before is not mistaken for it, and the way on is named."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tango_cnc import kinematics, locate
from tango_cnc.cli import guarded, tango
from tango_cnc.commands import locate as command
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, readings_text
from tango_cnc.plan import last_motion
from tango_cnc.records import Plan, Readings

MOVED = np.array([4.0, -3.0, 2.0])


def call(*words: object) -> int:
    return guarded(
        tango.main, [os.fspath(w) if isinstance(w, Path) else str(w) for w in words], prog_name="tango", standalone_mode=False
    )


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    write_example(tmp_path / "cell", "trunnion")
    return tmp_path / "cell"


def touched(made: Plan, *missed: str) -> Readings:
    """plan, facets at which nothing was met → readings of a table that was moved."""
    true = locate.moved(made.artefact, MOVED, np.zeros(3))
    tip = np.array(
        [
            np.add(true.facets[t.facet].point, made.machine.probe.tip_radius * np.array(true.facets[t.facet].normal))
            for t in made.touches
        ]
    )
    chain, count = kinematics.chain(made.machine), len(made.touches)
    position = np.array([touch.contact for touch in made.touches])
    linear = [made.machine.column(name) for name in made.machine.linear]
    for row in range(count):
        for _ in range(5):  # axes of a chain that is nearly linear in them
            off_by = tip[row] - kinematics.tip(chain, position[row][None])[0]
            step = np.array(
                [
                    (kinematics.tip(chain, (position[row] + one)[None])[0] - kinematics.tip(chain, position[row][None])[0])
                    for one in np.eye(position.shape[1])[linear]
                ]
            )
            position[row, linear] += np.linalg.solve(step.T, off_by)
    status = tuple("miss" if t.facet in missed else "ok" for t in made.touches)
    one = np.ones(count, dtype=np.int64)
    facets = tuple(t.facet for t in made.touches)
    return Readings(
        made.machine.names,
        np.arange(1, count + 1),
        np.zeros(count),
        facets,
        position,
        last_motion(made),
        status,
        one,
        one,
        np.full(count, 600.0),
    )


def measured(monkeypatch: pytest.MonkeyPatch, readings: Readings) -> None:
    monkeypatch.setattr(command, "conducted", lambda *_, **__: readings)


def test_what_was_found_before_is_set_aside(
    cell: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who copied locate/artefact.yaml after a refusal had the table where it stood the week before."""
    made = locate.strategy(read_cell(cell))
    measured(monkeypatch, touched(made))
    assert call("locate", "-C", cell, "--yes") == 0
    before = (cell / "locate" / "artefact.yaml").read_text()
    capsys.readouterr()
    measured(monkeypatch, touched(made, made.touches[2].facet))
    assert call("locate", "-C", cell, "--yes") == 1
    said = capsys.readouterr().err
    (kept,) = (cell / "locate").glob("artefact.*.yaml")
    assert kept.read_text() == before and not (cell / "locate" / "artefact.yaml").exists()
    assert f"kept as {kept}" in said
    assert f"nothing was met at {made.touches[2].facet}. Measure the place of the table with a rule" in said


def test_a_second_find_keeps_the_first(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = locate.strategy(read_cell(cell))
    measured(monkeypatch, touched(made))
    for _ in range(2):
        assert call("locate", "-C", cell, "--yes") == 0
    assert len(list((cell / "locate").glob("artefact*.yaml"))) == 2


def test_what_has_to_be_known_is_said_without_a_question(
    cell: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    measured(monkeypatch, touched(locate.strategy(read_cell(cell))))
    for words in (["--yes"], ["--program"]):
        assert call("locate", "-C", cell, *words) == 0
        ran = capsys.readouterr()
        assert "Obstacles have to stand where they are declared" in ran.out + ran.err


def test_a_table_less_exact_than_its_file_is_offered_last_and_not_where_a_touch_is_missing() -> None:
    made = locate.strategy(read_cell(Path(__file__).parent.parent / "examples" / "hu40t"))
    rng = np.random.default_rng(3)
    whole = touched(made)
    beside = replace(
        whole,
        position=whole.position + rng.uniform(-0.2, 0.2, (len(made.touches), 1)) * np.isin(made.machine.names, made.machine.linear),
    )
    with pytest.raises(locate.InputError) as refused:
        locate.locate(made, beside)
    said = str(refused.value)
    assert 0 < said.find("Measure the place of the table") < said.find("Only if you know")
    missing = replace(beside, status=("miss", *beside.status[1:]))
    with pytest.raises(
        locate.InputError, match=rf"As nothing was met at {made.touches[0].facet}, too few touches are left"
    ) as refused:
        locate.locate(made, missing)
    assert "--agrees" not in str(refused.value)


def test_with_a_touch_missing_no_table_is_taken_for_less_exact(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The refusal withheld `--agrees`, and the command took it: 2.7 mm beside, "9 touches count", one of which had met nothing."""
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    made = locate.strategy(read_cell(cell))
    gone = made.touches[0].facet
    (tmp_path / "touches.csv").write_text(readings_text(touched(made, gone)))
    assert call("locate", "-C", cell, "--readings", tmp_path / "touches.csv", "--agrees", "0.7") == 1
    said = capsys.readouterr().err
    assert f"--agrees: found 0.7; allowed: 0.05 where a touch met nothing. As nothing was met at {gone}, too few touches" in said
    assert not (cell / "locate" / "artefact.yaml").exists()


def test_only_touches_that_met_something_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A touch that met nothing stood among those by which facets are known, and sides seen."""
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    made = locate.strategy(read_cell(cell))
    names = [touch.facet for touch in made.touches]
    assert len(names) > locate.LEAST
    by_other = {name: [other for other in names if other != name] for name in names}
    gone = max(names, key=lambda name: locate.known_to(made.artefact, by_other[name])[0])
    file = tmp_path / "touches.csv"
    file.write_text(readings_text(touched(made, gone)))
    assert call("locate", "-C", cell, "--readings", file, "--json", "-") == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["residual_mm"]) == len(names) - 1
    assert found["known_mm"] == round(locate.known_to(made.artefact, by_other[gone])[0], 3)
    assert found["known_mm"] > round(locate.known_to(made.artefact, names)[0], 3)
    assert found["unseen"] == list(locate.unseen(made.artefact, by_other[gone]))
