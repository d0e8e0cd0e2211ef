"""A second compensation on top of one that is in the control: probing programs do not see what acts in TCP only."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support.closing import SETTINGS
from support.compensated import example, first, measured, text, truth, write

from sim_controller.compensation import read
from tango_cnc.compensate import Proposal, loop, propose
from tango_cnc.compensate.hidden import Present, of_record
from tango_cnc.compensate.outcome import outcome
from tango_cnc.compensate.promise import Figure
from tango_cnc.loaded import AS_SEEN
from tango_cnc.records import InputError

NOW, LATER = "2026-01-01T00:00:00Z", "2026-02-01T00:00:00Z"
TRIED = [
    *(pytest.param(target, marks=pytest.mark.long) for target in ("fanuc", "haas", "siemens")),
    *(pytest.param(target, marks=pytest.mark.campaign) for target in ("fagor", "grblhal", "heidenhain", "linuxcnc", "value_sheet")),
]


@cache
def one(target: str) -> Proposal:
    cell, world = example("trunnion")
    return propose(measured(cell, world, seed=5), target, SETTINGS.get(target, ()))


def again(target: str, tmp_path: Path, *, tcp: bool) -> tuple[Proposal, loop.Kept, loop.Kept, Path]:
    """Target → a second proposal from readings made with the first in the control; both as they are kept, the second's files."""
    cell, world = example("trunnion")
    (tmp_path / "tango.yaml").write_text("tango: 1\n")
    kept = loop.store(tmp_path, one(target), NOW)
    readings = measured(cell, world, read(kept.folder, cell.machine, tcp=tcp), seed=11)
    limits = dict(one(target).request.limits)
    two = propose(readings, target, SETTINGS.get(target, ()), of_record(kept.record), volume=limits, tcp=tcp)
    return two, kept, loop.store(tmp_path, two, LATER), write(two, tmp_path / "loaded")


@pytest.mark.parametrize("target", TRIED)
def test_what_acts_in_tcp_only_is_not_taken_away_twice(target: str, tmp_path: Path) -> None:
    """The true machine of the simulator has as much left as before, and the promise says so."""
    cell, world = example("trunnion")
    two, kept, next_, folder = again(target, tmp_path, tcp=False)
    left = [truth(cell, world, two, read(f, cell.machine)) for f in (kept.folder, folder)]
    print(target, [round(size, 2) for size in left], two.fit.rms_before, two.fit.rms_after)
    assert left[1] < one(target).fit.rms_after.high  # no more than the first promised
    assert two.fit.rms_before.low < left[0] < two.fit.rms_before.high
    assert two.fit.rms_after.low < left[1] < two.fit.rms_after.high
    # A third measurement, without tool center point control, has the whole of the kinematics taken off, not the last change.
    found = outcome(next_, measured(cell, world, read(folder, cell.machine, tcp=False), seed=12), list(two.held), tcp=False)
    assert found.measured.low < left[1] < found.measured.high
    assert found.verdict in (AS_SEEN, "undecided"), found.text  # it is as good as the first, and nothing speaks against it


@pytest.mark.long
def test_with_tcp_on_what_is_measured_is_added(tmp_path: Path) -> None:
    cell, world = example("trunnion")
    two, kept, _, folder = again("fanuc", tmp_path, tcp=True)
    left = [truth(cell, world, two, read(f, cell.machine)) for f in (kept.folder, folder)]
    assert left[1] < left[0] + 0.3 and two.fit.rms_after.low < left[1] < two.fit.rms_after.high


@pytest.mark.long
def test_it_asks_how_the_readings_were_made() -> None:
    place = "setting 255 (MRZP X)"
    proposal = propose(first("trunnion"), "haas", poses=100)
    present = Present({place: proposal.numbers[place]}, {})
    with pytest.raises(InputError, match=r"setting 255 .* allowed: --no-tcp"):
        propose(first("trunnion"), "haas", present=present, poses=100)
    assert propose(first("trunnion"), "haas", present=Present({}, {}), poses=100).given  # nothing acts in it only
    replaced = propose(first("trunnion"), "haas", present=Present(proposal.numbers, {}), poses=100, tcp=False)
    assert not replaced.fit.change.any() and replaced.fit.rms_before.value == pytest.approx(proposal.fit.rms_after.value, rel=0.05)


@pytest.mark.long
def test_a_proposal_that_makes_the_largest_errors_worse_says_so() -> None:
    proposal = propose(first("trunnion"), "haas", poses=100)
    assert "largest errors get worse" not in text(proposal) and "hardly any gain" not in text(proposal)
    small = replace(proposal.fit, rms_before=Figure(3.81, 3.15, 5.45), rms_after=Figure(3.41, 3.10, 3.95))
    assert "hardly any gain: the error now is between 3.15 and 5.45 µm" in text(replace(proposal, fit=small))
    idle = replace(proposal.fit, rms_after=proposal.fit.rms_before)
    assert "leave the control as it is" in text(replace(proposal, fit=idle))
    grown = replace(proposal.fit, largest_before=Figure(21.6, 21.0, 22.2), largest_after=Figure(22.7, 22.0, 23.4))
    assert "below 21.6 µm now, and below 22.7 µm after" in text(replace(proposal, fit=grown))


@pytest.mark.long
def test_millimetres_are_another_zero_and_hundredths_are_not() -> None:
    """Numbers of a file: where the control counts from elsewhere, what is measured is added to what is there."""
    place = "setting 255 (MRZP X)"
    proposal = propose(first("trunnion"), "haas", poses=100)
    base = proposal.present[place]
    error = proposal.numbers[place] - base
    assert abs(error) > 0.002
    for there, wanted in ((base + 0.02, base + error), (base + 7.5, base + 7.5 + error)):
        found = propose(first("trunnion"), "haas", present=Present({place: there}, {}), poses=100, tcp=False)
        assert found.numbers[place] == pytest.approx(wanted, abs=2e-4)
