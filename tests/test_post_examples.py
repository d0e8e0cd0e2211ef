"""What help, header and `tango plan` give as an example of an option can be stated: the program is written, and passes."""

from __future__ import annotations

import re
from typing import Any

import pytest
import yaml
from support.readback import golden, lines_of, read_back

from postprocessors import load, names
from postprocessors import settings as settled

EXAMPLE = re.compile(r"e\.g\. (\{[^}]*\}|[^;,{]+?)(?=[;,]|$| \(| that )")


def examples() -> list[tuple[str, str, Any]]:
    """→ (post, option, value) of every example in the meaning of an option."""
    found = []
    for post in names():
        for option in load(post).options:
            texts = EXAMPLE.findall(option.meaning)
            assert len(texts) == option.meaning.count("e.g."), option.meaning
            found += [(post, option.name, yaml.safe_load(text)) for text in texts]
    return found


@pytest.mark.few(14)
@pytest.mark.parametrize(("post", "option", "value"), examples(), ids=lambda part: str(part).replace(" ", ""))
def test_an_example_of_an_option_passes(post: str, option: str, value: Any) -> None:
    """Mach4 refused `probe_on: G65 P9832`, the very words of its own header."""
    stated = {option: value}
    if option in ("clamp", "unclamp"):  # one without the other is refused
        other = "unclamp" if option == "clamp" else "clamp"
        meaning = next(o.meaning for o in load(post).options if o.name == other)
        stated[other] = yaml.safe_load(EXAMPLE.findall(meaning)[0])
    settled(load(post), stated)
    assert read_back(lines_of(post, golden(), **stated), golden(), post, **stated)


def test_every_dialect_has_examples() -> None:
    found = examples()
    assert {post for post, _, _ in found} == {*names()} and len(found) > 30
