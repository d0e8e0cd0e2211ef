"""What was found, in the words of a person at the machine: µm, minutes, axes; a chance instead of a p-value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from .. import terms as families
from ..records import Array
from ..terms._texts import cause_texts
from ..texts import Said, joined, say
from ._aliases import differing
from ._moments import Moment
from ._records import Again, Dropped, Finding, Remainder
from ._scatter import Scatter
from ._size import form

SETTLED = 2.3  # time constants after which a tenth is left
UNSETTLED = 1.4  # time constants: a test shorter than that has not seen where a drift ends
STRONG = 0.35  # component of a direction that is worth a word


def said(f: Finding) -> str:
    """finding → what was found, how large, where and since when; without what to do."""
    says, known = f"{f.cause}.says", _words(f)
    try:
        return Said(cause_texts()[says].format_map(known), f"diagnosed.{says}", known)
    except KeyError:  # a setting that the sentence has no word for
        return joined(": ", (_of_cause(f, "text"), size(f)))


def meaning(f: Finding) -> str:
    """finding → what it means for parts."""
    return _of_cause(f, "meaning")


def cause_name(cause: str) -> str:
    """cause → its name in words. A name that the catalogue does not contain is returned unchanged."""
    name = cause_texts().get(f"{cause}.name")
    return cause.replace("_", " ") if name is None else Said(name, f"diagnosed.{cause}.name", {})


def _of_cause(f: Finding, what: str) -> Said:
    key = f"{f.cause}.{what}"
    return Said(cause_texts()[key], f"diagnosed.{key}", {})


def advice(f: Finding) -> str:
    """finding → what to do about it, with the time after which a drift has settled."""
    text: str = _of_cause(f, "advice")
    tau = f.detail.get("tau_s")
    if tau is not None and f.detail.get("shape") == "exponential" and not _unsettled(f.detail):
        text = joined("", (text, say("diagnosis_said.tenth_left_after", minutes=minutes(SETTLED * float(tau)))))
    return text


def also(f: Finding) -> str:
    """finding → its other settings that this plan cannot distinguish from it."""
    return joined("; ", dict.fromkeys(differing(f.cause, setting, f.setting) for setting, _ in f.aliases))


def gain(f: Finding) -> str | None:
    """finding → what keeping its term brings on touches that were not fitted; None for a spread, which no term takes away."""
    if f.gain is None:
        return None
    g = f.gain
    held = {"time": say("diagnosis_said.held_out_blocks_time"), "scattered": say("diagnosis_said.held_out_touches")}.get(
        g.scheme, say("diagnosis_said.held_out", scheme=g.scheme)
    )
    again = "" if f.stability is None else say("diagnosis_said.came_back_subsets_indexations", **asdict(f.stability))
    told = say(
        "diagnosis_said.with_term_predicted_instead_noise",
        held=held,
        heldout_after=f"{g.heldout_after * 1000.0:.2f}",
        heldout_before=f"{g.heldout_before * 1000.0:.2f}",
        chance=chance(f.p_value),
    )
    return joined("", (told, again))


def dropped(d: Dropped) -> str:
    """cause that fits and is not named → why it is not."""
    text = say("diagnosis_said.resembles_which_not_named", cause=d.finding.cause)
    g = d.finding.gain
    if d.why == "no gain" and g is not None:
        without, with_it = g.schemes.get("scattered", (g.heldout_before, g.heldout_after))
        figures = {"with_it": f"{with_it * 1e3:.2f}", "without": f"{without * 1e3:.2f}"}
        return joined("", (text, say("diagnosis_said.touches_were_not_fitted_do", **figures)))
    if d.why == "shape":
        return joined("", (text, say("diagnosis_said.smooth_shape_without_name_explains")))
    if d.why == "unstable":
        back = d.finding.stability
        often = say("diagnosis_said.comes_back_subsets_indexations_only", **({} if back is None else asdict(back)))
        return joined("", (text, often))
    if d.why == "rest":
        return joined("", (text, say("diagnosis_said.something_is_left_beside_it")))
    if d.why == "few":
        return joined("", (text, say("diagnosis_said.touches_too_few_for_name")))
    if d.why == "one touch":
        return joined("", (text, say("diagnosis_said.rests_on_one_touch")))
    if d.why == "size":
        s = d.finding.size
        known = say(
            "diagnosis_said.its_size_not_known_half", amplitude=f"{s.amplitude * 1e3:.2g}", std=f"{s.amplitude_std * 1e3:.2g}"
        )
        return joined("", (text, known))
    return joined("", (text, say("diagnosis_said.beside_something_larger_without_name")))


def size(f: Finding) -> str:
    """finding → 9.1 ± 0.4 µm, or about 9 µm."""
    return spread(f.size.amplitude, f.size.amplitude_std)


def chance(p: float) -> str:
    """probability → once in so many."""
    if p < 1e-6:
        return say("diagnosis_said.less_than_once_million_times")
    if p > 0.3:
        return say("diagnosis_said.all_cases", p=f"{100 * p:.0f}")
    return say("diagnosis_said.once_times", value=f"{float(f'{1 / p:.1g}'):,.0f}")


def minutes(seconds: float) -> str:
    """s → 40 s, 14 min or 2.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return say("diagnosis_said.min", seconds=f"{seconds / 60:.0f}") if seconds < 2 * 3600 else f"{seconds / 3600:.1f} h"


