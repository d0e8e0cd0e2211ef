"""What was found, in the words of a person at the machine: µm, minutes, axes; a chance instead of a p-value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .. import terms as families
from ..records import Array
from ._aliases import differing
from ._moments import Moment
from ._records import SUBSETS, Again, Dropped, Finding, Remainder
from ._scatter import Scatter

Texts = Callable[[str], str]  # key → text, of a shop in its own language
SETTLED = 2.3  # time constants after which a tenth is left
UNSETTLED = 1.4  # time constants: a test shorter than that has not seen where a drift ends
STRONG = 0.35  # component of a direction that is worth a word


def said(f: Finding, t: Texts | None = None) -> str:
    """finding, texts of a shop or None → what was found, how large, where and since when; without what to do."""
    try:
        return _told(f, "says", t).format_map(_words(f))
    except KeyError:  # a setting that the sentence has no word for
        return f"{_told(f, 'text', t)}: {size(f)}"


def meaning(f: Finding, t: Texts | None = None) -> str:
    """finding, texts of a shop or None → what it means for parts."""
    return _told(f, "meaning", t)


def _told(f: Finding, what: str, t: Texts | None) -> str:
    return cause_texts()[f"{f.cause}.{what}"] if t is None else t(f"diagnosed.{f.cause}.{what}")


def cause_texts() -> dict[str, str]:
    """→ text, says, meaning and advice of every cause, as its file has them: `chip.meaning` → sentence."""
    found: dict[str, str] = {}
    for name, cause in families.causes().items():
        own = {"text": cause.text, "says": cause.says, "meaning": cause.meaning, "advice": cause.advice}
        found |= {f"{name}.{what}": text for what, text in own.items()}
    return found


def advice(f: Finding, t: Texts | None = None) -> str:
    """finding, texts of a shop or None → what to do about it, with the time after which a drift has settled."""
    text = _told(f, "advice", t)
    tau = f.detail.get("tau_s")
    if tau is not None and f.detail.get("shape") == "exponential" and not _unsettled(f.detail):
        text += f" (a tenth of it is left after {minutes(SETTLED * float(tau))})"
    return text


def also(f: Finding) -> str:
    """finding → its other settings that this plan cannot tell from it."""
    return "; ".join(dict.fromkeys(differing(setting, f.setting) for setting, _ in f.aliases))


def gain(f: Finding) -> str | None:
    """finding → what keeping its term brings on touches that were not fitted; None for a spread, which no term takes away."""
    if f.gain is None:
        return None
    g = f.gain
    held = {"time": "held-out blocks of time", "scattered": "held-out touches"}.get(g.scheme, f"held-out {g.scheme}")
    return (
        f"with the term, {held} are predicted to {g.heldout_after * 1e3:.2f} µm instead of {g.heldout_before * 1e3:.2f} µm; noise "
        f"alone would look like this {chance(f.p_value)}"
        + ("" if f.stability is None else f"; it came back in {f.stability} of {SUBSETS} subsets of the indexations")
    )


def dropped(d: Dropped) -> str:
    """cause that fits and is not named → why it is not."""
    text = f"it resembles {d.finding.cause}, which is not named: "
    g = d.finding.gain
    if d.why == "no gain" and g is not None:
        without, with_it = g.schemes.get("scattered", (g.heldout_before, g.heldout_after))
        return text + (
            f"touches that were not fitted do not gain from it ({with_it * 1e3:.2f} µm with it, {without * 1e3:.2f} without), "
            "or no more than from the same pattern shuffled"
        )
    if d.why == "shape":
        return text + "a smooth shape without a name explains the touches at least as well"
    if d.why == "unstable":
        return text + f"it comes back in {d.finding.stability} of {SUBSETS} subsets of the indexations only"
    if d.why == "size":
        return text + "its size is not known to half of itself, or is larger than the residuals can hold"
    return text + "beside something larger without a name it may only follow what that leaves"


def size(f: Finding) -> str:
    """finding → 9.1 ± 0.4 µm, or about 9 µm."""
    return spread(f.size.amplitude, f.size.amplitude_std)


def chance(p: float) -> str:
    """probability → once in so many."""
    if p < 1e-6:
        return "less than once in a million times"
    if p > 0.3:
        return f"in {100 * p:.0f} % of all cases"
    return f"once in {float(f'{1 / p:.1g}'):,.0f} times"


def minutes(seconds: float) -> str:
    """s → 40 s, 14 min or 2.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 2 * 3600 else f"{seconds / 3600:.1f} h"


