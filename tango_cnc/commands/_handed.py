"""Commands in a sentence → the same, whole: as they are typed from where the person is, so that they can be pasted."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ..records import TangoError
from ..texts.handed import remade


def typed(*without: str) -> str:
    """names of options → the command line of the command that runs, without these, to be typed once more with others."""
    context = click.get_current_context()
    return shlex.join(["tango", context.info_name or "", *_stated(context, without)])


@dataclass(frozen=True)
class Kept:
    """What holds for the next call of a command, too: names of its options; and which of them do not go with which option."""

    names: tuple[str, ...] = ()
    apart: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # stated anew → not kept then


NOTHING = Kept()


def whole(said: str, kept: Kept = NOTHING, **places: object) -> str:
    """a sentence with commands in quotation marks, what holds for the next call, words that stand for others → the same.

    Each command has the folder and the port that were stated here, and this one what else holds, but for what it states anew.
    One without options that the sentence names as who has done or made something stays as it is.
    """

    return remade(said, lambda words: _whole([str(places.get(word, word)) for word in words], kept))


@contextmanager
def handed(kept: Kept = NOTHING) -> Iterator[None]:
    """what holds for the next call → within it, the commands in what is raised are whole."""
    try:
        yield
    except TangoError as error:
        error.args = (whole(str(error), kept),)
        raise


def hands(kept: Kept) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """what holds for the next call → decorator of a command: the commands in what it raises are whole."""

    def decorated(call: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(call)
        def called(**given: Any) -> Any:
            with handed(kept):
                return call(**given)

        return called

    return decorated


def _whole(words: Sequence[str], kept: Kept) -> str:
    context = click.get_current_context(silent=True)
    if context is None:  # who calls from a program has typed nothing
        return shlex.join(words)
    command, names, new = _command(context, words)
    if command is None or not any("-C" in option.opts for option in command.params):
        return shlex.join(words)
    anew = [str(option.name) for option in command.params if any(word in option.opts for word in new)]
    anew += [other for option in anew for other in kept.apart.get(option, ())]
    shared = {"port", "where"} & {str(option.name) for option in command.params}  # the control, the history
    only = {"folder", *shared, *(kept.names if command is context.command else ())}
    return shlex.join(["tango", *names, *_stated(context, anew, only), *new])


def _command(context: click.Context, words: Sequence[str]) -> tuple[click.Command | None, list[str], list[str]]:
    """words of a command line → the command that they name (None: tango has no such command), its name, and what follows it."""
    command: click.Command | None = context.find_root().command
    names, rest = [], list(words[1:])
    while isinstance(command, click.Group) and rest:
        names.append(rest.pop(0))
        command = command.get_command(context, names[-1])
    return command, names, rest


def printed(text: str, err: bool = False) -> None:
    """text, whether it goes to stderr → on the screen; commands in it are whole."""
    click.echo(whole(text), err=err)


def _stated(context: click.Context, without: Collection[str], only: Collection[str] | None = None) -> Iterator[str]:
    """the command that runs, names of options → the words that state the other ones, or of these those in `only`."""
    for option in context.command.params:
        name = option.name or ""
        if name in without or (only is not None and name not in only):
            continue
        if context.get_parameter_source(name) not in (ParameterSource.COMMANDLINE, ParameterSource.DEFAULT_MAP):  # of the group
            continue
        yield spelt(option)
        if not (isinstance(option, click.Option) and option.is_flag):
            value = context.params[name]
            values = value if isinstance(value, tuple) else (value,)
            yield from (f"{each:.9g}" if isinstance(each, float) else str(each) for each in values)


def spelt(option: click.Parameter) -> str:
    """option → its longest name."""
    return max(option.opts, key=len)


def pasted(place: Path) -> str:
    """folder or file → as it stands in a command that is pasted into a shell."""
    return shlex.quote(str(place))
