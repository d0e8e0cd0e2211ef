"""The diagnosis as a Python function: the page's own examples are run, and what does not fit is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import blind

from sim_controller.simulate import simulate
from tango_cnc.diagnose.arrays import diagnose_arrays
from tango_cnc.records import InputError

PAGE = Path(__file__).parent.parent / "docs" / "diagnose.md"


@pytest.mark.long
def test_the_examples_of_the_page_run_and_answer_as_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    b = blind.bench()
    effect = {"cause": "probe_lobing", "amplitude": 0.004, "order": 3, "phase": 10.0}
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, replace(b.world, effects=(effect,), noise=blind.NOISE))
    space: dict[str, Any] = {"folder": blind.EXAMPLE, "n": len(read), "facet": read.facet}
    space |= {name: getattr(read, name) for name in ("time", "position", "direction")}
    first, second = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    exec(first, space)
    assert "['probe_lobing'] [S3, {cause: probe_lobing, order: 3}]" in capsys.readouterr().out
    assert space["effects"][0]["amplitude"] == pytest.approx(0.004, rel=0.15)
    exec(second, space)
    said = re.search(r"^# (explained .*)$", second, re.M)
    assert said is not None
    assert capsys.readouterr().out.strip() == said[1]


def test_nothing_is_found_in_noise() -> None:
    rng = np.random.default_rng(2)
    answer = diagnose_arrays(rng.normal(size=(90, 2)), {"shift": ("category", list("abc") * 30)}, groups=np.arange(90) // 10)
    assert (answer["verdict"], answer["findings"], answer["rows"]) == ("adequate", [], 90)


WRONG: list[tuple[Mapping[str, Any], str]] = [
    ({"response": [1.0, 2.0], "covariates": {}}, "7 to 2500 rows"),
    ({"response": np.ones(9), "covariates": {"t": ("hour", np.ones(9))}}, "allowed: time, order"),
    ({"response": np.ones(9), "covariates": {"t": ("time", np.ones(8))}}, r"allowed: \(9,\)"),
    ({"response": np.ones(9), "covariates": {"t": ("time", [np.nan] * 9)}}, "not finite"),
    ({"response": np.ones(9), "covariates": {"t": ("time", ["x"] * 9)}}, "allowed: numbers"),
    ({"response": np.ones(9), "covariates": {}, "model": np.ones((8, 2))}, "allowed: 9"),
]


@pytest.mark.parametrize(("arguments", "said"), WRONG)
def test_what_does_not_fit_is_refused(arguments: Mapping[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        diagnose_arrays(**arguments)