def towards(v: Array) -> str:
    """vector → its main directions: towards +Y −Z."""
    unit = v / (np.linalg.norm(v) or 1.0)
    return "towards " + " ".join(f"{'+' if x > 0 else '−'}{c}" for c, x in zip("XYZ", unit, strict=True) if abs(x) > STRONG)


def _frame(name: str) -> str:
    """machine, table, spindle or axis → its word."""
    return say(f"diagnosis_said.of_{name}") if name in ("machine", "table", "spindle", "axis") else name


def covariate(name: str) -> str:
    """name of a covariate, or of several with × between them → what it is."""
    parts = [_covariate(part) for part in name.split(" × ")]
    return joined(say("diagnosis_said.together_with"), parts) if len(parts) > 1 else parts[0]


def _covariate(name: str) -> str:
    """name of a covariate → what it is."""
    kind, _, rest = name.partition(" ")
    if kind == "normal":
        letter, _, frame = rest.partition(", ")
        return say("diagnosis_said.touch_direction_frame", upper=letter.upper(), frame=_frame(frame))
    if kind == "place":
        return say("diagnosis_said.place_on_table", upper=rest[0].upper())
    if name == "since indexation":
        return say("diagnosis_said.time_since_last_indexation")
    if name == "probe direction along":
        return say("diagnosis_said.probe_direction_along_stylus")
    if kind == "way":
        return say("diagnosis_said.length_last_move", name=name[-1])
    if kind == "path":
        _, axis, play = rest.split(" ")
        return say("diagnosis_said.path_of_turning_axis", name=axis, play=play)
    if kind == "shift":
        letter, _, frame = rest.partition(", ")
        return say("diagnosis_said.time_shift_along_frame", upper=letter.upper(), frame=_frame(frame))
    if len(name) == 2 and name[0] == "d":
        return say("diagnosis_said.side_from_which_came", name=name[1])
    if len(name) == 1:
        return say("diagnosis_said.position", name=name)
    return {
        "order": say("diagnosis_said.order_touches"),
        "feed": say("diagnosis_said.measuring_feed"),
        "pause": say("diagnosis_said.time_since_touch_before"),
        "facet": say("table.facet"),
        "time": say("place.time"),
    }.get(name, name)


def _instead(r: Remainder) -> str:
    """remainder → what it may follow instead, as the end of a sentence."""
    if not r.rivals:
        return ""
    return say("diagnosis_said.other_covariates_do_as_well", others="; ".join(map(covariate, r.rivals)))


