"""A campaign of short checks whose truth is known: loaded, not, a file missing, wrong sign, twice, warm, of another machine."""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from support.compensated import truth, warmer
from support.loaded import Loaded, loaded

from sim_controller.world import Control
from tango_cnc.loaded import HELPS
from tango_cnc.records import InputError, World

SEEDS = int(os.environ.get("TANGO_SEEDS") or "1")
FIRST = int(os.environ.get("TANGO_SEED") or "0")
EXAMPLES = tuple((os.environ.get("TANGO_EXAMPLES") or "trunnion hu40t split fork_head three_axis_calibrated").split())
TARGETS = tuple((os.environ.get("TANGO_TARGETS") or "heidenhain fanuc linuxcnc").split())
HARMLESS = ("loaded", "loaded, 3 K warmer", "loaded, 3 K colder")


def cases(one: Loaded, other: Loaded) -> list[tuple[str, Control | None, World]]:
    """Compensation, one of another machine of the same kind → what is in the control, and the machine by then."""
    p, true, files = one.proposal, one.true, one.asked.files
    everything = one.control(dict(p.numbers), "all")
    turned = {h.place: h.number(2 * h.value(p.present[h.place]) - h.value(p.numbers[h.place])) for h in p.held}
    twice = {h.place: h.number(2 * h.value(p.numbers[h.place]) - h.value(p.present[h.place])) for h in p.held}
    strange = zip(p.held, other.proposal.held, strict=True)  # places of tables lie where each run touched
    swapped = {h.place: other.proposal.numbers[o.place] for h, o in strange}
    found = [
        ("loaded", everything, true),
        ("not loaded", None, true),
        ("wrong sign", one.control(turned, "turned"), true),
        ("twice", one.control(twice, "twice"), true),
        ("loaded, 3 K warmer", everything, warmer(true, 3.0)),
        ("loaded, 3 K colder", everything, warmer(true, -3.0)),
        ("not loaded, 3 K warmer", None, warmer(true, 3.0)),
        ("that of another machine", one.control(swapped, "other"), true),
    ]
    for file in sorted(set(files.values())) if len(set(files.values())) > 1 else ():
        numbers = {h.place: (p.present if files.get(h.place) == file else p.numbers)[h.place] for h in p.held}
        found.append((f"a file missing: {file}", one.control(numbers, f"without-{file}"), true))
    return found


@pytest.mark.campaign
@pytest.mark.parametrize("name", EXAMPLES)
def test_verdicts_whose_truth_is_known(name: str, tmp_path: Path) -> None:
    """What does not act as it was written is never kept; what does is never no help."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    inside, faults = Counter[bool](), []
    for target in TARGETS:
        for seed in range(FIRST, FIRST + SEEDS):
            try:
                one, other = (loaded(name, target, s, tmp_path / f"{target}{s}", tcp=True) for s in (seed, seed + 500))
            except InputError as error:
                counts["refused"][str(error)[:60]] += 1
                continue
            for what, control, world in cases(one, other):
                found = one.judged(control, 7000 + seed, world)
                left = truth(one.cell, world, one.proposal, control)
                inside[found.measured.low <= left <= found.measured.high] += 1
                counts[what.partition(":")[0]][found.verdict] += 1
                kept = found.verdict in HELPS and not (found.not_seen or left <= found.promised.high)
                file = what.partition(": ")[2]
                kept |= found.verdict in HELPS and bool(file) and file not in found.not_seen and left > found.promised.high
                if (what not in HARMLESS and kept) or (what in HARMLESS and found.verdict == "no help"):
                    faults.append(f"{name} {target} {seed} {what}: {found.verdict}, true {left:.2f}: {found.said}")
                shown = f"true {left:.2f} in {found.measured.low:.2f} to {found.measured.high:.2f}"
                print(f"{name} {target} {seed} {what}: {found.verdict} ({shown}); not seen: {', '.join(found.not_seen)}")
    for what, count in counts.items():
        print(f"    {name}: {what}: {', '.join(f'{n} {word}' for word, n in count.most_common())}")
    print(f"    {name}: within {dict(inside)}")
    assert not faults, "\n".join(faults)
