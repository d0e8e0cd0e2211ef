"""Every command in output, mails and pages of a cell whose path has a blank: a shell reads it, tango has it, it finds that cell."""

from __future__ import annotations

import html
import re
import shlex
from pathlib import Path

import click
import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.texts import english
from tango_cnc.texts.handed import CELLLESS, of_cell, page_of_cell

HANDED = re.compile(r"\"(tango [a-z][^\"\n]*)\"|'(tango [a-z][^'\n]*)'|(?:^ *|Next: |, then )(tango [a-z][^,\n]*)", re.MULTILINE)
NAMED = re.compile(
    r"\b(?:what|that|as|of|by|a|another) ['\"]tango [a-z0-9 -]+['\"]", re.IGNORECASE
)  # who has done or made something
CELL = Path("shop floor", "my cell")


def call(*words: object) -> int:
    return guarded(tango.main, [str(word) for word in words], prog_name="tango", standalone_mode=False)


def handed(said: str) -> list[str]:
    """text → every command line in it."""
    return [next(line for line in one.groups() if line) for one in HANDED.finditer(NAMED.sub("", said))]


def leads_to(line: str, here: Path) -> Path | None:
    """command line, folder where it is typed → the cell that it works in; None for a command that works in none."""
    words = shlex.split(line)[1:]
    command: click.Command | None = tango
    context = click.Context(tango)
    while isinstance(command, click.Group):
        command = command.get_command(context, words.pop(0))
        assert command is not None, line
    command.make_parser(click.Context(command)).parse_args(list(words))  # raises for an option that it does not have
    if not any("-C" in option.opts for option in command.params):
        return None
    return (here / words[words.index("-C") + 1]).resolve()


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The person stands in the folder that holds the shop floor."""
    (tmp_path / CELL.parent).mkdir()
    write_example(tmp_path / CELL, "trunnion")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def looked_through(said: str, here: Path, cell: Path, least: int = 0) -> None:
    """text, folder where it is typed, cell, commands at least → each leads to the cell."""
    found = handed(said)
    assert len(found) >= least, said
    for line in found:
        place = leads_to(line, here)
        assert place is None or cell.resolve() in (place, *place.parents), line  # compensations/check-001 is one of its own


@pytest.mark.few(0)
def test_a_night_hands_out_commands_that_find_its_cell(shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """ "'tango nightly --dry-run -C /tmp/shop floor/mill'": a shell read two words of a path."""
    cell = shop / CELL
    assert call("nightly", "-C", CELL, "--dry-run") == 1
    looked_through("".join(capsys.readouterr()), shop, cell, 1)
    assert call("nightly", "-C", CELL) == 3
    looked_through("".join(capsys.readouterr()), shop, cell, 1)
    messages = [*cell.glob("nights/*/*.txt"), *cell.glob("nights/outbox/*")]
    pages = [*cell.glob("nights/*/*.html")]
    assert messages and len(pages) == 2
    for file in messages:
        looked_through(file.read_text(encoding="utf-8"), Path("/elsewhere"), cell, 1)
    for file in pages:  # no page says where the folder is: it is typed beside it
        page = html.unescape(file.read_text(encoding="utf-8"))
        looked_through(page, cell.parent, cell, 1)
        assert "in the folder that holds the folder my cell" in page
    assert call("nightly", "-C", CELL, "--status") in (0, 1)
    looked_through("".join(capsys.readouterr()), shop, cell)


@pytest.mark.long
@pytest.mark.parametrize(
    "words",
    [
        ("check",),
        ("plan", "--post", "fanuc"),
        ("estimate", "--readings", f"{CELL}/simulated.csv"),
        ("verify", "--readings", f"{CELL}/simulated.csv"),
        ("diagnose", "--readings", f"{CELL}/simulated.csv"),
        ("iso230", "--readings", f"{CELL}/simulated.csv"),
        ("uncertainty", "--readings", f"{CELL}/simulated.csv"),
        ("report", "--readings", f"{CELL}/simulated.csv"),
        ("predict", "--test", "laser-X", "--readings", f"{CELL}/simulated.csv"),
        ("compensate", "--readings", f"{CELL}/simulated.csv", "--target", "fanuc"),
        ("compensate", "--readings", f"{CELL}/simulated.csv", "--target", "fanuc", "--simulated"),
        ("locate", "--program"),
        ("commission", "--program"),
        ("history", "list"),
        ("journal", "list"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_results_hand_out_commands_that_find_their_cell(
    shop: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    assert call("simulate", "-C", CELL) == 0
    assert call(*words, "-C", CELL) in (0, 1, 2)
    looked_through("".join(capsys.readouterr()), shop, shop / CELL)
    for file in (shop / CELL).glob("report*.html"):
        looked_through(html.unescape(file.read_text(encoding="utf-8")), (shop / CELL).parent, shop / CELL, 1)


def test_every_text_with_a_command_hands_it_out_whole() -> None:
    """None of them names a folder itself: a path with a blank would be two words of it."""
    texts = {key: text for key, text in english().items() if "'tango " in text and "-C " not in text}
    assert len(texts) > 40 and not [key for key, text in english().items() if re.search(r"-C \{", text)]
    for key, text in texts.items():
        for line in handed(of_cell(text, "/shop floor/mill")):
            words = shlex.split(line)
            assert words[1] in CELLLESS or words[words.index("-C") + 1] == "/shop floor/mill", key


def test_a_command_of_a_page_is_made_whole_in_its_spelling() -> None:
    page = "<p title='x'>of &#39;tango run&#39;; then &#39;tango run --resume&#39; &amp; see &#39;tango ports&#39;</p>"
    made = page_of_cell(page, "my cell")
    assert html.unescape(made) == ("<p title='x'>of 'tango run'; then \"tango run --resume -C 'my cell'\" & see 'tango ports'</p>")
    assert page_of_cell(page, "") == page
    assert of_cell("type 'tango run' here", ".") == "type 'tango run' here"


def test_the_commands_without_a_cell_are_those() -> None:
    context = click.Context(tango)
    alone = set()
    for name in tango.list_commands(context):
        command = tango.get_command(context, name)
        one = [o for o in command.params if "-C" in o.opts] if command is not None else []
        if not isinstance(command, click.Group) and not (one and not one[0].multiple):
            alone.add(name)
    assert alone == {*CELLLESS}