def towards(v: Array) -> str:
    """vector → its main directions: towards +Y −Z."""
    unit = v / (np.linalg.norm(v) or 1.0)
    return "towards " + " ".join(f"{'+' if x > 0 else '−'}{c}" for c, x in zip("XYZ", unit, strict=True) if abs(x) > STRONG)


def covariate(name: str) -> str:
    """name of a covariate, or of several with × between them → what it is."""
    return " together with ".join(_covariate(part) for part in name.split(" × "))


def _covariate(name: str) -> str:
    """name of a covariate → what it is."""
    kind, _, rest = name.partition(" ")
    if kind == "normal":
        letter, _, frame = rest.partition(", ")
        return f"touch direction {letter.upper()}, {frame} frame"
    if name == "since indexation":
        return "time since the last indexation"
    if name == "probe direction along":
        return "probe direction along the stylus"
    if kind == "way":
        return f"length of {name[-1]}'s last move"
    if kind == "shift":
        letter, _, frame = rest.partition(", ")
        return f"time, shift along {letter.upper()}, {frame} frame"
    if len(name) == 2 and name[0] == "d":
        return f"side from which {name[1]} came"
    if len(name) == 1:
        return f"position of {name}"
    return {"order": "order of the touches", "feed": "measuring feed"}.get(name, name)


def unexplained(r: Remainder) -> str:
    """remainder → a sentence."""
    where = {"": "", "none": "", f"axis {r.covariate}": ""}.get(r.frame, f", {r.frame}")
    if r.frame in ("machine", "table", "spindle"):
        where = f" in the frame of the {r.frame}"
    if r.shape == "lack of fit":
        return (
            f"with the causes above the residuals still follow {covariate(r.covariate)}, by {spread(r.amplitude, 0.0)}: something "
            "is missing, or a name is wrong"
        )
    if r.shape == "random walk":
        return (
            f"the machine wanders without a pattern, by about {r.amplitude * 1e3:.1f} µm over the test. That costs accuracy and "
            "has no name: warm up, measure faster, or repeat the first indexations at the end to see it"
        )
    again = "" if r.again is None else f". {known(r.again)}"
    also = "" if r.closed is None else f". A simple formula does as well: {r.closed}"
    return (
        f"nothing in the catalogue explains what follows {covariate(r.covariate)}{where}: {spread(r.amplitude, r.std)} at most of "
        f"what the model cannot absorb; it takes {100 * max(r.heldout_r2, 0.0):.0f} % of the variance of touches that were not "
        f"fitted{also}{again}. To confirm it: {r.confirm or 'measure again on another day, in another order'}"
    )


def known(again: Again) -> str:
    """shape that was learned before and is there again → a sentence."""
    day = f" (learned on {again.learned})" if again.learned else ""
    return (
        f"It is most likely the shape {again.name}{day}, {again.times:.1f} times as large: these touches see "
        f"{100 * again.agreement**2:.0f} % of the two in common"
    )


def moment(m: Moment) -> str:
    """what belongs to one moment or one pose → a sentence."""
    touches = f"touch {m.first + 1}" if m.first == m.last else f"touches {m.first + 1} to {m.last + 1}"
    size = f"{m.amplitude * 1e3:.1f} µm"
    if m.kind == "window":
        return f"{touches} were made while everything on the table was elsewhere, by {size} at most"
    if m.axis is not None:
        return f"{touches} (one indexation) were made at a wrong angle of {m.axis}, which moves them by {size} at most"
    return f"{touches} (one indexation) were made with the table beside its place, by {size} at most"


def noise(s: Scatter) -> list[str]:
    """scatter → what the noise is besides white and normal, a sentence each."""
    told = []
    group = {"facet": "facet", "direction": "direction of touch", "indexation": "indexation", "time": "part of the test"}
    if s.by is not None and s.rival is not None:
        told.append(
            f"single touches do not scatter alike: it depends on the {group[s.by]} or on the {group[s.rival]}. These touches "
            "cannot tell which. Touch the facets that scatter most from another direction"
        )
    elif s.clear:
        told.append(
            f"single touches do not scatter alike: it depends on the {group[str(s.by)]}. Touches that scatter "
            "more have less weight here"
        )
    if s.tails is not None:
        told.append(
            f"the scatter has heavy tails (like Student's t with {s.tails:.0f} degrees of freedom): far touches are more frequent "
            "than chance would make them. Look at chips, coolant and the battery of the probe"
        )
    if s.memory > 0:
        told.append(
            f"each touch remembers the one before (correlation {s.memory:.1f}): the noise is not new at every touch, so standard "
            "deviations are too small. Look at the temperature of the probe and at vibrations"
        )
    return told


