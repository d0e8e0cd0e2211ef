"""What `tango check` says before anything moves, and that it comes true."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest
import yaml
from support.profiles import spoken

from postprocessors import names
from tango_cnc.cli import guarded, tango
from tango_cnc.duration import duration
from tango_cnc.files import read_cell
from tango_cnc.plan import plan


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], standalone_mode=False)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    assert call("init", tmp_path / "cell") == 0
    return tmp_path / "cell"


@pytest.fixture
def short(cell: Path) -> Path:
    """The same with the first four indexations."""
    file = cell / "strategy.yaml"
    strategy = yaml.safe_load(file.read_text(encoding="utf-8"))
    file.write_text(yaml.safe_dump({**strategy, "indexations": strategy["indexations"][:4]}), encoding="utf-8")
    return cell


def touches_of(cell: Path) -> int:
    return sum(len(indexation.facets) for indexation in read_cell(cell).strategy.indexations)


def checked(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, dict]:
    capsys.readouterr()
    status = call("check", *arguments, "--json", "-")
    return status, json.loads(capsys.readouterr().out)


@pytest.mark.few(0)
def test_expected_standard_deviations_are_those_of_the_estimate(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    known = yaml.safe_load((cell / "tango.yaml").read_text(encoding="utf-8"))
    known.pop("controller")  # nothing is posted and read back: that is not what is asked here
    (cell / "tango.yaml").write_text(yaml.safe_dump(known), encoding="utf-8")
    status, before = checked(capsys, "-C", cell)
    assert status == 0
    assert call("simulate", "-C", cell) == 0
    capsys.readouterr()
    assert call("estimate", "-C", cell, "--json", "-") == 0
    after = json.loads(capsys.readouterr().out)
    assert set(before["expected_std"]) == set(after["parameters"]) | set(after["stylus"])
    scatter = after["residual"]["std_um"] / 0.7  # found from the readings, against the stated one
    for name, parameter in after["parameters"].items():
        assert parameter["std"] == pytest.approx(before["expected_std"][name]["std"] * scatter, rel=0.1), name
    assert before["condition_number"] == pytest.approx(after["condition_number"], rel=0.02)
    assert before["dof"] == after["residual"]["dof"]
    assert before["touches"] == sum(before["facets"].values()) == 393


@pytest.mark.few(0)
def test_condition_number_of_the_public_cell_is_the_published_one(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, found = checked(capsys, "-C", shared / "contract" / "hu40t")
    assert found["condition_number"] == pytest.approx(1.7e4, rel=0.05)


def test_a_strategy_that_leaves_parameters_unseen_is_named_in_words(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "strategy.yaml").write_text(
        "name: one indexation\napproach: {standoff: 10, search: 5, feed: 180}\n"
        "indexations: [{B: 0, C: 0, facets: [3, 4, 5, 9, 10, 12, 16, 19, 22, 25]}]\n",
        encoding="utf-8",
    )
    capsys.readouterr()
    assert call("check", "-C", cell) == 1
    text = capsys.readouterr().out
    assert "cannot be seen" in text and "EX0C" in text
    assert "touched once only" in text


@pytest.mark.few(0)
def test_touches_that_a_straight_stylus_cannot_make_are_counted_and_listed_and_the_rest_is_without_them(
    shared: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    contract = shared / "contract" / "hu40t"
    status, found = checked(capsys, "-C", contract)
    assert status == 0 and found["refused"] is None
    assert (found["touches"], found["planned_touches"], len(found["left_out"]), found["doubtful"]) == (393, 358, 35, [])
    assert "facet 10, indexation 1" in found["left_out"][0] and "away from the spindle" in found["left_out"][0]
    assert sum(found["facets"].values()) == 358
    made = plan(read_cell(contract))
    assert found["predicted_time_s"]["probe"] == pytest.approx(358 * 10 / 3)
    assert sum(found["predicted_time_s"].values()) == pytest.approx(sum(duration(made).values()))  # no post: nothing is proven
    assert call("check", "-C", contract) == 0
    said = capsys.readouterr().out
    assert "358 of 393 touches on 36 facets at 28 indexations" in said
    assert "a straight stylus cannot make the other 35: left out of the program, and of what follows:" in said


@pytest.mark.long
def test_what_is_lost_with_the_touches_that_are_left_out_is_told(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With them it is what `--obstructed warn` would measure: less scatter of every parameter, EXXb by a third."""
    contract = shared / "contract" / "hu40t"
    _, found = checked(capsys, "-C", contract)
    status, whole = checked(capsys, "-C", contract, "--obstructed", "warn")
    assert status == 0 and (whole["planned_touches"], len(whole["doubtful"]), whole["left_out"]) == (393, 35, [])
    assert found["with_left_out"] == {"touches": 393} | {key: whole[key] for key in found["with_left_out"] if key != "touches"}
    assert (found["dof"], found["with_left_out"]["dof"]) == (307, 342)
    more, less = found["with_left_out"]["expected_std"], found["expected_std"]
    worse = {name: less[name]["std"] / more[name]["std"] for name in less}
    assert min(worse.values()) > 1 and max(worse, key=worse.__getitem__) == "EXXb"
    call("check", "-C", contract)
    assert "expected std of EXXb, which gains most, 0.155 instead of 0.228 µm" in capsys.readouterr().out


