"""Commands in a sentence → the same, whole: as they are typed from where the person is, so that they can be pasted."""

from __future__ import annotations

import re
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

COMMAND = re.compile(  # to be typed, and not named as who wrote a file or is at work; a word of it may be quoted for the shell
    r"(?<!what )(?<!that )(?<!as )(?<!As )'(tango [a-z][a-z-]*(?: (?:'[^']*'|[^'\s]+))*)'(?! \(process)"
)


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


def whole(said: str, kept: Kept = NOTHING, *, names: bool = False, **places: object) -> str:
    """a sentence with commands in quotation marks, what holds for the next call, words that stand for others → the same.

    Each command has the folder and the port that were stated here, and this one what else holds, but for what it states anew.
    `names`: commands without options stay as they are, as they may be the names of what has done something.
    """
    return COMMAND.sub(lambda found: found[0] if names and found[1].count(" ") == 1 else _quoted(found[1], kept, places), said)


@contextmanager
def handed(kept: Kept = NOTHING, names: bool = False) -> Iterator[None]:
    """what holds for the next call, `names` as in `whole` → within it, the commands in what is raised are whole."""
    try:
        yield
    except TangoError as error:
        error.args = (whole(str(error), kept, names=names),)
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


def _quoted(command: str, kept: Kept, places: Mapping[str, object]) -> str:
    """a command as a sentence has it → the same, whole, in quotation marks that it does not have itself."""
    try:
        words = [str(places.get(word, word)) for word in shlex.split(command)]
    except ValueError:  # quotation marks of a sentence, not of a shell
        return f"'{command}'"
    found = _whole(words, kept)
    return f'"{found}"' if "'" in found else f"'{found}'"


def _whole(words: Sequence[str], kept: Kept) -> str:
    context = click.get_current_context()
    name, new = words[1], list(words[2:])
    command = context.command if name == context.info_name else _command(context, name)
    if command is None or not any("-C" in option.opts for option in command.params):
        return shlex.join(words)
    anew = [str(option.name) for option in command.params if any(word in option.opts for word in new)]
    anew += [other for option in anew for other in kept.apart.get(option, ())]
    at_the_control = {"port"} & {str(option.name) for option in command.params}
    only = {"folder", *at_the_control, *(kept.names if command is context.command else ())}
    return shlex.join(["tango", name, *_stated(context, anew, only), *new])


def _command(context: click.Context, name: str) -> click.Command | None:
    group = context.find_root().command
    return group.get_command(context, name) if isinstance(group, click.Group) else None


def _stated(context: click.Context, without: Collection[str], only: Collection[str] | None = None) -> Iterator[str]:
    """the command that runs, names of options → the words that state the other ones, or of these those in `only`."""
    for option in context.command.params:
        name = option.name or ""
        if name in without or (only is not None and name not in only):
            continue
        if context.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
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
