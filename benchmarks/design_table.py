"""The table of docs/measured_design.md: what plans of `tango design` reach, how near that is to the best, and what others reach.

    OPENBLAS_NUM_THREADS=1 python benchmarks/design_table.py [ROW …] [--keep FILE] [--plans FOLDER] [--parts]

A ROW is named hu40t, volume, or hu40t/volume/10; without one, all are made.

Cells are the examples with a positioning feed of 6000 mm/min and facets known within 0.3 mm, probe proven at a facet. `octagon` is
the stand-in for the thesis' table (tango_cnc/reproduce): 400 mm across flats, 26 facets, a scale bar, its strategy. Each row:

* what is reached, the bound on what any plan of that time could reach, and the efficiency; the same at the indexations of the plan;
* what is wanted: what the cell's own strategy reaches in its own time, or the size of a change that a check is to see;
* the best of 100 random plans and the regular plan of the same time;
* seconds between first and last contact, by the motion model and by the clock of the simulated control that runs the program;
* what is known when the run is broken off at 25, 50, 75 % of its time; with `--parts` beside plans designed for these times.

`--keep FILE` adds every row to FILE as it is done, and does not work out again what FILE has.
`--plans FOLDER` keeps the strategies.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from postprocessors import load, program
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language
from tango_cnc.commands import _design as told
from tango_cnc.design import check, goals, propose, sequence, timed, touching
from tango_cnc.design.problem import Chosen
from tango_cnc.files import read_cell
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Cell, InputError, World
from tango_cnc.reproduce import _setting as thesis

EXAMPLES = Path(__file__).parent.parent / "examples"
FEED, WITHIN = 6000.0, 0.3  # mm/min, mm
SIZE = 5.0  # µm: the change that a check is to see
# Table 8-5 of the thesis: how far the locations of that machine scatter over its plans, µm and µrad.
LIMITS = "EA0B=2.86,EC0B=4.22,EX0S=1.35,EY0S=2.29,EB0Z=10.88,EA0Y=2.43,EC0Y=1.94,EX0C=0.90,EA0C=3.61,EB0C=3.72"


@dataclass(frozen=True)
class Row:
    """Cell, goal, minutes, terms where they are not the usual ones."""

    cell: str
    goal: str
    minutes: float | None
    terms: tuple[str, ...] | None = None

    @property
    def name(self) -> str:
        """→ as it is asked for and printed."""
        goal = "limits" if "=" in self.goal else self.goal
        return "/".join([self.cell, goal, f"{self.minutes:g}" if self.minutes else "usual", *(self.terms or ())])


ROWS = (
    Row("trunnion", "check", 2.5),
    Row("hu40t", "check", 2.5),
    Row("trunnion", "locations", 5),
    Row("hu40t", "locations", 5),
    Row("hu40t", LIMITS, 5),
    Row("fork_head", "locations", 5),
    Row("trunnion", "volume", 10),
    Row("hu40t", "volume", 10),
    Row("octagon", "volume", 10),
    Row("fork_head", "volume", 10, ("S3",)),
    Row("fork_head", "volume", 10),
    Row("fork_head", "check", None),
    Row("trunnion", "D", 10),
    Row("trunnion", "A", 10),
    Row("trunnion", "condition", 10),
)


def cell_of(name: str) -> Cell:
    """name of an example, or octagon → cell with the table's feed and a facet as gate."""
    cell = read_cell(EXAMPLES / ("hu40t" if name == "octagon" else name))
    if name == "octagon":
        table = thesis.Setting(cell, cell.strategy).hu40t
        cell = replace(cell, artefact=table.artefact, strategy=replace(table.strategy, approach=cell.strategy.approach))
    assert cell.controller is not None
    return replace(cell, controller=replace(cell.controller, options={"positioning_feed": FEED, "gate": "facet"}))


def wish_of(row: Row, cell: Cell) -> propose.Wish:
    """row, its cell → what is asked for."""
    aim = goals.read(row.goal)
    approach = touching.touching(cell.strategy.approach, WITHIN).approach
    return propose.Wish(aim, row.minutes, row.terms or propose.usual_terms(aim, cell.terms), approach, feed=FEED, gate="facet")


def clock(found: Chosen) -> tuple[float, float]:
    """plan → s between first and last contact by the motion model, by the clock of the simulated control."""
    made, stamps = found.plan, []
    spoken = language("macro_b")
    motion = Motion(
        rig(made.machine, made.artefact, World()), lambda event, **_: stamps.append(motion.time) if event == "contact" else None
    )
    control = spoken.Control(motion, spoken.default_profile(made.machine), lambda _: None, lambda _, **__: None, ())
    lines = list(program(load("fanuc"), made, {"positioning_feed": FEED, "gate": "none"}, plan_hash(made))[2]())
    control.run(lines[1:-1], False)
    return float(found.time[-1] - found.time[0]), stamps[-1] - stamps[0]


