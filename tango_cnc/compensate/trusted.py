"""Whether what a compensation takes away, or what is found after it, rests on parameters that are to be trusted."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from ..estimate import Estimate
from ..judgement import Judgement
from ..records import TangoError
from .fit import Fit, Known, rms
from .outcome import Outcome, Remeasured
from .promise import DRAWS
from .space import Poses

HALF = 0.5  # of the sum of squares of all effects on the tool tip


def doubted(effects: Mapping[str, float], result: Estimate, untrusted: Collection[str]) -> list[str]:
    """{coefficient: its effect on the tip}, estimate, labels that are not to be trusted → those, where most of the error is theirs.

    Nothing where less than half of the error (its mean square) comes of them: then the rest is worth acting on.
    """
    named = {name: result.selection.label(name) for name in effects}
    own = [name for name, label in named.items() if label in untrusted]
    whole = sum(effect**2 for effect in effects.values())
    if not own or sum(effects[name] ** 2 for name in own) < HALF * whole:
        return []
    return [named[name] for name in sorted(own, key=lambda name: -effects[name])]


def worth_acting(best: Fit, result: Estimate, untrusted: Collection[str], despite: bool) -> None:
    """proposal's fit, estimate, labels that are not to be trusted, --despite → nothing.

    Raises TangoError where most of the error comes of parameters that are not to be trusted: nobody writes those into a control.
    """
    effects = {s.name: s.effect_um for s in best.shares if s.word != "set-up"}
    if (names := doubted(effects, result, untrusted)) and not despite:
        raise TangoError(
            f"compensate: most of the error comes of {_some(names)}, not to be trusted in these readings. Nothing was written. "
            "Mend what makes them doubtful (above) and measure again; --despite proposes it all the same"
        )


def wrong_by(result: Estimate, judgement: Judgement) -> dict[str, float]:
    """estimate, what is to be thought of it → {label: by how much it may be off, mm or rad} of what no touch shows, and of what a
    mistake that was named makes wrong: by twice its value, as with the other sign."""
    hidden = dict(judgement.hidden)
    if judgement.verdict != "doubtful":
        return hidden
    values = {result.selection.label(c.name): v for c, v in zip(result.model.coefficients, result.values, strict=False)}
    return {label: 2 * abs(float(values.get(label, 0.0))) for label in judgement.untrusted} | hidden


def kept_as_promised(best: Fit, result: Estimate, wrong: Collection[str]) -> None:
    """proposal's fit, estimate, labels that something named makes wrong → nothing.

    Raises TangoError where these would break the promise: its interval contains their scatter, and no wrong sign and no wrong bar.
    """
    named = {result.selection.label(s.name): s.effect_um * s.held for s in best.shares if s.word != "set-up"}
    own = {label: size for label, size in named.items() if label in wrong}
    size = sum(effect**2 for effect in own.values()) ** 0.5
    if size > best.rms_after.high:
        names = _some(sorted(own, key=lambda label: -own[label]))
        raise TangoError(
            f"compensate: {size:.1f} µm of what would be written come from {names}, and the mistake named above makes these wrong. "
            f"Then more would be left than {best.rms_after.value:.2f} µm ({best.rms_after.low:.2f} to "
            f"{best.rms_after.high:.2f}). Nothing was written. Mend the mistake and propose anew. Where you know that there "
            "is no mistake: --despite"
        )


def words_as_promised(
    found: Known, result: Estimate, wrong: Collection[str], at: Poses, command: str = "compensate", still: bool = True
) -> None:
    """what words are moved by, or a prediction rests on, estimate, labels that something named makes wrong, poses of what was
    touched, the command → nothing.

    Raises TangoError where these would move the tip by more than the scatter of the estimate does. `still`: without reversal, which
    is in no word.
    """
    levers = at.free(found.levers(at, still=still))
    own = {c.name: rms(levers[:, j] * found.values[j]) for j, c in enumerate(found.coefficients)}
    names = [name for name in own if result.selection.label(name) in wrong]
    rows = [j for j, c in enumerate(found.coefficients) if c.name in names]
    size = rms(levers[:, rows] @ found.values[rows]) if rows else 0.0
    scatter = float(np.quantile(np.sqrt(np.sum((levers @ found.draws(DRAWS)) ** 2, axis=0) / len(at)), 0.975)) * 1e3
    if size > scatter:
        labels = _some([result.selection.label(name) for name in sorted(names, key=lambda name: -own[name])])
        what, done = ("what the words would be moved by", "written") if still else ("what would be predicted", "predicted")
        raise TangoError(
            f"{command}: {size:.1f} µm of {what} come from {labels}, and the mistake named above makes "
            f"these wrong; the scatter of the estimate is up to {scatter:.2f} µm. Nothing was {done}. Mend the mistake and "
            f"{command} anew. Where you know that there is no mistake: --despite"
        )


def as_far_as_trusted(
    found: Outcome,
    record: Mapping[str, object],
    result: Estimate,
    untrusted: Collection[str],
    hidden: Mapping[str, float],
    run: Remeasured,
) -> Outcome:
    """outcome, record of the compensation, estimate of readings made with it, labels that are not to be trusted, {label: by how
    much what no touch shows may move it, mm or rad}, what the readings find → what to say.

    Parameters that are not to be trusted prove nothing good. That it has not helped stands, and says so: taking back what may
    do harm needs less evidence than leaving it in. What no touch shows takes nothing from a parameter where it could be less than
    half of what was there before: that the most of it is gone is seen all the same.
    """
    listed = record.get("coefficients")
    effects = {c["name"]: float(c["effect_um"]) * float(c["held"]) for c in listed} if isinstance(listed, list) else {}
    sizes = {c.name: rms(run.levers[:, j]) for j, c in enumerate(run.now.coefficients)}
    small = {
        label
        for name, effect in effects.items()
        if (label := result.selection.label(name)) in hidden and hidden[label] * sizes.get(name, 0.0) < HALF * effect
    }
    names = doubted(effects, result, [label for label in untrusted if label not in small])
    if not names or found.verdict == "undecided":
        return found
    why = f"most of what was to be taken away is {_some(names)}, not to be trusted in these readings"
    mend = "mend what makes them doubtful and measure again"
    if found.verdict == "no help":
        return replace(found, text=f"{found.text}. But {why}: take it back all the same, then {mend}")
    text = f"this run decides nothing: {why}. {mend.capitalize()}"
    return replace(found, verdict="undecided", text=text, not_seen=(), left_if_none=None)


def _some(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
