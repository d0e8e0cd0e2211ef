"""The words, lists and mappings of a YAML text with their lines, as `files/checked.py` reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import yaml

DEEPEST = 50  # levels of nesting


@dataclass(slots=True)
class Scalar:
    """One word of a YAML file, the line (from 0) where it stands, and the marks of quotation around it."""

    tag: str
    line: int
    value: str
    style: str | None


@dataclass(slots=True)
class Series:
    """A list of a YAML file; `line` from 0."""

    tag: str
    line: int
    value: list[Raw]


@dataclass(slots=True)
class Pairs:
    """A mapping of a YAML file, keys as often as they are given; `line` from 0."""

    tag: str
    line: int
    value: list[tuple[Raw, Raw]]


Raw = Scalar | Series | Pairs
R = TypeVar("R", Scalar, Series, Pairs)


# Words and brackets of a YAML text by libyaml, where it is there: yaml's own parser takes a minute for a megabyte.
EVENTS: type[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class Composer:
    """Composes `Raw` in place of yaml's own nodes, whose marks take ten times the memory of what they mark."""

    def __init__(self, text: str) -> None:
        self._events: Any = EVENTS(text)
        self._anchors: dict[str, Raw] = {}
        self._words: dict[str, str] = {}  # the same word again and again is kept once
        self._kinds: dict[tuple[str, bool], str] = {}  # plain word → its tag

    def document(self) -> Raw | None:
        """→ the one document of the text, None for an empty text. Raises yaml.YAMLError, RecursionError."""
        take = self._events.get_event
        take()
        if isinstance(take(), yaml.StreamEndEvent):
            return None
        raw = self._node(take(), 0)
        take()
        event = take()
        if not isinstance(event, yaml.StreamEndEvent):
            raise yaml.MarkedYAMLError(problem="a second document begins here", problem_mark=event.start_mark)
        return raw

    def _node(self, event: Any, depth: int) -> Raw:
        if depth > DEEPEST:
            raise RecursionError
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                where: Any = event.start_mark  # libyaml's own kind of mark
                raise yaml.MarkedYAMLError(problem=f"the alias {event.anchor!r} is defined nowhere", problem_mark=where)
            return self._anchors[event.anchor]
        line = event.start_mark.line
        if isinstance(event, yaml.ScalarEvent):
            tag = self._plain(event) if event.tag in (None, "!") else str(event.tag)
            return self._anchored(event.anchor, Scalar(tag, line, self._words.setdefault(event.value, event.value), event.style))
        take = self._events.get_event
        if isinstance(event, yaml.SequenceStartEvent):
            series = self._anchored(event.anchor, Series(_tagged(event, "seq"), line, []))
            while not isinstance(inner := take(), yaml.SequenceEndEvent):
                series.value.append(self._node(inner, depth + 1))
            return series
        pairs = self._anchored(event.anchor, Pairs(_tagged(event, "map"), line, []))
        while not isinstance(inner := take(), yaml.MappingEndEvent):
            key = self._node(inner, depth + 1)
            pairs.value.append((key, self._node(take(), depth + 1)))
        return pairs

    def _plain(self, event: Any) -> str:
        known = (event.value, event.implicit[0])
        if known not in self._kinds:
            self._kinds[known] = str(self._events.resolve(yaml.ScalarNode, event.value, event.implicit))
        return self._kinds[known]

    def _anchored(self, anchor: str | None, node: R) -> R:
        if anchor is not None:
            self._anchors[anchor] = node
        return node


def _tagged(event: Any, kind: str) -> str:
    return f"tag:yaml.org,2002:{kind}" if event.tag in (None, "!") else str(event.tag)
