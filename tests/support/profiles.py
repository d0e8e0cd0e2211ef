"""The profile of an example, for another control than its own."""

from __future__ import annotations

import re

from postprocessors import load, names

OWN = re.compile(r"post: fanuc(,|\n *) *probe_state: none")


def spoken(text: str, words: str) -> str:
    """tango.yaml of an example, what stands there for 'post: fanuc' → the same text, for that control.

    An example states that its control has no variable for the probe; that goes where the post does not ask for one.
    """
    name = re.match(r"post: ([\w./]+)", words)
    asks = (
        "probe_state" not in words
        and name is not None
        and name[1] in names()
        and any(option.must for option in load(name[1]).options)
    )
    changed, count = OWN.subn(lambda found: f"{words}{found[1]}probe_state: none" if asks else words, text)
    assert count == 1, text
    return changed