def unexplained(r: Remainder) -> str:
    """remainder → a sentence."""
    where = {"": "", "none": "", f"axis {r.covariate}": ""}.get(r.frame, f", {r.frame}")
    if r.frame in ("machine", "table", "spindle"):
        where = say("diagnosis_said.frame", frame=_frame(r.frame))
    if r.shape == "apart":
        return say(
            "diagnosis_said.single_touches_stand_together",
            touches=r.confirm,
            covariate=covariate(r.covariate),
            spread=spread(r.amplitude, 0.0),
        )
    if r.shape == "memory":
        return say("diagnosis_said.touches_are_like_those_before", spread=spread(r.amplitude, 0.0))
    if r.shape == "uneven":
        return say("diagnosis_said.scatter_beside_names", group=_group(r.covariate))
    if r.shape == "changing":
        where = covariate(r.covariate)
        size = spread(r.amplitude, r.std)
        return say("diagnosis_said.name_whose_size_changes", cause=r.confirm, covariate=where, spread=size, also=_instead(r))
    if r.shape == "undecided":
        return say("diagnosis_said.one_of_several_causes", cause=r.confirm, others=", ".join(r.rivals))
    if r.shape == "near":
        return say("diagnosis_said.cause_or_shape", cause=r.confirm, covariate=covariate(r.covariate))
    if r.shape == "unsure":
        return say("diagnosis_said.something_like_a_name", cause=r.confirm, spread=spread(r.amplitude, 0.0))
    if r.shape == "no pattern":
        return say(
            "diagnosis_said.residuals_follow_without_cause", covariate=covariate(r.covariate), spread=spread(r.amplitude, 0.0)
        )
    if r.shape == "lack of fit":
        return say(
            "diagnosis_said.with_causes_above_residuals_still", covariate=covariate(r.covariate), spread=spread(r.amplitude, 0.0)
        )
    if r.shape == "random walk":
        return say("diagnosis_said.machine_wanders_without_pattern_about", amplitude=f"{r.amplitude * 1000.0:.1f}")
    again = "" if r.again is None else joined("", (". ", known(r.again)))
    also = "" if r.closed is None else say("diagnosis_said.simple_formula_does_as_well", closed=r.closed)
    also += _instead(r)
    return say(
        "diagnosis_said.nothing_catalogue_explains_what_follows",
        covariate=covariate(r.covariate),
        where=where,
        spread=spread(r.amplitude, r.std),
        share=f"{100 * max(r.heldout_r2, 0.0):.0f}",
        also=also,
        again=again,
        confirm=r.confirm or say("diagnosis_said.another_day"),
    )


def nearly(shape: tuple[str, float]) -> str:
    """covariates of a shape that comes near to a name, its evidence less → a sentence."""
    return say("diagnosis_said.shape_comes_near", covariate=covariate(shape[0]), less=f"{shape[1]:.0f}")


def known(again: Again) -> str:
    """shape that was learned before and is there again → a sentence."""
    day = say("diagnosis_said.learned_on", learned=again.learned) if again.learned else ""
    return say(
        "diagnosis_said.most_likely_shape_times_as",
        name=again.name,
        day=day,
        times=f"{again.times:.1f}",
        agreement=f"{100 * again.agreement**2:.0f}",
    )


def moment(m: Moment) -> str:
    """what belongs to one moment or one pose → a sentence."""
    first, last = (int(m.item[key]) for key in ("at", "until"))
    touches = say("diagnosis_said.touch", first=first) if first == last else say("diagnosis_said.touches", first=first, last=last)
    size = f"{m.amplitude * 1e3:.1f} µm"
    if m.kind == "window":
        return say("diagnosis_said.were_made_while_everything_on", touches=touches, size=size)
    if m.axis is not None:
        return say("diagnosis_said.one_indexation_were_made_at", touches=touches, axis=m.axis, size=size)
    return say("diagnosis_said.one_indexation_were_made_with", touches=touches, size=size)


def _group(by: str) -> str:
    """what scatter depends on → its words."""
    words = {
        "facet": "table.facet",
        "direction": "diagnosis_said.direction_touch",
        "indexation": "diagnosis_said.indexation",
        "time": "diagnosis_said.part_test",
    }
    return say(words[by])


def few(touches: int) -> str:
    """touches beyond the unknowns → why no cause is named."""
    return say("diagnosis_said.few_touches_tell_no_cause", touches=touches)


def noise(s: Scatter) -> list[str]:
    """scatter → what the noise is besides white and normal, a sentence each."""
    told: list[str] = []
    if s.by is not None and s.rival is not None:
        told.append(say("diagnosis_said.single_touches_do_not_scatter", group=_group(s.by), group2=_group(s.rival)))
    elif s.clear:
        told.append(say("diagnosis_said.single_touches_do_not_scatter_2", group=_group(str(s.by))))
    if s.tails is not None:
        told.append(say("diagnosis_said.scatter_has_heavy_tails_like", tails=f"{s.tails:.0f}"))
    if s.memory > 0:
        told.append(say("diagnosis_said.each_touch_remembers_one_before", memory=f"{s.memory:.1f}"))
    return told


