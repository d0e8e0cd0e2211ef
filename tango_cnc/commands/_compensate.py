"""What `tango compensate` says to a person, and the reading of its options."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..compensate import targets
from ..compensate.fit import Fit
from ..compensate.proposal import Proposal
from ..compensate.rows import lines_of, rows_of
from ..compensate.space import sample
from ..compensate.trial import Sign
from ..estimate import Estimate
from ..identify.words import summary
from ..records import Cell, InputError, Machine
from ._common import table

UNREAD = (
    "the promise is of these numbers: no reader of this program is of a control with these settings, so the files were not read "
    "back. Compare them with the numbers below before they are loaded"
)
LEAST_WORSE = 0.1  # µm: a growth by less is rounding
LISTED = 6  # names in a sentence
WORTH_IT = 0.98  # of what a control leaves: programs that leave as much, but for the scatter of the draws, take nothing away


def volume_of(text: str | None, machine: Machine) -> dict[str, tuple[float, float]]:
    """'X=-100:100,B=-30:30' → limits in mm and rad. Raises InputError for anything else."""
    result = {}
    for part in text.split(",") if text else ():
        name, _, limits = part.partition("=")
        low, _, high = limits.partition(":")
        axes = (*machine.linear, *machine.rotary)
        try:
            values = float(low), float(high)
        except ValueError:
            values = (math.nan, math.nan)
        if name.strip() not in axes or not values[0] < values[1]:
            raise InputError(
                f"--volume: found {part!r}; allowed: AXIS=LOW:HIGH,… in mm and degrees, LOW below HIGH, with the axes "
                f"{' '.join(axes)}, e.g. X=-100:100,{axes[-1]}=-90:90"
            )
        scale = 1.0 if name.strip() in machine.linear else math.pi / 180
        result[name.strip()] = (values[0] * scale, values[1] * scale)
    return result


def volume_text(record: Mapping[str, Any]) -> str:
    """record of a compensation → its volume as --volume has it."""
    return ",".join(f"{name}={low!r}:{high!r}" for name, (low, high) in record["volume"].items())


def settings_of(record: Mapping[str, Any]) -> list[str]:
    """record of a compensation, or nothing → its settings as --set has them."""
    return [f"{key}={value}" for key, value in record.get("options", {}).items()]


def in_millimeters(cell: Cell, name: str) -> None:
    """cell, target → nothing. Raises InputError where its control counts in inches, and would read the millimeters of a file so."""
    options = cell.controller.options if cell.controller is not None else {}
    if options.get("position_unit") == "inch" and not targets.load(name).UNIT_BESIDE:
        beside = ", ".join(n for n in targets.names() if targets.load(n).UNIT_BESIDE)
        raise InputError(
            f"--target {name}: found a control that counts in inches (position_unit: inch in tango.yaml), and the lengths of this "
            f"target are in millimeters: it would take them as inches. Allowed: a target that has the unit beside its numbers "
            f"({beside}); of value_sheet, enter each mm divided by 25.4"
        )


def listed() -> str:
    """→ every target with its line."""
    return table([[name, targets.load(name).TEXT] for name in targets.names()], "<<")


def facts(name: str) -> str:
    """target → what it is built on, and its settings."""
    module = targets.load(name)
    lines = [f"{name}: {module.TEXT}", "", "read in manuals or source code:"]
    lines += [f"  - {fact.text} ({fact.source})" for fact in module.FACTS if fact.confirmed]
    lines += ["", "not confirmed; check each on your control:"]
    lines += [f"  - {fact.text} ({fact.source})" for fact in module.FACTS if not fact.confirmed] or ["  nothing"]
    lines += ["", "settings (--set NAME=VALUE):"]
    for key, option in module.OPTIONS.items():
        allowed = f" ({', '.join(map(str, option.allowed))})" if option.allowed and len(option.allowed) < 8 else ""
        lines.append(f"  {key}={option.default}  {option.text}{allowed}")
    return "\n".join(lines)


def text(proposal: Proposal) -> str:
    """proposal → what a person reads before anything is written."""
    best, promised = proposal.fit, proposal.fit.promised
    width = {"exactly": [], "partly": [], "not at all": [], "set-up": []}  # type: dict[str, list[str]]
    for share in sorted(best.shares, key=lambda s: -s.effect_um):
        part = f" ({100 * share.held:.0f} %)" if share.word == "partly" else ""
        width[share.word].append(f"{share.name} {share.effect_um:.1f} µm{part}")
    machine = proposal.request.machine
    limits = []
    for name, (low, high) in proposal.request.limits.items():
        scale = 1.0 if name in machine.linear else 180 / math.pi
        limits.append(f"{name} {low * scale:.0f} to {high * scale:.0f}")
    lines = [f"volume ({proposal.over}): {', '.join(limits)}", "", "what this target can hold (effect on the tool tip, rms):"]
    lines += [f"  {word:10s} {', '.join(items) or 'nothing'}" for word, items in width.items() if items or word != "set-up"]

    def row(name: str, f: object) -> list[str]:
        from ..compensate.promise import Figure

        assert isinstance(f, Figure)
        return [name, f"{f.value:.2f}", f"{f.low:.2f} to {f.high:.2f}"]

    gains = best.rms_program.value < WORTH_IT * best.rms_after.value
    lines += [
        "",
        table(
            [
                ["error of the tool tip over the volume, µm", "", "95 %"],
                row("now, rms", promised.rms_before),
                row("after, rms", promised.rms_after),
                row("now, 95 % of the volume below", promised.largest_before),
                row("after, 95 % of the volume below", promised.largest_after),
                *([row("with programs compensated as well, rms", promised.rms_program)] if gains else []),
            ],
            "<><",
        ),
        *_one_orientation(best),
        *_either(best),
        *_worse(best),
        *([] if gains else ["compensating programs as well would take nothing more away"]),
        "",
        f"direction of the tool: {best.direction_before:.1f} µrad now, {best.direction_after:.1f} µrad after (rms)",
        f"rounding to the increment costs {best.rounding:.2f} µm",
        *([UNREAD] if proposal.unread else []),
        *(f"in none of these numbers: {said}" for said in summary(proposal.not_identifiable)),
        *(
            [f"every 10 µm/m of the absolute scale leave {proposal.common_scale:.2f} µm (rms) beside these figures"]
            if proposal.common_scale
            else []
        ),
    ]
    if proposal.bar is not None:
        lines.append(
            f"all scales rest on the length of the scale bar: its {proposal.bar[0]:.2g} µm (standard uncertainty) are in "
            f"these figures, and each further µm that it is off leaves {proposal.bar[1]:.2f} µm (rms) beside them"
        )
    if proposal.unseen:
        lines += [
            "",
            f"measured without tool center point control: what the control's kinematics take away already ({proposal.unseen:.2f} "
            "µm) is off 'now' by calculation. Their numbers are replaced, not added to. The effects by name above are as measured.",
        ]
    changed = [(h, c) for h, c in zip(proposal.held, best.change, strict=True) if c]
    singles = [h for h, _ in changed if h.at is None]
    lines += ["", f"{len(changed)} of {len(proposal.held)} numbers change:"]
    rows = [[f"  {h.place}", f"{proposal.present[h.place]:.9g}", "→", f"{proposal.numbers[h.place]:.9g}", h.unit] for h in singles]
    if rows:
        lines.append(table(rows, "<><><"))
    for name in dict.fromkeys(h.table for h, _ in changed if h.at is not None):
        own = [h for h in proposal.held if h.table == name]
        most = max(abs(proposal.numbers[h.place] - proposal.present[h.place]) for h in own)
        lines.append(f"  {name}: table of {len(own)} numbers, largest change {most:.6f} {own[0].unit}")
    lines += pinned(proposal)
    lines += _together(proposal)
    if not proposal.given:
        lines += ["", "present values: taken as empty tables and the geometry of machine.yaml; give them with --present"]
    lines += [f"NOTE: {doubt}" for doubt in proposal.doubts]
    lines += ["", "not confirmed; check each on your control before you write:"]
    lines += [f"  - {item}" for item in targets.unconfirmed(proposal.module)] or ["  nothing"]
    return "\n".join(lines)


def met(proposal: Proposal, result: Estimate) -> list[str]:
    """proposal, its estimate → a line for each table: which of its rows the touches meet; a wrong row that none meets stays."""
    changed = {h.place for h in proposal.held if proposal.numbers[h.place] != proposal.present[h.place]}
    touches = result.model.touches
    found = lines_of(rows_of(proposal.held, changed, touches, sample(touches.machine, proposal.request.limits)))
    return ["", *found] if found else []


def pinned(proposal: Proposal) -> list[str]:
    """proposal → a sentence that names the centers and directions that keep their values, as no touch shows them."""
    if not proposal.pinned:
        return []
    listed = ", ".join(proposal.pinned[:6]) + (f" and {len(proposal.pinned) - 6} more" if len(proposal.pinned) > 6 else "")
    return [
        f"these keep their present values, as no touch shows them: {listed}. Either the axis hardly turned in this run, or the "
        "length of the tool and the set-up of the workpiece take them out. Where the axis is to turn, touch with it turned",
    ]


def _together(proposal: Proposal) -> list[str]:
    """proposal → a sentence where kinematics and tables of rotary axes change together: without one, the other is no help."""
    changed = [h for h in proposal.held if proposal.numbers[h.place] != proposal.present[h.place]]
    kinematics = any(h.tcp for h in changed)
    read = [axis for axis in proposal.request.machine.rotary if any(h.axis == axis and h.at is not None for h in changed)]
    if not kinematics or not read:
        return []
    return [
        "",
        "centers and directions act with tool center point control only, "
        f"tables that are read with {' and '.join(read)} always. They are fitted together, so what is promised holds with it on. "
        "Indexed work without it gets the tables alone, and its error may grow: propose for such work without the kinematics "
        "(--set, see docs/compensate.md)",
    ]


def _one_orientation(best: Fit) -> list[str]:
    """fit → a sentence where the promise contains more than its touches show: what no touch parts from the stylus, or shows."""
    if best.widened is None:
        return []
    seen, names = best.rms_after, best.widened.doubted
    if not best.widened.size and not names:
        return []
    if not best.widened.size:
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        return [
            f"the intervals contain by how much what no touch shows (a drift, a step), or a mistake that was named, may move "
            f"{', '.join(names[:LISTED])}{more}. Without that {seen.value:.2f} µm ({seen.low:.2f} to {seen.high:.2f}) are left"
        ]
    return [
        "NOTE: the spindle was never turned, so where it is may be the runout of the stylus "
        f"({1e3 * best.widened.size:.1f} µm in each direction, from EXt, EYt and tolerances.runout): none of it is written, and "
        "all of it is in these intervals. For a tool that runs out as the stylus does, "
        f"{seen.value:.2f} µm ({seen.low:.2f} to {seen.high:.2f}) are left. Touch with S turned "
        "by 180° as well, and propose anew",
    ]


def _either(best: Fit) -> list[str]:
    """fit → a sentence where nothing proves whether tool center point control was on in the readings."""
    if best.widened is None or not best.widened.either:
        return []
    seen = best.rms_after
    return [
        "NOTE: nothing proves whether tool center point control was on in these readings, and the numbers differ by "
        f"{best.widened.either:.2f} µm. The machine may as well have changed by that. If your answer is wrong, the larger figures "
        f"above are left; if it is right, {seen.value:.2f} µm ({seen.low:.2f} to {seen.high:.2f}). For a proof measure again with "
        "'tango run', whose programs switch it off, state --no-tcp, and compare 'now' of both proposals",
    ]


def _worse(best: Fit) -> list[str]:
    """fit → a sentence where nothing is gained, or where the largest errors grow while their mean square falls."""
    if best.rms_after.value > WORTH_IT * best.rms_before.value:
        return ["NOTE: this takes hardly anything away, and a second measurement could not confirm it: leave the control as it is"]
    notes = []
    if best.rms_after.value > best.rms_before.low:
        low, high = best.rms_before.low, best.rms_before.high
        notes.append(
            f"NOTE: hardly any gain: the error now is between {low:.2f} and {high:.2f} µm, so it may be as small as what is "
            "promised, and a second measurement could not tell. Leave the control as it is, or measure with more touches first"
        )
    now, after = best.largest_before.value, best.largest_after.value
    if after <= now + LEAST_WORSE:
        return notes
    return [
        *notes,
        f"NOTE: the largest errors get worse: 95 % of the volume are below {now:.1f} µm now, and below {after:.1f} µm after. These "
        "numbers make the mean smaller and cannot follow the rest. Where the largest error counts, leave them as they are",
    ]


def sign(found: Sign, flips: Sequence[str] = ()) -> str:
    """verdict of a sign trial, settings that would turn the sign round → what it means for a person."""
    touches = "1 touch" if found.touches == 1 else f"{found.touches} touches"
    if not math.isfinite(found.std):
        return (
            f"{touches} compared, and the change moves none of them, so the sign stays unknown. Touch again the touch that "
            "--sign-trial named, with the trial in the control"
        )
    again = " and ".join(f"--set {flip}" for flip in flips)
    turned = f"propose again with {again}" if again else "this target has no setting for it: do not load the compensation"
    words = {
        "as assumed": "the sign is as assumed. Load undo/, then the compensation",
        "turned round": f"the sign is the other one. Load undo/, and {turned}",
        "not used": "the control does not use this place. Load undo/, and see what switches it on "
        "('tango compensate --facts TARGET')",
        "undecided": "the sign cannot be determined from this. Make more touches, or choose one that the change moves",
    }
    return f"{touches} changed by {found.ratio:+.2f} ± {2 * found.std:.2f} of the prediction: {words[found.word]}"
