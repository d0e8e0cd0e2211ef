"""Questions that a person at the machine answers with yes, no, or not seen."""

from __future__ import annotations

import click

HOW = "y yes, n no, ? not seen"
WORDS = {"y": "y", "yes": "y", "n": "n", "no": "n", "?": "?"}


class _Answer(click.ParamType):
    name = "answer"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """what was typed → y, n or ?."""
        word = WORDS.get(value.strip().lower())
        if word is None:
            self.fail(f"found {value!r}; allowed: {HOW}", param, ctx)
        return word


def answered(text: str, *, waits: bool = False) -> bool | None:
    """question, whether Enter alone is no answer → yes or no; None: the person has not seen it."""
    default = None if waits else "?"
    found = click.prompt(f"{text} {HOW}", type=_Answer(), default=default, show_default=not waits, err=True)
    return None if found == "?" else found == "y"
