"""The size of the noise: what it depends on, against noise drawn here; and what a person reads about it."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from click.testing import CliRunner

from tango_cnc.diagnose._scatter import Scatter, scatter
from tango_cnc.diagnose.sentences import noise

TOUCHES, FACETS = 400, 25
ONE = np.ones(TOUCHES)


def groups(rng: np.random.Generator) -> dict[str, np.ndarray]:
    row = np.arange(TOUCHES)
    return {"facet": rng.permutation(row % FACETS), "direction": row % 6, "indexation": row // 11, "time": row * 8 // TOUCHES}


def drawn(kind: str, rng: np.random.Generator, members: dict[str, np.ndarray]) -> np.ndarray:
    white = rng.normal(size=TOUCHES)
    if kind == "white":
        return white
    if kind == "heavy":
        return rng.standard_t(3, size=TOUCHES)
    member = members[kind]
    loud = rng.permutation(member.max() + 1) < max(2, (member.max() + 1) // 4)
    return np.where(loud[member], 3.0, 1.0) * white


@pytest.mark.parametrize("kind", ["white", "heavy", "facet", "direction", "indexation", "time"])
def test_what_the_scatter_depends_on_is_told_and_nothing_else(kind: str) -> None:
    told = []
    for seed in range(10):
        rng = np.random.default_rng([5, seed])
        members = groups(rng)
        found = scatter(drawn(kind, rng, members), ONE, members)
        told.append(found.by if found.clear else None)
        assert (found.tails is not None) == (kind == "heavy")
    if kind in ("white", "heavy"):
        assert set(told) == {None}
    else:
        assert told.count(kind) >= 9 and set(told) <= {kind, None}


def test_a_few_wild_touches_make_no_facet_rough() -> None:
    rng = np.random.default_rng(3)
    members = groups(rng)
    white = rng.normal(size=TOUCHES)
    white[rng.choice(TOUCHES, 4, replace=False)] = [60.0, -45.0, 80.0, 30.0]
    assert scatter(white, ONE, members).by is None


def test_residuals_of_nothing_have_no_scatter() -> None:
    members = groups(np.random.default_rng(1))
    assert scatter(np.zeros(TOUCHES), ONE, members).by is None
    assert scatter(ONE, np.zeros(TOUCHES), members).by is None


def test_noise_is_told_in_plain_words() -> None:
    assert noise(Scatter(None, 0.0, 0.0, None)) == []
    first, second, third = noise(Scatter("direction", 30.0, 20.0, 3.2, 0.6))
    assert "direction of touch" in first and "3 degrees of freedom" in second and "correlation 0.6" in third


def test_html_without_matplotlib_is_a_message_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    from tango_cnc.cli import tango
    from tango_cnc.records import InputError

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = CliRunner().invoke(tango, ["diagnose", "-C", "examples/hu40t", "--html", "page.html"], standalone_mode=False)
    assert isinstance(result.exception, InputError) and "tango-cnc[report]" in str(result.exception)