TILTED = """\
name: a table that is only ever tilted one way
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, B: 0, C: 0, facets: [3, 5, 7, 11, 12, 13, 16, 19, 22, 25]}
  - {S: 0, B: 0, C: 90, facets: [3, 5, 7, 11, 12, 13, 16, 19, 22, 25]}
  - {S: 90, B: 0, C: 0, facets: [3, 5, 7, 11, 12, 13, 16, 19, 22, 25]}
  - {S: 0, B: 60, C: 0, facets: [11, 12, 13, 15]}
"""


@pytest.mark.long
def test_what_cannot_be_seen_without_the_touches_that_are_left_out_is_named(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only touches that face away would tell how C stands to B, and how long the stylus is."""
    (cell / "strategy.yaml").write_text(TILTED, encoding="utf-8")
    status, found = checked(capsys, "-C", cell)
    assert status == 1 and found["planned_touches"] == 30 and found["indexations"] == 3
    seen, whole = set(found["expected_std"]), set(found["with_left_out"]["expected_std"])
    assert not {"EC0B", "EZt"} & seen and {"EC0B", "EZt"} <= whole
    assert call("check", "-C", cell) == 1
    said = capsys.readouterr().out
    assert re.search(r"with them \(--obstructed warn, .*\) .*EC0B, EZt could be seen", said)
    assert "cannot be seen: EZt, EZZ1, EC0B cannot be separated from the positions of the facets" in said


@pytest.mark.few(0)
def test_what_plan_refuses_is_said_in_its_words_and_what_is_left_is_checked(
    short: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A post stands in front of facet 3."""
    cell, touches = short, touches_of(short)
    text = (cell / "artefact.yaml").read_text(encoding="utf-8")
    point = yaml.safe_load(text)["facets"][3]["point"]
    normal = yaml.safe_load(text)["facets"][3]["normal"]
    x, y, z = (p + 12 * n for p, n in zip(point, normal, strict=True))
    box = f"obstacles:\n  - {{kind: box, low: [{x - 5}, {y - 5}, {z - 5}], high: [{x + 5}, {y + 5}, {z + 40}]}}\n"
    (cell / "artefact.yaml").write_text(re.sub(r"obstacles: .*\n", "", text) + box, encoding="utf-8")
    status, found = checked(capsys, "-C", cell)
    assert status == 1 and found["touches"] == touches and found["planned_touches"] == touches - len(found["left_out"]) < touches
    assert "touches cannot be made with a straight probe" in found["refused"] and "would hit obstacle 1" in found["refused"]
    assert call("plan", "-C", cell) == 2
    assert found["refused"] in capsys.readouterr().err
    assert call("check", "-C", cell) == 1
    assert "what 'tango plan' refuses of this cell:" in capsys.readouterr().out


def test_a_travel_that_is_exceeded_is_an_error_with_the_touch(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (cell / "machine.yaml").read_text(encoding="utf-8")
    (cell / "machine.yaml").write_text(text.replace("travel: [-400, 400]", "travel: [-190, 400]"), encoding="utf-8")
    assert call("check", "-C", cell) == 2
    error = capsys.readouterr().err
    assert "touch" in error and "facet" in error and "-190" in error


@pytest.mark.few(0)
def test_predicted_time_is_the_sum_of_its_parts(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, found = checked(capsys, "-C", short)
    parts = found["predicted_time_s"]
    assert all(math.isfinite(s) and s >= 0 for s in parts.values()) and len(parts) > 2
    assert sum(parts.values()) > 5 * 60


@pytest.mark.long
def test_a_program_takes_the_time_in_which_it_proves_the_probe_alive(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A finger: 20 s of slow motion, 5 s to let go, 10 mm back at 3000 mm/min. A facet: down to it, 10 mm at 180 mm/min, back."""
    _, found = checked(capsys, "-C", short)
    assert found["predicted_time_s"]["prove the probe alive"] == pytest.approx(25.2)
    profile = (short / "tango.yaml").read_text(encoding="utf-8")
    for which, low, high in (("none", 0, 0), ("facet", 10 / 3, 60)):
        (short / "tango.yaml").write_text(profile.replace("post: fanuc", f"post: fanuc\n  gate: {which}"), encoding="utf-8")
        _, found = checked(capsys, "-C", short)
        assert low <= found["predicted_time_s"].get("prove the probe alive", 0) <= high


def test_axes_that_index_turn_one_after_the_other(cell: Path) -> None:
    """As in the programs: B and the spindle at a turn in 6 s, C in 3 s, 5 rad/s², B and C 1.5 s to clamp."""
    made = plan(read_cell(cell))
    speed = {"B": math.tau / 6, "C": math.tau / 3, "S": math.tau / 6}
    at: dict[str, float] = {}
    wanted = 0.0
    for move in made.moves:
        for name in move.target if move.kind == "index" else ():
            way = abs(move.target[name] - at.get(name, move.target[name]))
            at[name] = move.target[name]
            if way:
                long = way * 5 >= speed[name] ** 2
                wanted += way / speed[name] + speed[name] / 5 if long else 2 * math.sqrt(way / 5)
                wanted += 1.5 * (name != "S")
    assert duration(made)["index and clamp"] == pytest.approx(wanted)


@pytest.mark.long
def test_protected_moves_take_the_positioning_feed_of_the_post(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One touch, counted by hand: 10 mm at 180 mm/min; off and back 10 mm at 50 mm/s and 2 m/s²: 10/50 + 2 · 50/2000 s."""
    _, usual = checked(capsys, "-C", short)
    count, usual = usual["touches"], usual["predicted_time_s"]
    assert usual["probe"] == pytest.approx(count * 10 / 3)
    assert usual["back off"] == pytest.approx(count * (10 / 50 + 2 * 50 / 2000))
    profile = (short / "tango.yaml").read_text(encoding="utf-8")
    (short / "tango.yaml").write_text(profile.replace("post: fanuc", "post: fanuc\n  positioning_feed: 1500.0"), encoding="utf-8")
    _, slow = checked(capsys, "-C", short)
    assert slow["positioning_feed"] == 1500 and slow["predicted_time_s"]["probe"] == usual["probe"]
    assert 1.5 * usual["retract and clear"] < slow["predicted_time_s"]["retract and clear"] < 2 * usual["retract and clear"]


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("controller", "words"),
    [
        ("post: fanucc", f"tango.yaml:8: controller.post: found 'fanucc'; allowed: {names()[0]}, .* Did you mean 'fanuc'"),
        ("post: fanuc\n  reste: G17", "tango.yaml:9: controller: found the unknown key 'reste'; .* Did you mean 'reset'"),
        ("post: fanuc\n  decimals: 5", "tango.yaml:9: controller.decimals: found 5; allowed: 3, 4"),
        (
            "post: fanuc\n  clamp: {D: M10}",
            r"tango.yaml:9: controller.clamp: found 'D': 'M10'; allowed: a word such as M10 for B, C",
        ),
        ("post: fanuc\n  reset: G17 G40 G80 G90 G94", "something moves before G49 M5 is stated, see controller.reset"),
    ],
)
def test_what_plan_refuses_in_the_profile_is_refused_here_too(
    cell: Path, capsys: pytest.CaptureFixture[str], controller: str, words: str
) -> None:
    profile = (cell / "tango.yaml").read_text(encoding="utf-8")
    (cell / "tango.yaml").write_text(profile.replace("post: fanuc", controller), encoding="utf-8")
    assert call("check", "-C", cell) == 2
    assert re.search(words, capsys.readouterr().err)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "socket://",
            "sockte://",
            r"tango.yaml:10: controller.port: found 'sockte://.*', in it found scheme 'sockte'; allowed: serial://, ",
        ),
        ("terms: S3", "terms: s3", "tango.yaml:6: terms: found 's3'; allowed: S1, .* Did you mean 'S3'"),
        (
            "machine: machine.yaml",
            "machine: machin.yaml",
            "tango.yaml:3: machine: found 'machin.yaml', no such file; .* Did you mean 'machine.yaml'",
        ),
        pytest.param(  # a plan is made before it is noticed
            *("terms: S3", "terms: S3, EYX2", r"tango.yaml:6: terms: found 'S3, EYX2', .* Write a list: \[S3, EYX2\]"),
            marks=pytest.mark.long,
        ),
        ("post: fanuc", "post:", "tango.yaml:8: controller.post: found nothing; allowed: the name of a dialect"),
    ],
)
def test_a_slip_in_tango_yaml_is_told_with_its_line(
    cell: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, words: str
) -> None:
    profile = (cell / "tango.yaml").read_text(encoding="utf-8")
    (cell / "tango.yaml").write_text(profile.replace(old, new), encoding="utf-8")
    assert call("check", "-C", cell) == 2
    assert re.search(words, capsys.readouterr().err)


