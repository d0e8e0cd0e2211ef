"""`${NAME}` in a URL of a cell's files: the word is in the environment, so that no file of the cell has it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable


def filled(text: str, coded: Callable[[str], str], unset: Callable[[str], Exception]) -> str:
    """text, how a word is coded in it, what is raised for a name that the environment does not have → the same with its words."""

    def value(match: re.Match[str]) -> str:
        if match[1] not in os.environ:
            raise unset(match[1])
        return coded(os.environ[match[1]])

    return re.sub(r"\$\{(\w+)\}", value, text)
