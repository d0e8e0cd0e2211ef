"""Every doubt is an experiment: where exactly one belief about a control is wrong, exactly this one fails, and nothing is hit."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import pytest
from support.controls import golden
from test_dialects import EVERY
from test_gate import NEAR, ran

from postprocessors._base import companions, load, program
from postprocessors._base import settings as settings_of
from tango_cnc import commission, readback
from tango_cnc.commands.commission import _record
from tango_cnc.files.commissioning import Proof, add_proofs, latest, profile_hash, read_commissioning
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError, Plan

QUICK = ("fanuc", "haas", "siemens", "heidenhain", "linuxcnc", "okuma")


@cache
def air(name: str) -> Plan:
    return commission.air(golden(), 2 if name == "grbl" else commission.MOST)


def profile(name: str) -> dict[str, Any]:
    return {"misses": 20} if any(option.name == "misses" for option in load(name).options) else {}


def stops_when_held(name: str, ignored: bool) -> bool:
    """dialect, whether its control ignores a probe that is deflected before a move begins → whether the program stops then."""
    who: dict[str, Any] = {"probe": "alive", "person": False} if ignored else {"probe": "inverted"}
    found = ran(name, air(name), profile(name) | {"gate": "none"}, **who)
    return not any(line.lstrip().startswith("P") for line in found.out.decode("ascii", "replace").splitlines())


def seen(name: str, held: bool | None = None, **wrong: Any) -> tuple[commission.Seen, list[str]]:
    """dialect, what is wrong with the machine or its control → what the command sees, and the events of the machine."""
    made = air(name)
    found = ran(name, made, profile(name), **wrong)
    lines = found.out.decode("ascii", "replace").replace("\x12", "").replace("\x14", "").splitlines()
    records = {r[0]: r[1:] for line in lines if line.lstrip().startswith("P") and (r := _record(line, made))}
    said = found.why or " ".join(found.stops)
    begun, ended = (any(f"TANGO {word} " in line for line in lines) for word in ("START", "END"))
    return commission.Seen(made, records, begun, ended, (), said, None, held), [event for event, _ in found.events]


def failed(what: commission.Seen) -> list[str]:
    return [j.experiment.belief for j in commission.judge(what) if j.verdict.verdict == "FAIL"]


@pytest.mark.parametrize("name", sorted(EVERY))
def test_its_program_is_read_back(name: str) -> None:
    made, options = air(name), profile(name)
    lines = program(load(name), made, options, plan_hash(made))[2]
    assert not readback.check(lines, made, settings_of(load(name), options), companions(load(name), made, options))


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.long) for n in sorted(EVERY)])
def test_a_control_on_which_all_is_right_passes(name: str) -> None:
    what, events = seen(name, held=stops_when_held(name, ignored=False))
    verdicts = {j.experiment.belief: j.verdict.verdict for j in commission.judge(what)}
    asked = {e.belief for e in commission.experiments() if e.question}
    assert {belief for belief, verdict in verdicts.items() if verdict != "PASS"} == asked, verdicts
    assert not set(NEAR) & set(events)


WRONG: Mapping[str, Mapping[str, Any]] = {
    "alive": {"probe": "other"},
    "miss": {"probe": "chatter"},
    "rotary": {"slack": {"B": 1.0}},
    "deflected": {},
}


@pytest.mark.parametrize("belief", sorted(WRONG))
@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.long) for n in sorted(EVERY)])
def test_where_one_belief_is_wrong_this_one_fails(name: str, belief: str) -> None:
    wrong = dict(WRONG[belief])
    held = stops_when_held(name, ignored=True) if belief == "deflected" else None
    what, events = seen(name, held=held, **wrong)
    tolerated = belief == "miss" and name not in ("linuxcnc", "grbl")  # they look at the way that is left as well
    assert failed(what) == ([] if tolerated else [belief]), (what.said, what.records)
    assert not set(NEAR) & set(events)


def test_what_was_proven_is_kept_and_only_for_its_profile(tmp_path: Any) -> None:
    own, other = profile_hash("fanuc", {"skip": "G31 P1"}), profile_hash("fanuc", {})
    add_proofs(
        tmp_path, "fanuc", [Proof("alive", "FAIL", "no", profile=own), Proof("miss", "PASS", "yes", 3.0, "touches", profile=own)]
    )
    add_proofs(tmp_path, "fanuc", [Proof("alive", "PASS", "stopped", profile=own), Proof("frames", "OPEN", "", profile=own)])
    proofs = read_commissioning(tmp_path)
    assert [proof.verdict for proof in proofs] == ["FAIL", "PASS", "PASS", "OPEN"]
    assert {b: p.verdict for b, p in latest(proofs, own).items()} == {"alive": "PASS", "miss": "PASS"}
    assert not latest(proofs, other)
    assert profile_hash("fanuc", {"confirmed": ["x"]}) == other
    (tmp_path / "commissioning.yaml").write_text("format: something\n")
    with pytest.raises(InputError, match="allowed: tango-commissioning/1"):
        read_commissioning(tmp_path)


def test_a_proof_takes_what_it_settles_off_the_list_and_the_rest_is_ordered_by_danger() -> None:
    from postprocessors._base import unverified

    doubts = unverified(load("fanuc"), {})
    left, open_beliefs = commission.remaining(doubts, {"rotary": "PASS", "alive": "FAIL"})
    assert any("turns a rotary axis" in d for d in doubts) and not any("turns a rotary axis" in d for d in left)
    assert any(d.startswith("skip = ") for d in left)
    assert [e.danger for e in open_beliefs] == sorted(e.danger for e in open_beliefs)
    dangers = [danger for danger, _, _ in commission.ordered(doubts)]
    assert dangers == sorted(dangers) and dangers[0] == 1
