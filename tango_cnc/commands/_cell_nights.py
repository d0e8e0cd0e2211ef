"""A cell → the analysis of its nights: what is followed, what touches cost, and the stages that read an estimate."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg

import postprocessors as posts

from ..compensate import loop
from ..duration import duration
from ..estimate import Estimate
from ..files import read_cell, read_readings_text, read_strategy
from ..files.checked import suggestion
from ..files.nightly import NAME, Nightly, history_of, read_nightly
from ..gate import proving_touch
from ..iso230.signed import withheld
from ..link.rest import durations
from ..nightly.analysis import Nights
from ..nightly.before import Timed
from ..nightly.doubt import NightDoubt
from ..plan import last_motion
from ..records import Cell, InputError, Plan, Readings, TangoError
from ..report.units import shown
from ..state import Frame, frame
from ..state.volume import levers
from ..texts import Said, instead, say
from ..touches import of_facets
from ._common import dialect, json_text
from ._in_control import given, in_control
from .estimate import as_json as estimate_json

if TYPE_CHECKING:
    from ..history.former import Names

LOOKED = 30  # nights looked back over for those of another cell

CHECK = "check.yaml"
LEAST = 0.1  # µrad, µm/m: no night sees less of an angle or a scale
READ = 64  # nights whose readings are kept parsed: many nights in one process learn from the same ones


def nights_of(cell: Cell, settings: Nightly, made: Plan, *, deep: bool = True) -> Nights:
    """cell, settings, its plan, whether plausibility and diagnosis are asked → the analysis. Raises InputError."""
    position = np.array([touch.contact for touch in made.touches])
    touches = of_facets(cell.machine, cell.artefact, [t.facet for t in made.touches], position, last_motion(made))
    followed = frame(touches, cell.terms)
    _limited(cell, settings, followed)
    check = None
    if (cell.folder / CHECK).exists():
        check = replace(cell, strategy=read_strategy(cell.folder / CHECK, cell.machine, cell.artefact))
    return Nights(
        cell,
        settings,
        followed,
        replace(timed(made), first=_begins(cell, made)),
        lru_cache(READ)(lambda text: read_readings_text(text, cell.machine, cell.artefact)),
        check,
        _judged if deep else None,
        _diagnosed if deep else None,
        lambda result: {"estimate.json": json_text(estimate_json(result, withheld(result))) + "\n"},
        **_compensations(cell.folder, followed),
    )


def _compensations(folder: Path, followed: Frame, until: str = "") -> dict[str, Any]:
    """cell, what is followed, before which moment (UTC; '': now) → members of the analysis that tell what the control holds."""
    return {
        "control": in_control(folder, followed.model, lambda: levers(followed), until),
        "given": given(folder, until),
        "happened": tuple(loop.happened(folder, until)),
    }


def as_of(analysis: Nights, utc: str) -> Nights:
    """analysis, moment (UTC) → the same with what the control held then: a night of the past is judged by what was known."""
    if len(loop.happened(analysis.cell.folder, utc)) == len(analysis.happened):
        return analysis
    return replace(analysis, **_compensations(analysis.cell.folder, analysis.followed, utc))


def _limited(cell: Cell, settings: Nightly, followed: Frame) -> None:
    """A limit of what no night follows would never be crossed, and one below what a touch can see always is: raises InputError."""
    units = {"volume": "mm"} | {followed.selection.label(followed.names[i]): followed.units[i] for i in followed.machine}
    known = list(units)
    for name in settings.limits:
        if name not in known:
            raise InputError(
                f"{cell.folder / NAME}: limits: found {name!r}, which the nights of this machine do not follow; "
                f"allowed: {', '.join(known)}.{suggestion(name, known)}"
            )
        limit = settings.limits[name]
        factor, unit = shown(units[name])
        least = cell.machine.probe.repeatability * factor if units[name] == "mm" else LEAST
        if limit < least:
            raise InputError(
                f"{cell.folder / NAME}: limits: found {limit:g} {unit} for {name!r}, which no night can see: "
                f"limits are in {unit}, allowed: {least:g} or more. Did you mean {limit * 1e3:g}?"
            )


def _begins(cell: Cell, made: Plan) -> tuple[int, ...]:
    """cell, plan of its strategy → the touch that every night begins with: the facet that proves the probe (docs/dialects.md)."""
    if cell.controller is None or posts.settings(dialect(cell), cell.controller.options).get("gate", "none") != "facet":
        return ()
    try:
        return (proving_touch(made).number,)
    except InputError:  # no night of this cell can begin: its preflight says so
        return ()


def timed(made: Plan) -> Timed:
    """plan → what one touch and one more indexation cost, out of the predicted time of the whole."""
    seconds = durations(made)
    numbers = np.array([t.number for t in made.touches])
    indexation = np.unique([t.indexation for t in made.touches], return_inverse=True)[1]
    first = np.concatenate([[True], np.diff(indexation) != 0])
    spent = np.array([seconds[int(n)] for n in numbers])
    touch = float(np.median(spent[~first])) if np.any(~first) else float(np.median(spent))
    turn = max(float(np.mean(spent[first])) - touch, 0.0)
    rest = max(sum(duration(made).values()) - float(spent.sum()), 0.0) / len(numbers)
    return Timed(numbers, indexation, touch + rest, turn)


def again() -> str:
    """→ who makes what a night has not made: no run goes on with the readings of a night."""
    return say("night.again")


def _judged(cell: Cell, readings: Readings, result: Estimate, kind: str, agrees: bool = False) -> NightDoubt:
    """As 'tango estimate' judges a whole strategy; a check by what is known after it.

    A check of few touches is judged by the nights before alone: so few cannot show which of them does not fit.
    `agrees`: the touches are where the nights before predicted them. Then a wander that the readings show by themselves is one that
    the errors of the machine could make as well, and chance: it makes no night doubtful, however small it is.
    """
    from ..estimate import estimate
    from ..noise import honest
    from ..plausible import STRUCTURED, judge
    from ..plausible.creeps import CREPT
    from ..plausible.spare import FEW

    if kind == "full":
        with suppress(TangoError):
            result = estimate(cell.machine, cell.artefact, readings, cell.terms)
    plain, spare = result, len(result.jacobian) - len(result.values)
    if kind == "full" or spare >= FEW:
        with suppress(np.linalg.LinAlgError, scipy.linalg.LinAlgError):
            result = honest(result)
    walk = 0.0 if result.noise is None else result.noise.walk / max(result.noise.white, 1e-9)
    found = judge(cell, readings, result, search=False, alone=kind == "full", agrees=agrees)
    if agrees and walk > 0 and found.verdict != "trustworthy":
        found, walk = judge(cell, readings, plain, search=False, alone=kind == "full", agrees=agrees), 0.0
    wandered = next((r for r in found.reasons if "wandered" in r), "") if walk > STRUCTURED else ""
    resume = str(say("plausible.readings.go_on_with_tango_run", more=""))
    reasons = tuple(instead(r, resume, again()) for r in found.reasons)
    crept = next((r for r in found.remarks if isinstance(r, Said) and r.key == CREPT), "")
    return NightDoubt(found.verdict, reasons, found.incomplete, wandered, walk, crept=crept)


def _diagnosed(cell: Cell, readings: Readings) -> Mapping[str, Any]:
    from ..diagnose import diagnose
    from ..diagnose.words import as_json

    return as_json(diagnose(cell.machine, cell.artefact, readings, cell.terms))


def twin(history: Names, name: str, folder: Path, where: str | None = None) -> Path | None:
    """history, name of the machine of a cell, its folder, --history → another folder with nights in this history under that name,
    if its machine.yaml still has the name; else None. A folder that was moved or renamed counts as gone.
    """
    if name not in history.machines():
        return None
    records = [r for r in history.records(name, LOOKED) if not any(p.get("check") == "import" for p in r.get("preflight") or ())]
    for other in dict.fromkeys(str(r.get("cell") or "") for r in records):
        if other and _is_twin(Path(other), name, folder, where):
            return Path(other)
    return None


def _is_twin(other: Path, name: str, folder: Path, where: str | None) -> bool:
    try:
        if not (other / "machine.yaml").exists() or other.resolve() == folder.resolve():
            return False
        own, its = (history_of(one, read_nightly(one), where) for one in (folder, other))
        same = own.resolve() == its.resolve() if isinstance(own, Path) and isinstance(its, Path) else own == its
        return same and read_cell(other).machine.name == name
    except (TangoError, OSError):  # a cell that nobody can read measures nothing
        return False
