"""What plain values have to be: objects, lists, texts and numbers, stated once as a shape.

A shape is `str`, `int`, `float` (any number), `bool`, `[shape]` (a list of these), `{"*": shape}` (an object of these) or
`{"key": shape, "other?": shape}`: `other` may be absent or null. What else an object has is left alone.
"""

from __future__ import annotations

from typing import Any

WORDS = {str: "a text", int: "a whole number", float: "a number", bool: "true or false", list: "a list", dict: "an object"}
KINDS: dict[type, tuple[type, ...]] = {float: (int, float)}


def misfit(found: Any, shape: Any, at: str = "") -> str:
    """plain values, shape, where they are → the first that does not fit, in words; '' when all do."""
    kind = type(shape) if isinstance(shape, list | dict) else shape
    if not _is(found, kind):
        return f"{f'{at}: ' if at else ''}found {_short(found)}; allowed: {WORDS[kind]}"
    if isinstance(shape, list):
        return next((said for i, item in enumerate(found, 1) if (said := misfit(item, shape[0], f"{at}[{i}]"))), "")
    if not isinstance(shape, dict):
        return ""
    before = f"{at}." if at else ""
    if "*" in shape:
        return next((said for key, item in found.items() if (said := misfit(item, shape["*"], f"{before}{key[:40]}"))), "")
    for key, inner in shape.items():
        name = key.removesuffix("?")
        if found.get(name) is None:
            if name == key:
                return f"{before}{name}: found nothing; allowed: {WORDS[type(inner) if isinstance(inner, list | dict) else inner]}"
        elif said := misfit(found[name], inner, f"{before}{name}"):
            return said
    return ""


def _is(found: Any, kind: type) -> bool:
    if type(found) is kind:  # nearly always; asked a few hundred times a record
        return True
    return isinstance(found, KINDS.get(kind, kind)) and (kind is bool or not isinstance(found, bool))


def _short(found: Any) -> str:
    return WORDS[type(found)] if isinstance(found, list | dict) else f"{found!a:.40}"
