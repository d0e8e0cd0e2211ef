"""Random programs written in every language of `tango compensate PROGRAM`, and where the parts of each block lead afterwards.

The generator knows where each block is meant to go, so nothing of the product has to be read to judge it. Every block that moves
bears a tag in a comment; the parts that a block became are the lines from its tag to the next one.
"""

from __future__ import annotations

import math
import random
import re
from dataclasses import dataclass
from functools import partial

import numpy as np

from tango_cnc.records import Array

LANGUAGES = ("rs274", "macro_b", "siemens", "klartext")
PLANES = {"G17": ("X", "Y", "Z", "I", "J"), "G18": ("Z", "X", "Y", "K", "I"), "G19": ("Y", "Z", "X", "J", "K")}
WORD = re.compile(r"([XYZABC])\s*=?\s*([-+]?(?:\d+\.?\d*|\.\d+))")

HEADS = {
    "rs274": ("%", "G21 G90 G17 G54 G40 G49 G80 G94", "G0 A0 C0", "T1 M6", "G0 Z90", "BEGIN", "F900 S9000 M3"),
    "macro_b": (
        "%", "O1 (X1. Y2.)", "G91 G28 Z0.", "G21 G90 G17 G54 G40 G49 G80 G94", "G0 A0 C0", "T1 M6", "G5.1 Q1", "BEGIN", "F900."
    ),
    "siemens": ("; part", "G90 G71 G17 G54 G40 G94", "SUPA G0 Z0 D0", "T1 D1", "M6", "G0 A0 C0", "BEGIN", "G64 F900"),
    "klartext": ("0 BEGIN PGM A MM", "1 BLK FORM 0.1 Z X-50 Y-50 Z-20", "2 TOOL CALL 1 Z S3000", "3 * - part", "BEGIN"),
}  # fmt: skip


@dataclass(frozen=True)
class Meant:
    """A block that moves: programmed coordinates of axes at a share of its way, 0 to 1."""

    tag: str
    start: dict[str, float]
    end: dict[str, float]
    rapid: bool
    axes: tuple[str, str] | None = None  # of an arc
    centre: tuple[float, float] = (0.0, 0.0)
    sweep: float = 0.0

    def at(self, share: float) -> dict[str, float]:
        """share → coordinates."""
        place = {n: v + share * (self.end[n] - v) for n, v in self.start.items()}
        if self.axes is not None:
            a, b = self.axes
            angle = math.atan2(self.start[b] - self.centre[1], self.start[a] - self.centre[0]) + share * self.sweep
            one, two = (math.dist((p[a], p[b]), self.centre) for p in (self.start, self.end))
            radius = one + share * (two - one)
            place[a], place[b] = self.centre[0] + radius * math.cos(angle), self.centre[1] + radius * math.sin(angle)
        return place


