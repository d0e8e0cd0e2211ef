"""strategy.yaml → how a facet is approached, and which are touched at which indexations (docs/formats.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ..records import Approach, Artefact, Find, Indexation, InputError, Machine, Strategy
from .angles import angle
from .checked import Node, load, suggestion
from .gathered import gathered

# How near a touch may begin and how little past the facet it may end, mm. A probe comes free within hundredths of a mm, controls
# call a move of some hundredths less than programmed arrived, and grbl's post backs off 1.5 mm before a guarded move can follow.
LEAST = {
    "standoff": (2.0, "there the probe has to be free again, which takes a way back from the contact; raise standoff"),
    "search": (0.1, "a contact nearer than that to the end of the move is taken for none; raise search"),
}
OBSTRUCTED = ("leave-out-facing-away", "leave-out", "refuse", "warn")  # the first is usual; what they do: docs/formats.md
LONGEST = 1000.0  # mm of stand-off and search: a probe that looks further at measuring feed looks for minutes
MOSTLY = 0.8  # of the indexations name what this cell lacks: not single mistakes, but another cell's strategy
CLEAR_OF_ZONE = 0.5  # mm from where the measuring move of a double touch begins to its search zone


def read_strategy(file: Path, machine: Machine, artefact: Artefact) -> Strategy:
    """strategy.yaml of a machine and artefact → strategy. Raises InputError for a facet or axis that nothing defines."""
    with gathered() as read:
        fields = read.fields(load(file), ["name", "approach", "indexations"], ["obstructed"])
        name = read(lambda: fields["name"].text())
        obstructed = read(lambda: fields["obstructed"].text(OBSTRUCTED)) if "obstructed" in fields else None
        approach = read(
            lambda: _approach(fields["approach"].fields(["standoff", "search", "feed"], ["find"]), machine.probe.max_feed)
        )
        items = fields["indexations"].list()
        if found := _of_another_cell(items, machine, artefact):
            raise fields["indexations"].wrong(
                f"rotary axes {', '.join(machine.rotary) or 'none'} of {machine.name}, and facets of {artefact.name!r} "
                f"({', '.join(artefact.facets)}). Is it the strategy of another machine or table? "
                "Then take it away: 'tango design' makes one",
                found,
            )
        indexations = read.each(items, lambda item: _indexation(item, machine, artefact))
    if not indexations:
        raise fields["indexations"].wrong("at least one indexation", "none")
    used: list[int] = []
    for item, indexation in zip(items, indexations, strict=True):
        if indexation.stylus in used[:-1]:
            raise item.wrong(
                "all indexations of a stylus one after the other: a stylus that is changed back does not sit as before",
                f"stylus {indexation.stylus} again, after stylus {used[-1]}",
            )
        used += [] if used[-1:] == [indexation.stylus] else [indexation.stylus]
    return Strategy(name, approach, tuple(indexations), obstructed)


def _of_another_cell(items: Sequence[Node], machine: Machine, artefact: Artefact) -> str:
    """indexations → the axes and facets that this cell lacks, where nearly all of them name some; else nothing: single mistakes."""
    strange: list[list[str]] = []
    with suppress(InputError, AttributeError, TypeError):
        for item in (node.plain() for node in items):
            axes = [key for key in item if key in ("A", "B", "C") and key not in machine.rotary]
            strange.append([*axes, *(f"facet {name}" for name in item.get("facets", ()) if str(name) not in artefact.facets)])
    each = list(dict.fromkeys(name for names in strange for name in names))
    if len(strange) < 2 or len(each) < 2 or sum(map(bool, strange)) < MOSTLY * len(strange):
        return ""
    return ", ".join(each[:6]) + (f" and {len(each) - 6} more" if len(each) > 6 else "")


def _approach(fields: Mapping[str, Node], fastest: float) -> Approach:
    given = {key: child for key, child in fields.items() if key != "find"}
    values = {
        key: child.number(0.1, 100_000) if key == "feed" else child.number(above=0, high=LONGEST) for key, child in given.items()
    }
    for key, (least, why) in LEAST.items():
        if values[key] < least:
            raise fields[key].wrong(f"a finite number at least {least:g}: {why}")
    _bearable(fields["feed"], values["feed"], fastest)
    single = Approach(values["standoff"], values["search"], values["feed"])
    return replace(single, find=_find(fields["find"].fields(["feed", "retreat"]), single, fastest)) if "find" in fields else single


def _bearable(node: Node, feed: float, fastest: float) -> None:
    if feed > fastest:
        raise node.wrong(
            f"at most {fastest:g} mm/min (machine.yaml: probe.max_feed): faster, probes overrun and styli break", f"{feed:g}"
        )


def _find(fields: Mapping[str, Node], single: Approach, fastest: float) -> Find:
    """The measuring move begins outside of its search zone, so that a probe that is not free by then shows as an early contact."""
    feed, retreat = fields["feed"].number(0.1, 100_000), fields["retreat"].number(above=0)
    _bearable(fields["feed"], feed, fastest)
    if feed < single.feed:
        raise fields["feed"].wrong(f"at least {single.feed:g}, the measuring feed: finding is to be the quicker touch")
    least = max(LEAST["standoff"][0], single.search + CLEAR_OF_ZONE)
    if retreat < least:
        raise fields["retreat"].wrong(
            f"at least {least:g}: the measuring move begins free of the facet and {CLEAR_OF_ZONE:g} mm before the search zone; "
            "raise retreat or lower search"
        )
    if retreat > single.standoff:
        raise fields["retreat"].wrong(f"at most {single.standoff:g}, the standoff")
    return Find(feed, retreat)


def _indexation(node: Node, machine: Machine, artefact: Artefact) -> Indexation:
    known = list(artefact.facets)

    def named(item: Node) -> str:
        facet = item.identifier()
        if facet not in artefact.facets:
            raise item.wrong(f"a facet of artefact {artefact.name!r} ({', '.join(known)}).{suggestion(facet, known)}")
        return facet

    with gathered() as read:
        fields = read.fields(node, [*machine.rotary, "facets"], ["S", "stylus"])
        turned = {name: child for name, child in fields.items() if name not in ("facets", "stylus")}
        angles = dict(zip(turned, read.each(turned.values(), angle), strict=True))
        facets = read.each(fields["facets"].list(), named)
    position = {name: 0.0 for name in (*machine.rotary, "S")} | angles
    if not facets:
        raise fields["facets"].wrong("at least one facet", "none")
    number = fields["stylus"].integer(1) if "stylus" in fields else 1
    if number > max(len(machine.styli), 1):
        raise fields["stylus"].wrong(f"1 … {max(len(machine.styli), 1)}: machine.yaml lists the others under styli", f"{number}")
    return Indexation(position, tuple(facets), number)
