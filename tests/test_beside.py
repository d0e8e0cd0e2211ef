"""Options that act beside another one only: without it they are refused, and none is ignored in silence."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example

FIRST = {"capability": ("repeatability",), "reproduce": ("4-6",)}  # arguments that a command has to have
SAID = re.compile(
    r"^With ((?:--[a-z-]+|PROGRAM)(?:,? (?:or )?(?:--[a-z-]+|PROGRAM))*)[:,.]|, for (--[a-z-]+(?: and --[a-z-]+)*)\.$"
)
ALSO = {"verify": ("--sphere-at", "--sphere-diameter", "--levels", "--over", "--map", "--cmm-scale"), "uncertainty": ("--conform",)}
NOT = {"--tcp"}  # of a proposal, too: how the readings were made


def leaves(name: tuple[str, ...] = (), command: click.Command = tango) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """→ (words, command) of every command that does something."""
    if not isinstance(command, click.Group):
        yield name, command
        return
    context = click.Context(command)
    for each in command.list_commands(context):
        found = command.get_command(context, each)
        assert found is not None
        yield from leaves((*name, each), found)


def value(option: click.Option) -> tuple[str, ...]:
    """option → words after its name that its type takes."""
    if option.is_flag:
        return ()
    kind: Any = option.type
    if isinstance(kind, click.Choice):
        return (str(kind.choices[0]),)
    if isinstance(kind, click.IntRange | click.FloatRange):
        return (str(1 if kind.min is None or kind.min < 1 else kind.min),)
    return ("1",) * option.nargs


EVERY = [
    pytest.param(words, option, id=f"{' '.join(words)} {max(option.opts, key=len)}")
    for words, command in leaves()
    for option in command.params
    if isinstance(option, click.Option)
    and not NOT & {*option.opts}
    and (SAID.search(option.help or "") or {*option.opts} & {*ALSO.get(words[0], ())} or getattr(option, "beside", ()))
]


@pytest.mark.few(20)
@pytest.mark.parametrize(("words", "option"), EVERY)
def test_an_option_that_does_nothing_alone_is_refused_alone(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    option: click.Option,
) -> None:
    """'tango nightly --at 23:30' measured at once, 'tango verify --sphere-at' tested another place: neither said a word."""
    write_example(tmp_path / "cell", "trunnion")
    monkeypatch.chdir(tmp_path / "cell")
    name = max(option.opts, key=len)
    stated = [*words, *FIRST.get(words[0], ()), name, *value(option)]
    assert guarded(tango.main, stated, prog_name="tango", standalone_mode=False) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"tango: {name}: found") and "without" in said, said
    found = SAID.search(option.help or "")
    assert found is None or re.findall(r"--[a-z-]+|PROGRAM", found[1] or found[2])[0] in said


ALONE = [
    pytest.param(words, option, other, id=f"{' '.join(words)} {max(option.opts, key=len)} {max(other.opts, key=len)}")
    for words, command in leaves()
    for option in command.params
    if hasattr(option, "acting")
    for other in command.params
    if isinstance(other, click.Option) and other is not option and not {*other.opts} & {*option.acting}
]


@pytest.mark.few(40)
@pytest.mark.parametrize(("words", "option", "other"), ALONE)
def test_an_option_that_does_nothing_beside_a_stronger_one_is_refused(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    option: click.Option,
    other: click.Option,
) -> None:
    """'tango run --watch --port' followed the cell's own run, 'tango locate --readings --yes' moved nothing, without a word."""
    write_example(tmp_path / "cell", "trunnion")
    monkeypatch.chdir(tmp_path / "cell")
    stated = [*words, *(word for each in (option, other) for word in (max(each.opts, key=len), *value(each)))]
    assert guarded(tango.main, stated, prog_name="tango", standalone_mode=False) == 2
    said = capsys.readouterr().err
    names = [max(each.opts, key=len) for each in (option, other)]
    assert said.startswith("tango: -") and "found" in said and all(name in said for name in names), said


def test_what_an_option_acts_beside_is_there() -> None:
    """One that is spelt otherwise would never be found: the option would be refused always."""
    for words, command in leaves():
        context = click.Context(command)
        there = {name for p in command.params for name in (*p.opts, p.make_metavar(context).strip("[]."))}
        for option in command.params:
            assert there >= {*getattr(option, "beside", ()), *getattr(option, "acting", ())}, (words, option.name)
    assert len(EVERY) > 30 and len(ALONE) > 40


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("verify", "--volume", "--subsets"), "--subsets: found without held-out touches and --cmm"),
        (("design", "--stylus-within", "0.01"), "--stylus-within: found without a check"),
        (("capability", "drift", "--block", "5"), "--block: found capability drift; allowed: capability wetness"),
        (("nightly", "--install", "cron", "--port", "socket://127.0.0.1:1"), "--port: found with --install, and the timer would"),
        (("nightly", "--install", "cron", "--simulated"), "--simulated: found with --install"),
    ],
    ids=lambda given: given[0],
)
def test_an_option_of_another_goal_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], why: str
) -> None:
    write_example(tmp_path / "cell", "trunnion")
    monkeypatch.chdir(tmp_path / "cell")
    assert guarded(tango.main, list(words), prog_name="tango", standalone_mode=False) == 2
    assert why in capsys.readouterr().err