def spread(value: float, std: float) -> str:
    """mm and its standard deviation → 9.1 ± 0.4 µm; about 9 µm where that is not known well."""
    if not 0 < std < value / 2:
        return say("diagnosis_said.about", value=f"{float(f'{value * 1000.0:.1g}'):g}")
    return f"{value * 1e3:.1f} ± {max(std * 1e3, 0.05):.1f} µm"


# What `says` of a cause may have in braces; more, from `Cause.words` of its own file.
WORDS = frozenset(
    [
        "size",
        "course",
        "toward",
        "where",
        "axis",
        "name",
        "by",
        "after",
        "order",
        "waves",
        "towards",
        "period",
        "at",
        "moment",
        "until",
        "clock",
        "facet",
        "facets",
        "found",
        "stated",
        "times",
        "early",
        "delay",
    ]
)


class _Known(dict[str, str]):
    """Words of one finding."""


def _words(f: Finding) -> _Known:
    d = f.detail
    known = _Known(size=size(f), course=_course(d), toward="", where="")
    lengths = {one["unit"] for one in d.get("coefficients", {}).values()} == {"mm"}  # the size of others is what the touches felt
    if lengths and _unsettled(d):  # the size is that of the end, which nobody has seen
        part = 1 - np.exp(-float(d["run_s"]) / float(d["tau_s"]))
        known["size"] = f"{f.size.amplitude * part * 1e3:.1f} µm"
    for key in ("axis", "name", "by", "after", "order"):
        if key in d:
            known[key] = str(d[key])
    if "order" in d:
        known["waves"] = (
            say("diagnosis_said.one_wave_turn") if d["order"] == 1 else say("diagnosis_said.waves_turn", order=d["order"])
        )
    if "S" in d:
        known["where"] = f" (at S {float(d['S']):g}°)"
    if "direction" in d:
        known["towards"] = say(
            "diagnosis_said.frame_2", towards=towards(np.array(d["direction"])), frame=_frame(d.get("frame", "machine"))
        )
        known["toward"] = " " + known["towards"]
    elif form(list(d.get("coefficients", ()))) == "vector wave":
        known["towards"] = say("diagnosis_said.mostly", towards=towards(np.linalg.svd(f.size.values.reshape(2, 3))[2][0]))
    elif d.get("component") in ("X", "Y", "Z"):
        known["toward"] = say("diagnosis_said.along", component=d["component"])
    if "period_s" in d:
        known["period"] = minutes(float(d["period_s"]))
    if "period_mm" in d:
        known["period"] = say("diagnosis_said.mm", period_mm=f"{float(d['period_mm']):.2f}")
    if "at" in d:
        known["at"] = f"{d['at']:g}" if isinstance(d["at"], float) else str(d["at"])
        known["moment"] = _moment_of(d)
    if "until" in d:
        known["until"] = str(d["until"])
    if "time_s" in d:
        known["clock"] = minutes(float(d["time_s"]))
    known.update(families.causes()[f.cause].words(d))
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


def _moment_of(d: Mapping[str, Any]) -> str:
    """detail with the first touch after something happened → when that was: touches before it that felt nothing tell nothing."""
    if int(d.get("at_after", int(d["at"]) - 1)) >= int(d["at"]) - 1:
        return say("diagnosis_said.at_touch", at=d["at"])
    return say("diagnosis_said.between_touches", first=d["at_after"], last=d["at"])


def _unsettled(d: Mapping[str, Any]) -> bool:
    """Whether a warm-up is slower than the test could show: less than three quarters of it was seen."""
    return d.get("shape") == "exponential" and "run_s" in d and float(d["run_s"]) < UNSETTLED * float(d["tau_s"])


def _course(d: Mapping[str, Any]) -> str:
    if d.get("sensor"):
        return say("diagnosis_said.with_temperature", sensor=d["sensor"])
    if d.get("shape") == "exponential" and _unsettled(d):
        return say("diagnosis_said.within_test_has_not_settled", minutes=minutes(float(d["run_s"])))
    if d.get("shape") == "exponential" and "tau_s" in d:
        return say("diagnosis_said.as_warms_up_two_thirds", minutes=minutes(float(d["tau_s"])))
    return say("diagnosis_said.per_hour_steadily") if d.get("shape") == "linear" and "tau_s" in d else ""