def measured(row: Row, parts: bool, plans: Path | None) -> dict[str, Any]:
    """row → its numbers, plain data; `refused` where there is no plan."""
    cell, began = cell_of(row.cell), time.process_time()
    ready = propose.setting(cell, wish_of(row, cell))
    try:
        found = propose.propose(ready)
    except InputError as error:
        return {"row": row.name, "refused": str(error), "cpu_s": time.process_time() - began}
    spent = time.process_time() - began
    sees = check.power(found, ready.lever) if row.goal == "check" else None
    data = told.as_json(ready, found, "", sees, propose.competitors(ready, found))
    if plans is not None:
        plans.mkdir(parents=True, exist_ok=True)
        text = told.strategy_text(found, data, told.as_text(ready, data).splitlines())
        (plans / f"{row.name.replace('/', '-')}.yaml").write_text(text, encoding="utf-8")
    keys = ("touches", "indexations", "time_s", "criterion", "determined", "competitors", "certificate", "broken_off", "check")
    result = {"row": row.name, "cpu_s": spent, "clock_s": clock(found)} | {key: data[key] for key in keys if key in data}
    if sees is None:
        with suppress(InputError):
            own = plan(cell, "leave-out")
            worth = propose.same_time(ready, cell, own)
            result["own"] = {"value": propose.reached(ready, worth.value)[0], "touches": len(worth.rows), "time_s": worth.seconds}
    if parts and sees is None:
        result["designed"] = [designed(row, cell, part, found) for part in sequence.FRACTIONS]
    return result


def designed(row: Row, cell: Cell, part: float, whole: Chosen) -> float | None:
    """row, cell, part of its time, its plan → what a plan designed for that time reaches; None where it is refused."""
    ready = propose.setting(cell, replace(wish_of(row, cell), minutes=part * whole.seconds / 60))
    try:
        found = propose.propose(ready)
    except InputError:
        return None
    return propose.reached(ready, found.value)[0] if timed.determined(found.problem, found.information) else None


def shown(data: dict[str, Any]) -> str:
    """numbers of a row → a line of the table."""
    if "refused" in data:
        return f"| {data['row']} | refused: {data['refused']} |"
    value, unit = data["criterion"]["value"], data["criterion"]["unit"]
    sure = data["certificate"]
    goal = data["row"].split("/")[1]
    if "check" in data:
        size = data["check"]["size_um"]
        wanted = f"{SIZE:g} µm: {'kept' if size <= SIZE else 'missed'}"
        reached = f"sees {size:.1f} µm ({value:.3g} µm std)"
    else:
        reached = f"{value:.3g} {unit}"
        own = data.get("own")
        wanted = "" if own is None else f"{own['value']:.3g}, {own['touches']} touches in {own['time_s'] / 60:.0f} min: "
        wanted += "" if own is None else "kept" if value <= own["value"] else "missed"
        if goal == "limits":
            wanted = f"1: {'kept' if value <= 1 else 'missed'}"
    ratio = lambda other: other - value if goal == "D" else other / value  # noqa: E731
    others = ", ".join(f"{name} {other:.3g} ({ratio(other):.3g})" for name, other in data["competitors"].items())
    model, control = data["clock_s"]
    known = lambda v: "–" if v is None else f"{v:.3g}"  # noqa: E731
    broken = ", ".join(known(b["value"]) for b in data.get("broken_off", ())[:-1])
    broken += "" if "designed" not in data else f" (designed: {', '.join(map(known, data['designed']))})"
    cells = (
        data["row"],
        f"{data['touches']} at {data['indexations']}",
        f"{data['time_s'] / 60:.2f}",
        reached,
        f"{sure['bound']:.3g}",
        f"{100 * sure['efficiency']:.0f} %",
        f"{100 * sure['efficiency_at_these_indexations']:.0f} %",
        wanted,
        others,
        broken,
        f"{model:.0f}, {control:.0f}",
        f"{data['cpu_s']:.0f}",
    )
    return f"| {' | '.join(cells)} |"


HEAD = (
    "cell/goal/minutes",
    "touches at indexations",
    "min",
    "reached",
    "bound",
    "efficiency",
    "at these indexations",
    "wanted",
    "others (times)",
    "broken off at 25, 50, 75 %",
    "s by model, by control",
    "CPU s",
)


def main() -> int:
    """→ exit status: 0."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--plans", type=Path)
    parser.add_argument("--parts", action="store_true")
    given = parser.parse_args()
    kept: dict[str, dict[str, Any]] = {}
    if given.keep is not None and given.keep.exists():
        kept = {data["row"]: data for data in map(json.loads, given.keep.read_text().splitlines())}
    asked = [r for r in ROWS if not given.rows or any(w == r.name or w in r.name.split("/") for w in given.rows)]
    print(f"| {' | '.join(HEAD)} |", "|" + " --- |" * len(HEAD), sep="\n", flush=True)
    for row in asked:
        data = kept.get(row.name)
        if data is None or (given.parts and "broken_off" in data and "designed" not in data):
            data = measured(row, given.parts, given.plans)
            if given.keep is not None:
                with given.keep.open("a") as file:
                    file.write(json.dumps(data) + "\n")
        print(shown(data), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
