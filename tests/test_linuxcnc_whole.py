"""The LinuxCNC program on the whole control: its real planner, its real axes, a probe that trips on the simulated table."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.realcontrol import PERIOD, Control, linuxcnc

from tango_cnc.files import read_cell, read_readings, read_world
from tango_cnc.plan import last_motion, plan
from tango_cnc.records import Array

pytestmark = pytest.mark.system("linuxcnc", "linuxcncrsh")
HERE = Path(__file__).parent
EXAMPLE = HERE.parent / "examples" / "hu40t"
RETOUCHED = 3  # facets that a resumed run touches again first
CLOSE = 0.05  # mm or rad
# (B, C, S, which of the indexations like that, facets or all of the strategy): every parameter of S3 can be seen.
PART: tuple[tuple[float, float, float, int, Sequence[object] | None], ...] = (
    (30, -90, 0, 0, None),
    (60, -180, 0, 0, None),
    (-45, 135, 0, 0, None),
    (-75, 225, 0, 0, None),
    (15, -45, 0, 0, None),
    (0, 0, 0, 1, (101, 102, 103, 104, 105, 201, 202, 203, 204, 205, 3, 5, 7, 12, 15, 17, 19, 21, 24, 26)),
    (0, 180, 0, 0, (3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27)),
    (0, 0, 90, 0, None),
    (0, 0, 180, 0, None),
    (0, 0, 270, 0, None),
)
OPTIONS = "controller: {post: linuxcnc, log: log.txt, gate: none, positioning_feed: 24000}\n"


def tango(*arguments: object, code: int = 0) -> str:
    """Arguments of the command → what it prints. Fails when it ends with another status."""
    done = subprocess.run(
        [sys.executable, "-m", "tango_cnc", *map(str, arguments)], capture_output=True, text=True, check=False, timeout=5400
    )
    assert done.returncode == code, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def result(*arguments: object) -> dict[str, object]:
    """Arguments of the command → its JSON."""
    found: dict[str, object] = json.loads(tango(*arguments, "--json", "-"))
    return found


def hu40t(folder: Path, part: bool) -> Path:
    """The example on LinuxCNC, all of it or 111 touches at ten indexations; at 180 mm/min, from 3 mm, as time here is real time."""
    shutil.copytree(EXAMPLE, folder)
    (folder / "tango.yaml").write_text(
        f"tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S3\n{OPTIONS}"
    )
    (folder / "uncertainty.yaml").write_text(
        f"contributions:\n  - {{source: repeatability}}\n  - {{source: probe_latch, period: {PERIOD}}}\n"
    )
    machine = yaml.safe_load((folder / "machine.yaml").read_text())
    for axis in machine["axes"].values():
        if axis["kind"] != "spindle":
            axis.update(rapid=30_000, acceleration=5.0)
            axis.pop("clamp_time", None)
    (folder / "machine.yaml").write_text(yaml.safe_dump(machine, sort_keys=False))
    strategy = yaml.safe_load((folder / "strategy.yaml").read_text())
    strategy["approach"] = {"standoff": 3.0, "search": 2.0, "feed": 180.0}
    if part:
        chosen = []
        for b, c, s, which, facets in PART:
            like = [i for i in strategy["indexations"] if (i["B"], i["C"], i["S"]) == (b, c, s)][which]
            chosen.append({**like, "facets": list(facets or like["facets"])})
        strategy.update(name="part of thesis Table 4-2", indexations=chosen)
    (folder / "strategy.yaml").write_text(yaml.safe_dump(strategy, sort_keys=False))
    return folder


def measured(folder: Path, probability: float) -> None:
    """The whole flow of the product on the real control, and what it has to give. Prints what the control does to the readings."""
    tango("plan", "-C", folder, "--post", "linuxcnc")
    with linuxcnc(folder) as control:
        resumed = run(folder, control.url)
        contacts = control.contacts()
    cell, world = read_cell(folder), read_world(folder / "world.yaml")
    readings = read_readings(folder / "readings.csv", cell.machine, cell.artefact)
    made = plan(cell)
    assert set(readings.status) == {"ok"} and len(readings) == len(made.touches) == len(contacts) - RETOUCHED * resumed
    contacts = of_these(readings.position, made.touches, contacts)

    # The position is taken at the first look at the probe that finds it on: after the contact, by less than a period's way.
    way = cell.strategy.approach.feed / 60 * PERIOD
    late = lateness(cell.machine.names, made.touches, readings.position, np.array([contact["at"] for contact in contacts]))
    assert late.min() > -1e-4 and late.max() < way + 1e-4

    # Beside the simulation, which draws the same repeatability. It goes straight from touch to touch: backlash may differ.
    tango("simulate", "-C", folder, "-o", folder / "simulated.csv")
    beside = ("compare", "-C", folder, "--with", folder / "simulated.csv", "--period", PERIOD)
    print("\n" + tango(*beside))
    found = result(*beside)
    count, latch = found["touches"], found["latch"]
    assert isinstance(count, int) and isinstance(latch, dict) and count == len(readings)
    backlash = 1e3 * sum(abs(value) for name, value in world.errors.items() if name in ("EXXb", "EYYb"))
    assert abs(found["mean_um"] - latch["mean_um"]) < 4 * latch["std_um"] / math.sqrt(count) + backlash  # type: ignore[operator]
    assert found["std_um"] == pytest.approx(latch["std_um"], rel=0.25)

    # Every parameter within the interval in which all are with this probability, by a budget that knows of the looks at the probe.
    estimate = result("estimate", "-C", folder)
    budget = result("uncertainty", "-C", folder, "--probability", probability)
    parameters, joint = budget["parameters"], budget["joint"]
    assert isinstance(parameters, dict) and isinstance(joint, dict) and set(parameters) >= set(world.errors)
    size = {n: abs(p["value"] - world.errors.get(n, 0.0)) / p["std"] for n, p in parameters.items()}
    print("error over u:", {name: round(value, 2) for name, value in size.items()}, "k_q", round(joint["rectangle"], 2))
    assert max(size.values()) < joint["rectangle"], size
    expected = math.hypot(cell.machine.probe.repeatability, way / math.sqrt(12)) * 1e3
    residual = estimate["residual"]
    assert isinstance(residual, dict)
    assert residual["std_um"] == pytest.approx(expected, rel=4 / math.sqrt(2 * residual["dof"]))

    # What the model without the control lacks is scatter.
    print(tango("diagnose", "-C", folder))
    named = {finding["cause"] for finding in result("diagnose", "-C", folder)["findings"]}  # type: ignore[attr-defined]
    assert "noise_level" in named


def run(folder: Path, url: str) -> int:
    """cell, port → how often it had to be resumed, as LinuxCNC 2.9 loses count of its own motions now and then."""
    command = [sys.executable, "-m", "tango_cnc", "run", "-C", str(folder), "--port", url, "--yes"]
    for resumed in range(10):
        done = subprocess.run(
            [*command, *(["--resume"] if resumed else [])], capture_output=True, text=True, check=False, timeout=5400
        )
        if done.returncode == 0:
            print(f"resumed {resumed} times after 'Queue is not empty after probing'")
            return resumed
        assert "a known fault of LinuxCNC" in done.stderr, done.stdout[-2000:] + done.stderr[-2000:]
    pytest.fail("resumed ten times: this is not the fault that comes now and then")


def of_these(positions: Array, touches: Sequence[object], contacts: list[dict[str, object]]) -> list[dict[str, object]]:
    """(n, k) readings, touches, contacts in their order → the contact of every reading; what was touched again is left out."""
    rest = iter(contacts)
    return [
        next(
            contact
            for contact in rest
            if contact["surface"] == touch.facet and np.abs(np.array(contact["at"]) - position).max() < CLOSE  # type: ignore[attr-defined]
        )
        for touch, position in zip(touches, positions, strict=True)
    ]


def lateness(names: Sequence[str], touches: Sequence[object], positions: Array, contacts: Array) -> Array:
    """Axes, touches, (n, k) readings and true contacts → (n,) mm, how far behind the contact along the approach."""
    linear = [names.index(name) for name in "XYZ"]
    way = np.array([np.subtract(touch.contact, touch.standoff) for touch in touches])[:, linear]  # type: ignore[attr-defined]
    away = (positions - contacts)[:, linear]
    result: Array = np.einsum("ij,ij->i", away, way / np.linalg.norm(way, axis=1, keepdims=True))
    return result


@pytest.mark.campaign
def test_a_hundred_touches_give_the_parameters_within_their_uncertainties(tmp_path: Path) -> None:
    measured(hu40t(tmp_path / "cell", part=True), 0.95)


@pytest.mark.campaign
def test_the_whole_strategy_on_the_real_control(tmp_path: Path) -> None:
    """Resumed or not, its draws are others each time: at p = 0.95 a perfect control would fail once in twenty times."""
    measured(hu40t(tmp_path / "cell", part=False), 0.999)


# What a program does when the table is not where it is expected: six touches, read from the log of the control


def words(line: str) -> dict[str, float]:
    return {letter: float(value) for letter, value in re.findall(r"([A-Z])(-?[\d.]+)", line)}


def small(
    folder: Path, moved: Mapping[str, float], obstacle: Mapping[str, object] | None = None, **options: object
) -> tuple[Path, Path]:
    """Folder, mm by which facets lie farther out, what nobody planned for → cell to plan with, cell as the table really is."""
    for name in ("planned", "true"):
        shutil.copytree(HERE / "golden" / "cell", folder / name)
        more = "".join(f", {key}: {json.dumps(value)}" for key, value in options.items())
        (folder / name / "tango.yaml").write_text(
            "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
            f"controller: {{post: linuxcnc, log: log.txt, gate: none, positioning_feed: 24000{more}}}\n"
        )
        (folder / name / "world.yaml").write_text(f"facets: {json.dumps(moved)}\n")
    if obstacle is not None:
        with (folder / "true" / "artefact.yaml").open("a") as artefact:
            artefact.write(f"obstacles: [{json.dumps(obstacle)}]\n")
    return folder / "planned", folder / "true"


def said(control: Control, cell: Path) -> tuple[list[str], str]:
    lines, error = control.run(cell)
    assert lines and lines[0].startswith("TANGO START")
    return lines[1:], error


@pytest.mark.long
def test_a_miss_and_an_early_contact_are_told_apart(tmp_path: Path) -> None:
    planned, true = small(tmp_path, {"top": 7.0, "3": -8.0})
    with linuxcnc(true) as control:
        lines, error = said(control, planned)
    assert not error and re.fullmatch(r"TANGO END \w+ 6", lines[-1])
    assert [words(line)["H"] for line in lines[:-1]] == [1, 2, 1, 2, 0, 1]


@pytest.mark.campaign
@pytest.mark.parametrize(("retreat", "flags"), [(8, [1, 2, 1, 2, 0, 1]), (6, [1])])
def test_a_facet_is_touched_twice_and_recorded_once(tmp_path: Path, retreat: int, flags: list[int]) -> None:
    """The top is 7 mm nearer than planned: early, or already there where the measuring move is to begin."""
    planned, true = small(tmp_path, {"top": 7.0, "3": -8.0})
    for folder in (planned, true):
        text = (folder / "strategy.yaml").read_text().replace("feed: 180}", f"feed: 180, find: {{feed: 800, retreat: {retreat}}}}}")
        (folder / "strategy.yaml").write_text(text)
    with linuxcnc(true) as control:
        lines, error = said(control, planned)
        contacts = control.contacts()
    assert [words(line)["H"] for line in lines if line.startswith("P")] == flags
    assert error == ("" if retreat == 8 else "PROBE MET SOMETHING ON ITS WAY")
    assert len(contacts) == (10 if retreat == 8 else 4)  # twice each; the miss never; the one on the way


@pytest.mark.long
def test_a_contact_on_the_way_ends_the_program_before_its_record(tmp_path: Path) -> None:
    """Something lies on the table where touch 2 goes down to its stand-off."""
    planned, true = small(tmp_path, {}, {"kind": "box", "low": [10, 20, 5], "high": [30, 40, 45]})
    with linuxcnc(true) as control:
        lines, error = said(control, planned)
        contacts = control.contacts()
        assert said(control, planned) == ([], "THE PROBE IS DEFLECTED"), "it still is: the program itself refuses to start"
    assert "Probe tripped during non-probe move" in error
    assert [line[:5] for line in lines] == ["P1 H1"]
    assert [contact["surface"] for contact in contacts] == ["1", "obstacle"]


@pytest.mark.long
def test_wrapped_axes_come_to_every_touch_as_the_plan_says(tmp_path: Path) -> None:
    """WRAPPED_ROTARY of the control: the sense of the last motion is what backlash depends on."""
    planned, true = small(tmp_path, {}, wrapped=True)
    with linuxcnc(true, wrapped="C") as control:
        lines, error = said(control, planned)
        contacts = control.contacts()
    assert not error and re.fullmatch(r"TANGO END \w+ 6", lines[-1])
    made = plan(read_cell(planned))
    column = made.machine.column("C")
    assert [contact["sense"][column] for contact in contacts] == last_motion(made)[:, column].tolist()  # type: ignore[index]
    for line, touch in zip(lines[:-1], made.touches, strict=True):
        assert math.remainder(words(line)["C"] - math.degrees(touch.contact[column]), 360) == pytest.approx(0, abs=1e-6)
