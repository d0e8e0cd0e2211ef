"""The line of docs/commissioning.md that starts the simulated control of a dialect, from the first hour to the first readings."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from support.rows import added, command, writing

from postprocessors import load, mark_of, names
from sim_controller.__main__ import run
from sim_controller.named import controls
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.files.commissioning import read_commissioning

ROOT = Path(__file__).parent.parent
ROW = re.compile(r"^\| (\w+) \| `(\{.*\})` \| `python -m (sim_controller .*)` \|$", re.MULTILINE)
ROWS = {name: (profile, line) for name, profile, line in ROW.findall((ROOT / "docs" / "commissioning.md").read_text("utf-8"))}
STRATEGY = f"""\
name: the first hour
approach: {{standoff: 10, search: 5, feed: 180}}
indexations:
  - {{S: 0, B: 0, C: 0, facets: {list(range(3, 29))}}}
  - {{S: 0, B: 0, C: 90, facets: [3, 5]}}
"""


class Terminal(io.StringIO):
    """A person who has typed already."""

    def isatty(self) -> bool:
        return True


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


def called(dialect: str, *arguments: object) -> str:
    """dialect, words of a command → what it says beside its result. Fails with the row of the table and what the command said."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        code = call(*arguments)
    at = f"docs/commissioning.md, Try it without a machine, row {dialect}: {ROWS[dialect][0]}; python -m {ROWS[dialect][1]}"
    assert code == 0, f"{at}\ntango {' '.join(map(str, arguments))} ended with {code}:\n{said.getvalue()}"
    return said.getvalue()


def cell_of(folder: Path, dialect: str) -> Path:
    """folder, dialect → a cell there as the table has it, with a port and a file of its own."""
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    controller = yaml.safe_load(ROWS[dialect][0])
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = str(controller["port"]).replace("8193", str(free.getsockname()[1]))
    controller["port"] = port.replace("/tmp/TANGO.TXT", str(folder / "TANGO.TXT"))
    text = (folder / "tango.yaml").read_text()
    (folder / "tango.yaml").write_text(text[: text.index("controller:")] + yaml.safe_dump({"controller": controller}))
    return folder