FORGETFUL = """
from dataclasses import replace
from postprocessors.fanuc import POST as FANUC

def retract(job, leg):
    return iter(()) if leg.touch.number == len(job.plan.touches) else FANUC.retract(job, leg)

POST = replace(FANUC, retract=retract)
"""


@pytest.mark.few(0)
def test_a_turn_of_the_spindle_that_a_run_would_refuse_is_refused_here(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = short / "strategy.yaml"
    strategy = yaml.safe_load(file.read_text(encoding="utf-8"))
    first = strategy["indexations"][0]
    file.write_text(yaml.safe_dump({**strategy, "indexations": [first, {**first, "S": 90}]}), encoding="utf-8")
    known = yaml.safe_load((short / "tango.yaml").read_text(encoding="utf-8"))
    for port, status in (("grbl+socket://127.0.0.1:23", 2), ("grbl+socket://127.0.0.1:23?orient=m19", 1)):
        known["controller"] = {"post": "grbl", "port": port}
        (short / "tango.yaml").write_text(yaml.safe_dump(known), encoding="utf-8")
        capsys.readouterr()
        assert call("check", "-C", short) == status
        said = capsys.readouterr().err
        assert ("tango.yaml:3: controller.port: found" in said and "turns the spindle" in said) == (status == 2)
        assert (f"Next: tango plan -C {short}" in said) == (status == 1)  # 1: two indexations determine little


def test_the_whole_program_is_read_back(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A post of one's own that forgets the last way up only."""
    cell, last = short, len(plan(read_cell(short)).touches)
    (cell / "forgetful.py").write_text(FORGETFUL, encoding="utf-8")
    profile = (cell / "tango.yaml").read_text(encoding="utf-8")
    (cell / "tango.yaml").write_text(spoken(profile, "post: ./forgetful.py\n  probe_state: none"), encoding="utf-8")
    assert call("check", "-C", cell) == 2
    said = capsys.readouterr()
    assert f"the program ends before the retract move of touch {last}" in said.err and not said.out


@pytest.mark.few(0)
def test_numbers_that_are_words_need_no_quotes_and_terms_have_to_be_stated(short: Path) -> None:
    cell, unseen = short, 1  # four indexations do not tell everything, which is no refusal
    profile = (cell / "tango.yaml").read_text(encoding="utf-8")
    (cell / "tango.yaml").write_text(profile.replace("post: fanuc", "post: fanuc\n  print_format: 53"), encoding="utf-8")
    assert call("check", "-C", cell) == unseen
    assert call("check", "-C", cell, "--terms", "") == 2
