"""Options that would be ignored are refused before anything is done: one that acts beside another one only, stated without it; one
beside a stronger one, with which the command does something else."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import click
from click.core import ParameterSource

from ..records import InputError
from ._handed import spelt

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class Beside(click.Option):
    """An option, and beside which others, or arguments, it acts: as these are spelt. None: it acts by itself."""

    def __init__(self, *names: Any, beside: Sequence[str] = (), **how: Any) -> None:
        super().__init__(*names, **how)
        self.beside = tuple(beside)

    def handle_parse_result(self, ctx: click.Context, opts: Mapping[str, Any], args: list[str]) -> tuple[Any, list[str]]:
        """context, what was stated, the rest → as click has it. Raises InputError where it would do nothing."""
        others = [p for p in ctx.command.params if {*p.opts, p.make_metavar(ctx).strip("[]")} & {*self.beside}]
        if self.beside and _stated(self, ctx, opts) and not any(_stated(other, ctx, opts) for other in others):
            raise InputError(
                f"{spelt(self)}: found without {' or '.join(self.beside)}, so it does nothing; allowed: only beside it"
            )
        return super().handle_parse_result(ctx, opts, args)


class Alone(click.Option):
    """An option with which the command does something else, and which others act with it: as these are spelt."""

    def __init__(self, *names: Any, acting: Sequence[str] = (), **how: Any) -> None:
        super().__init__(*names, **how)
        self.acting = tuple(acting)

    def handle_parse_result(self, ctx: click.Context, opts: Mapping[str, Any], args: list[str]) -> tuple[Any, list[str]]:
        """context, what was stated, the rest → as click has it. Raises InputError for another option that would do nothing."""
        for other in ctx.command.params if _stated(self, ctx, opts) else ():
            names = {*other.opts, *other.secondary_opts, other.make_metavar(ctx).strip("[].")}
            if other is not self and not names & {*self.acting} and _stated(other, ctx, opts):
                found = spelt(other) if isinstance(other, click.Option) else other.make_metavar(ctx)
                acting = ", ".join(self.acting) or "nothing"
                raise InputError(f"{found}: found beside {spelt(self)}, where it does nothing; allowed there: {acting}")
        return super().handle_parse_result(ctx, opts, args)


def alone(*names: str) -> Callable[..., Decorator]:
    """spelt names of options, or arguments → what makes the decorator of an option beside which only these act."""
    return partial(click.option, cls=Alone, acting=names)


def beside(*names: str) -> Callable[..., Decorator]:
    """spelt names of options, or arguments → what makes the decorator of an option that acts beside one of them only."""
    return partial(click.option, cls=Beside, beside=names)


def stated(name: str) -> bool:
    """longest name of an option of the command that runs, without its dashes → whether the command line has it."""
    context = click.get_current_context()
    of = next(option for option in context.command.params if f"--{name}" in option.opts)
    return context.get_parameter_source(str(of.name)) is ParameterSource.COMMANDLINE


def _stated(option: click.Parameter, context: click.Context, stated: Mapping[str, Any]) -> bool:
    return option.consume_value(context, stated)[1] is ParameterSource.COMMANDLINE