def program(seed: int, name: str, blocks: int = 30) -> tuple[str, list[Meant]]:
    """Seed, language → text, and what its blocks mean."""
    r = random.Random(f"{seed} {name}")
    klartext, siemens = name == "klartext", name == "siemens"
    at = {n: round(r.uniform(-50, 50), 3) for n in "XYZ"} | {"A": 0.0, "C": 0.0}
    point = "" if klartext or siemens else "."

    def number(value: float, sign: bool = klartext) -> str:
        text = f"{value:{'+' if sign else ''}.3f}".rstrip("0")
        return text if text[-1] != "." else text[:-1] + point

    def word(letter: str, value: float) -> str:
        return f"{letter}{'=' if siemens and r.random() < 0.3 else ''}{number(value)}"

    def line(i: int, text: str, tag: str) -> str:
        if klartext:
            return f"{i} {text} ; {tag}"
        text = f"N{i} {text}" if r.random() < 0.5 else text
        text = text.lower() if r.random() < 0.1 and name == "rs274" else text
        return f"{text} ; {tag}" if siemens or (name == "rs274" and r.random() < 0.5) else f"{text} ({tag})"

    begin = " ".join(word(n, at[n]) for n in "XYZ")
    lines = list(HEADS[name])
    lines[lines.index("BEGIN")] = {
        "rs274": f"G43 H1 {begin} (first)",
        "macro_b": f"G0 G43 H1 {begin} (FIRST)",
        "siemens": f"G0 {begin} ; first",
        "klartext": f"4 L A+0 C+0 {begin} R0 FMAX ; first",
    }[name]
    found = []
    modal, plane = "G0", "G17"
    for i in range(blocks):
        tag, kind, start = f"b{i}b", r.random(), dict(at)
        tail = r.choice(["", "", "", " M8", " M9"])
        write = partial(line, 10 * i + 10)
        if kind < 0.3:
            if not klartext and r.random() < 0.2:
                plane = r.choice(list(PLANES))
                lines.append(plane)
            a, b, third, one, two = PLANES[plane]
            angle, radius = r.uniform(-math.pi, math.pi), r.uniform(1, 25)
            way = {a: round(radius * math.cos(angle), 3), b: round(radius * math.sin(angle), 3)}
            centre = start[a] + way[a], start[b] + way[b]
            clockwise, whole, helix = r.random() < 0.5, r.random() < 0.15 and not klartext, r.random() < 0.2 and not klartext
            sweep = 2 * math.pi if whole else r.uniform(0.2, 5.8)
            sweep = -sweep if clockwise else sweep
            turned = math.atan2(-way[b], -way[a]) + sweep
            if not whole:
                size = math.hypot(*way.values())
                at[a], at[b] = (round(centre[0] + size * math.cos(turned), 3), round(centre[1] + size * math.sin(turned), 3))
            if helix:
                at[third] = round(max(-60.0, min(60.0, at[third] + r.uniform(-5, 5))), 3)
            ends = " ".join(word(n, at[n]) for n in sorted((a, b, third) if helix else (a, b)))
            by_radius = r.random() < 0.4 and not whole and 0.5 < abs(sweep) < 5.5 and abs(abs(sweep) - math.pi) > 0.3
            if by_radius:
                radius = round(math.hypot(*way.values()), 4)
                chord, middle = (at[a] - start[a], at[b] - start[b]), ((at[a] + start[a]) / 2, (at[b] + start[b]) / 2)
                long = math.hypot(*chord)
                height = math.sqrt(max(0.0, radius**2 - long**2 / 4)) * (-1 if clockwise == (abs(sweep) < math.pi) else 1)
                centre = middle[0] - height * chord[1] / long, middle[1] + height * chord[0] / long
                signed = radius if abs(sweep) < math.pi else -radius
            # The way that the rounded end really has.
            first, last = (math.atan2(p[b] - centre[1], p[a] - centre[0]) for p in (start, at))
            if not whole:
                sweep = -((first - last) % (2 * math.pi)) if clockwise else (last - first) % (2 * math.pi)
            if klartext:
                turn = "DR-" if clockwise else "DR+"
                if by_radius:
                    lines.append(write(f"CR {ends} R{signed:+.4f} {turn}{tail}", tag))
                else:
                    lines += [f"{10 * i + 9} CC {word(a, centre[0])} {word(b, centre[1])}", write(f"C {ends} {turn}{tail}", tag)]
                    centre = round(centre[0], 3), round(centre[1], 3)
            else:
                code = "G2" if clockwise else "G3"
                where = f"{'CR=' if siemens else 'R'}{signed:.4f}" if by_radius else f"{word(one, way[a])} {word(two, way[b])}"
                ends = "" if whole and not helix and r.random() < 0.5 else ends
                modal, said = code, "" if modal == code and r.random() < 0.5 else code + " "
                lines.append(write(f"{said}{ends} {where}{tail}", tag))
            found.append(Meant(tag, start, dict(at), False, (a, b), centre, sweep))
            continue
        rapid = r.random() < 0.2
        if kind < 0.45:
            at["C"] = (
                round(r.uniform(-170, 170), 3) if r.random() < 0.7 else round(at["C"] + r.choice([-1, 1]) * r.uniform(300, 1500), 3)
            )
            at["A"] = round(r.uniform(-60, 60), 3)
            names = r.choice(["A", "C", "AC", "ACX", "CY"])
        else:
            names = "".join(sorted(r.sample("XYZ", r.randint(1, 3))))
        for n in set(names) & set("XYZ"):
            at[n] = round(max(-80.0, min(80.0, at[n] + r.uniform(-1, 1) * r.choice([10, 10, 90]))), 3)
        at = {n: v if n in names else start[n] for n, v in at.items()}
        said = " ".join(word(n, at[n]) for n in names)
        if klartext:
            lines.append(write(f"L {said} R0 {'FMAX' if rapid else 'F500'}{tail}", tag))
        else:
            code = "G0" if rapid else "G1"
            modal, code = code, "" if modal == code and r.random() < 0.6 else code + " "
            lines.append(write(f"{code}{said}{tail}", tag))
        found.append(Meant(tag, start, dict(at), rapid))
    end = {"klartext": [f"{9999} END PGM A MM"], "siemens": ["M30"]}.get(name, ["M30", "%"])
    return "\n".join([*lines, *end]) + "\n", found


def parts(text: str, blocks: list[Meant]) -> list[list[dict[str, float]]]:
    """Compensated text, what its blocks mean → of each block the coordinates at the end of each of its parts."""
    found: list[list[dict[str, float]]] = []
    at = dict.fromkeys("XYZAC", 0.0)
    for line in text.splitlines():
        tag = re.search(r"b\d+b", line.lower())
        bare = re.sub(r"\([^)]*\)|;.*", "", line)
        if tag:
            assert tag[0] == blocks[len(found)].tag, line
            found.append([])
        if re.search(r"(?i)SUPA|G28|CC|BLK|\bG1[789]\b|PGM", bare) and not tag:
            continue
        words = {m[0].upper(): float(m[1]) for m in WORD.findall(bare.upper())}
        at = {**at, **{n: v for n, v in words.items() if n in at}}
        if words and found:
            found[-1].append(dict(at))
        elif tag:
            found[-1].append(dict(at))  # nothing was to move
    assert len(found) == len(blocks)
    return found


def array(places: list[dict[str, float]]) -> Array:
    """Coordinates → (n, 5) of X Y Z A C, mm and degrees."""
    return np.array([[p[n] for n in "XYZAC"] for p in places])
