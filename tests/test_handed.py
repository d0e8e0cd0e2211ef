"""What a refusal hands out: commands that can be pasted whole, and what the program of a control has done when it is silent."""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import socket
from pathlib import Path

import pytest
from support.common_parts import dialect
from support.controls import GOLDEN
from support.linkparts import job
from support.proof_parts import keys_of

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.commission import experiments
from tango_cnc.files import read_cell
from tango_cnc.files.commissioning import Proof, add_proofs
from tango_cnc.link.client import Asked, Failed
from tango_cnc.link.protocols import dnc, file
from tango_cnc.texts.handed import COMMAND

START, NOTHING, CONTACT = b"TANGO START %s 3\n", b"P%d H0 X1.0 Y2.0 Z3.0 B0.0 C0.0\n", b"P%d H1 X1.0 Y2.0 Z3.0 B0.0 C0.0\n"


def call(*words: object) -> int:
    return guarded(tango.main, [str(word) for word in words], prog_name="tango", standalone_mode=False)


def commands(said: str) -> list[list[str]]:
    """what is said → the words of every command in it, as a shell has them."""
    return [shlex.split(found[1] or found[2]) for found in re.finditer(r"\"(tango [^\"]+)\"|'(tango [^']+)'", said)]


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A cell in a folder whose name has a blank."""
    write_example(tmp_path / "my cell", "trunnion")
    return tmp_path / "my cell"


def test_a_command_that_is_handed_out_can_be_pasted_from_a_folder_with_a_blank(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """ "'tango locate --within 8'", it said: of the folder where the person was, and without what had been stated."""
    assert call("locate", "-C", cell, "--program", "--within", 10, "--agrees", 0.3) == 0
    with_port, nearer = commands(capsys.readouterr().out)
    stated = ["tango", "locate", "-C", str(cell)]
    assert with_port == [*stated, "--within", "10", "--agrees", "0.3", "--port", "file:///FOLDER/TANGO.TXT?from=last", "--yes"]
    assert nearer[:-1] == [*stated, "--agrees", "0.3", "--within"] and float(nearer[-1]) < 10


@pytest.mark.parametrize("what", ["locate", "run"])
def test_where_nobody_listens_nothing_has_happened_to_the_machine(
    cell: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    """A refused port was answered with what to do after a stop: clear the alarm, move the probe up by hand."""
    if what == "run":
        cell = Path(shutil.copytree(GOLDEN, cell.with_name("golden")))
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
    assert call(what, "-C", cell, "--port", url, "--yes") == 3
    said = capsys.readouterr().err
    assert "Nothing was sent: switch the control on, or correct the port" in said
    assert "After a stop" not in said and "by hand" not in said and "is it 1" not in said


@pytest.mark.parametrize("client", [dnc.Client, file.Client])
def test_a_program_that_ends_by_itself_is_named_as_soon_as_its_record_is_late(client: type[dnc.Client | file.Client]) -> None:
    """The terminal waited 43 s, and then said that the control was silent."""
    task = job(misses=2, due=(10.0, 10.0, 10.0))
    talk = client(task, {"listen": "no"} if client is dnc.Client else {})
    talk.bytes_to_send(100_000)
    talk.receive(START % task.mark.encode() + CONTACT % 1)
    assert talk.elapsed(11.0) == []
    talk.receive(NOTHING % 2)
    assert talk.elapsed(9.0) == []
    (late,) = talk.elapsed(2.0)
    rule = f"the last touch (facet {task.plan.touches[1].facet}) met nothing. After 2 in a row that meet nothing the program ends"
    assert isinstance(late, Asked) and late.text.startswith(rule) and "NO CONTACT" in late.text and "11 s" in late.text
    assert talk.elapsed(1.0) == []
    (ended,) = talk.elapsed(30.0)
    assert isinstance(ended, Failed) and ended.why.startswith(rule) and "NO CONTACT" in ended.why
    unknown = client(job(misses=2, counted=False, due=(10.0, 10.0, 10.0)), {"listen": "no"} if client is dnc.Client else {})
    unknown.bytes_to_send(100_000)
    unknown.receive(START % task.mark.encode() + CONTACT % 1 + NOTHING % 2)
    (ended,) = unknown.elapsed(31.0)
    assert isinstance(ended, Failed) and "NO CONTACT" not in ended.why, "a post of one's own that counts nothing"


def test_before_touches_no_command_is_named_that_does_not_try_what_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """'tango commission tries these, and with --touch at the table', of a stylus held aside, which neither of them tries."""
    folder = Path(shutil.copytree(GOLDEN, tmp_path / "cell"))
    cell = read_cell(folder)
    assert cell.controller is not None
    key = keys_of(cell, dialect(cell))
    for left, says in (
        ({"deflected"}, "commission --held"),
        ({"pivots"}, "commission --touch"),
        ({"frames"}, "commission' tries it in minutes"),
    ):
        done = [Proof(e.belief, "PASS", "seen", profile=key[e.belief]) for e in experiments() if e.belief not in left]
        (folder / "commissioning.yaml").unlink(missing_ok=True)
        add_proofs(folder, cell.controller.post, done)
        assert call("run", "-C", folder, "--port", "socket://127.0.0.1:9", "--yes") == 3
        (said,) = (line for line in capsys.readouterr().err.splitlines() if line.startswith("'tango commission"))
        at = f" -C {folder} --port socket://127.0.0.1:9"
        assert at in said and says in said.replace(at, "") and said.count("tango") == 1


SOURCES = Path(__file__).parents[1] / "tango_cnc" / "commands"
WITHOUT = ("_night_", "_simulated", "serve", "accept", "fleet", "trust", "_trusted")  # pages, no -C


@pytest.mark.few(0)
def test_commands_that_results_hand_out_are_whole(
    cell: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """'tango iso230' says why, it said: of the folder where the person stood, which was another one."""
    monkeypatch.chdir(cell.parent)
    handed: dict[str, int] = {}
    for words in (
        ("check",),
        ("simulate",),
        ("estimate",),
        ("iso230",),
        ("plan", "--post", "fanuc"),
        ("history", "list"),
        ("journal", "list"),
    ):
        name = words[0]
        assert call(*words, "-C", cell.name) in (0, 1, 2), words
        said = "".join(capsys.readouterr())
        assert all(f"-C '{cell.name}'" in found for found in re.findall(r"Next: .*", said)), said
        for found in commands(re.sub(r"\b(what|that|as|of|by|a|another) '(tango [a-z]+)'", "a name", said)):
            assert found[found.index("-C") + 1] == cell.name if "-C" in found else found[1] in ("trust", "ports"), found
            handed[name] = handed.get(name, 0) + 1
    assert {"check", "estimate", "plan", "history", "journal"} <= {*handed}, handed


@pytest.mark.few(0)
def test_a_source_that_names_a_command_hands_it_out_whole() -> None:
    """A new sentence with a command in it goes through `whole`, or is raised, which makes it whole as well."""
    found = []
    for source in sorted(SOURCES.glob("*.py")):
        if source.stem.startswith(WITHOUT):
            continue
        tree = ast.parse(source.read_text(encoding="utf-8"))
        raised = {id(part) for node in ast.walk(tree) if isinstance(node, ast.Raise) for part in ast.walk(node)}
        told = {id(part) for node in ast.walk(tree) if isinstance(node, ast.Call) and shows(node) for part in ast.walk(node)}
        for node in ast.walk(tree):
            text = node.value if isinstance(node, ast.Constant) else None
            if isinstance(text, str) and COMMAND.search(text) and id(node) in told - raised:
                found.append(f"{source.name}:{node.lineno}: {text}")
    assert found == []


def shows(node: ast.Call) -> bool:
    """call → whether it writes to the screen as it is, without making commands whole."""
    name = ast.unparse(node.func)
    inner = {ast.unparse(part.func) for part in ast.walk(node) if isinstance(part, ast.Call)}
    return name in ("click.echo", "said") and not inner & {"whole", "_handed.whole"}
