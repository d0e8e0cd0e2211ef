"""Touches that do not say where the table is: what was found before is not mistaken for it, and the way on is named."""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from support.located import touched

from tango_cnc import locate, telling
from tango_cnc.cli import guarded, tango
from tango_cnc.commands import locate as command
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, readings_text
from tango_cnc.files.artefact import read_artefact
from tango_cnc.records import Artefact, Cell, Facet, InputError, LinkError, NothingSentError, Readings

CELL = read_cell(Path(__file__).parent.parent / "examples" / "hu40t")


def call(*words: object) -> int:
    return guarded(
        tango.main, [os.fspath(w) if isinstance(w, Path) else str(w) for w in words], prog_name="tango", standalone_mode=False
    )


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    write_example(tmp_path / "cell", "trunnion")
    return tmp_path / "cell"


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


@pytest.mark.few(0)
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


@pytest.mark.few(0)
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
    assert 0 < said.find("measure the place of the table") < said.find("Only if you know")
    missing = replace(beside, status=("miss", *beside.status[1:]))
    with pytest.raises(
        locate.InputError, match=rf"As nothing was met at {made.touches[0].facet}, too few touches are left"
    ) as refused:
        locate.locate(made, missing)
    assert "--agrees" not in str(refused.value)


@pytest.mark.long
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


