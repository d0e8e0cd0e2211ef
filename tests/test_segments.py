"""A run that stood still in the middle: readings say which part they are of, and the estimate carries what moved in between."""

import csv
import json
from functools import partial

import pytest
from support.runs import Control, Result, readings, run
from support.runs import cell as seven_touches  # noqa: F401  a fixture

from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell
from tango_cnc.link.entries import ProgramSent, Reading
from tango_cnc.link.readings import readings_of
from tango_cnc.plan import plan

MOVED = (0.008, -0.005, 0.003)  # mm, machine frame, towards which everything sits after the pause


@pytest.fixture
def interrupted(tmp_path):
    """An HU40T measured in two parts; from touch 201 on everything sits somewhere else."""
    folder = tmp_path / "hu40t"
    write_example(folder, "hu40t")
    size = sum(v**2 for v in MOVED) ** 0.5
    world = (folder / "world.yaml").read_text()
    effect = f"  - {{cause: step, amplitude: {size}, direction: [{', '.join(map(str, MOVED))}], at: 201, frame: machine}}\n"
    assert "effects: []\n" in world
    (folder / "world.yaml").write_text(world.replace("effects: []\n", f"effects:\n{effect}"))
    assert Result("simulate", "-C", folder).code == 0
    rows = list(csv.reader((folder / "simulated.csv").open()))
    with (folder / "simulated.csv").open("w", newline="") as out:
        csv.writer(out).writerows([[*rows[0], "segment"], *([*row, 1 + (i > 200)] for i, row in enumerate(rows[1:], 1))])
    return folder


def estimated(folder, *more):
    result = Result("estimate", "-C", folder, "--json", "-", *more)
    assert result.code == 0, result.err
    return json.loads(result.out)


@pytest.mark.few(0)
def test_the_offset_of_the_second_segment_is_found(interrupted):
    plain, carried = estimated(interrupted, "--despite"), estimated(interrupted, "--segment-offset", "machine")
    found = [carried["parameters"][f"step[201,machine].{axis}"] for axis in "xyz"]
    for parameter, true in zip(found, MOVED, strict=True):
        assert abs(parameter["value"] - true) < 4 * parameter["std"] + 1e-6
        assert parameter["std"] < 1e-3
    assert carried["residual"]["rms_um"] < 0.5 * plain["residual"]["rms_um"]


@pytest.mark.few(0)
def test_touches_without_contact_do_not_shift_where_the_segment_begins(interrupted):
    text = (interrupted / "simulated.csv").read_text().splitlines()
    text[5] = text[5].replace(",ok,", ",miss,")
    (interrupted / "simulated.csv").write_text("\n".join(text) + "\n")
    assert "step[201,machine].x" in estimated(interrupted, "--segment-offset", "machine")["parameters"]


@pytest.mark.few(0)
def test_a_run_of_one_piece_has_no_offset(interrupted):
    text = (interrupted / "simulated.csv").read_text()
    (interrupted / "simulated.csv").write_text(
        "".join(f"{line[:-1]}1\n" if line[-1] == "2" else line + "\n" for line in text.splitlines())
    )
    result = Result("estimate", "-C", interrupted, "--segment-offset", "table")
    assert result.code == 2
    assert "without interruption" in result.err


def test_a_resumed_run_numbers_its_readings_and_one_without_interruption_does_not(seven_touches):
    run(seven_touches, Control(seven_touches, stop=4), "--timeout", "0.4")
    assert readings(seven_touches, "readings.partial.csv").segment is None
    assert run(seven_touches, Control(seven_touches), "--resume").code == 0
    assert readings(seven_touches).segment.tolist() == [1, 1, 1, 1, 2, 2, 2]


def test_several_programs_of_one_run_are_one_segment(seven_touches):
    begun = partial(ProgramSent, "2026-01-01T00:00:00+00:00", "1", "M", {}, "P", "N", ())
    entries = [
        begun(part) if part else Reading(touch, "1", (0.0,) * 6, 0.0, "ok", None, None, (0,) * 6, "")
        for part, touch in [([1, 2], 0), (None, 1), ([2, 2], 0), (None, 2), ([1, 1], 0), (None, 3)]
    ]
    made = plan(read_cell(seven_touches))
    assert readings_of(entries[:4], made).segment is None
    assert readings_of(entries, made).segment.tolist() == [1, 1, 2]
