"""`tango plan --picture`: the way of the tip as a drawing; what is drawn are the moves of the plan."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.few import every
from support.runs import Result

from tango_cnc import kinematics
from tango_cnc.files import read_cell
from tango_cnc.plan import plan
from tango_cnc.report import pictures
from tango_cnc.report.path import KINDS, picture
from tango_cnc.report.texts import texts

GOLDEN = Path(__file__).parent / "golden" / "cell"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(GOLDEN, tmp_path / "cell")
    return tmp_path / "cell"


def lines(drawn: object) -> dict[str, np.ndarray]:
    """label → (n, 3) mm of the lines with this label; not-a-number between two of them."""
    return {line.get_label(): np.array(line.get_data_3d()).T for line in drawn.axes[0].lines}  # type: ignore[attr-defined]


@pytest.mark.few(0)
def test_every_touch_is_drawn_once_and_where_it_is_made() -> None:
    made = plan(read_cell(GOLDEN))
    found = lines(picture(made))[texts()("way.probe")]
    ends = found[np.flatnonzero(np.isnan(found[:, 0])) - 1]
    np.testing.assert_allclose(ends, kinematics.tip(kinematics.chain(made.machine), np.array([t.contact for t in made.touches])))


@pytest.mark.few(0)
def test_travels_between_touches_are_told_from_those_to_where_axes_turn() -> None:
    found = lines(picture(plan(read_cell(GOLDEN))))
    count = {name: int(np.isnan(line[:, 0]).sum()) for name, line in found.items()}
    assert count[texts()("way.travel")] == 3  # 6 touches at 3 indexations
    assert any("sweeps, radius 151 mm" in name for name in found)


@pytest.mark.long
def test_one_indexation_is_drawn_alone() -> None:
    drawn = picture(plan(read_cell(GOLDEN)), 2)
    assert int(np.isnan(lines(drawn)[texts()("way.probe")][:, 0]).sum()) == 2
    assert "2 touches, indexation 2: B-30 C-90 S0" in drawn.axes[0].get_title(loc="left")


@pytest.mark.few(0)
@pytest.mark.parametrize("ending", every(["png", "svg", "pdf"], 3))
def test_the_picture_is_written_beside_the_program_or_alone(cell: Path, ending: str) -> None:
    file = cell / f"path.{ending}"
    result = Result("plan", "-C", cell, "--dry-run", "--picture", file)
    assert result.code == 0, result.err
    assert file.stat().st_size > 5000 and not (cell / "program").exists()
    if ending == "svg":
        text = file.read_text(encoding="utf-8")
        assert all(re.search(f">{texts()(f'way.{kind}').split(' (')[0]}", text) for kind in KINDS)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--picture", "path.gif"], "--picture: found 'path.gif'; allowed: a name that ends with .png, .svg, .pdf"),
        (["--indexation", "2"], "--indexation: it says what --picture draws; give --picture FILE too"),
        (["--picture", "path.png", "--indexation", "9"], "--indexation: found 9; allowed: 1 … 3 of this strategy"),
    ],
)
def test_what_cannot_be_drawn_is_said(
    cell: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, options: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = Result("plan", "-C", cell, *options)
    assert result.code == 2 and words in result.err
    assert not (cell / "program").exists() and not (tmp_path / "path.png").exists()


def test_without_matplotlib_it_is_said_what_to_install(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "available", lambda: False)
    result = Result("plan", "-C", cell, "--picture", cell / "path.png")
    assert result.code == 2 and "pip install 'tango-cnc[report]'" in result.err
    assert not (cell / "program").exists()
