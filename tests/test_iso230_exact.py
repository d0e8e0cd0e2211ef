"""Readings without any scatter: the figures of ISO 230-1 have their numbers all the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from support.runs import Result

from tango_cnc.commands.init import write_example


@pytest.mark.long
@pytest.mark.parametrize("example", ["hu40t", "three_axis_calibrated"])
def test_a_machine_without_noise_is_estimated(example: str, tmp_path: Path) -> None:
    """The weight of an exact touch beside the width of an error motion has no inverse in 16 digits."""
    folder = tmp_path / "cell"
    write_example(folder, example)
    world = folder / "world.yaml"
    world.write_text(re.sub(r"noise: .*", "noise: 0.0", world.read_text(encoding="utf-8")), encoding="utf-8")
    assert Result("simulate", "-C", folder).code == 0
    estimated = Result("estimate", "-C", folder)
    assert estimated.code == 0 and "ISO figures are withheld" in estimated.out + estimated.err
