"""The checks of `tango verify` one after the other: what each found, for JSON, for people, against the limit and as pictures."""

from __future__ import annotations

import csv
import dataclasses
import io
from pathlib import Path
from typing import Any, Literal

import click
import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate, estimate
from ..files import artefact_text, degrees_of, read_cell, read_readings, read_world, strategy_text, write_text
from ..files.origin import current
from ..files.write import dump, machine_text
from ..iso230.signed import withheld
from ..iso230.temperature import grown
from ..judgement import Judgement
from ..kinematics import chain, tip
from ..records import Array, Cell, InputError, Machine, Readings, TermItem
from ..report import pictures
from ..verify import cmm, held_out, sphere, summary, volume
from ..verify.apart import apart
from ._common import table, write_json
from ._handed import pasted, printed
from ._trust import members, status, told
from .iso230 import thermal_of

SUBSETS: tuple[tuple[TermItem, ...], ...] = (("S1",), ("S2",), ("S3",), ("S4",))


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line states, under the names of its options."""

    folder: Path
    file: Path | None
    terms: str | None
    degree: int
    subsets: bool
    hold: tuple[str, ...]
    one: bool
    size: int | None
    cmm_file: Path | None
    cmm_scale: bool
    ball: bool
    sphere_cell: Path | None
    write_sphere: Path | None
    sphere_at: str
    sphere_diameter: float
    volumetric: bool
    levels: int | None
    over: Literal["travel", "probed"]
    map_file: Path | None
    world_file: Path | None
    after_file: Path | None
    limit_um: float | None
    picture_folder: Path | None
    despite: bool
    json_file: str | None


def write_sphere(cell: Cell, options: Options) -> None:
    """cell, options → a cell that touches a sphere. Raises InputError for a folder in use or a sphere out of reach."""
    folder = options.write_sphere
    assert folder is not None
    if folder.exists() and any(folder.iterdir()):
        raise InputError(f"{folder}: already there and not empty; give a new folder, nothing is ever overwritten")
    artefact, strategy = _sphere(cell, options)
    write_text(folder / "machine.yaml", machine_text(cell.machine))
    write_text(folder / "artefact.yaml", artefact_text(artefact))
    write_text(folder / "strategy.yaml", strategy_text(strategy))
    tango: dict[str, Any] = {"tango": 1, "machine": "machine.yaml", "artefact": "artefact.yaml", "strategy": "strategy.yaml"}
    if cell.controller is not None:
        port = {} if cell.controller.port is None else {"port": cell.controller.port}
        tango["controller"] = {"post": cell.controller.post, **port, **cell.controller.options}
    write_text(folder / "tango.yaml", dump(tango))
    count = sum(len(i.facets) for i in strategy.indexations)
    click.echo(f"{folder} holds a cell with {count} touches on a sphere at {len(strategy.indexations)} indexations")
    click.echo(f"Next: tango run -C {pasted(folder)}, then tango verify -C {pasted(options.folder)} --sphere-cell {pasted(folder)}")


def _sphere(cell: Cell, options: Options) -> tuple[Any, Any]:
    try:
        centre = [float(value) for value in options.sphere_at.split(",")]
    except ValueError:
        centre = []
    if len(centre) != 3 or not np.all(np.isfinite(centre)):
        raise InputError(f"--sphere-at: found {options.sphere_at!r}; allowed: three numbers of mm, e.g. 0,150,100")
    if not options.sphere_diameter > 0:
        raise InputError(f"--sphere-diameter: found {options.sphere_diameter:g}; allowed: greater than 0 mm")
    unturned = [i for i in cell.strategy.indexations if not i.position.get("S", 0.0)]
    seen: dict[tuple[tuple[str, float], ...], Any] = {tuple(sorted(i.position.items())): i for i in unturned}
    return sphere.sphere_cell(cell.machine, list(seen.values()), centre, options.sphere_diameter / 2, cell.strategy.approach)


@dataclasses.dataclass
class Verification:
    """One run of the command: what was found so far, for JSON, for people and against the limit."""

    cell: Cell
    readings: Readings
    terms: tuple[TermItem, ...]
    result: Estimate
    options: Options
    judgement: Judgement

    def __post_init__(self) -> None:
        self.data: dict[str, Any] = {"format": "tango-verification/1", "terms": list(self.terms), **members(self.judgement)}
        self.data["not_identifiable_figures"] = list(withheld(self.result))
        self.lines: list[str] = told(self.judgement)
        self.limited: dict[str, float] = {}
        self.drawn: dict[str, Any] = {}

    @property
    def pictures(self) -> bool:
        """→ whether pictures are wanted."""
        return self.options.picture_folder is not None

    def choices(self) -> list[tuple[str, tuple[TermItem, ...]]]:
        """→ (name, terms) of the sets to compare, the cell's own among them."""
        every = [*(SUBSETS if self.options.subsets else ()), self.terms]
        named = {_spelt(terms): terms for terms in every}
        return list(named.items())

    def groups(self) -> held_out.Groups:
        """→ groups of indexations to hold out."""
        number = held_out.indexations(self.readings, self.cell.machine)
        groups: list[tuple[int, ...]] = [numbers(text) for text in self.options.hold]
        if self.options.size is not None:
            groups += held_out.dealt(number, self.options.size)
        if self.options.one or not groups:
            groups += held_out.leave_one_out(number)
        return tuple(groups)

    def held_out(self) -> None:
        """Predicts each group from all other indexations."""
        groups, degree = self.groups(), self.options.degree
        rows, found = [["predicted without", "terms", *summary.FIGURES, "predicted/expected"]], {}
        what = f"{len(groups)} groups in turn" if len(groups) > 1 else f"indexations {', '.join(map(str, groups[0]))}"
        for name, terms in self.choices():
            one = held_out.held_out(self.cell.machine, self.cell.artefact, self.readings, terms, groups, degree)
            found[name] = summary.held_out_json(one)
            rows.append([what, name, *summary.figures_text(one.figures), f"{one.ratio:.2f}"])
            if name == _spelt(self.terms):
                own = one
        self.data["held_out"] = found
        self.limited["held-out touches"] = own.figures.worst
        self.lines += [
            "Held-out indexations, µm (predicted/expected: 1 where the model predicts as well as it claims)",
            table(rows, "<<>>>>>>"),
            *summary.held_out_lines(own),
        ]
        if len(own.groups) <= 6:
            self.lines += ["held out: " + held_out.in_words(self.readings, self.cell.machine, g) for g in own.groups]
        if own.unpredictable:
            self.lines.append(
                f"cannot be predicted, because all their touches are in one held-out group: facets {', '.join(own.unpredictable)}"
            )
        always = {c.text for c in self.result.selection.unseen}
        self.lines += [
            f"with some indexations held out, the rest cannot determine: {text}" for text in own.unseen if text not in always
        ]
        if self.pictures:
            names = {int(i): held_out.in_words(self.readings, self.cell.machine, [i]) for i in np.unique(own.indexation)}
            self.drawn["held_out"] = pictures.held_out(own.indexation, own.residual, own.expected, names)

    def cmm(self, file: Path) -> None:
        """file of a CMM → estimated facets and predicted tips compared with it."""
        measured = cmm.read_cmm(file, self.cell.artefact)
        rows, found, panels = [["against the CMM", "terms", *summary.FIGURES]], {}, {}
        thermal = thermal_of(self.cell.folder)
        thermal = thermal if thermal is not None and thermal.table is not None and thermal.cmm is not None else None
        model, free = self.result.model, self.options.cmm_scale
        longer = cmm.NOT if thermal is None else grown(thermal, model.bar is not None or bool(model.calibrated))
        for name, terms in self.choices():
            result = (
                self.result
                if name == _spelt(self.terms)
                else estimate(self.cell.machine, self.cell.artefact, self.readings, terms, self.options.degree)
            )
            table_ = cmm.compare_artefact(result, measured, longer, free)
            tips = cmm.compare_tips(result, self.readings, measured, None, longer, free)
            found[name] = {"artefact": summary.comparison_json(table_), "tips": summary.comparison_json(tips)}
            rows.append(["estimated facets", name, *summary.figures_text(table_.figures)])
            rows.append(["predicted tip positions", name, *summary.figures_text(tips.figures)])
            panels[f"{name}: predicted tip against CMM"] = self.arrows(tips.facet, tips.residual)
            if name == _spelt(self.terms):
                self.limited["tip positions against the CMM"] = tips.figures.worst
                said = summary.comparison_lines(tips, thermal)
        self.data["cmm"] = found
        self.lines += [f"CMM comparison, {len(measured)} facets, µm after the best rigid fit", table(rows, "<<>>>>>"), *said]
        if self.pictures:
            self.drawn["cmm"] = pictures.vectors(panels)

    def arrows(self, facets: tuple[str, ...], residual: Array) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """facet ids (n), residuals (n,) mm → points, normals, residuals, groups for a picture."""
        known = self.cell.artefact.facets
        order = {f: i for i, f in enumerate(known)}
        spread = np.arange(len(facets)) if len(set(facets)) < len(facets) else np.array([order[f] for f in facets])
        return np.array([known[f].point for f in facets]), np.array([known[f].normal for f in facets]), residual, spread

    def sphere(self) -> None:
        """Predicts or evaluates the sphere test."""
        if self.options.sphere_cell:
            other = read_cell(self.options.sphere_cell)
            if other.machine.topology != self.cell.machine.topology:
                raise InputError(f"--sphere-cell: found topology {other.machine.topology}; allowed: {self.cell.machine.topology}")
            file = current(self.options.sphere_cell)
            touches = sphere.measured(other.machine, other.artefact, read_readings(file, other.machine, other.artefact))
            what = "measured"
        else:
            artefact, strategy = _sphere(self.cell, self.options)
            if self.options.world_file:
                from sim_controller.simulate import simulate

                world = dataclasses.replace(read_world(self.options.world_file), facets={})
                readings = simulate(self.cell.machine, artefact, strategy, world)
                touches, what = sphere.measured(self.cell.machine, artefact, readings), "of the simulated machine"
            else:
                truth = sphere.drawn(self.result)
                touches = sphere.contacts(self.cell.machine, artefact, strategy, truth, self.result.sigma)
                what = "predicted for a machine drawn from the estimate and its uncertainty"
        found = sphere.sphere_test(self.result, touches)
        self.data["sphere"] = {"source": what, **summary.sphere_json(found)}
        predicted = what.startswith("predicted")
        self.limited["out of sphericity, compensated"] = found.expected[1] if predicted else found.compensated.out_of_sphericity
        self.lines += [f"Sphere test {what}, {len(touches)} touches", table(summary.sphere_rows(found), "<>>")]
        self.lines.append(
            f"touch scatter and the uncertainty of the estimate alone leave {found.expected[0] * 1e3:.2f} µm out of sphericity "
            f"(97.5 %: {found.expected[1] * 1e3:.2f}); more than that is machine which the model does not contain"
        )
        if self.pictures:
            panels = {"nominal model": found.nominal.residual, "compensated model": found.compensated.residual}
            self.drawn["sphere"] = pictures.sphere(touches.normal, found.true_radius, panels)

    def volume(self) -> None:
        """Maps the error of the tool tip."""
        machine, touches = self.cell.machine, self.result.model.touches
        own = np.array(touches.position)
        own[:, machine.column("S")] = 0.0
        grid = volume.grid(machine, touches, self.options.levels, self.options.over)
        chart = volume.volume(self.result, np.vstack([grid, own]))
        sizes = {"error": chart.size}
        if self.options.world_file:
            from sim_controller.world import tip_in_table, true_machine

            world = dataclasses.replace(read_world(self.options.world_file), stylus={}, facets={})
            true = tip_in_table(true_machine(machine, world), chart.position, np.zeros_like(chart.position))
            before = volume.of_tips(chart, true, touches)
            sizes = {"before": np.linalg.norm(before, axis=1), "after": np.linalg.norm(before - chart.error, axis=1)}
        elif self.options.after_file:
            again = read_readings(self.options.after_file, machine, self.cell.artefact)
            later = volume.volume(estimate(machine, self.cell.artefact, again, self.terms, self.options.degree), chart.position)
            sizes = {
                "before": chart.size,
                "after": np.linalg.norm(volume.of_tips(chart, tip(chain(machine), chart.position) + later.error, touches), axis=1),
            }
        inside = ~chart.extrapolated
        regions = {"within what was touched": inside, "beyond it: extrapolated, a guess": ~inside}
        found = {
            key: summary.region_json(machine, chart, rows, sizes)
            for key, rows in zip(("touched", "extrapolated"), regions.values(), strict=True)
        }
        self.data["volume"] = {"grid_poses": len(grid), "reference": "best set-up of workpiece and tool length", **found}
        limit = sizes["after"] if "after" in sizes else sizes["error"]
        self.limited["error in the touched volume"] = float(limit[inside].max()) if inside.any() else float(limit.max())
        rows = [["tool tip relative to the table", "poses", "", "largest", "std there", "rms", "at"]]
        for name, mask in regions.items():
            for key, size in sizes.items():
                i = np.flatnonzero(mask)
                if not len(i):
                    continue
                w = i[np.argmax(size[i])]
                shown = [f"{size[w] * 1e3:.2f}", f"{chart.std[w] * 1e3:.2f}", f"{np.sqrt(np.mean(size[i] ** 2)) * 1e3:.2f}"]
                rows.append([name, f"{len(i)}", key, *shown, summary.pose_text(machine, chart.position[w])])
        self.lines += ["Volumetric error, µm, after the best set-up of workpiece and tool length", table(rows, "<><>>><")]
        reversal = float(chart.reversal[inside].max()) if inside.any() else 0.0
        self.lines.append(f"backlash adds up to {reversal * 1e3:.2f} µm to either side within what was touched")
        far = [n for n in (*machine.linear, *machine.rotary) if chart.outside[:, machine.column(n)].any()]
        if far:
            self.lines.append(f"travel beyond the touched range: {', '.join(_range(touches, n) for n in far)}")
        if unseen := [c.names[0] for c in self.result.selection.unseen]:
            self.lines.append(f"not contained, since the touches cannot see it: {', '.join(unseen)}")
        if beside := apart(self.result):
            self.lines.append(beside)
        if self.options.map_file is not None:
            write_text(self.options.map_file, map_csv(machine, chart, sizes))
            self.lines.append(f"map of {len(chart.position)} poses: {self.options.map_file}")
        if self.pictures:
            names = (*machine.linear, *machine.rotary)
            columns = [machine.column(n) for n in names]
            at = (chart.position / degrees_of(machine))[:, columns]
            unit = ["mm" if n in machine.linear else "°" for n in names]
            self.drawn["volume"] = pictures.volume(names, at, unit, sizes, chart.std, inside)

    def finish(self) -> int:
        """→ exit status; writes pictures, JSON or text."""
        limit = self.options.limit_um
        failed = {} if limit is None else {name: worst for name, worst in self.limited.items() if worst * 1e3 > limit}
        if limit is not None:
            self.data |= {"limit_um": limit, "passed": not failed and not status(self.judgement, self.options.despite)}
            for name, worst in self.limited.items():
                verdict = "exceeds" if name in failed else "within"
                self.lines.append(f"{name}: {worst * 1e3:.2f} µm, {verdict} the limit of {limit:g} µm")
        folder = self.options.picture_folder
        for name, drawn in self.drawn.items():
            assert folder is not None  # nothing is drawn without
            file = pictures.write(drawn, folder / f"{name}.png")
            click.echo(f"picture: {file}", err=True)
        if not write_json(self.options.json_file, self.data):
            printed("\n".join(self.lines))
        return int(bool(failed))


