"""Random NC programs, and where a program leads: read by a few lines of its own that know nothing of the product."""

from __future__ import annotations

import math
import random
import re

import numpy as np

from tango_cnc.records import Array, Machine


def rs274(seed: int, blocks: int = 40, rotary: str = "AC") -> str:
    """Seed → a program of lines, arcs, rapids and turns, with comments, numbers and M functions here and there."""
    r = random.Random(seed)
    a, c = rotary
    at = [r.uniform(-60, 60), r.uniform(-60, 60), r.uniform(-10, 30)]
    lines = ["%", "O1 (RANDOM)", "G21 G90 G17 G54", f"G0 {a}{r.uniform(-60, 60):.3f} {c}{r.uniform(-170, 170):.3f}"]
    lines += [f"G0 X{at[0]:.3f} Y{at[1]:.3f}", f"G43 H1 Z{at[2]:.3f} M8", "F900"]
    for i in range(blocks):
        number, comment = (f"N{i * 10} " if r.random() < 0.5 else ""), (" (say)" if r.random() < 0.2 else "")
        kind = r.random()
        if kind < 0.2:
            angle, radius = r.uniform(-math.pi, math.pi), r.uniform(2, 25)
            centre = round(radius * math.cos(angle), 3), round(radius * math.sin(angle), 3)
            size = math.hypot(*centre)
            turned = math.atan2(-centre[1], -centre[0]) + r.uniform(0.3, 5.5)
            end = at[0] + centre[0] + size * math.cos(turned), at[1] + centre[1] + size * math.sin(turned)
            at[:2] = round(end[0], 3), round(end[1], 3)
            lines.append(f"{number}G{r.choice((2, 3))} X{at[0]:.3f} Y{at[1]:.3f} I{centre[0]:.3f} J{centre[1]:.3f}{comment}")
        elif kind < 0.3:
            lines.append(f"{number}G{r.choice((0, 1))} {a}{r.uniform(-60, 60):.3f} {c}{r.uniform(-170, 170):.3f}{comment}")
        elif kind < 0.4:
            lines.append(f"{number}S{r.randint(1, 9)}000 M3{comment}")
        else:
            far = 90 if kind > 0.9 else 15
            names = r.sample("XYZ", r.randint(1, 3))
            for name in names:
                j = "XYZ".index(name)
                at[j] = round(max(-80.0, min(80.0, at[j] + r.uniform(-far, far))), 3)
            moved = " ".join(f"{n}{at['XYZ'.index(n)]:.3f}" for n in sorted(names))
            lines.append(f"{number}G{r.choice((0, 1, 1, 1))} {moved}{comment}")
    return "\n".join([*lines, "M30", "%"]) + "\n"


def ends(text: str, machine: Machine, zero: dict[str, float], length: float) -> tuple[Array, list[int]]:
    """RS-274 program of absolute lines → (n, k) mm rad at the end of every line that moves, its line from 1.

    Only lines after which every linear axis has been named count.
    """
    at: dict[str, float] = dict.fromkeys(machine.rotary, 0.0)
    found, rows = [], []
    for number, line in enumerate(text.splitlines(), 1):
        bare = re.sub(r"\([^)]*\)", "", line)
        words = {w[0]: float(w[1:]) for w in re.findall(r"[XYZABC]-?[\d.]+", bare)}
        if not words or re.search(r"G(53|28|92)\b", bare):
            continue
        at.update(words)
        if all(name in at for name in "XYZ"):
            position = np.zeros(len(machine.names))
            for name, value in at.items():
                scale = 1.0 if name in machine.linear else math.pi / 180
                position[machine.column(name)] = scale * (value + zero.get(name, 0.0) + (length if name == "Z" else 0.0))
            found.append(position)
            rows.append(number)
    return np.array(found), rows