def spread(value: float, std: float) -> str:
    """mm and its standard deviation → 9.1 ± 0.4 µm; about 9 µm where that is not known well."""
    if not 0 < std < value / 2:
        return f"about {float(f'{value * 1e3:.1g}'):g} µm"
    return f"{value * 1e3:.1f} ± {max(std * 1e3, 0.05):.1f} µm"


class _Known(dict[str, str]):
    """Words of one finding."""


def _words(f: Finding) -> Mapping[str, str]:
    d = f.detail
    known = _Known(size=size(f), course=_course(d), toward="", where="")
    if "direction" in d and _unsettled(d):  # the size is that of the end, which nobody has seen
        part = 1 - np.exp(-float(d["run_s"]) / float(d["tau_s"]))
        known["size"] = f"{f.size.amplitude * part * 1e3:.1f} µm"
    for key in ("axis", "name", "by", "after", "order"):
        if key in d:
            known[key] = str(d[key])
    if "order" in d:
        known["waves"] = "one wave a turn" if d["order"] == 1 else f"{d['order']} waves a turn"
    if "S" in d:
        known["where"] = f" (at S {float(d['S']):g}°)"
    if "direction" in d:
        known["towards"] = f"{towards(np.array(d['direction']))} ({d.get('frame', 'machine')} frame)"
        known["toward"] = " " + known["towards"]
    elif f.cause == "ambient_cycle" and f.size.values.size == 6:
        known["towards"] = f"mostly {towards(np.linalg.svd(f.size.values.reshape(2, 3))[2][0])}"
    elif d.get("component") in ("X", "Y", "Z"):
        known["toward"] = f" along {d['component']}"
    if "period_s" in d:
        known["period"] = minutes(float(d["period_s"]))
    if "period_mm" in d:
        known["period"] = f"{float(d['period_mm']):.2f} mm"
    if "at" in d:
        known["at"] = f"{d['at']:g}" if isinstance(d["at"], float) else str(d["at"])
    if "until" in d:
        known["until"] = str(d["until"])
    if "time_s" in d:
        known["clock"] = minutes(float(d["time_s"]))
    if f.cause == "compensation_kink":
        places = [d["at"]] if d.get("at") is not None else list(d.get("nodes", ()))
        unit = "mm" if d.get("axis") in ("X", "Y", "Z") else "deg"
        known["place"] = ", ".join(f"{float(p):.0f}" for p in places) + f" {unit}"
    if "facet" in d:
        known["facet"] = str(d["facet"])
    if "facets" in d:
        known["facets"] = ", ".join(str(x) for x in d["facets"])
    for key in ("found_um", "stated_um"):
        if key in d:
            known[key[:-3]] = f"{float(d[key]):.2f}"
    if f.size.values.size == 1:
        known["times"] = f"{float(f.size.values[0]):.2g}"
        known["early"] = "early" if f.size.values[0] > 0 else "late"
        known["delay"] = f"{1e3 * float(f.size.values[0]):.2f}"
    return known


def _unsettled(d: Mapping[str, Any]) -> bool:
    """Whether a warm-up is slower than the test could show: less than three quarters of it was seen."""
    return d.get("shape") == "exponential" and "run_s" in d and float(d["run_s"]) < UNSETTLED * float(d["tau_s"])


def _course(d: Mapping[str, Any]) -> str:
    if d.get("sensor"):
        return f" with the temperature {d['sensor']}"
    if d.get("shape") == "exponential" and _unsettled(d):
        return f" within the {minutes(float(d['run_s']))} of the test and has not settled"
    if d.get("shape") == "exponential" and "tau_s" in d:
        return f" as it warms up, two thirds of it within {minutes(float(d['tau_s']))}, then it settles"
    return " per hour, steadily" if d.get("shape") == "linear" and "tau_s" in d else ""