def map_csv(machine: Machine, chart: volume.VolumeMap, sizes: dict[str, Array]) -> str:
    """map → CSV, one row a pose: axes in mm and degrees, nominal tip in mm, errors in µm, whether it is extrapolated."""
    names = (*machine.linear, *machine.rotary)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    errors = ["error_x_um", "error_y_um", "error_z_um", *(f"{key}_um" for key in sizes if key != "error"), "std_um", "reversal_um"]
    writer.writerow([*names, "x", "y", "z", *errors, "extrapolated"])
    at = (chart.position / degrees_of(machine))[:, [machine.column(name) for name in names]]
    more = [size for key, size in sizes.items() if key != "error"]
    values = 1e3 * np.column_stack([chart.error, *more, chart.std, chart.reversal])
    for i in range(len(at)):
        row = [f"{v + 0.0:.4f}" for v in (*at[i], *chart.point[i])] + [f"{v + 0.0:.3f}" for v in values[i]]
        writer.writerow([*row, int(chart.extrapolated[i])])
    return out.getvalue()


def _range(touches: Any, name: str) -> str:
    at = touches.axis(name)
    scale, unit = (1.0, "mm") if name in touches.machine.linear else (180 / np.pi, "°")
    low, high = touches.machine.axis(name).travel or (at.min(), at.max())
    return f"{name} {low * scale:.4g} … {high * scale:.4g} {unit} (touched {at.min() * scale:.4g} … {at.max() * scale:.4g})"


def numbers(text: str) -> tuple[int, ...]:
    """`3,7,12` → numbers of indexations. Raises InputError for anything else."""
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--hold-out: found {text!r}; allowed: numbers of indexations, e.g. 3,7,12") from None


def _spelt(terms: tuple[TermItem, ...]) -> str:
    names = [item if isinstance(item, str) else str(item["cause"]) for item in terms]
    return "+".join(names if len(names) <= 4 else [*names[:2], f"{len(names) - 2} more"])
