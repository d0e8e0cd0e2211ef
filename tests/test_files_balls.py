"""Facets of a ball are compared with it: what they contradict alike is named rather than the first of them."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from tango_cnc.files import read_artefact
from tango_cnc.records import InputError

SQUARE = 12.7 / math.sqrt(2)


def artefact(folder: Path, centre: str = "[-50, 0, 60]", radius: float = 12.7, top: str = "[-50, 0, 72.7]") -> Path:
    """A ball with four facets: its top and three half-way down its sides."""
    lines = ["name: one ball", "facets:", f"  1: {{point: {top}, normal: [0, 0, 1], ball: 1}}"]
    for key, (x, y) in enumerate([(1, 0), (0, 1), (-1, 0)], 2):
        point = [-50 + SQUARE * x, SQUARE * y, 60 + SQUARE]
        lines.append(f"  {key}: {{point: {point}, normal: {[x * 0.70711, y * 0.70711, 0.70711]}, ball: 1}}")
    file = folder / "artefact.yaml"
    file.write_text("\n".join([*lines, "balls:", f"  1: {{centre: {centre}, radius: {radius}}}", ""]))
    return file


def said(file: Path) -> str:
    with pytest.raises(InputError) as error:
        read_artefact(file)
    return str(error.value).removeprefix(f"{file}:")


def test_a_table_set_up_by_hand_is_read(tmp_path: Path) -> None:
    assert read_artefact(artefact(tmp_path)).balls["1"].radius == 12.7
    assert read_artefact(artefact(tmp_path, centre="[-49, 1, 61]"))
    assert read_artefact(artefact(tmp_path, radius=13.7))


def test_one_facet_elsewhere_is_named(tmp_path: Path) -> None:
    text = said(artefact(tmp_path, top="[-5, 0, 72.7]"))
    assert text.startswith("3: facets.1: found a point 34.1 mm off the surface of ball 1 (46.76 mm from its centre, radius 12.7)")
    assert text.endswith("allowed: within 2 mm of it. Correct point, centre, radius or the ball's number")


def test_a_centre_that_all_facets_contradict_alike_may_be_what_is_wrong(tmp_path: Path) -> None:
    assert said(artefact(tmp_path, centre="[-50, 0, 15]")) == (
        "8: balls.1.centre: found [-50, 0, 15], 45 mm from [-50, 0, 60], where by point and normal all of its 4 facets have it; "
        "allowed: within 2 mm of that. The centre may be wrong, or all of these facets: correct one or the other"
    )


@pytest.mark.parametrize("radius", [25.4, 6.35])
def test_a_diameter_for_the_radius_is_told_from_a_wrong_centre(radius: float, tmp_path: Path) -> None:
    text = said(artefact(tmp_path, radius=radius))
    assert re.match(
        rf"8: balls\.1\.radius: found {radius}, but all of its 4 facets lie 12\.7 mm from the centre; allowed: within", text
    )


def test_a_large_ball_may_be_known_to_a_tenth_of_its_radius(tmp_path: Path) -> None:
    facet = "{point: [0, 0, %g], normal: [0, 0, 1], ball: 1}"
    file = tmp_path / "artefact.yaml"
    text = f"name: large\nfacets:\n  1: {facet}\nballs:\n  1: {{centre: [0, 0, 0], radius: 100}}\n"
    file.write_text(text % 109)
    assert read_artefact(file)
    file.write_text(text % 111)
    assert "a point 11 mm off the surface of ball 1" in said(file)
