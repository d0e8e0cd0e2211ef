"""All mistakes of a file in one message: who corrects one of them need not ask for the next."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TypeVar, cast

from ..records import InputError
from .checked import TWICE, Node, complaint, missing, nearest, unknown

MOST = 20  # mistakes that one message names
T = TypeVar("T")
V = TypeVar("V")


class Mistakes(InputError):
    """Several mistakes as one error; `each` has them one by one."""

    def __init__(self, each: Sequence[InputError]) -> None:
        lines = [f"  {error}" for error in each[:MOST]]
        more = [f"  … and {len(each) - MOST} more"] if len(each) > MOST else []
        super().__init__("\n".join([f"{len(each)} mistakes:", *lines, *more]))
        self.each = tuple(each)


class _Unread(InputError):
    """A key that is missing is asked for: `Reader.fields` has said so already."""


class _Found(dict[str, Node]):
    def __missing__(self, key: str) -> Node:
        raise _Unread(key)


class Reader:
    """Reads one value after the other, and keeps what is wrong with each; see `gathered`."""

    def __init__(self) -> None:
        self.mistakes: list[InputError] = []

    def __call__(self, read: Callable[[], V]) -> V:
        """what reads a value → the value. Where it is wrong the mistake is kept, and what is returned must not be used."""
        try:
            return read()
        except _Unread:
            pass
        except InputError as error:
            self.mistakes += error.each if isinstance(error, Mistakes) else [error]
        return cast("V", None)  # nobody sees it: `gathered` ends with the mistakes

    def each(self, items: Iterable[T], read: Callable[[T], V]) -> list[V]:
        """items, what reads one → what it reads of each; as `__call__`."""
        return [self(partial(read, item)) for item in items]

    def once(self, node: Node) -> list[tuple[str, Node]]:
        """mapping of any keys → (key, value) in file order; keeps as mistakes keys that are given again."""
        found: dict[str, Node] = {}
        for key, child in node.pairs():
            if key in found:
                self.mistakes.append(complaint(child.file, child.line, child.path, *TWICE))
            else:
                found[key] = child
        return list(found.items())

    def fields(self, node: Node, required: Collection[str], optional: Collection[str] = ()) -> dict[str, Node]:
        """mapping → {key: value} of the keys that are known; keeps as mistakes unknown, missing and repeated ones."""
        try:
            return node.fields(required, optional)  # nearly always
        except InputError:
            pairs = node.pairs()
        known = list(dict.fromkeys([*required, *optional]))
        found, meant = _Found(), set[str]()
        for key, child in pairs:
            if key in known and key not in found:
                found[key] = child
            else:
                self.mistakes.append(
                    complaint(child.file, child.line, child.path, *TWICE) if key in known else unknown(child, key, known)
                )
                meant |= {near} if (near := nearest(key, known)) else set()
        for key in required:
            if key not in found and key not in meant:  # a key that is misspelt is one mistake
                self.mistakes.append(missing(node, key))
        return found


@contextmanager
def gathered() -> Iterator[Reader]:
    """→ what reads one value after the other. Raises InputError at the end: the one mistake, or `Mistakes` where there are more."""
    reader = Reader()
    try:
        yield reader
    except _Unread:
        pass
    except InputError as error:
        reader.mistakes += error.each if isinstance(error, Mistakes) else [error]
    if len(reader.mistakes) == 1:
        raise reader.mistakes[0]
    if reader.mistakes:
        raise Mistakes(reader.mistakes)
