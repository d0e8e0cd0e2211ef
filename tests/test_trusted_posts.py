"""A post that a cell names is a program: it does not run before somebody has trusted it."""

import importlib.util
import py_compile
import re
from pathlib import Path

import click
import pytest
from support.profiles import spoken
from support.runs import STRATEGY, Result

from tango_cnc.cli import tango
from tango_cnc.commands import _trusted
from tango_cnc.commands.init import write_example

POST = """\
from pathlib import Path
Path(__file__).with_name("ran").touch()
"""


@pytest.fixture
def cell(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "mine.py").write_text(POST)
    text = (folder / "tango.yaml").read_text()
    assert "post: fanuc" in text
    (folder / "tango.yaml").write_text(spoken(text, "post: mine.py"))
    return folder


COMMANDS = [
    ["check"],
    ["plan"],
    ["link-test", "--port", "socket://127.0.0.1:1", "--seconds", "0.2"],
    ["run", "--port", "socket://127.0.0.1:1", "--yes"],
    ["commission", "--program"],
    ["locate", "--program"],
    ["design", "--goal", "check"],
    ["nightly"],
]
LATER = {"serve"}  # its --port is its own


def test_every_command_that_reads_a_post_or_opens_a_port_is_asked(root):
    context = click.Context(tango)
    options = {name: tango.get_command(context, name).params for name in tango.list_commands(context)}
    files = {name: root / "tango_cnc" / "commands" / f"{name.replace('-', '_')}.py" for name in options}
    loading = {name for name, file in files.items() if re.search(r"\bdialect\(|postprocessors", file.read_text(encoding="utf-8"))}
    loading |= {name for name, params in options.items() if any({"--port", "--post"} & set(p.opts) for p in params)}
    left = loading - {words[0] for words in COMMANDS} - LATER
    assert not left, f"tests/test_trusted_posts.py: COMMANDS: add words of {', '.join(sorted(left))} that make it read the post"


@pytest.mark.untrusted
@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: words[0])
def test_no_command_runs_a_post_that_was_not_trusted(cell, words):
    result = Result(words[0], "-C", cell, *words[1:])
    assert (result.code, "you have not trusted it" in result.err, f"tango trust {cell / 'mine.py'}" in result.err) == (
        2,
        True,
        True,
    )
    assert not (cell / "ran").exists()


@pytest.mark.untrusted
def test_what_was_trusted_runs_until_it_is_changed(cell):
    assert Result("trust", cell / "mine.py").code == 0
    assert "defines no POST" in Result("plan", "-C", cell).err
    assert (cell / "ran").exists()
    (cell / "ran").unlink()
    (cell / "mine.py").write_text(POST + "# another line\n")
    assert "you have not trusted it" in Result("plan", "-C", cell).err
    assert not (cell / "ran").exists()


BESIDE = {  # files beside a post, and one of them that somebody changes after it was trusted
    "a module": ("import parts", ["parts.py"]),
    "a module within a function": ("def step():\n    import parts", ["parts.py"]),
    "a module of a module": ("from parts import one", ["parts.py", "deep.py"]),
    "a package": ("import pack.inner", ["pack/__init__.py", "pack/inner.py"]),
    "a name from a package": ("from pack import inner", ["pack/__init__.py", "pack/inner.py"]),
    "a compiled module": ("import parts", ["parts.pyc"]),
    "a library": ("import parts", ["parts.cpython-311-x86_64-linux-gnu.so"]),
}


@pytest.mark.untrusted
@pytest.mark.parametrize("case", BESIDE)
def test_what_it_imports_from_beside_itself_is_trusted_with_it(cell, case):
    line, names = BESIDE[case]
    (cell / "mine.py").write_text(f"{POST}\n{line}\n")
    for name in names:
        (cell / name).parent.mkdir(exist_ok=True)
        (cell / name).write_text("import deep\n")
    (cell / "stranger.py").write_text("")
    for name in names:
        assert Result("trust", cell / "mine.py").code == 0
        (cell / "stranger.py").write_text(f"# changed before {name}\n")
        assert _trusted.known(cell / "mine.py")
        (cell / name).write_text("import deep\n# changed\n")
        result = Result("plan", "-C", cell)
        assert "you have not trusted it" in result.err and name in result.err
    assert not (cell / "ran").exists()


@pytest.mark.untrusted
def test_a_compiled_file_in_the_cell_does_not_run_instead_of_the_text_that_was_trusted(cell):
    (cell / "other.py").write_text(POST.replace('"ran"', '"other"'))
    cached = Path(importlib.util.cache_from_source(str(cell / "mine.py")))
    never = py_compile.PycInvalidationMode.UNCHECKED_HASH  # Python does not compare it with the text
    cached.parent.mkdir()
    py_compile.compile(str(cell / "other.py"), cfile=str(cached), invalidation_mode=never)
    assert Result("trust", cell / "mine.py").code == 0
    Result("plan", "-C", cell)
    assert (cell / "ran").exists() and not list(cell.rglob("other"))


@pytest.mark.untrusted
def test_a_post_of_the_command_line_is_asked_about_too(cell):
    assert "you have not trusted it" in Result("plan", "-C", cell, "--post", cell / "mine.py").err
    assert not (cell / "ran").exists()
