"""`tango compensate --sign-trial` and `--sign-of`: a change of some micrometers, touched before and with it in the control."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import click

from ..compensate import loop, targets, trial
from ..compensate.proposal import Proposal
from ..estimate import Estimate
from ..files import read_readings
from ..files.then import at_that_time
from ..records import Cell, InputError, TangoError
from ..touches import Touches, from_readings
from . import _compensate
from ._common import write_json
from ._handed import pasted, printed
from ._present import ended, rows, whose_is

BLIND = "no touch feels this change, whatever its sign, so these readings say nothing of it"
WITHOUT = (
    "The change acts with tool center point control alone. A control without it uses none of these numbers, in no program: there "
    "propose without them (--set kinematics=no --set directions=no, or what --facts lists for it)"
)


def written(cell: Cell, proposal: Proposal, result: Estimate, options: dict[str, Any], now: str, *, simulated: bool) -> int:
    """cell, proposal, its estimate, options, UTC, whether its readings are simulated → exit status; the folder of a trial."""
    changed, changes = trial.trial(proposal, options["trial_of"])
    touches = result.model.touches
    number, size = trial.best(proposal.held, changes, touches)
    first = cell.folder / loop.FOLDER / f"sign-trial-{options['target']}"
    free = (place for i in count(1) if not (place := first if i == 1 else first.with_name(f"{first.name}-{i}")).exists())
    folder = options["out"] or next(free)
    loop.store(cell.folder, changed, now, folder, simulated=simulated, trial=True)
    facet = touches.facet[list(touches.number).index(number)]
    tcp = any(h.tcp for h in proposal.held if h.place in changes)
    how = " --tcp" if tcp else ""
    click.echo(
        f"→ {folder}: {len(changes)} numbers of {options['trial_of']} changed, everything else as it is now; undo/ takes it back\n"
        f"1. Load its files as steps.txt says.\n"
        f"2. Touch again what was touched{', with tool center point control on, as before' if tcp else ''}; touch {number} (facet "
        f"{facet}) alone is enough where table and stylus stay: it changes by {1e3 * abs(size):.1f} µm, and by its sign "
        f"the sign of the table is known. {trial.ENOUGH} touches or more also show a table that was moved.\n"
        f"3. tango compensate -C {pasted(cell.folder)} --sign-of {pasted(folder)} --readings BEFORE --after AFTER{how}\n"
        "4. Load undo/." + (f"\n{WITHOUT}" if tcp else "")
    )
    return 0


def judged(cell: Cell, options: dict[str, Any]) -> int:
    """cell, options → exit status; what the readings before and during a trial say of the sign. Raises InputError."""
    record = loop.check(options["sign_of"])
    if options["file"] is None or options["after"] is None:
        raise InputError("--sign-of: found no --readings or no --after; allowed: readings before the trial, and with it")
    if rows(options["file"]) == rows(options["after"]):
        raise InputError(f"--after: found the touches of {options['file']} once more; allowed: readings made during the trial")
    written = str(record["created_utc"])
    if (when := ended(options["after"])) is not None and when[:19] < written[:19]:
        raise InputError(
            f"--after: found {options['after']}, which ended at {when}, before the trial was written ({written}); allowed: "
            "readings made with the trial in the control. Before and after may have been given the wrong way round"
        )
    if when is not None and (first := ended(options["file"])) is not None and first[:19] > when[:19]:
        raise InputError(
            f"--readings: found {options['file']}, which ended at {first}, after --after ({when}); allowed: the readings before "
            "the trial. Before and after were given the wrong way round"
        )
    module = targets.load(record["target"])
    whose_is(loop.Kept(0, options["sign_of"], record), cell)
    before, after = (_touches(at_that_time(cell, file), file) for file in (options["file"], options["after"]))
    settings = targets.options(module, _compensate.settings_of(record))
    request = targets.Request(cell.machine, _compensate.volume_of(_compensate.volume_text(record), cell.machine), settings)
    changes = {v["place"]: v["new"] - v["present"] for v in record["values"] if v["new"] != v["present"]}
    held = tuple(module.held(request))
    places = [h.place for h in held if h.tcp and h.place in changes]
    if places and options["tcp"] is None:
        more = f" and {len(places) - 1} more" if len(places) > 1 else ""
        raise InputError(
            f"--sign-of: found neither --tcp nor --no-tcp, and the trial changes {places[0]}{more}, which act with tool center "
            "point control only; allowed: --tcp when both runs were made with it on; --no-tcp when one was not"
        )
    found = trial.judge(held, changes, before, after)
    if places and not options["tcp"]:
        found = replace(found, word="undecided", ratio=0.0, std=math.inf)
    flips = trial.flips(module, request, changes) if found.word == "turned round" else []
    data = {"format": "tango-sign-trial/1", "verdict": found.word, "ratio": round(found.ratio, 4), "touches": found.touches}
    if not write_json(options["json_file"], data):
        blind = places and not options["tcp"]
        printed(f"made without tool center point control: {BLIND}. {WITHOUT}" if blind else _compensate.sign(found, flips))
    return 0 if found.word == "as assumed" else TangoError.exit_code


def _touches(cell: Cell, file: Path) -> Touches:
    return from_readings(cell.machine, cell.artefact, read_readings(file, cell.machine, cell.artefact))
