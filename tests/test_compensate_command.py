"""`tango compensate` as a person uses it: proposal, cap, files, undo, check, loop, history."""

from __future__ import annotations

import json
import re
import shutil
from datetime import datetime
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.compensated import ROOT

from tango_cnc.cli import guarded, tango
from tango_cnc.commands import predict
from tango_cnc.compensate import loop, targets
from tango_cnc.compensate.space import Held
from tango_cnc.loaded import AS_SEEN
from tango_cnc.records import InputError, TangoError


def run(*arguments: object) -> Result:
    from tango_cnc.cli import tango as command

    return CliRunner().invoke(command, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cells") / "mill"
    shutil.copytree(ROOT / "examples" / "three_axis_calibrated", folder)
    assert run("simulate", "-C", folder).exit_code == 0
    return folder


def copied(cell: Path, to: Path) -> Path:
    shutil.copytree(cell, to)
    return to


def test_it_writes_files_undo_steps_and_a_record(cell: Path, tmp_path: Path) -> None:
    mill = copied(cell, tmp_path / "mill")
    done = run("compensate", "-C", mill, "--target", "linuxcnc", "--simulated")
    assert done.exit_code == 0, done.output
    folder = mill / "compensations" / "001-linuxcnc"
    written = {f.name for f in folder.iterdir()}
    assert {"joint_0.comp", "compensation.hal", "compensation.ini", "undo", "steps.txt", "compensation.json"} <= written
    undo = (folder / "undo" / "joint_0.comp").read_text().split()
    assert all(up == down == nominal for nominal, up, down in zip(undo[::3], undo[1::3], undo[2::3], strict=True))
    assert run("compensate", "--check", folder).exit_code == 0
    assert [e["event"] for e in loop.history(mill)] == ["proposed"]


@pytest.mark.long
@pytest.mark.parametrize(("settings", "said"), [((), False), (("--set", "sign=1"), True)])
def test_files_that_no_reader_has_read_back_are_said_to_be_that(cell: Path, settings: tuple[str, ...], said: bool) -> None:
    done = run("compensate", "-C", cell, "--target", "fanuc", "--dry-run", *settings)
    assert done.exit_code == 0, done.output
    assert ("the files were not read back" in " ".join(done.output.split())) == said


def test_the_promise_is_of_the_files_as_the_control_reads_them(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sign that is wrong in the files alone was in no promise: it was of the numbers that were to be written."""
    module = targets.load("linuxcnc")
    plain = module.files

    def turned(request: targets.Request, held: list[Held], numbers: dict[str, float]) -> dict[str, str]:
        found: dict[str, str] = plain(request, held, {h.place: 2 * h.base - numbers[h.place] for h in held})
        return found

    def promise() -> tuple[float, float]:
        done = run("compensate", "-C", cell, "--target", "linuxcnc", "--dry-run", "--json", "-")
        found = json.loads(done.stdout)["promise"]
        return found["rms_before_um"]["value"], found["rms_after_um"]["value"]

    before, after = promise()
    monkeypatch.setattr(module, "files", turned)
    assert after < before < 0.7 * promise()[1]


@pytest.mark.long
def test_files_of_simulated_readings_need_consent_and_say_so_first(cell: Path, tmp_path: Path) -> None:
    mill = copied(cell, tmp_path / "mill")
    part, out = tmp_path / "part.ngc", tmp_path / "out.ngc"
    part.write_text("G21 G90 G94\nG1 X0. Y0. Z0. F500.\nG1 X10.\nM2\n")
    for written, wanted in (
        (mill / "compensations", ["--target", "linuxcnc"]),
        (out, [part, "-o", out, "--zero", "X=0,Y=0,Z=0"]),
    ):
        refused = run("compensate", "-C", mill, *wanted)
        assert isinstance(refused.exception, TangoError) and "--simulated" in str(refused.exception)
        assert not written.exists()
        assert run("compensate", "-C", mill, *wanted, "--simulated").exit_code == 0
    folder = mill / "compensations" / "001-linuxcnc"
    for name in ("steps.txt", loop.REMARK):
        assert (folder / name).read_text().splitlines()[0] == loop.SIMULATED
    assert next(iter(json.loads((folder / loop.RECORD).read_text()).items())) == ("simulated", loop.SIMULATED)
    assert run("compensate", "--check", folder).exit_code == 0
    assert any("SIMULATED READINGS, FOR NO MACHINE" in line for line in out.read_text().splitlines()[:2])
    predicted = run("predict", "-C", mill, part, "--zero", "X=0,Y=0,Z=0")
    assert predicted.stdout.splitlines()[0] == predict.SIMULATED
    for zero, said in (("X=0,Y=0,Z=0", "with this estimate and zero"), ("X=1,Y=0,Z=0", "another estimate or another zero")):
        again = run("predict", "-C", mill, out, "--zero", zero)
        text = str(again.exception)
        assert isinstance(again.exception, InputError) and said in text and "found the mark of a compensated program" in text
        assert "Predict the program that it was made from" in text and "a guess by its text" in text


@pytest.mark.few(0)
def test_a_change_beyond_the_cap_writes_nothing(cell: Path, tmp_path: Path) -> None:
    mill = copied(cell, tmp_path / "mill")
    done = run("compensate", "-C", mill, "--target", "linuxcnc", "--cap-mm", "0.0001", "--simulated")
    assert isinstance(done.exception, TangoError) and done.exception.exit_code == 1
    assert "allowed: 0.0001 mm" in str(done.exception) and "--cap-mm" in str(done.exception)
    assert not (mill / "compensations").exists()


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--target", "linuxnc"], "Did you mean 'linuxcnc'"),
        (["--target", "linuxcnc", "--set", "point=3"], "Did you mean 'points'"),
        (["--target", "linuxcnc", "--set", "points=300"], "2 to 256"),
        (["--target", "linuxcnc", "--set", "points=some"], "int"),
        (["--target", "linuxcnc", "--set", "kinematics=xyzac-trt-kins"], "not for wXYfZ(S)t"),
        (["--target", "linuxcnc", "--volume", "X=10:-10"], "AXIS=LOW:HIGH"),
        (["--target", "linuxcnc", "--volume", "X=-9000:0"], "within its travel"),
        (["--target", "linuxcnc", "--terms", "S1"], "no error of the machine"),
        ([], "allowed: "),
        (["--measured", "7"], "--dry-run: found beside --measured, where it does nothing"),
    ],
)
def test_wrong_input_is_answered(cell: Path, arguments: list[str], said: str) -> None:
    done = run("compensate", "-C", cell, "--dry-run", *arguments)
    assert isinstance(done.exception, TangoError) and said in str(done.exception), done.output
    assert not (cell / "compensations").exists()


def test_a_compensation_that_is_not_there_is_named(cell: Path) -> None:
    assert "no compensation 7" in str(run("compensate", "-C", cell, "--measured", 7).exception)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["compensate", "--list", "--target", "haas"], "--target: found beside --list"),
        (["compensate", "--facts", "haas", "--json", "-"], "--json: found beside --facts"),
        (["compensate", "--check", "x", "--target", "haas"], "--target: found beside --check"),
        (["compensate", "--written", "1", "--readings", "x"], "--readings: found beside --written"),
        (
            ["compensate", "-C", str(ROOT / "examples/trunnion"), str(ROOT / "README.md"), "--cap-mm", "1"],
            "--cap-mm: found beside a PROGRAM",
        ),
        (["verify", "--write-sphere", "x", "--volume"], "--volume: found beside --write-sphere"),
        (["design", "--facets", "table:400,300", "--minutes", "5"], "--minutes: found beside --facets"),
        (["design", "--judge", str(ROOT / "README.md"), "--compare"], "--compare: found beside --judge"),
        (["design", "--separate", "backlash", "step", "--minutes", "5"], "--minutes: found beside --separate"),
    ],
)
def test_what_does_nothing_beside_a_stronger_option_is_refused(arguments: list[str], said: str) -> None:
    assert said in str(run(*arguments).exception)


def test_simulated_readings_are_refused_before_anything_is_proposed(cell: Path) -> None:
    done = run("compensate", "-C", cell, "--target", "siemens")
    assert isinstance(done.exception, InputError) and "which a simulator has made" in str(done.exception)
    assert not done.output.strip() and not (cell / "compensations").exists()


@pytest.mark.long
def test_the_loop_is_closed_and_recorded(cell: Path, tmp_path: Path) -> None:
    mill = copied(cell, tmp_path / "mill")
    assert run("compensate", "-C", mill, "--target", "siemens", "--simulated").exit_code == 0
    folder = mill / "compensations" / "001-siemens"
    early = run("compensate", "-C", mill, "--measured", 1, "--readings", mill / "simulated.csv")
    assert isinstance(early.exception, InputError) and "noted as proposed" in str(early.exception)
    assert run("compensate", "-C", mill, "--written", 1).exit_code == 0
    blind = run("compensate", "-C", mill, "--target", "siemens", "--simulated")
    assert isinstance(blind.exception, InputError) and "--present" in str(blind.exception)
    assert run("simulate", "-C", mill, "--compensation", folder, "-o", mill / "after.csv", "--seed", 99).exit_code == 0
    done = run("compensate", "-C", mill, "--measured", 1, "--readings", mill / "after.csv", "--json", "-")
    assert done.exit_code == 0 and json.loads(done.stdout)["verdict"] == "kept"
    # A second one on top, over the volume of the first though other touches were made: what is in the control stays.
    again = run(
        "compensate", "-C", mill, "--target", "siemens", "--present", folder, "--readings", mill / "after.csv", "--dry-run",
        "--json", "-",
    )  # fmt: skip
    assert again.exit_code == 0, again.exception
    assert json.loads(again.stdout)["volume"] == json.loads((folder / "compensation.json").read_text())["volume"]
    values = json.loads(again.stdout)["values"]
    assert max(abs(v["new"] - v["present"]) for v in values) < 0.2 * max(abs(v["present"]) for v in values)
    # The readings that it was made from, taken by default, would have it twice. The answer names the ones made after it.
    twice = run("compensate", "-C", mill, "--target", "siemens", "--present", folder, "--simulated")
    assert isinstance(twice.exception, InputError) and "made after it in the folder" in str(twice.exception)
    assert [e["event"] for e in loop.history(mill)] == ["proposed", "written", "kept"]
    # The nights' history has the same, newest first, in its chain; taking it out again is one more entry with its reason.
    listed = json.loads(run("history", "list", "-C", mill, "--json", "-").stdout)["compensations"]
    assert [e["event"] for e in listed] == ["kept", "written", "proposed"]
    outcome = json.loads(done.stdout)
    for name in ("before_um", "promised_um", "measured_um"):
        assert listed[0][name] == outcome[name]
    assert listed[2]["promised_um"] == listed[0]["promised_um"] < listed[2]["before_um"]
    silent = run("compensate", "-C", mill, "--rolled-back", 1)
    assert isinstance(silent.exception, InputError) and "--reason" in str(silent.exception)
    assert run("compensate", "-C", mill, "--rolled-back", 1, "--reason", "the spindle was changed").exit_code == 0
    shown = run("history", "list", "-C", mill).output.splitlines()
    assert "rolled back" in shown[1] and "the spindle was changed" in shown[1] and len(shown) == 5
    assert f"at ({datetime.now().astimezone():%Z})" in shown[0] and re.search(r"\d\d:\d\d +compensation", shown[1])
    assert "4 entries" in run("history", "verify", "-C", mill).output


@pytest.mark.long
def test_the_last_compensation_is_taken_out_first(cell: Path, tmp_path: Path) -> None:
    """undo/ of the second one holds what the first one wrote."""
    mill = copied(cell, tmp_path / "mill")
    assert run("compensate", "-C", mill, "--target", "siemens", "--simulated").exit_code == 0
    shutil.copytree(mill / "compensations" / "001-siemens", mill / "compensations" / "002-siemens")
    for number in (1, 2):
        loop.note(mill, loop.one(mill, number), f"2026-11-0{number}T00:00:00Z", "written")
    back = ["compensate", "-C", mill, "--reason", "trial", "--rolled-back"]
    early = run(*back, 1)
    assert isinstance(early.exception, InputError) and "2 was written after it" in str(early.exception)
    assert [run(*back, number).exit_code for number in (2, 1)] == [0, 0]


def test_numbers_of_a_person_are_taken_with_a_note_and_another_file_is_named(cell: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("CEC X to Y at X 0 mm: 0.001\n")
    done = run("compensate", "-C", cell, "--target", "siemens", "--present", cell / "machine.yaml")
    assert "no file of numbers" in str(done.exception) and "a folder that 'tango compensate' has written" in str(done.exception)
    assert "nobody knows whether" in run("compensate", "-C", cell, "--target", "siemens", "--present", own, "--dry-run").output


@pytest.mark.long
def test_a_history_that_cannot_be_written_gets_the_event_later(cell: Path, tmp_path: Path) -> None:
    mill = copied(cell, tmp_path / "mill")
    (mill / "nightly.yaml").write_text("nightly: 1\nhistory: away/history.db\n")
    done = run("compensate", "-C", mill, "--target", "siemens", "--simulated")
    assert done.exit_code == 0 and "no such folder" in done.output
    (mill / "away").mkdir()
    assert run("compensate", "-C", mill, "--written", 1).exit_code == 0
    listed = json.loads(run("history", "list", "-C", mill, "--json", "-").stdout)["compensations"]
    assert [e["event"] for e in listed] == ["written", "proposed"]


@pytest.mark.long
def test_readings_that_see_little_of_it_decide_nothing(cell: Path, tmp_path: Path) -> None:
    mill = copied(cell, tmp_path / "mill")
    assert run("compensate", "-C", mill, "--target", "siemens", "--simulated").exit_code == 0
    assert run("compensate", "-C", mill, "--written", 1).exit_code == 0
    same = run("compensate", "-C", mill, "--measured", 1, "--readings", mill / "simulated.csv")
    assert isinstance(same.exception, InputError) and "that the compensation was made from" in str(same.exception)
    # Nothing was loaded: an estimate of few terms finds little error all the same.
    assert run("simulate", "-C", mill, "-o", mill / "after.csv", "--seed", 8).exit_code == 0
    done = run("compensate", "-C", mill, "--measured", 1, "--readings", mill / "after.csv", "--terms", "EXX1,EZZ1")
    assert "undecided: these touches see" in done.output, done.output
    whole = run("compensate", "-C", mill, "--measured", 1, "--readings", mill / "after.csv")
    assert "no help" in whole.output and "not loaded" in whole.output
    # A clock tells as well: what ended before the proposal cannot contain it.
    record = loop.one(mill, 1).record
    assert "before the compensation was proposed" in loop.older(record, ["00000000"], "2020-01-01T00:00:00Z")
    assert not loop.older(record, ["00000000"], "2999-01-01T00:00:00Z")


@pytest.mark.long
def test_it_asks_whether_the_second_run_saw_the_kinematics(tmp_path: Path) -> None:
    cradle = tmp_path / "cradle"
    shutil.copytree(ROOT / "examples" / "trunnion", cradle)
    assert run("simulate", "-C", cradle).exit_code == 0
    done = run("compensate", "-C", cradle, "--target", "linuxcnc", "--simulated", "-o", tmp_path / "elsewhere")
    assert "has no number" in done.output and "--written 1" not in done.output
    assert run("compensate", "-C", cradle, "--target", "linuxcnc", "--simulated").exit_code == 0
    noted = run("compensate", "-C", cradle, "--written", 1)
    assert noted.exit_code == 0 and "--measured 1 --readings after.csv --no-tcp" in noted.output  # as it works: the next step below
    folder, verdicts = cradle / "compensations" / "001-linuxcnc", []
    for switch in ("--no-tcp", "--tcp"):
        more = ["--no-tcp"] if switch == "--no-tcp" else []
        after = cradle / f"after{switch}.csv"
        said = run("simulate", "-C", cradle, "--compensation", folder, "-o", after, *more).output
        assert ("control off" if more else "control on") in said
        asked = run("compensate", "-C", cradle, "--measured", 1, "--readings", after)
        assert isinstance(asked.exception, InputError) and "x-rot-point" in str(asked.exception)
        loop.note(cradle, loop.one(cradle, 1), "2026-01-01T00:00:00Z", "written")
        said = run("compensate", "-C", cradle, "--measured", 1, "--readings", after, switch).output
        verdicts.append(said[said.index("compensation 1:") :].split(": ")[1])
        loop.note(cradle, loop.one(cradle, 1), "2026-01-01T00:00:00Z", "written")
    assert verdicts == [AS_SEEN, AS_SEEN]  # the kinematics; small tables of screws
    # Nothing in the control: all is left that was there, and nothing is taken off for kinematics that do not act.
    assert run("simulate", "-C", cradle, "-o", cradle / "nothing.csv", "--seed", 57).exit_code == 0
    nothing = run("compensate", "-C", cradle, "--measured", 1, "--readings", cradle / "nothing.csv", "--no-tcp").output
    assert "no help" in nothing and "Before it 30." in nothing and "and 30." in nothing and "by calculation" not in nothing, nothing


@pytest.mark.long
def test_a_wrong_sign_is_rolled_back(cell: Path, tmp_path: Path) -> None:
    """The control adds where the file was made for one that takes away: the second measurement says so."""
    mill = copied(cell, tmp_path / "mill")
    assert (
        run("compensate", "-C", mill, "--target", "siemens", "--simulated", "--set", "sign_cec=1", "--set", "sign_enc=-1").exit_code
        == 0
    )
    folder = mill / "compensations" / "001-siemens"
    assert run("compensate", "-C", mill, "--written", 1).exit_code == 0
    assert run("simulate", "-C", mill, "--compensation", folder, "-o", mill / "after.csv").exit_code == 0
    done = run("compensate", "-C", mill, "--measured", 1, "--readings", mill / "after.csv")
    assert done.exit_code == 0 and "no help" in done.output and "undo" in done.output
    assert guarded(tango.main, ["compensate", "-C", str(mill), "--measured", "1"], standalone_mode=False) == 2
    assert loop.history(mill)[-1]["event"] == "no help"
    # It is in the control until a person notes that undo/ was loaded: nothing is proposed as if the control were empty.
    blind = run("compensate", "-C", mill, "--target", "siemens", "--simulated", "--readings", mill / "after.csv")
    assert isinstance(blind.exception, InputError) and "compensation 1 (siemens) is in the control" in str(blind.exception)
    assert run("compensate", "-C", mill, "--rolled-back", 1, "--reason", "no help").exit_code == 0
    assert loop.in_control(mill) is None


@pytest.mark.long
@pytest.mark.parametrize(("sign", "said", "code"), [(-1, "as assumed", 0), (1, "turned round", 1)])
def test_a_sign_trial_decides_by_touches(cell: Path, tmp_path: Path, sign: int, said: str, code: int) -> None:
    """The simulated control adds CEC to the command: a file made for that is right, the other one is found out."""
    mill = copied(cell, tmp_path / "mill")
    trial = tmp_path / "trial"
    common = ["compensate", "-C", mill, "--target", "siemens", "--simulated", "--set", f"sign_cec={sign}"]
    done = run(*common, "--sign-trial", "CEC X to Y", "-o", trial)
    assert done.exit_code == 0 and "1. Load" in done.output, done.exception
    assert run("simulate", "-C", mill, "--compensation", trial, "-o", mill / "after.csv", "--seed", 5).exit_code == 0
    rest = ["--sign-of", trial, "--readings", mill / "simulated.csv", "--after", mill / "after.csv"]
    judged = CliRunner().invoke(tango, [str(a) for a in ["compensate", "-C", mill, *rest, "--json", "-"]], standalone_mode=False)
    assert json.loads(judged.stdout)["verdict"] == said and judged.return_value == code
    same = run(
        "compensate", "-C", mill, "--sign-of", trial, "--readings", mill / "simulated.csv", "--after", mill / "simulated.csv"
    )
    assert isinstance(same.exception, InputError) and "once more" in str(same.exception)
    assert run("simulate", "-C", mill, "-o", mill / "idle.csv", "--seed", 6).exit_code == 0
    unused = run("compensate", "-C", mill, "--sign-of", trial, "--readings", mill / "simulated.csv", "--after", mill / "idle.csv")
    assert "does not use this place" in unused.output
    (mill / "idle.csv").unlink()
    told = run("compensate", "-C", mill, *rest).output
    assert ("propose again with --set sign_cec=-1" in told) == (said == "turned round"), told
    lines = (mill / "after.csv").read_text().splitlines(keepends=True)
    (mill / "idle.csv").write_text("".join(line for line in lines if line.startswith(("touch", "20,"))))  # does not feel it
    idle = run("compensate", "-C", mill, *rest[:-1], mill / "idle.csv")
    assert "the change moves none of them" in idle.output and "inf" not in idle.output
    for place in ("CEC X to Y", "CEC Z to X"):  # one after the other, each with a folder of its own
        assert run(*common, "--sign-trial", place).exit_code == 0
    assert {f.name for f in (mill / "compensations").iterdir()} == {"sign-trial-siemens", "sign-trial-siemens-2"}
    wrong = run(*common, "--sign-trial", "CEC X to U")
    assert isinstance(wrong.exception, InputError) and "CEC X to Y" in str(wrong.exception)


def test_the_list_and_the_facts_are_complete() -> None:
    listed = run("compensate", "--list").output
    for name in targets.names():
        assert name in listed
        facts = run("compensate", "--facts", name).output
        module = targets.load(name)
        assert all(fact.text in facts and fact.source for fact in module.FACTS) and all(
            option in facts for option in module.OPTIONS
        )


@pytest.mark.long
def test_numbers_that_a_named_mistake_makes_wrong_are_not_written(tmp_path: Path) -> None:
    """Columns with the other sign: every reversal value would be entered with the wrong sign, and double the error."""
    folder = tmp_path / "trunnion"
    shutil.copytree(ROOT / "examples" / "trunnion", folder)
    world = folder / "world.yaml"
    world.write_text(re.sub(r"EXXb: \S+?(?=[,}\s])", "EXXb: 0.006", world.read_text()))
    assert run("simulate", "-C", folder).exit_code == 0
    source = next(folder.glob("*.csv"))
    head, *rows = source.read_text().splitlines()
    columns = [head.split(",").index(name) for name in ("dX", "dY")]
    turned = [[str(-int(w)) if i in columns else w for i, w in enumerate(row.split(","))] for row in rows]
    other = folder / "turned.csv"
    other.write_text("\n".join([head, *(",".join(row) for row in turned)]) + "\n")
    asked = ("compensate", "-C", folder, "--target", "fanuc", "--readings", other, "--simulated", "--cap-mm", 1, "--cap-deg", 1)
    with pytest.raises(
        TangoError, match=r"µm of what would be written come from EXXb.*, and the mistake named above makes these wrong"
    ):
        raise run(*asked).exception or AssertionError
    assert not (folder / "compensations").exists()


@pytest.mark.long
def test_readings_of_the_time_after_a_compensation_are_not_taken_as_without_it(cell: Path, tmp_path: Path) -> None:
    mill = copied(cell, tmp_path / "mill")
    assert run("compensate", "-C", mill, "--target", "centroid", "--simulated").exit_code == 0
    assert run("compensate", "-C", mill, "--written", 1).exit_code == 0
    asked = ("compensate", "-C", mill, "--target", "centroid", "--simulated", "--present", "none", "--dry-run")
    assert run(*asked).exit_code == 0
    history = mill / loop.FOLDER / loop.HISTORY
    history.write_text(re.sub(r'"utc": "\d{4}', '"utc": "2020', history.read_text()))
    with pytest.raises(InputError, match=r"--present: found none, and .*, which ended at .*, after compensation 1 had been noted"):
        raise run(*asked).exception or AssertionError
    assert run(*asked, "--despite").exit_code == 0
    mine = mill / "mine.csv"
    assert run("simulate", "-C", mill, "-o", mine, "--seed", 5).exit_code == 0
    (mill / "mine.origin.json").unlink()
    with pytest.raises(InputError, match=r"mine\.csv, and nothing beside it says when it was made; compensation 1 had been noted"):
        raise run(*asked, "--readings", mine).exception or AssertionError
