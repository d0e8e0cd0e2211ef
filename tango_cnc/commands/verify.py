"""`tango verify`: test the estimate with touches that it has not used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..files import read_cell, read_readings, read_terms
from ..files.origin import current
from ..judging import judged
from ..records import InputError
from ..report import pictures
from ._beside import alone, beside
from ._common import Output, ahead, cell_option, json_option
from ._trust import despite_option, status
from ._verify import Options, Verification, write_sphere

PLACE = "Understand 40"  # in the list of commands

path = click.Path(path_type=Path)
BALL = ("--sphere", "--write-sphere")


@click.command()
@cell_option
@click.option("--readings", "file", type=path, metavar="FILE", help="Readings file [default: readings.csv, else simulated.csv].")
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option("--subsets", is_flag=True, help="Held-out touches and CMM also with S1, S2, S3 and S4, side by side.")
@click.option("--hold-out", "hold", multiple=True, metavar="3,7,12", help="Predict these indexations from all others; repeatable.")
@click.option("--leave-one-out", "one", is_flag=True, help="Predict each indexation from all others (what is done by default).")
@click.option("--groups", "size", type=int, metavar="N", help="Hold out N indexations at a time, spread over the plan.")
@click.option("--cmm", "cmm_file", type=path, metavar="FILE", help="Facets measured by a CMM: facet and x,y,z or offset.")
@beside("--cmm")("--cmm-scale", is_flag=True, help="Fit a scale between machine and CMM as well, beside what the temperatures say.")
@click.option("--sphere", "ball", is_flag=True, help="Predicted sphere test, from the estimate (and --world, if given).")
@click.option("--sphere-cell", type=path, metavar="DIR", help="Sphere test measured: cell of the sphere with its readings.csv.")
@alone("-C", "--sphere-at", "--sphere-diameter")(
    "--write-sphere", type=path, metavar="DIR", help="Write a cell that touches a sphere at the cell's indexations."
)
@beside(*BALL)("--sphere-at", metavar="X,Y,Z", default="0,150,100", show_default=True, help="Its centre, mm, table frame.")
@beside(*BALL)("--sphere-diameter", type=float, default=19.05, show_default=True, help="mm")
@click.option("--volume", "volumetric", is_flag=True, help="Error of the tool tip over the working volume.")
@beside("--volume")("--levels", type=int, metavar="N", help="Grid points an axis.")
@beside("--volume")(
    "--over", type=click.Choice(["travel", "probed"]), default="travel", show_default=True, help="Extent of the grid."
)
@beside("--volume")("--map", "map_file", type=Output(), metavar="FILE", help="Write the map of --volume as CSV, one row a pose.")
@beside("--volume", "--sphere")(
    "--world", "world_file", type=path, metavar="FILE", help="The true machine, for --volume and --sphere."
)
@beside("--volume")("--after", "after_file", type=path, metavar="FILE", help="Readings after compensation, for --volume.")
@click.option("--limit-um", type=float, metavar="L", help="Exit 1 when a check is worse than this, µm; see docs/verify.md.")
@click.option("--pictures", "picture_folder", type=path, metavar="DIR", help="Write pictures there (needs matplotlib).")
@despite_option
@json_option
def command(**given: Any) -> int:
    """Tests the estimate with measurements that it has not used: held-out indexations, a CMM, a sphere, the working volume.

    Without options, each indexation is predicted from all others. Exit status 1 when --limit-um is exceeded, or when the
    estimate is implausible.
    """
    options = Options(**given)
    folder = options.folder
    if options.picture_folder is not None:
        pictures.needed()
    cell = read_cell(folder)
    if options.write_sphere:
        write_sphere(cell, options)
        return 0
    if options.limit_um is not None and not options.limit_um > 0:
        raise InputError(f"--limit-um: found {options.limit_um:g}; allowed: greater than 0 µm")
    other = options.cmm_file or options.ball or options.sphere_cell or options.volumetric
    held = bool(options.hold or options.one or options.size or not other)
    if options.subsets and not held and not options.cmm_file:
        raise InputError("--subsets: found without held-out touches and --cmm; allowed: beside one of them, e.g. --leave-one-out")
    source = current(folder, options.file)
    readings = read_readings(source, cell.machine, cell.artefact)
    terms = cell.terms if options.terms is None else read_terms(options.terms, folder)
    result, judgement = judged(cell, readings, terms, options.degree, source=source)
    job = Verification(cell, readings, terms, result, options, judgement)
    if held:
        job.held_out()
    if options.cmm_file:
        job.cmm(options.cmm_file)
    if options.ball or options.sphere_cell:
        job.sphere()
    if options.volumetric:
        job.volume()
    failed = job.finish()
    if not failed and judgement.verdict == "trustworthy" and options.file is None and options.json_file != "-":
        ahead(folder, "uncertainty", "iso230")
    return failed or status(judgement, options.despite)
