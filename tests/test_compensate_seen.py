"""What a run does not see of a compensation is said first, and nothing that may be missing is called kept."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from support.commands import run
from support.compensated import ROOT
from support.loaded import loaded

from tango_cnc.compensate import loop, propose
from tango_cnc.compensate import turned as turn
from tango_cnc.compensate.loads import files_of
from tango_cnc.compensate.seen import Sorted, seen
from tango_cnc.compensate.shares import Before, Part
from tango_cnc.compensate.short import Short
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_readings
from tango_cnc.loaded import AS_SEEN, HELPS, KEPT
from tango_cnc.noise import honest
from tango_cnc.report.compensated import marked
from tango_cnc.report.texts import texts


def sorts(within: str = "", missing: str = "", unsure: str = "", small: str = "") -> Sorted:
    """Names with blanks between → parts, sorted."""
    return Sorted(within.split(), missing.split(), unsure.split(), small.split(), {})


def test_a_file_of_which_one_table_acts_is_loaded_and_its_small_tables_alone_are_not_seen() -> None:
    class Place:
        def __init__(self, place: str) -> None:
            self.place = place

    parts = [Part(name, (Place(name),), (1.0,)) for name in ("big", "dim", "lone")]  # type: ignore[arg-type]
    held = {"big": "one.txt", "dim": "one.txt", "lone": "two.txt"}
    found = seen(sorts("big", small="dim lone"), parts, sorts(small="one.txt two.txt"), held)
    assert found.unseen == ("two.txt", "dim") and found.files
    assert found.acting == ("big",) and set(found.hidden) == {"dim", "lone"}
    found = seen(sorts("big", small="dim lone"), parts, sorts("one.txt two.txt"), held)
    assert found.unseen == ("dim", "lone") and not found.files
    found = seen(sorts("big", missing="dim", small="lone"), parts, sorts("two.txt", missing="one.txt"), held)
    assert found.missing == ("dim",)  # its file is loaded: it is the table that does not act
    found = seen(sorts(missing="big", small="dim lone"), parts, sorts("two.txt", missing="one.txt"), held)
    assert found.missing == ("one.txt",)
    found = seen(sorts(unsure="big", small="dim lone"), parts, sorts("two.txt", unsure="one.txt"), held)
    assert found.unsure == ("one.txt",)
    found = seen(sorts(unsure="big", small="dim lone"), parts, sorts("two.txt", unsure="one.txt"), held, ("big", "one.txt"))
    assert not found.unsure and "one.txt" in found.unseen  # no touch of the whole strategy would decide it


@pytest.mark.long
def test_a_check_asks_for_every_file_that_touches_can_tell(tmp_path: Path) -> None:
    """X.COM takes 8 µm of 105 away, less than a tenth: it was not asked for, and the check was kept without it."""
    one = loaded("hu40t", "heidenhain", -1, tmp_path, tcp=True)
    p = one.proposal
    files = files_of(p.module, p.request, p.held, p.present, p.numbers)
    assert set(files.values()) >= {"X.COM", "kinematics.txt"} and all(files.values())
    assert one.look.seconds <= 8 * 60 and {"X.COM", "Z.COM", "B.COM"} <= set(one.look.names)
    everything = one.judged(one.control(dict(p.numbers), "all"), 77)
    assert everything.verdict in HELPS and not {"X.COM", "Z.COM", "B.COM"} & set(everything.not_seen)
    for file in sorted(set(files.values())):
        found = one.judged(one.without({place for place, name in files.items() if name == file}, f"without-{file}"), 77)
        print(file, found.verdict, found.said[:200])
        assert found.verdict != KEPT
        assert file not in ("X.COM", "Z.COM", "B.COM", "kinematics.txt") or found.verdict not in HELPS
        assert found.verdict != AS_SEEN or (file in found.not_seen and found.said.startswith("this run does not see whether"))


@pytest.mark.long
def test_the_same_stylus_tells_a_center_from_another_stylus(tmp_path: Path) -> None:
    one = loaded("huron", "fanuc", -1, tmp_path, tcp=True)
    control = one.control(dict(one.proposal.numbers), "all")
    assert one.judged(control, 77).verdict == "undecided"
    before, asked = one.asked.before, one.asked
    known = type(before)(before.result, before.days, same_stylus=True)
    same = type(one)(
        one.cell, one.true, one.proposal, Short(asked.kept, known, asked.held, True, False, asked.files), one.look, tmp_path
    )
    assert same.judged(control, 77).verdict in HELPS
    assert same.judged(None, 77).verdict not in HELPS
    centres = {h.table for h in one.proposal.held if h.tcp}
    assert same.judged(same.without(centres, "without"), 77).verdict not in HELPS


@pytest.mark.long
def test_without_tool_center_point_control_kinematics_are_not_kept(tmp_path: Path) -> None:
    """Nothing shows whether the kinematics were loaded: neither a short check nor the whole strategy says that they were."""
    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", cell)
    assert run("simulate", "-C", cell).exit_code == 0
    assert run("compensate", "-C", cell, "--target", "heidenhain", "--simulated").exit_code == 0
    folder = loop.one(cell, 1).folder
    assert run("compensate", "-C", cell, "--written", 1).exit_code == 0
    assert run("compensate", "-C", cell, "--short-check", 1, "--no-tcp").exit_code == 0
    place = cell / loop.FOLDER / "check-001"
    for where, file in ((place, place / "few.csv"), (cell, cell / "after.csv")):
        made = ("simulate", "-C", where, "-o", file, "--seed", 9, "--compensation", folder, "--no-tcp")
        assert run(*made).exit_code == 0
        found = json.loads(run("compensate", "-C", cell, "--measured", 1, "--readings", file, "--no-tcp", "--json", "-").stdout)
        assert found["verdict"] == AS_SEEN and found["not_seen"][0] == "the kinematics"
        assert found["left_if_none_um"] > 10
    last = loop.history(cell)[-1]
    assert last["not_seen"][0] == "the kinematics" and last["text"].startswith(
        "this run does not see whether the control uses the kin"
    )
    assert marked([type("E", (), {"event": AS_SEEN, "utc": last["utc"], "number": 1})()], texts()).popitem()[1].endswith(AS_SEEN)
    again = run("compensate", "-C", cell, "--short-check", 1, "--no-tcp")  # the readings of the first stay with their strategy
    assert str(place) + "-2" in again.stdout and (place / "few.csv").exists()
    both = run("compensate", "-C", cell, "--short-check", 1, "--no-tcp", "--tcp")
    assert "found both" in str(both.exception)
    assert run("compensate", "-C", cell, "--rolled-back", 1, "--reason", "spindle").exit_code == 0
    for asked in ("--written", "--short-check"):
        assert "anew" in str(run("compensate", "-C", cell, asked, 1).exception)


def test_what_is_not_seen_is_said_before_all_else() -> None:
    from tango_cnc.compensate.outcome import Outcome
    from tango_cnc.compensate.promise import Figure

    figure = Figure(1.0, 0.5, 2.0)
    found = Outcome(figure, figure, figure, AS_SEEN, "it agrees", ("A.COM",), 2.5)
    assert found.said.startswith(
        "this run does not see whether the control uses A.COM. If it does not, 2.50 µm would be left, more"
    )
    assert not found.in_any_case  # the exit status is 1: the promise need not be kept
    assert Outcome(figure, figure, figure, AS_SEEN, "it agrees", ("A.COM",), 1.5).in_any_case
    assert found.said.endswith("It agrees") and np.isfinite(found.left_if_none or np.nan)


@pytest.mark.long
def test_kinematics_of_which_one_turn_shows_nothing_are_not_kept(tmp_path: Path) -> None:
    """Turning A shows nothing of C. The command refuses micrometres, a whole turn, and a letter that stands there twice."""
    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", cell)
    assert run("simulate", "-C", cell).exit_code == 0
    assert run("compensate", "-C", cell, "--target", "siemens", "--simulated", "--set", "tables=no").exit_code == 0
    kept = loop.one(cell, 1)
    said = run("compensate", "-C", cell, "--written", 1).stdout
    assert "Look by hand" in said and "--turned" in said and "in the table, where the facets are" in said

    def turned(text: str, *more: object) -> Result:
        return run("compensate", "-C", cell, "--measured", 1, "--turned", text, *more)

    mill = read_cell(cell)
    readings = read_readings(kept.folder / loop.MADE_FROM, mill.machine, mill.artefact)
    result = honest(estimate(mill.machine, mill.artefact, readings, mill.terms))
    asked = Short(kept, Before(result, 1.0), propose(result, "siemens", ("tables=no",)).held, tcp=True, first_tcp=False)
    words = {}
    for axis, angle in (("C", 180), ("A", 60)):
        expected = turn.turn(asked, axis, np.radians(angle), fixture=False)
        values = ",".join(f"{letter}={v:.5f}" for letter, v in zip(expected.letters, expected.within, strict=True))
        found = json.loads(turned(f"{axis}={angle}:{values}", "--json", "-").stdout)
        words[axis] = found["verdict"]
        assert found["verdict"] != AS_SEEN or any("A" in name for name in found["not_seen"])
    assert words == {"C": AS_SEEN, "A": "undecided"}
    for text, why in (
        ("C=360:X=0,Y=0", "whole turns"),
        ("C=180:X=18.9,Y=-60", "at most about"),
        ("C=180:X=0,X=1,Y=0", "allowed: AXIS=DEG"),
    ):
        assert why in str(turned(text).exception)
    assert "--no-tcp" in str(turned("C=180:X=0,Y=0", "--no-tcp").exception)
    other = run("compensate", "-C", cell, "--target", "fanuc", "--present", "none", "--simulated")
    assert "corrected twice" in str(other.exception)


@pytest.mark.long
def test_of_kinematics_of_a_head_the_printed_commands_have_tool_center_point_control_on(tmp_path: Path) -> None:
    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "fork_head", cell)
    assert run("simulate", "-C", cell).exit_code == 0
    asked = ("compensate", "-C", cell, "--target", "siemens", "--simulated", "--cap-mm", 5, "--cap-deg", 1, "--set", "tables=no")
    assert run(*asked).exit_code == 0
    said = run("compensate", "-C", cell, "--written", 1).stdout
    assert "--short-check 1 --tcp" in said and "--no-tcp" not in said
    assert run("compensate", "-C", cell, "--short-check", 1, "--tcp").exit_code == 0
