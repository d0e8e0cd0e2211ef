"""An alarm of another night as it is tonight: gone again, or how far it has come, and what that does to parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..texts import LIST, Said, joined, say
from ..texts.number import Number, number, shown
from .texts import texts

LENGTHS = ("stylus", "table", "ball")  # causes whose size is a length in space
WARMED = ("scale", "scales", "temperature")  # causes that no clamp and no bearing explains
OVER = "night.words.gone_since_night"  # of an alarm that nobody has closed, though what moved is back where it was
STANDING = ("night.words.changed_since_night", OVER)
ONLY = ("night.alarms.now", "night.alarms.still_there")  # which say no more than a size
NOW = (*ONLY, "night.alarms.confirmed")
WAS = "night.alarms.was"
UNSEEN = ("night.alarms.unseen", "night.alarms.unseen_then")  # which say that nothing can be seen of it any more
GONE = (
    "night.alarms.gone_again_left",
    "night.alarms.scatter_gone",
    "night.sensors.warm_gone",
    "night.sensors.warm_gone_last",
)  # which say that it is back where it was
UNSURE = 2.0  # standard deviations: a smaller size may be nothing
AS_FOUND = 0.25  # share of its size by which an alarm may have grown and still be what its night found
LEAST = 0.05  # share that is nothing in any case
BEYOND = ("out_of_limits", "doubtful")  # verdicts of a night after which no part is made
SURE = 4.0  # standard deviations of its size above which it has grown although that is less than AS_FOUND


def is_gone(now: str) -> bool:
    """what a night says of an older alarm by now → whether what moved is back where it was."""
    return isinstance(now, Said) and now.key in GONE


def in_the_past(a: dict[str, Any]) -> dict[str, Any]:
    """alarm of another night → the same; touches that no longer scatter did so then."""
    from ..state.changes import change  # a list of nights needs nothing that they compute with

    text = a.get("text")
    if (
        not change(a.get("cause")).scatters
        or not is_gone(a.get("now") or "")
        or not isinstance(text, Said)
        or text.key != "changed.noise_level"
    ):
        return a
    return a | {"text": say("changed.noise_level_then", **text.values)}


def is_over(a: Mapping[str, Any]) -> bool:
    """alarm of another night → whether what moved is back where it was, or the alarm is that of its way back."""
    return is_gone(a.get("now") or "") or bool(a.get("undoes"))


def only_set_up(a: Mapping[str, Any]) -> bool:
    """alarm of a record → whether parts have it only by what was set up or measured with the probe: it is of the probe or a ball,
    and no touch tells it from the place of an axis. Every view asks here.
    """
    from ..state.changes import change  # as above

    part, cause = a.get("on_part"), a.get("cause")
    axis = isinstance(part, Said) and part.key == "part.pivot_since"
    return (change(cause).of_the_probe or cause == "ball") and not axis


def is_unsure(record: Mapping[str, Any]) -> bool:
    """record of a night → whether nobody knows if the machine is within its limits. Then somebody has to measure a first part, so
    every exit status of that night is 1.
    """
    believed = record.get("verdict") in ("good", "changed")
    return believed and any(x.get("passed") is None and x.get("limit") for x in record.get("limits") or ())


def is_unseen(now: object) -> bool:
    """what a night says of an older alarm by now → whether it has gone again, as far as that night can tell."""
    return isinstance(now, Said) and now.key in UNSEEN


def shows(size: float, change: float, std: float) -> bool:
    """size that a night found, what there is of it by now, standard deviation of that → whether it still shows: no more does what
    has turned, nor what is less than two standard deviations from nothing, and nearer to nothing than to what was found. Every view
    asks here.
    """
    return change * size >= 0 and (abs(change) >= UNSURE * std or abs(change) >= abs(change - size))


def has_grown(total: float, size: float, std: float | None, now: float = 0.0) -> bool:
    """how far it is by now, size that its night found, standard deviation of that (None: not on record), and of how far it is by
    now (0: not on record) → whether that is another number: by far, or surely. A night that hardly knows it gives no other number.
    """
    other = abs(total - size)
    if other <= UNSURE * now:
        return False
    return other > AS_FOUND * abs(size) or bool(std and other > max(LEAST * abs(size), SURE * abs(std)))


def size_of(a: Mapping[str, Any]) -> float:
    """fault → µm that it does, at most where that is on record, else the size that was found (of a tilt over 300 mm)."""
    if a.get("on_part_um") is not None:
        return abs(float(a["on_part_um"]))
    return abs(float(a.get("size") or 0.0)) * (1e3 if a.get("unit") == "mm" else 3e5)


def std_now(a: Mapping[str, Any]) -> float:
    """alarm of another night → standard deviation of how far it is by now, in the unit of the alarm; 0 where no record has it."""
    told = (x.values.get("told") for x in _inside(a.get("now")))
    found = next((x for x in told if isinstance(x, Number) and x.std), None)
    return 0.0 if found is None or found.std is None else found.std / shown(str(a.get("unit") or "mm"))[0]


def hardly_known(a: Mapping[str, Any]) -> bool:
    """alarm of another night → whether the last night that measured hardly knows how far it is by now: not to half of its size."""
    return std_now(a) > 0.5 * abs(float(a.get("size") or 0.0)) > 0.0


def by_tonight(cause: Mapping[str, Any]) -> dict[str, Any]:
    """alarm → `on_part` and `on_part_um`; what goes on from an earlier night as it is tonight."""
    part, small, total, size = cause["on_part"], cause.get("on_part_um"), cause.get("total"), float(cause.get("size") or 0.0)
    same = {"on_part": part, "on_part_um": small}
    if not small or not total or not size or is_gone(cause["now"]) or is_unseen(cause["now"]):
        return same
    if not (cause.get("rate_per_day") or cause.get("ignored") or has_grown(float(total), size, cause.get("std"), std_now(cause))):
        return same
    counted = float((cause.get("ignored") or {}).get("total") or size)
    large = abs(float(small) * (counted + float(total) - size) / counted)
    return {"on_part": with_effect(part, float(small), large), "on_part_um": large}


def with_its_size(text: Any, a: Mapping[str, Any]) -> Any:
    """sentence about a night, an alarm of another night that it names → the sentence with the size that this has by now, where that
    is another number than its night found: one alarm has one size.
    """
    size, now = float(a.get("size") or 0.0), a.get("now")
    if is_gone(now or "") or not moved_on(a):
        return text
    told = next((x.values["told"] for x in _inside(now) if x.key in NOW and isinstance(x.values.get("told"), str)), None)
    factor, unit = shown(str(a.get("unit") or "mm"))
    std = None if a.get("std") is None else float(a["std"]) * factor
    own = number(size * factor, unit, std, signed=a.get("cause") not in LENGTHS)
    return text if told is None else _with(text, own, told)


def as_drifting(record: Mapping[str, Any]) -> Mapping[str, Any]:
    """record of a night → the same; an alarm of another night about a parameter that drifts the same way has the order of that
    drift: nobody asks about one knock, or enters a number, beside "enter none before it stands still".
    """
    waiting = record.get("standing") or ()
    every = [
        a for a in (*(record.get("alarms") or ()), *waiting) if a.get("rate_per_day") and a.get("steady", True) and a.get("do")
    ]
    drifts = {a["parameter"]: _stood(a) for a in every if not is_over(a)}

    def told(a: Mapping[str, Any]) -> Mapping[str, Any]:
        drift = drifts.get(a["parameter"])
        if drift is not None and a["id"] == drift["id"]:
            return drift
        if drift is None or a.get("rate_per_day") or is_over(a) or a.get("compensation") or a.get("settled"):
            return a
        same = float(a.get("size") or 0.0) * float(drift.get("size") or 0.0) > 0
        return {**a, "do": drift["do"], "confirmed": None} if same else a

    return {**record, "standing": [told(a) for a in waiting]} if drifts and waiting else record


def _stood(a: Mapping[str, Any]) -> Mapping[str, Any]:
    """alarm of a drift → the same; one that stands still by now no longer waits for that."""
    usual = isinstance(a["do"], Said) and a["do"].key == "night.drift_do"
    return {**a, "do": say("morning.drift_stood_do")} if a.get("stands") and usual else a


def by_now(text: Any, a: Mapping[str, Any]) -> Any:
    """sentence of an alarm, the alarm → the sentence with one size: what there is of it by the last night that measured; of one
    that has gone again what its night found, and what is left.
    """
    now = a.get("now")
    if is_gone(now or "") or is_unseen(now):
        return joined("; ", (text, now))
    last = next((x for x in _inside(now) if x.key == WAS), None)
    return with_its_size(text, a if last is None else {**a, "now": say(ONLY[0], told=last.values["told"])})


def sized(headline: Any, record: Mapping[str, Any]) -> Any:
    """headline of a night, its record → the same; the alarm of another night that it names first has the size of that night."""
    first = next(iter(record.get("standing") or ()), None)
    return headline if first is None else with_its_size(headline, first)


def by_verdict(a: Mapping[str, Any], verdict: object) -> dict[str, Any]:
    """alarm, verdict of the last night that measured → the same; where no part is made it does not say when to make them."""
    own, key = a.get("do"), "cause.temperature.do"
    if isinstance(own, Said) and own.key == "night.sensors.do_knock":
        return {**a, "do": own.but(do=by_verdict({**a, "do": own.values["do"]}, verdict)["do"])}
    usual = own.key == key if isinstance(own, Said) else own == texts()(key)
    if a.get("cause") != "temperature" or verdict not in BEYOND or not usual:
        return dict(a)
    return {**a, "do": say("cause.temperature.do_beyond")}


def moved_on(a: Mapping[str, Any]) -> bool:
    """alarm of another night → whether what has come together by now is another number than the one that its night found."""
    total, size = a.get("total"), float(a.get("size") or 0.0)
    if total is None or not size:
        return False
    return bool(a.get("rate_per_day")) or has_grown(float(total), size, a.get("std"), std_now(a))


def _inside(text: Any) -> Iterator[Said]:
    """text → it, and every text within it."""
    if isinstance(text, Said):
        yield text
        for x in text.values.values():
            yield from _inside(x)


def _with(text: Any, own: str, told: str) -> Any:
    """sentence, size of its alarm, size by now → the sentence with the latter alone."""
    if not isinstance(text, Said):
        return told if text == own else text
    values = {name: _with(x, own, told) for name, x in text.values.items()}
    if text.key in STANDING and values != text.values:
        values["now"] = _without(text.values["now"], told)
    return text.but(**values) if values != text.values else text


def _without(now: Any, told: str) -> Any:
    """what a headline says in brackets of an alarm by now, size by now → the same without what only says that size."""
    if not isinstance(now, Said) or now.key != LIST:
        return now
    parts = [x for name, x in now.values.items() if name != "between"]
    left = [x for x in parts if not (isinstance(x, Said) and x.key in ONLY and x.values.get("told") == told)]
    kept = [_without(x, told) for x in left]
    return joined(str(now.values["between"]), kept) if any(isinstance(x, Said) and x for x in kept) else ""


def with_effect(part: str, small: float, large: float) -> str:
    """what an alarm means for a part, µm that this says, µm in their place → the same with these."""
    own, by_now = number(small, "µm", signed=False), number(large, "µm", signed=False)
    if not isinstance(part, Said):
        return str(part).replace(own, by_now)
    return part.but(**{name: by_now if v == own else v for name, v in part.values.items() if isinstance(v, str)})
