"""`tango verify`: does the estimate predict what it has not seen?"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate, estimate
from ..files import artefact_text, degrees_of, read_cell, read_readings, read_terms, read_world, strategy_text, write_text
from ..files.write import dump, machine_text
from ..kinematics import chain, tip
from ..records import Array, Cell, InputError, Readings, TermItem
from ..report import pictures
from ..verify import cmm, held_out, sphere, summary, volume
from ._common import cell_option, json_option, table, write_json

SUBSETS: tuple[tuple[TermItem, ...], ...] = (("S1",), ("S2",), ("S3",), ("S4",))
path = click.Path(path_type=Path)


@click.command()
@cell_option
@click.option("--readings", "file", type=path, metavar="FILE", help="Readings file [default: readings.csv in the cell].")
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option("--subsets", is_flag=True, help="Held-out touches and CMM also with S1, S2, S3 and S4, side by side.")
@click.option("--hold-out", "hold", multiple=True, metavar="3,7,12", help="Predict these indexations from all others; repeatable.")
@click.option("--leave-one-out", "one", is_flag=True, help="Predict each indexation from all others (what is done by default).")
@click.option("--groups", "size", type=int, metavar="N", help="Hold out N indexations at a time, spread over the plan.")
@click.option("--cmm", "cmm_file", type=path, metavar="FILE", help="Facets measured by a CMM: facet and x,y,z or offset.")
@click.option("--sphere", "ball", is_flag=True, help="Sphere test foretold from the estimate (and --world, if given).")
@click.option("--sphere-cell", type=path, metavar="DIR", help="Sphere test measured: cell of the sphere with its readings.csv.")
@click.option("--write-sphere", type=path, metavar="DIR", help="Write a cell that touches a sphere at the cell's indexations.")
@click.option("--sphere-at", metavar="X,Y,Z", default="0,150,100", show_default=True, help="Its centre, mm, table frame.")
@click.option("--sphere-diameter", type=float, default=19.05, show_default=True, help="mm")
@click.option("--volume", "volumetric", is_flag=True, help="Error of the tool tip over the working volume.")
@click.option("--levels", type=int, metavar="N", help="Grid points an axis.")
@click.option("--over", type=click.Choice(["travel", "probed"]), default="travel", show_default=True, help="Extent of the grid.")
@click.option("--world", "world_file", type=path, metavar="FILE", help="The true machine, for --volume and --sphere.")
@click.option("--after", "after_file", type=path, metavar="FILE", help="Readings after compensation, for --volume.")
@click.option("--limit-um", type=float, metavar="L", help="Exit 1 when a check is worse than this, µm; see docs/verify.md.")
@click.option("--pictures", "picture_folder", type=path, metavar="DIR", help="Write pictures there (needs matplotlib).")
@json_option
def command(**options: Any) -> int:
    """Checks the estimate against what it has not seen: held-out indexations, a CMM, a sphere, the whole working volume.

    Without a choice, each indexation is predicted from all others. Exit status 1 when --limit-um is exceeded.
    """
    folder: Path = options["folder"]
    cell = read_cell(folder)
    if options["write_sphere"]:
        write_sphere(cell, options)
        return 0
    if options["limit_um"] is not None and not options["limit_um"] > 0:
        raise InputError(f"--limit-um: found {options['limit_um']:g}; allowed: greater than 0 µm")
    readings = read_readings(options["file"] or folder / "readings.csv", cell.machine, cell.artefact)
    terms = cell.terms if options["terms"] is None else read_terms(options["terms"])
    result = estimate(cell.machine, cell.artefact, readings, terms, options["degree"])
    job = _Job(cell, readings, terms, result, options)
    other = options["cmm_file"] or options["ball"] or options["sphere_cell"] or options["volumetric"]
    if options["hold"] or options["one"] or options["size"] or not other:
        job.held_out()
    if options["cmm_file"]:
        job.cmm()
    if options["ball"] or options["sphere_cell"]:
        job.sphere()
    if options["volumetric"]:
        job.volume()
    return job.finish()


def write_sphere(cell: Cell, options: dict[str, Any]) -> None:
    """cell, options → a cell that touches a sphere. Raises InputError for a folder in use or a sphere out of reach."""
    folder: Path = options["write_sphere"]
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
    click.echo(f"Next: tango run -C {folder}, then tango verify -C {options['folder']} --sphere-cell {folder}")


def _sphere(cell: Cell, options: dict[str, Any]) -> tuple[Any, Any]:
    try:
        centre = [float(value) for value in options["sphere_at"].split(",")]
    except ValueError:
        centre = []
    if len(centre) != 3 or not np.all(np.isfinite(centre)):
        raise InputError(f"--sphere-at: found {options['sphere_at']!r}; allowed: three numbers of mm, e.g. 0,150,100")
    if not options["sphere_diameter"] > 0:
        raise InputError(f"--sphere-diameter: found {options['sphere_diameter']:g}; allowed: greater than 0 mm")
    unturned = [i for i in cell.strategy.indexations if not i.position.get("S", 0.0)]
    seen: dict[tuple[tuple[str, float], ...], Any] = {tuple(sorted(i.position.items())): i for i in unturned}
    return sphere.sphere_cell(cell.machine, list(seen.values()), centre, options["sphere_diameter"] / 2, cell.strategy.approach)


@dataclasses.dataclass
class _Job:
    """One run of the command: what was found so far, for JSON, for people and against the limit."""

    cell: Cell
    readings: Readings
    terms: tuple[TermItem, ...]
    result: Estimate
    options: dict[str, Any]

    def __post_init__(self) -> None:
        self.data: dict[str, Any] = {"format": "tango-verification/1", "terms": list(self.terms)}
        self.lines: list[str] = []
        self.limited: dict[str, float] = {}
        self.drawn: dict[str, Any] = {}

    @property
    def pictures(self) -> bool:
        return self.options["picture_folder"] is not None

    def choices(self) -> list[tuple[str, tuple[TermItem, ...]]]:
        every = [*(SUBSETS if self.options["subsets"] else ()), self.terms]
        named = {_spelt(terms): terms for terms in every}
        return list(named.items())

    def groups(self) -> held_out.Groups:
        number = held_out.indexations(self.readings, self.cell.machine)
        groups: list[tuple[int, ...]] = [_numbers(text) for text in self.options["hold"]]
        if self.options["size"] is not None:
            groups += held_out.dealt(number, self.options["size"])
        if self.options["one"] or not groups:
            groups += held_out.leave_one_out(number)
        return tuple(groups)

    def held_out(self) -> None:
        groups, degree = self.groups(), self.options["degree"]
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
        ]
        if len(own.groups) <= 6:
            self.lines += ["held out: " + held_out.in_words(self.readings, self.cell.machine, g) for g in own.groups]
        if own.unpredictable:
            self.lines.append(f"not predictable, touched at held-out indexations only: facets {', '.join(own.unpredictable)}")
        always = {c.text for c in self.result.selection.unseen}
        self.lines += [f"without some of the indexations cannot be seen: {text}" for text in own.unseen if text not in always]
        if self.pictures:
            names = {int(i): held_out.in_words(self.readings, self.cell.machine, [i]) for i in np.unique(own.indexation)}
            self.drawn["held_out"] = pictures.held_out(own.indexation, own.residual, own.expected, names)

    def cmm(self) -> None:
        measured = cmm.read_cmm(self.options["cmm_file"], self.cell.artefact)
        rows, found, panels = [["against the CMM", "terms", *summary.FIGURES]], {}, {}
        for name, terms in self.choices():
            result = (
                self.result
                if name == _spelt(self.terms)
                else estimate(self.cell.machine, self.cell.artefact, self.readings, terms, self.options["degree"])
            )
            table_, tips = cmm.compare_artefact(result, measured), cmm.compare_tips(result, self.readings, measured)
            found[name] = {"artefact": summary.comparison_json(table_), "tips": summary.comparison_json(tips)}
            rows.append(["estimated facets", name, *summary.figures_text(table_.figures)])
            rows.append(["predicted tip positions", name, *summary.figures_text(tips.figures)])
            panels[f"{name}: predicted tip against CMM"] = self.arrows(tips.facet, tips.residual)
            if name == _spelt(self.terms):
                self.limited["tip positions against the CMM"] = tips.figures.worst
        self.data["cmm"] = found
        self.lines += [f"CMM comparison, {len(measured)} facets, µm after the best rigid fit", table(rows, "<<>>>>>")]
        if self.pictures:
            self.drawn["cmm"] = pictures.vectors(panels)

    def arrows(self, facets: tuple[str, ...], residual: Array) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        known = self.cell.artefact.facets
        order = {f: i for i, f in enumerate(known)}
        spread = np.arange(len(facets)) if len(set(facets)) < len(facets) else np.array([order[f] for f in facets])
        return np.array([known[f].point for f in facets]), np.array([known[f].normal for f in facets]), residual, spread

    def sphere(self) -> None:
        if self.options["sphere_cell"]:
            other = read_cell(self.options["sphere_cell"])
            if other.machine.topology != self.cell.machine.topology:
                raise InputError(f"--sphere-cell: found topology {other.machine.topology}; allowed: {self.cell.machine.topology}")
            file = self.options["sphere_cell"] / "readings.csv"
            touches = sphere.measured(other.machine, other.artefact, read_readings(file, other.machine, other.artefact))
            what = "measured"
        else:
            artefact, strategy = _sphere(self.cell, self.options)
            if self.options["world_file"]:
                from sim_controller.simulate import simulate

                world = dataclasses.replace(read_world(self.options["world_file"]), facets={})
                readings = simulate(self.cell.machine, artefact, strategy, world)
                touches, what = sphere.measured(self.cell.machine, artefact, readings), "of the simulated machine"
            else:
                truth = sphere.drawn(self.result)
                touches = sphere.contacts(self.cell.machine, artefact, strategy, truth, self.result.sigma)
                what = "foretold for a machine drawn from the estimate and its uncertainty"
        found = sphere.sphere_test(self.result, touches)
        self.data["sphere"] = {"source": what, **summary.sphere_json(found)}
        foretold = what.startswith("foretold")
        self.limited["out of sphericity, compensated"] = found.expected[1] if foretold else found.compensated.out_of_sphericity
        self.lines += [f"Sphere test {what}, {len(touches)} touches", table(summary.sphere_rows(found), "<>>")]
        self.lines.append(
            f"touch scatter and the uncertainty of the estimate alone leave {found.expected[0] * 1e3:.2f} µm out of sphericity "
            f"(97.5 %: {found.expected[1] * 1e3:.2f}); more than that is machine which the model does not contain"
        )
        if self.pictures:
            panels = {"nominal model": found.nominal.residual, "compensated model": found.compensated.residual}
            self.drawn["sphere"] = pictures.sphere(touches.normal, found.true_radius, panels)

    def volume(self) -> None:
        machine, touches = self.cell.machine, self.result.model.touches
        own = np.array(touches.position)
        own[:, machine.column("S")] = 0.0
        grid = volume.grid(machine, touches, self.options["levels"], self.options["over"])
        chart = volume.volume(self.result, np.vstack([grid, own]))
        sizes = {"error": chart.size}
        if self.options["world_file"]:
            from sim_controller.world import tip_in_table, true_machine

            world = dataclasses.replace(read_world(self.options["world_file"]), stylus={}, facets={})
            true = tip_in_table(true_machine(machine, world), chart.position, np.zeros_like(chart.position))
            before = volume.of_tips(chart, true, touches)
            sizes = {"before": np.linalg.norm(before, axis=1), "after": np.linalg.norm(before - chart.error, axis=1)}
        elif self.options["after_file"]:
            again = read_readings(self.options["after_file"], machine, self.cell.artefact)
            later = volume.volume(estimate(machine, self.cell.artefact, again, self.terms, self.options["degree"]), chart.position)
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
        if self.pictures:
            names = (*machine.linear, *machine.rotary)
            columns = [machine.column(n) for n in names]
            at = (chart.position / degrees_of(machine))[:, columns]
            unit = ["mm" if n in machine.linear else "°" for n in names]
            self.drawn["volume"] = pictures.volume(names, at, unit, sizes, chart.std, inside)

    def finish(self) -> int:
        limit = self.options["limit_um"]
        failed = {} if limit is None else {name: worst for name, worst in self.limited.items() if worst * 1e3 > limit}
        if limit is not None:
            self.data |= {"limit_um": limit, "passed": not failed}
            for name, worst in self.limited.items():
                verdict = "exceeds" if name in failed else "within"
                self.lines.append(f"{name}: {worst * 1e3:.2f} µm, {verdict} the limit of {limit:g} µm")
        for name, drawn in self.drawn.items():
            file = pictures.write(drawn, self.options["picture_folder"] / f"{name}.png")
            click.echo(f"picture: {file}", err=True)
        if not write_json(self.options["json_file"], self.data):
            click.echo("\n".join(self.lines))
        return int(bool(failed))


def _range(touches: Any, name: str) -> str:
    at = touches.axis(name)
    scale, unit = (1.0, "mm") if name in touches.machine.linear else (180 / np.pi, "°")
    low, high = touches.machine.axis(name).travel or (at.min(), at.max())
    return f"{name} {low * scale:.4g} … {high * scale:.4g} {unit} (touched {at.min() * scale:.4g} … {at.max() * scale:.4g})"


def _numbers(text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--hold-out: found {text!r}; allowed: numbers of indexations, e.g. 3,7,12") from None


def _spelt(terms: tuple[TermItem, ...]) -> str:
    names = [item if isinstance(item, str) else str(item["cause"]) for item in terms]
    return "+".join(names if len(names) <= 4 else [*names[:2], f"{len(names) - 2} more"])
