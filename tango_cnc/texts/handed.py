"""Commands in a sentence → the same, whole: with the folder of the cell, quoted for a shell, so that they can be pasted."""

from __future__ import annotations

import html
import re
import shlex
from collections.abc import Callable, Sequence

COMMAND = re.compile(  # to be typed, and not named as who wrote a file or is at work; a word of it may be quoted for the shell
    r"(?<!what )(?<!that )(?<!as )(?<!As )'(tango [a-z][a-z0-9-]*(?: (?:'[^']*'|[^'\s]+))*)'(?! \(process)"
)
DOER = re.compile(r"\b(?:of|by|a|another|the next|while) $", re.IGNORECASE)  # before the name of one
CELLLESS = ("demo", "fleet", "init", "ports", "reproduce", "serve", "trust")  # commands that work in no cell, or in several
MARK = "'"
SPELT = "&#39;"  # that mark in a page
PAGED = re.compile(rf"[^<>&]{{0,20}}{SPELT}tango (?:(?!{SPELT})[^<>])*(?<! ){SPELT}")  # with the word before it


def remade(said: str, line: Callable[[Sequence[str]], str]) -> str:
    """a sentence with commands in quotation marks, words of a command → the command as it is to be typed → the sentence.

    One without options that the sentence names as who has done or made something stays as it is, and so does what no shell reads.
    """

    def found(one: re.Match[str]) -> str:
        if one[1].count(" ") == 1 and DOER.search(said[: one.start()]):
            return one[0]
        try:
            words = shlex.split(one[1])
        except ValueError:  # quotation marks of a sentence, not of a shell
            return one[0]
        return quoted(line(words))

    return COMMAND.sub(found, said)


def quoted(command: str) -> str:
    """a command → in quotation marks that it does not have itself."""
    return f'"{command}"' if MARK in command else f"'{command}'"


def of_cell(said: str, cell: str) -> str:
    """a sentence with commands in quotation marks, folder of a cell ('' or '.': here) → the same, each with -C."""
    return said if cell in ("", ".") else remade(said, lambda words: of_folder(words, cell))


def of_folder(words: Sequence[str], cell: str) -> str:
    """words of a command, folder of a cell → the line to be typed, with the option that finds the cell, where it takes one."""
    here = len(words) < 2 or words[1] in CELLLESS or "-C" in words
    return shlex.join([*words, *([] if here else ["-C", cell])])


def page_of_cell(page: str, cell: str) -> str:
    """HTML, folder of a cell ('': of no single one) → the same; commands between quotation marks have -C."""
    if cell == "":
        return page
    return PAGED.sub(lambda one: html.escape(of_cell(html.unescape(one[0]), cell)).replace("&#x27;", SPELT), page)