@pytest.mark.few(0)
def test_only_touches_that_met_something_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A touch that met nothing stood among those by which facets are known, and sides seen."""
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    made = locate.strategy(read_cell(cell))
    names = [touch.facet for touch in made.touches]
    assert len(names) > locate.LEAST
    by_other = {name: [other for other in names if other != name] for name in names}
    gone = max(names, key=lambda name: telling.known_to(made.artefact, by_other[name])[0])
    file = tmp_path / "touches.csv"
    file.write_text(readings_text(touched(made, gone)))
    assert call("locate", "-C", cell, "--readings", file, "--agrees", "0.05", "--json", "-") == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["residual_mm"]) == len(names) - 1
    assert found["known_mm"] == round(telling.known_to(made.artefact, by_other[gone])[0], 3)
    assert found["known_mm"] > round(telling.known_to(made.artefact, names)[0], 3)
    assert found["unseen"] == list(telling.unseen(made.artefact, by_other[gone]))


def _hexagon(hands: tuple[int, ...]) -> Cell:
    """hands of the sides that the strategy touches → the example with a table of six sides and six facets on top; two a side."""
    facets: dict[str, Facet] = {}
    for side, angle in enumerate(np.radians(np.arange(10, 370, 60))):
        normal, along = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        for hand in (-1, 1):
            name = f"{side + 1}{'_lr'[hand]}"
            x, y, z = (float(v) for v in 150 * normal + 48 * hand * along - (24 + 2 * hand) * np.array([0, 0, 1]))
            facets[name] = Facet(name, (x, y, z), (float(normal[0]), float(normal[1]), 0.0))
    for row, (x, y) in enumerate([(90, 20), (-80, 70), (-60, -95), (30, 110), (60, -90), (0, 5)], 1):
        facets[f"top{row}"] = Facet(f"top{row}", (float(x), float(y), 0.0), (0.0, 0.0, 1.0))
    table = Artefact("hexagon", facets)
    some = tuple(name for name in facets if name[-1] in {"_lr"[hand] for hand in hands} or name.startswith("top"))
    one = replace(CELL.strategy.indexations[0], facets=some, position=dict.fromkeys(CELL.strategy.indexations[0].position, 0.0))
    return replace(CELL, artefact=table, strategy=replace(CELL.strategy, indexations=(one,)))


@pytest.mark.few(1)
@pytest.mark.parametrize("larger", [1.01, 1.005, 0.993])
def test_touches_tell_a_table_of_another_size_from_one_that_is_turned(larger: float) -> None:
    """On the same hand of each of six sides, 1 % of size is 1.6 deg of turn: it was placed 3 mm beside, and "known to 0.04 mm"."""
    cell = _hexagon((-1, 1))
    planned = locate.strategy(cell)
    grown = {k: replace(f, point=tuple(larger * x for x in f.point)) for k, f in cell.artefact.facets.items()}
    true = locate.moved(replace(cell.artefact, facets=grown), np.array([-2.0, 14.0, 5.0]), np.radians([0.5, -0.6, 1.5]))
    assert telling.unsized(cell.artefact, [touch.facet for touch in planned.touches]).beside < locate.KNOWN
    size = f"{abs(larger - 1):.1%} {'larger' if larger > 1 else 'smaller'}"
    with pytest.raises(InputError, match=f"All of them fit a table that is {size} than artefact.yaml says: measure"):
        locate.locate(planned, touched(planned, true=true))


def _pinwheel(sides: int, apothem: float, aside: float) -> Cell:
    """how many sides, mm from the middle, mm beside the middle of each → the example with a table of one facet a side."""
    facets: dict[str, Facet] = {}
    for side, angle in enumerate(np.radians(10 + np.arange(sides) * 360 / sides), 1):
        (x, y), (u, v) = (np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))
        at = (float(apothem * x + aside * u), float(apothem * y + aside * v), -25.0)
        facets[str(side)] = Facet(str(side), at, (float(x), float(y), 0.0))
    for row, (x, y) in enumerate([(90, 20), (-80, 70), (-60, -95), (30, 110), (60, -90), (0, 5)], 1):
        facets[f"top{row}"] = Facet(f"top{row}", (float(x), float(y), 0.0), (0.0, 0.0, 1.0))
    first = CELL.strategy.indexations[0]
    one = replace(first, facets=tuple(facets), position=dict.fromkeys(first.position, 0.0))
    return replace(CELL, artefact=Artefact("pinwheel", facets), strategy=replace(CELL.strategy, indexations=(one,)))


def _larger(table: Artefact, by: float) -> Artefact:
    return replace(table, facets={k: replace(f, point=tuple(by * x for x in f.point)) for k, f in table.facets.items()})


@pytest.mark.few(0)
@pytest.mark.parametrize(("sides", "apothem", "aside"), [(6, 155, 58), (8, 190, 45), (5, 170, 70)])
def test_where_no_facets_tell_the_size_the_table_is_not_placed_until_somebody_states_it(
    sides: int, apothem: float, aside: float
) -> None:
    """One facet a side: 1 % of size is 1.5 to 2.4 deg of turn, and no facet is beside its place at its point. It was placed."""
    cell = _pinwheel(sides, apothem, aside)
    planned = locate.strategy(cell)
    names = [touch.facet for touch in planned.touches]
    other = telling.unsized(cell.artefact, names)
    turn = np.arctan(0.01 * apothem / aside)
    assert other.turned == pytest.approx(np.degrees(turn), rel=0.01)
    corner = apothem / np.cos(np.pi / sides) * np.array([1.01, 0.0]) - apothem / np.cos(np.pi / sides) * np.array(
        [np.cos(turn), np.sin(turn)]
    )
    assert other.beside == pytest.approx(np.linalg.norm(corner), rel=0.05)
    by, start = np.array([-2.0, 14.0, 5.0]), np.radians([0.1, -0.1, 0.3])
    for larger in (1.01, 0.996, 1.0):
        true = locate.moved(_larger(cell.artefact, larger), by, -np.sign(larger - 1) * start)
        with pytest.raises(InputError, match=r"up to 1 % larger or smaller .* is turned by some \d\.\d deg: .* --agrees MM"):
            locate.locate(planned, touched(planned, true=true))
    true = locate.moved(cell.artefact, by, start)
    found = locate.locate(planned, touched(planned, true=true), 0.05)
    for name, facet in true.facets.items():
        assert found.artefact.facets[name].point == pytest.approx(facet.point, abs=1e-3)
    stated = telling.unsized(cell.artefact, names, 0.05)
    assert stated.share == pytest.approx(0.05 / apothem, rel=0.1) and stated.beside < 0.3


def test_tables_whose_touches_tell_enough_are_placed_without_a_word_on_their_size() -> None:
    for example in ("hu40t", "trunnion"):
        cell = read_cell(Path(__file__).parent.parent / "examples" / example)
        planned = locate.strategy(cell)
        true = locate.moved(cell.artefact, np.array([-2.0, 14.0, 5.0]), np.radians([0.1, -0.1, 1.0]))
        assert not locate.locate(planned, touched(planned, true=true)).left_out
        assert telling.unsized(cell.artefact, [touch.facet for touch in planned.touches]).beside < 0.2


@pytest.mark.few(0)
def test_where_no_facets_tell_the_size_it_is_said_before_and_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = _hexagon((1,))
    planned = locate.strategy(cell)
    assert telling.unsized(cell.artefact, [touch.facet for touch in planned.touches]).beside > 3.0
    true = locate.moved(cell.artefact, np.array([-2.0, 14.0, 5.0]), np.radians([0.5, -0.6, 1.5]))
    came = touched(planned, true=true)
    write_example(tmp_path / "cell", "hu40t")
    monkeypatch.setattr(command, "read_cell", lambda folder: replace(cell, folder=folder))
    monkeypatch.setattr(command, "read_readings", lambda *_: came)
    says = "a table up to 1 % larger or smaller than artefact.yaml says fits these touches as well, once it is turned by some"
    assert call("locate", "-C", tmp_path / "cell", "--program") == 0
    said = capsys.readouterr().out
    assert f"Measure the size of the table first: {says}" in said and "Without --agrees the table is not placed then" in said
    again = ("locate", "-C", tmp_path / "cell", "--readings", tmp_path / "cell" / "tango.yaml")
    assert call(*again) == 1
    said = capsys.readouterr().err
    assert says in said and "--agrees MM' places the table from these same touches" in said
    assert not (tmp_path / "cell" / "locate" / "artefact.yaml").exists()
    again = (*again, "--length", cell.machine.probe.length)
    assert call(*again, "--agrees", "0.05", "--json", "-") == 0
    assert 0 < json.loads(capsys.readouterr().out)["unsized_mm"] < 0.5
    assert call(*again, "--agrees", "1") == 0
    assert "larger or smaller than artefact.yaml says fits these touches as well" in capsys.readouterr().out


@pytest.mark.few(0)
def test_touches_that_agree_on_a_turn_beyond_what_is_searched_are_refused() -> None:
    planned = locate.strategy(CELL)
    for turn, placed in ((2.9, True), (3.07, False), (3.3, False)):
        true = locate.moved(CELL.artefact, np.zeros(3), np.radians([0.0, 0.0, turn]))
        came = touched(planned, true=true)
        if placed:
            assert not locate.locate(planned, came).left_out
        else:
            with pytest.raises(InputError, match=rf"turned by {turn} deg, and 3 are searched"):
                locate.locate(planned, came)


@pytest.mark.few(0)
def test_clamps_on_the_table_are_in_both_places_until_somebody_has_looked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They stayed where they were declared, the table moved by 20 mm, and the next run met one."""
    write_example(tmp_path / "cell", "hu40t")
    file = tmp_path / "cell" / "artefact.yaml"
    clamp = "{kind: box, low: [-8, -10, 0], high: [12, 10, 30], name: clamp}"
    stem = "{kind: cylinder, base: [0, 40, 0], axis: [0, 0, 1], radius: 4, height: 25}"
    data = yaml.safe_load(file.read_text())
    data["obstacles"] = [yaml.safe_load(clamp), yaml.safe_load(stem)]
    file.write_text(yaml.safe_dump(data))
    assert call("locate", "-C", tmp_path / "cell", "--program") == 0
    assert "if clamp, cylinder moved with it, correct artefact.yaml first" in " ".join(capsys.readouterr().out.split())
    made = locate.strategy(read_cell(tmp_path / "cell"))
    by, turn = np.array([12.0, -9.0, 4.0]), np.radians([0.4, -0.5, 2.0])
    readings = tmp_path / "touches.csv"
    readings.write_text(readings_text(touched(made, true=locate.moved(made.artefact, by, turn))))
    placed = ("locate", "-C", tmp_path / "cell", "--readings", readings, "--length", made.machine.probe.length)
    assert call(*placed, "--json", tmp_path / "found.json") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "clamp, obstacle 2 (cylinder): no touch says whether what stands on the table has moved with it" in said
    assert json.loads((tmp_path / "found.json").read_text())["obstacles"] == ["clamp", "obstacle 2 (cylinder)"]
    placed = read_artefact(tmp_path / "cell" / "locate" / "artefact.yaml")
    box, rod, box_there, rod_there = placed.obstacles
    assert (box, rod) == made.artefact.obstacles and (box_there.kind, box_there.title) == ("hull", "clamp, moved with the table")
    rotation = Rotation.from_rotvec(turn)
    truly = rotation.apply([(x, y, z) for x in (-8, 12) for y in (-10, 10) for z in (0, 30)]) + by
    assert box_there.points is not None and len(box_there.points) == 8
    assert all(np.linalg.norm(np.subtract(box_there.points, corner), axis=1).min() < 0.01 for corner in truly)
    assert rod_there.base == pytest.approx(rotation.apply([0, 40, 0]) + by, abs=0.01)
    assert rod_there.axis == pytest.approx(rotation.apply([0, 0, 1]), abs=1e-4) and (rod_there.radius, rod_there.height) == (4, 25)
    readings.write_text(readings_text(touched(made, true=locate.moved(made.artefact, 0.01 * by, 0.001 * turn))))
    assert call("locate", "-C", tmp_path / "cell", "--readings", readings) == 0
    assert len(read_artefact(tmp_path / "cell" / "locate" / "artefact.yaml").obstacles) == 2


