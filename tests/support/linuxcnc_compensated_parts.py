"""What several tests share of linuxcnc compensated."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np

from support.realcontrol import HERE, Control
from tango_cnc.records import Array

ERRORS = {"EXX1": 3e-4, "EYY1": -4e-4, "EZZ1": 2e-4}  # 30 µm and more on the way to this table: what a touch may be late by is 3
LATE = 0.004  # mm


def cell(folder: Path) -> Path:
    shutil.copytree(HERE / "golden" / "cell", folder)
    (folder / "tango.yaml").write_text(
        "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
        "controller: {post: linuxcnc, log: log.txt, gate: none, positioning_feed: 24000}\n"
    )
    (folder / "world.yaml").write_text(f"errors: {json.dumps(ERRORS)}\n")
    return folder


def probed(control: Control, folder: Path) -> Array:
    """Control, cell → (n, 3) mm: X Y Z that the control tells of every contact."""
    lines, error = control.run(folder)
    assert not error, (error, lines[-2:], control.contacts()[-2:])
    rows = [{w[0]: float(w[1:]) for w in re.findall(r"[XYZ]-?[\d.]+", line)} for line in lines if re.match(r"P\d+ H1", line)]
    return np.array([[row[a] for a in "XYZ"] for row in rows])
