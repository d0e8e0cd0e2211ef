"""A short check after a compensation was written: it decides in minutes, and takes no stylus, table or missing file for help."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.closing import SETTINGS
from support.commands import run
from support.compensated import ROOT, disturbed, example, text, truth, write
from support.loaded import Loaded, before, loaded

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from sim_controller.world import Control, nominal_machine, tip_in_table, true_machine
from tango_cnc import kinematics
from tango_cnc.compensate import loop, propose, turned
from tango_cnc.compensate.hidden import Present
from tango_cnc.compensate.outcome import Outcome, outcome
from tango_cnc.compensate.seen import asked_for
from tango_cnc.compensate.shares import Before
from tango_cnc.compensate.short import Short, by_part, not_all
from tango_cnc.estimate import estimate
from tango_cnc.loaded import AS_SEEN, HELPS, KEPT
from tango_cnc.noise import honest
from tango_cnc.records import Cell, InputError, World
from tango_cnc.touches import from_readings

SEEDS = int(os.environ.get("TANGO_SEEDS") or "5")
FIRST = int(os.environ.get("TANGO_SEED") or "0")
EXAMPLES = ("trunnion", "hu40t", "split", "fork_head", "huron", "three_axis_calibrated")
TARGETS = tuple((os.environ.get("TANGO_TARGETS") or "siemens fanuc heidenhain linuxcnc iso230").split())


def cases(one: Loaded, seed: int, parts: int = 99) -> dict[str, tuple[Outcome, float]]:
    """Compensation, seed of the check, how many parts go missing → {what is in the control: outcome, µm that are truly left}."""
    p, found = one.proposal, {}

    def add(what: str, control: Control | None, world: World | None = None) -> None:
        whole = control if one.asked.tcp or control is None else one.control(dict(p.numbers), "loaded")
        found[what] = one.judged(control, seed, world), truth(one.cell, one.true, p, whole)

    everything = one.control(dict(p.numbers), "loaded")
    add("loaded", everything)
    add("loaded, another stylus, table moved", everything, disturbed(one.cell, one.true, seed))
    add("not loaded", None)
    add("not loaded, another stylus, table moved", None, disturbed(one.cell, one.true, seed))
    wrong = {h.place: h.number(2 * h.value(p.present[h.place]) - h.value(p.numbers[h.place])) for h in p.held}
    add("wrong sign", one.control(wrong, "wrong"))
    poses = one.asked.poses
    at_all = [(part, float(np.sqrt(np.mean(np.sum(_free(poses, part) ** 2, axis=1)))) * 1e3) for part in one.asked.parts]
    for part, size in at_all[:parts]:
        if len(at_all) > 1:
            seen = asked_for(size, p.fit.rms_before, one.asked.before.sigma)
            kind = "a part missing" if seen else "a small part missing"
            add(f"{kind}: {part.name} {size:.1f}", one.without({part.name}, f"without{len(found)}"))
    return found


def _free(poses, part):  # type: ignore[no-untyped-def]
    return poses.free(part.moved(poses).reshape(-1, 1)).reshape(-1, 3)


@pytest.mark.long
@pytest.mark.parametrize(("name", "target", "tcp"), [("trunnion", "fanuc", True)])
def test_a_short_check_decides(name: str, target: str, tcp: bool, tmp_path: Path) -> None:
    one = loaded(name, target, 1, tmp_path, tcp=tcp)
    assert one.look.seconds <= 8 * 60
    found = cases(one, 77, parts=1)
    said = {what: one.verdict for what, (one, _) in found.items()}
    print(said)
    assert {said.pop("loaded"), said.pop("loaded, another stylus, table moved")} <= set(HELPS)
    assert said.pop("not loaded") == said.pop("not loaded, another stylus, table moved") == said.pop("wrong sign") == "no help"
    assert all(word != "kept" for what, word in said.items() if what.startswith("a part"))


@pytest.mark.campaign
@pytest.mark.parametrize("tcp", [True, False], ids=["tcp", "no-tcp"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_short_checks_of_many_machines(name: str, tcp: bool, tmp_path: Path) -> None:
    """Loaded is never no help, not loaded, wrong sign or a part that matters missing never kept."""
    faults = []
    for target in TARGETS:
        counts: dict[str, Counter[str]] = defaultdict(Counter)
        minutes, touches, within = [], [], Counter[bool]()
        for seed in range(FIRST, FIRST + SEEDS):
            try:
                one = loaded(name, target, seed, tmp_path / f"{target}{seed}", tcp=tcp)
            except InputError as error:
                assert "allowed:" in str(error)
                counts["refused"][str(error)[:60]] += 1
                continue
            minutes.append(one.look.seconds / 60)
            touches.append(len(one.look.plan.touches))
            for what, (found, true) in cases(one, 5000 + seed).items():
                counts[what.partition(":")[0]][found.verdict] += 1
                within[found.measured.low <= true <= found.measured.high] += 1
                wrong = {"loaded": ("no help",), "not loaded": HELPS, "wrong sign": HELPS, "a part missing": HELPS}
                wrong |= {"a small part missing": (KEPT,)}
                if found.verdict in wrong.get(what.partition(":")[0].partition(",")[0], ()):
                    faults.append(f"{name} {target} {tcp} {seed} {what}: {found.verdict}: true {true:.2f}: {found.text}")
        if minutes:
            print(
                f"{name} {target} {'tcp' if tcp else 'no-tcp'}: full {len(before(name, FIRST)[2].residuals)}, check "
                f"{min(touches)} to {max(touches)} touches in {min(minutes):.1f} to {max(minutes):.1f} min; within {dict(within)}"
            )
        for what, count in counts.items():
            print(f"    {what}: {dict(count)}")
    print("\n".join(faults))
    assert not faults


@pytest.mark.long
def test_the_command_walks_from_the_proposal_to_the_verdict(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", cell)
    assert run("simulate", "-C", cell).exit_code == 0
    assert run("compensate", "-C", cell, "--target", "fanuc", "--simulated").exit_code == 0
    folder = loop.one(cell, 1).folder
    assert "--short-check 1" in (folder / "steps.txt").read_text()
    assert run("compensate", "--check", folder).exit_code == 0
    assert run("compensate", "-C", cell, "--written", 1).exit_code == 0
    chosen = run("compensate", "-C", cell, "--short-check", 1, "--tcp", "--minutes", 4, "--json", "-")
    place = cell / loop.FOLDER / "check-001"
    data = json.loads(chosen.stdout)
    assert data["folder"] == str(place) and data["time_s"] <= 240 and data["touches"] < 60
    for name, given, word in (("loaded", ("--compensation", folder), AS_SEEN), ("not", (), "no help")):
        few = place / f"{name}.csv"
        assert run("simulate", "-C", place, "-o", few, "--seed", 9, *given).exit_code == 0
        found = run("compensate", "-C", cell, "--measured", 1, "--readings", few, "--tcp", "--json", "-")
        assert json.loads(found.stdout)["verdict"] == word
    assert [e["event"] for e in loop.history(cell)] == ["proposed", "written", AS_SEEN, "no help"]
    few = cell / "elsewhere.csv"  # its own strategy is not that of the cell in which its readings lie
    shutil.copyfile(place / "loaded.csv", few)
    shutil.copyfile(place / "loaded.origin.json", cell / "elsewhere.origin.json")
    monkeypatch.setattr("tango_cnc.commands._short_check.FEW", 0.0)  # as if it had as many touches as the run before it
    found = run("compensate", "-C", cell, "--measured", 1, "--readings", few, "--tcp")
    assert "strategy.yaml was changed" not in found.stderr and "A short check" in found.output


@pytest.mark.long
def test_a_table_that_is_not_loaded_is_seen_in_a_full_run_beside_centers_that_are(tmp_path: Path) -> None:
    """The sum agrees with the promise: 1.6 µm of reversal values beside 30 µm of centers."""
    one = loaded("trunnion", "siemens", -1, tmp_path, tcp=True)
    for missing, word in (((), "kept"), (("reversal values",), "not as promised")):
        control = one.without(set(missing), f"without{len(missing)}")
        few = simulate(one.cell.machine, one.cell.artefact, one.cell.strategy, one.true, seed=5, control=control)
        touches = from_readings(one.cell.machine, one.cell.artefact, few)
        result = honest(estimate(one.cell.machine, one.cell.artefact, few, one.cell.terms))
        found = outcome(one.asked.kept, result, list(one.proposal.held), tcp=True)
        assert found.verdict == "kept"
        found = not_all(found, by_part(one.asked, touches), one.asked.kept)
        assert found.verdict == word
        assert not missing or "reversal.mpf" in found.text  # the file that is not in the control


@pytest.mark.long
def test_a_reversal_value_of_one_axis_that_is_not_loaded_is_no_kept_compensation(tmp_path: Path) -> None:
    """Judged with those of all axes together two thirds of them act, which might be all."""
    one = loaded("fork_head", "heidenhain", -1, tmp_path, tcp=True, minutes=12)
    words = {}
    for axis in ("", "A", "C"):
        control = one.without({f"{axis}.COM, BACKLASH"} if axis else set(), f"without{axis}")
        few = simulate(one.cell.machine, one.cell.artefact, one.cell.strategy, one.true, seed=5, control=control)
        result = honest(estimate(one.cell.machine, one.cell.artefact, few, one.cell.terms))
        found = outcome(one.asked.kept, result, list(one.proposal.held), tcp=True)
        judged = not_all(found, by_part(one.asked, from_readings(one.cell.machine, one.cell.artefact, few)), one.asked.kept)
        words[axis] = found.verdict, judged.verdict
        assert not axis or f"{axis}.COM" in judged.text
    assert {by_sum for by_sum, _ in words.values()} == {"kept"}
    assert words[""][1] == "kept" and {words["A"][1], words["C"][1]} == {"not as promised"}


@pytest.mark.few(0)
@pytest.mark.parametrize("target", ["fanuc", "value_sheet"])
def test_the_center_of_an_axis_that_never_turned_keeps_its_value(target: str) -> None:
    cell, world = example("trunnion")
    flat = tuple(i for i in cell.strategy.indexations if abs(i.position.get("A", 0.0)) < 1e-6)
    readings = simulate(cell.machine, cell.artefact, replace(cell.strategy, indexations=flat), world, seed=3)
    result = estimate(cell.machine, cell.artefact, readings, cell.terms)
    made = propose(result, target, SETTINGS.get(target, ()))
    kept = [h.place for h in made.held if h.tcp and "A" in h.place]
    assert kept and set(kept) <= set(made.pinned)
    assert all(made.numbers[place] == made.present[place] for place in kept)
    there = {place: made.present[place] + 0.0123456 for place in kept}
    again = propose(result, target, SETTINGS.get(target, ()), Present(there, {}), tcp=False)
    assert all(again.numbers[place] == there[place] for place in kept)
    assert "keep their present values" in text(made) and kept[0] in text(made)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "settings", "loaded"),
    [
        ("split", ("tables=no",), "undecided"),  # B, in the head, takes most away, and does not turn
        ("split", ("vectors=no", "tables=no", "fixture_offset=G54"), "kept"),
        ("trunnion", ("tables=no",), AS_SEEN),
    ],
)
def test_kinematics_alone_are_judged_by_one_feature_at_two_angles(
    name: str, settings: tuple[str, ...], loaded: str, tmp_path: Path
) -> None:
    """Program coordinates of a boss at C 0 and C 180, by the true machine of the simulator, with scatter.

    It stands about where the facets are; a boss a quarter of a meter below them was expected on machines with a head.
    """
    cell, true, result = before(name, 3)
    proposal = propose(result, "fanuc", settings)
    (tmp_path / "tango.yaml").write_text("tango: 1\n")
    kept = loop.store(tmp_path, proposal, "2026-01-01T00:00:00Z")
    asked = Short(kept, Before(result, 1.0), proposal.held, tcp=True, first_tcp=False)
    fixture = len(settings) > 1
    expected = turned.turn(asked, "C", np.pi, fixture=fixture)
    wrong = {h.place: h.number(2 * h.value(proposal.present[h.place]) - h.value(proposal.numbers[h.place])) for h in proposal.held}
    for numbers, word in ((dict(proposal.numbers), loaded), (dict(proposal.present), "no help"), (wrong, "no help")):
        control = read(write(replace(proposal, numbers=numbers), tmp_path / word), cell.machine)
        for seed in range(5):
            seen = boss(cell, true, control, fixture=fixture) + np.random.default_rng(seed).normal(size=2) * 1e-3
            found = turned.judged(asked, expected, seen)
            assert found.verdict == word, found.text
            assert word != AS_SEEN or {"centre of A" in n or "A, " in n for n in found.not_seen} == {True}


def boss(cell: Cell, world: World, control: Control, *, fixture: bool) -> np.ndarray:
    """Cell, true machine, its control → (2,) mm by which a boss at C 180 is elsewhere in the program than at C 0."""
    machine, chain = cell.machine, kinematics.chain(cell.machine)
    place = np.median([f.point for f in cell.artefact.facets.values()], axis=0) + np.array([10.0, -15.0, 25.0])
    at = np.zeros((2, len(machine.names)))
    at[1, machine.column("C")] = np.pi
    at = np.vstack([kinematics.inverse(chain, at[i : i + 1], place[None]) for i in (0, 1)])
    still = np.zeros_like(at)
    true = true_machine(machine, replace(world, stylus={}), control)
    error = tip_in_table(true, at, still) - tip_in_table(nominal_machine(machine), at, still)
    away = error[0] - error[1]
    return (np.linalg.inv(kinematics.affine(chain, at)[2][1]) @ away if fixture else away)[:2]


@pytest.mark.long
def test_steps_of_kinematics_alone_say_what_to_look_at_by_hand(tmp_path: Path) -> None:
    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "split", cell)
    assert run("simulate", "-C", cell).exit_code == 0
    settings = ("--set", "vectors=no", "--set", "tables=no", "--set", "fixture_offset=G54")
    assert run("compensate", "-C", cell, "--target", "fanuc", "--simulated", *settings).exit_code == 0
    kept = loop.one(cell, 1)
    steps = (kept.folder / "steps.txt").read_text()
    assert "with G54.2 on, in G54" in steps and "--measured 1 --turned C=180:X=MM,Y=MM" in steps
    assert run("compensate", "-C", cell, "--written", 1).exit_code == 0
    found = re.search(r"is X (\S+) Y (\S+) mm where the numbers act, and X (\S+) Y (\S+) mm where", steps)
    assert found is not None
    for (x, y), word in (((found[1], found[2]), "kept"), ((found[3], found[4]), "no help")):
        asked = run("compensate", "-C", cell, "--measured", 1, "--turned", f"C=180:X={x},Y={y}", "--json", "-")
        assert json.loads(asked.stdout)["verdict"] == word
    refused = run("compensate", "-C", cell, "--measured", 1, "--turned", "B=90:X=0,Z=0")
    assert "allowed: a rotary axis of the table (C)" in str(refused.exception)


@pytest.mark.few(0)
def test_the_folder_of_a_short_check_asks_for_a_finger_where_its_cell_proves_the_probe_by_a_facet(tmp_path: Path) -> None:
    """The printed run was refused: no run in that folder had proven the facet."""
    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", cell)
    file = cell / "tango.yaml"
    stated = yaml.safe_load(file.read_text())
    stated["controller"] = {"post": "fanuc", "probe_state": 1004, "gate": "facet"}
    file.write_text(yaml.safe_dump(stated))
    assert run("simulate", "-C", cell).exit_code == 0
    assert run("compensate", "-C", cell, "--target", "fanuc", "--simulated").exit_code == 0
    shown = run("compensate", "-C", cell, "--short-check", 1, "--tcp", "--minutes", 4)
    assert shown.exit_code == 0, shown.output
    assert yaml.safe_load((cell / "compensations" / "check-001" / "tango.yaml").read_text())["controller"]["gate"] == "finger"
    assert yaml.safe_load(file.read_text())["controller"]["gate"] == "facet"
    assert "asks for a finger at the stylus" in " ".join(shown.output.split())
