"""A post that a cell names is a program: it does not run before somebody has trusted it."""

import pytest
from test_run import STRATEGY, Result

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
    (folder / "tango.yaml").write_text(text.replace("post: fanuc", "post: mine.py"))
    return folder


COMMANDS = [
    ["check"],
    ["plan"],
    ["link-test", "--port", "socket://127.0.0.1:1", "--seconds", "0.2"],
    ["run", "--port", "socket://127.0.0.1:1", "--yes"],
]


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


@pytest.mark.untrusted
def test_a_post_of_the_command_line_is_asked_about_too(cell):
    assert "you have not trusted it" in Result("plan", "-C", cell, "--post", cell / "mine.py").err
    assert not (cell / "ran").exists()