@contextlib.contextmanager
def started(cell: Path, dialect: str, *more: object) -> Iterator[None]:
    """cell, dialect, more options → its line of the table is carried out."""
    words = [*ROWS[dialect][1].split(), *map(str, more)]
    with subprocess.Popen(
        [sys.executable, "-m", *(str(cell) if word == "cell" else word for word in words)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline().strip()
            yield
        finally:
            process.kill()


def row(dialect: str) -> str:
    """dialect → its row, or that of a relative; the option that names the language stands there where it is needed."""
    language = load(dialect).language
    known = dialect in controls()
    relative_of = next((name for name in (dialect, *sorted(ROWS)) if name in ROWS and load(name).language == language), "")
    profile, line = ROWS.get(relative_of) or other(dialect)
    line = re.sub(r" --language \S+", "", line)
    relative = re.search(r"post: (\w+)", profile)
    assert relative is not None
    stated = profile.replace(relative[0], f"post: {dialect}")
    return f"| {dialect} | `{stated}` | `python -m {line}{'' if known else f' --language {language}'}` |"


def other(dialect: str) -> tuple[str, str]:
    """dialect of a new language → what its post has to state, on the port that its programs travel by, and the command."""
    post = load(dialect)
    way = {"dnc": "socket://127.0.0.1:8193", "grbl": "grbl+socket://127.0.0.1:8193"}.get(post.link, "file:///tmp/TANGO.TXT")
    asked = "".join(f", {option.name}: none" for option in post.options if option.must)
    return f"{{post: {dialect}, port: '{way}'{asked}}}", "sim_controller --cell cell"


def settled(text: str, rows: list[str]) -> str:
    """page, rows → the page with them, in place of those of the same dialects."""
    for line in rows:
        dialect = line.split(" | ")[0].strip("| ")
        text = added(re.sub(rf"(?m)^\| {dialect} \| `{{post: .*\n", "", text), HEAD, line)
    return text


def test_a_row_that_was_written_before_its_control_had_a_name_is_written_anew() -> None:
    """Its line kept `--language`, two long tests waited a minute each for a control that was another one, and nothing said why."""
    rows = [row("brother"), row("fanuc")]
    stale = "\n".join([HEAD, "|---|---|---|", *(line.replace(" cell`", " cell --language macro_b`") for line in rows), "", "End"])
    assert settled(stale, rows) == "\n".join([HEAD, "|---|---|---|", *rows, "", "End"])


HEAD = "| dialect | `controller:` in tango.yaml | the simulated control |"
WRITE = command("tests/test_commission_simulated.py -k table")


def test_the_table_has_a_line_for_every_dialect() -> None:
    page = ROOT / "docs" / "commissioning.md"
    text = page.read_text("utf-8")
    missing = [row(name) for name in names() if f"{row(name)}\n" not in text]
    if missing and writing():
        page.write_text(settled(text, missing), encoding="utf-8")
        return
    assert not missing, f"docs/commissioning.md, Try it without a machine: {WRITE} writes what is missing:\n" + "\n".join(missing)
    gone = set(ROWS) - set(names())
    assert not gone, f"docs/commissioning.md, Try it without a machine: no dialect has the names {', '.join(sorted(gone))}"


@pytest.mark.parametrize("dialect", ["centroid", "fanuc", "grbl", "mach3", "okuma"])
def test_the_row_of_a_new_language_is_the_one_that_works(dialect: str) -> None:
    """It had a file for every post, and lacked what has to be stated: commission ended with 2."""
    assert other(dialect) == ROWS[dialect]


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "dialect", [name if name == "mach3" else pytest.param(name, marks=pytest.mark.long) for name in sorted(ROWS)]
)
def test_the_line_of_a_dialect_goes_from_commissioning_to_readings(dialect: str, tmp_path: Path) -> None:
    """Nine could not be started by docs alone, and a program that lay there was carried out before anybody waited for it."""
    cell = cell_of(tmp_path / "cell", dialect)
    called(dialect, "commission", "-C", cell, "--program")  # it lies there from now on
    with started(cell, dialect):
        time.sleep(1.0)
        records = cell / "TANGO.TXT"
        assert not records.exists() or not records.read_text(), "nobody waits for it"
        called(dialect, "commission", "-C", cell, "--answers", "yes")
        called(dialect, "locate", "-C", cell, "--yes")
        called(dialect, "run", "-C", cell, "--yes")
    verdicts = {proof.belief: proof.verdict for proof in read_commissioning(cell)}
    assert "FAIL" not in verdicts.values() and verdicts["alive"] == verdicts["directions"] == "PASS"
    found = json.loads((cell / "readings.json").read_text())
    assert found["ok"] == found["touches"] > 20


@pytest.mark.few(0)
@pytest.mark.parametrize("dialect", sorted(ROWS))
def test_the_simulated_person_holds_the_stylus_and_a_sound_control_stops(
    dialect: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It had no hand: deflected FAIL on a sound control, and locate and run refused it from then on.

    Who brings programs by hand was asked to hold the stylus while the control still had the moves in the air, under the same name.
    """
    cell, ledger = cell_of(tmp_path / "cell", dialect), tmp_path / "ledger.jsonl"
    monkeypatch.setattr(sys, "stdin", Terminal("y\n" * 60))
    with started(cell, dialect, "--ledger", ledger):
        said = called(dialect, "commission", "-C", cell, "--timeout", "6", "--no-dial")
        monkeypatch.setattr(sys, "stdin", io.StringIO())
        called(dialect, "locate", "-C", cell, "--yes")  # and nobody holds it any more
    assert {proof.belief: proof.verdict for proof in read_commissioning(cell)}["deflected"] == "PASS"
    files = [file for file in (cell / "commissioning" / "program").glob("*") if file.suffix != ".csv"]
    (held,) = [text for file in files if "HOLD THE STYLUS ASIDE" in (text := file.read_text(errors="replace"))]
    if "file://" in ROWS[dialect][0]:
        before_hold, asked, _ = said.partition("Do you hold it?")
        load_it = before_hold.rindex("and load it before you go on")
        assert asked and f"PROGRAM {mark_of(held).upper()}" in before_hold[load_it:]
    events = [json.loads(line) for line in ledger.read_text().splitlines()]
    assert not any(event["event"] == "collision" for event in events)
    if load(dialect).language != "grbl":  # which is asked line by line, and has no programs
        begins = [row for row, event in enumerate(events) if event["event"] == "program" and event["state"] != "ended"]
        second = events[begins[1] : begins[2]]
        assert not any(event["event"] in ("rapid", "contact") or event.get("result") == "miss" for event in second), "it went on"


@pytest.mark.long
def test_whoever_ends_it_while_it_runs_is_asked_nothing_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It asked five questions, and a service never ended, as nobody answered them."""
    cell, heard = cell_of(tmp_path / "cell", "fanuc"), []

    def end(step: object) -> None:
        heard.append(step)
        if len(heard) == 3:
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr("tango_cnc.commands.commission._told", end)
    typed = Terminal("y\n" * 60)
    monkeypatch.setattr(sys, "stdin", typed)
    with started(cell, "fanuc", "--speed", 30):
        assert call("commission", "-C", cell) == 3
    said = capsys.readouterr().err
    assert "stopped by the user" in said and "The program stopped" not in said and "goes on with it: press feed hold" in said
    assert typed.tell() < len(typed.getvalue()), "answers are left"
    assert not read_commissioning(cell)


@pytest.mark.few(0)
def test_a_macro_that_mach3_does_not_have_is_no_silent_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit status 0, not a word, and no record."""
    cell = cell_of(tmp_path / "cell", "mach3")
    assert call("commission", "-C", cell, "--program") == 0
    program, records = cell / "commissioning" / "program" / "tango.tap", tmp_path / "R"
    alone = Path(shutil.copy(program, tmp_path / "tango.tap"))
    capsys.readouterr()
    assert run(["--cell", str(cell), "--start", str(alone), "--records", str(records)]) == 3
    said = capsys.readouterr().err
    assert "M880 (no macro of this name)" in said and "--stored FILE" in said and not records.read_text()
    assert run(["--cell", str(cell), "--start", str(program), "--records", str(records)]) == 0
    assert "TANGO END" in records.read_text()


@pytest.mark.parametrize(
    ("port", "options", "complaint"),
    [
        ("socket://192.168.1.20:8193", [], "port 'socket://192.168.1.20:8193' in the cell; allowed: one of them, or port: of this"),
        ("/dev/ttyUSB0", [], "found none of --tcp, --pty, --records, and port '/dev/ttyUSB0' in the cell"),
        ("file:///tmp/R", ["--pty", "--records", "R"], "found several of --tcp, --pty, --records; allowed: one of them"),
    ],
)
def test_a_port_that_is_not_on_this_computer_is_refused(
    port: str, options: list[str], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_example(tmp_path / "cell", "hu40t")
    settings = tmp_path / "cell" / "tango.yaml"
    settings.write_text(settings.read_text().replace("socket://127.0.0.1:8193", port))
    assert run(["--cell", str(tmp_path / "cell"), *options]) == 2
    assert complaint in capsys.readouterr().err
