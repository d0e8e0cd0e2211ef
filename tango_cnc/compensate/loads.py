"""With which file of a compensation each number is loaded: what one file holds acts together, or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType

from .space import Held
from .targets import Request


def files_of(
    module: ModuleType, request: Request, held: Sequence[Held], present: Mapping[str, float], new: Mapping[str, float]
) -> dict[str, str]:
    """target, its job, what it holds, numbers before and after by place → {place that changed: names of its files}.

    A file is written once more without a table, or without a single number of no table: where that differs, it holds it.
    """
    written = module.files(request, held, new)
    groups: dict[str, list[str]] = {}
    for h in held:
        if new[h.place] != present[h.place]:
            groups.setdefault(h.place if h.axis is None else h.table, []).append(h.place)
    found = {}
    for places in groups.values():
        without = module.files(request, held, {**new, **{place: present[place] for place in places}})
        names = [name for name, text in written.items() if without[name] != text]
        found.update(dict.fromkeys(places, ", ".join(names)))
    return found