def test_touches_that_are_broken_off_leave_no_place_of_before_behind(
    cell: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The place of the week before stayed without a word, beside the readings of a try that an alarm had ended."""
    measured(monkeypatch, touched(locate.strategy(read_cell(cell))))
    assert call("locate", "-C", cell, "--yes") == 0
    before = (cell / "locate" / "artefact.yaml").read_text()
    capsys.readouterr()

    def stops(kind: type[LinkError]) -> None:
        def conducted(*_: object, **__: object) -> Readings:
            raise kind("the control has been silent for longer than 43 s; look at the machine")

        monkeypatch.setattr(command, "conducted", conducted)
        assert call("locate", "-C", cell, "--yes") == 3

    stops(NothingSentError)
    assert (cell / "locate" / "artefact.yaml").read_text() == before and "kept as" not in capsys.readouterr().err
    stops(LinkError)
    (kept,) = (cell / "locate").glob("artefact.*.yaml")
    said = capsys.readouterr().err
    assert kept.read_text() == before and not (cell / "locate" / "artefact.yaml").exists()
    assert f"kept as {kept}" in said and "move the probe up along the tool by hand before anything turns" in said


@pytest.mark.parametrize(
    "words",
    [
        ("locate", "--program", "--readings", "FILE"),
        ("commission", "--touch", "--held"),
        ("commission", "--touch", "--dial"),
        ("commission", "--touch", "--said", "TEXT"),
        ("commission", "--timeout", "-1"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(words: tuple[str, ...], cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(words[0], "-C", cell, *words[1:]) == 2
    said = capsys.readouterr().err
    assert any(word in said for word in words[1:] if word.startswith("--") and word != "--touch")
    assert not (cell / "commissioning").exists() and not (cell / "locate").exists()


def test_a_program_is_written_without_a_terminal_and_none_for_a_held_stylus(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("commission", "-C", cell, "--program") == 0
    assert call("commission", "-C", cell, "--held", "--program") == 2
    assert "--held: found beside --program, where it does nothing" in capsys.readouterr().err


@pytest.mark.few(0)
def test_the_touch_that_would_tell_the_size_and_met_nothing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """ "Add them to strategy.yaml", it said, and the facet that would tell was there: it had met nothing."""
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    made = locate.strategy(read_cell(cell))
    file = tmp_path / "my touches.csv"
    silent = 0
    for touch in made.touches:
        file.write_text(readings_text(touched(made, touch.facet)))
        refused = call(
            "locate", "-C", cell, "--readings", file, "-o", tmp_path / f"{touch.facet}.yaml", "--json", tmp_path / "it.json"
        )
        out, err = capsys.readouterr()
        if refused:
            silent += 1
            assert f"Facet {touch.facet} would tell, but nothing was met there" in err and "strategy.yaml" not in err
            assert f'"tango locate -C {cell} ' in err and f" --readings '{file}' --agrees MM\"" in err
        else:
            assert f"nothing was met at facet {touch.facet}: see why" in out
            assert json.loads((tmp_path / "it.json").read_text())["missed"] == [touch.facet]
    assert silent == 1


def test_a_probe_that_has_died_is_not_pressed_into_every_facet(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Eight touches have to agree: after so many without contact in a row that fewer are left, the program ends with an alarm."""
    made = locate.strategy(read_cell(cell))
    assert call("locate", "-C", cell, "--program") == 0
    (program,) = (cell / "locate" / "program").glob("*.nc")
    assert len(made.touches) == 8 and re.search(r"^IF\[#\d+GE2\]GOTO", program.read_text(), re.MULTILINE)
    assert "UP TO 2 FACETS" in program.read_text()


@pytest.mark.few(0)
def test_a_table_of_quite_another_size_is_not_offered(tmp_path: Path) -> None:
    """ "93.7 % smaller", it said, of a table that was 0.7 % smaller in two directions and 0.3 % larger in the third."""
    cell = _hexagon((-1, 1))
    planned = locate.strategy(cell)
    half = {k: replace(f, point=tuple(0.5 * x for x in f.point)) for k, f in cell.artefact.facets.items()}
    with pytest.raises(InputError) as refused:
        locate.locate(planned, touched(planned, true=replace(cell.artefact, facets=half)))
    assert "smaller" not in str(refused.value)


def test_where_eight_touches_fit_a_table_of_another_size_both_explanations_are_named() -> None:
    """It named one touch alone, and led from 'search farther' to 'search nearer' and back: the size explains all eight."""
    cell = read_cell(Path(__file__).parent.parent / "examples" / "split")
    planned = locate.strategy(cell)
    true = locate.moved(_larger(cell.artefact, 1.01), np.array([3.0, 2.0, 0.0]), np.zeros(3))
    assert len(planned.touches) == locate.LEAST
    with pytest.raises(
        InputError, match=r"the table has another size; these touches cannot tell\. All of them fit .* 1\.0% larger"
    ):
        locate.locate(planned, touched(planned, true=true))


def test_a_place_that_a_rule_knows_better_is_refused() -> None:
    """ "Known to 9.83 mm now", it said, and to copy it over artefact.yaml."""
    cell = read_cell(Path(__file__).parent.parent / "examples" / "split")
    planned = locate.strategy(cell)
    with pytest.raises(
        InputError, match=r"may be 1 mm beside their places on the table are known to \d+ mm then, .*; allowed: 5 mm"
    ):
        locate.locate(planned, touched(planned), 1.0)
