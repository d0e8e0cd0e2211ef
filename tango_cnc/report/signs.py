"""A row of signs, one a night: what each of them found, by shape as well as by color."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

from markupsafe import Markup

from . import svg
from .days import day
from .texts import Texts
from .verdict import Level

LEVELS: Mapping[str, Level] = {
    "good": "good",
    "changed": "look",
    "partial": "look",
    "not_measured": "look",
    "out_of_limits": "stop",
    "doubtful": "stop",
}
UNSURE = "not_certain"  # a good night of which nobody knows whether it is within a limit
ALSO = "_not_certain"  # behind the verdict of another one of which nobody knows it
SHORT, GAP = 10, 190.0  # signs of a strip that is old, and room for how old it is


def of_night(verdict: str, status: str, unsure: bool) -> str:
    """verdict of a night, status, whether nobody knows if it is within a limit → what its sign is of: its own verdict."""
    own = "partial" if status == "partial" and verdict == "good" else verdict
    if not unsure or own not in ("good", "changed", "partial"):
        return own
    return UNSURE if own == "good" else f"{own}{ALSO}"


def level_of(sign: str) -> str:
    """what a sign is of → good, look, stop, or unsure, as the curve of the tool tip draws it."""
    return "unsure" if sign == UNSURE else LEVELS.get(sign.removesuffix(ALSO), "stop")


def strip(nights: Sequence[tuple[str, str, str]], label: str, t: Texts, old: int = 0) -> Markup:
    """(date, verdict, address) of nights, oldest first, what it is, texts, nights since the last one that measured where these are
    too many → a row of signs, one a night, by shape and color; old ones end with how long nothing was measured since.
    """
    wide = 14.0
    nights = nights[-SHORT:] if old else nights
    gap = GAP if old else 0.0
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {max(wide * len(nights), wide) + gap:g} 16" '
        f'width="{max(wide * len(nights), wide) + gap:g}" height="16" role="img" aria-label="{svg.escape(label)}">'
    ]
    for i, (date, verdict, _) in enumerate(nights):
        parts.append(f"<g>{_tip(date, verdict, t)}{_sign(verdict, wide * i + wide / 2)}</g>")
    if old:
        told = svg.escape(t("web.then_none", nights=old))
        parts.append(f'<text x="{wide * len(nights) + 4:g}" y="13" font-size="13" fill="{svg.SOFT}">{told}</text>')
    return Markup("".join([*parts, "</svg>"]))


@lru_cache(4096)
def _tip(date: str, verdict: str, t: Texts) -> str:
    """date, verdict, texts → what a sign says of itself; two hundred machines have the same thirty dates."""
    word = t(f"morning.{verdict}") if f"morning.{verdict}" in t else verdict.replace("_", " ")
    return f"<title>{svg.escape(day(date, t))}: {svg.escape(word)}</title>"


def _sign(verdict: str, x: float) -> str:
    verdict = verdict.removesuffix(ALSO)
    if verdict == "not_measured":
        return f'<circle cx="{x:g}" cy="8" r="4" fill="none" stroke="{svg.SOFT}" stroke-width="1.6"/>'
    if verdict == "partial":
        half = f'<path d="M{x:g} 4a4 4 0 0 1 0 8z" fill="{svg.LOOK}"/>'
        return f'<circle cx="{x:g}" cy="8" r="4" fill="none" stroke="{svg.LOOK}" stroke-width="1.6"/>{half}'
    if verdict == UNSURE:
        return f'<rect x="{x - 4.2:g}" y="3.8" width="8.4" height="8.4" fill="none" stroke="{svg.LOOK}" stroke-width="1.8"/>'
    level = LEVELS.get(verdict, "stop")
    if level == "good":
        return f'<circle cx="{x:g}" cy="8" r="3.4" fill="{svg.GOOD}"/>'
    if level == "look":
        return f'<path d="M{x:g} 1.5l6 12h-12z" fill="{svg.LOOK}"/>'
    return f'<path d="M{x - 5:g} 3h10v10h-10z" fill="{svg.STOP}"/>'
