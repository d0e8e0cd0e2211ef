"""The checks of a report: plausible, complete, fitted, predicted, explained, within the limit. The worst is its verdict."""

from __future__ import annotations

from typing import Any

from ..asked import resume_of
from ..diagnose.sentences import covariate
from ..loaded import HELPS
from ..texts import instead, say
from .answer import LEVELS
from .compensated import order
from .days import at, day, spoken_days
from .facts import Facts
from .plain import length, plain
from .repeated import as_found
from .texts import Texts, code
from .tonight import sized
from .verdict import MISSING, OUTLIERS, PREDICTED, RATIO, Check, Level, Verdict, graded, worst_of

VERDICTS = ("good", "changed", "out_of_limits", "doubtful", "not_measured")


def verdict(f: Facts, t: Texts) -> Verdict:
    """facts, texts → the checks and the worst of them."""
    numbers = [_plausible(f, t), _complete(f, t), _fit(f, t), _predicts(f, t), _diagnosis(f, t)]
    return worst_of([*_nights(f, t), *numbers, _limit(f, t)])


def _plausible(f: Facts, t: Texts) -> Check:
    j = f.judgement
    level: Level = "good" if j.verdict == "trustworthy" else "look" if j.verdict == "doubtful" and not j.nothing else "stop"
    todo = t("todo.plausible")
    if j.suspicions and j.suspicions[0].kind == "missing_touches":
        todo = ""  # the check of what is complete says it
    elif j.suspicions:
        s = j.suspicions[0]
        line = t("todo.line", line=s.line) if s.line else ""
        likely = "todo.plausible_part" if s.fits is False else "todo.plausible_likely"
        todo = t(likely, text=s.text, where=f"{s.file}{line}", change=s.change)
    why = "; ".join(t.of(r) for r in j.reasons)
    text = t(f"check.plausible_{level}", why=why)
    if level == "good" and j.untrusted:
        text = t("check.plausible_but", names=", ".join(j.untrusted))
    return Check("plausible", level, t(f"judged.{j.verdict}"), text, todo)


def _complete(f: Facts, t: Texts) -> Check:
    planned = max(f.planned, f.used)
    missing = planned - f.used
    level: Level = "good" if not missing else "look" if missing <= MISSING * planned else "stop"
    text = t(f"check.complete_{level}", planned=planned, missing=missing)
    return Check(
        "complete",
        level,
        f"{f.used} / {planned}",
        text,
        t("todo.complete", more=resume_of(f.paper.origin).removeprefix("--resume")),
    )


def _fit(f: Facts, t: Texts) -> Check:
    u = f.wishes.units
    sigma, out = f"{f.result.sigma * 1e3 * u.per_micron:.2f}", len(f.result.outliers)
    flagged = t("check.fit_outliers", outliers=out, touches=f.used) if out else ""
    stated = f"{f.cell.machine.probe.repeatability * 1e3 * u.per_micron:.2f}"
    ratio = f.ratio
    level: Level = "look" if ratio is None else graded(ratio, RATIO)
    if out > OUTLIERS * f.used:
        level = "stop"
    elif out and level == "good":
        level = "look"
        return Check("fit", level, f"{out}", flagged, t("todo.fit_outliers"))
    todo = t("todo.fit_outliers") if out and ratio is not None and ratio < RATIO[0] else t("todo.fit")
    text = (
        t("check.fit_unstated", sigma=sigma, unit=u.small)
        if ratio is None
        else t(f"check.fit_{level}", sigma=sigma, stated=stated, ratio=f"{ratio:.1f}", unit=u.small)
    )
    value = f"{ratio:.1f} ×" if ratio is not None else f"{sigma} {u.small}"
    return Check("fit", level, value, "; ".join(x for x in (text, flagged) if x), todo)


def _predicts(f: Facts, t: Texts) -> Check:
    if f.held is None:
        return Check("predicts", "look", "–", t("check.predicts_none", why=f.why_not_held), t("todo.predicts_none"))
    level = graded(f.held.beyond, PREDICTED)
    ratio = f"{f.held.ratio:.2f}"
    return Check("predicts", level, f"{ratio} ×", t(f"check.predicts_{level}", ratio=ratio), t("todo.predicts"))


def _diagnosis(f: Facts, t: Texts) -> Check:
    d = f.diagnosis
    if d is None:
        todo = t("todo.diagnosis_none") if f.judgement.verdict != "implausible" else ""  # what is wrong there comes first
        return Check("diagnosis", "look", "–", t("check.diagnosis_none", why=f.why_no_diagnosis), todo)
    if d.verdict == "adequate":
        return Check("diagnosis", "good", t(f"judged.{d.verdict}"), t("check.diagnosis_good"))
    if d.findings:
        from ..diagnose.sentences import advice, cause_name

        causes = ", ".join(dict.fromkeys(t.of(cause_name(x.cause)) for x in d.findings))
        text = t.of(advice(d.findings[0]))
        todo = t("todo.diagnosis", advice=f"{text[0].upper()}{text[1:]}.")
        return Check("diagnosis", "look", t(f"judged.{d.verdict}"), t("check.diagnosis_look", causes=causes), todo)
    names = ", ".join(t.of(covariate(r.covariate)) for r in d.unexplained)
    todo = t("todo.diagnosis_unexplained")
    return Check(
        "diagnosis", "look", t(f"judged.{d.verdict}"), t("check.diagnosis_unexplained", causes=names), todo, undermines=True
    )


def limits_of(f: Facts) -> list[dict[str, Any]]:
    """facts → the limit of the tool tip as a night records it (docs/nightly.md); empty where none is stated or nothing is known."""
    if f.tip is None or f.wishes.limit is None:
        return []
    size, half, limit = (1e3 * x for x in (f.tip.worst, f.factor * f.tip.std, f.wishes.limit))
    passed = True if size + half <= limit else False if size - half > limit else None
    return [
        {"what": "volume", "value": size, "unit": "µm", "low": size - half, "high": size + half, "limit": limit, "passed": passed}
    ]


def _limit(f: Facts, t: Texts) -> Check:
    u = f.wishes.units
    if f.tip is None:
        return Check("limit", "look", "–", t("check.limit_unknown"), t("todo.limit_unknown"), trust=False)
    value = length(f.tip.worst * 1e3, u)
    if f.wishes.limit is None:
        return Check("limit", "good", value, t("check.limit_none"), t("todo.limit_none"), trust=False, open=True)
    passed = limits_of(f)[0]["passed"]
    text = t("check.limit_judged", worst=value, limit=length(f.wishes.limit * 1e3, u))
    if f.control is not None and f.control.gone is not None:
        text = f"{text}; {t('check.limit_in_control', number=f.control.beneath or f.control.number, target=f.control.target)}"
    if f.control is not None and f.control.event not in HELPS:
        words = {"number": f.control.number, "target": f.control.target, "event": code(f.control.event)}
        text = f"{text}; {t('check.limit_open_control', **words)}"
    label = t(f"morning.limit_{'open' if passed is None else 'good' if passed else 'stop'}")
    tone: Level = "look" if passed is None else "good" if passed else "stop"
    todo = t("todo.limit_open" if passed is None else "todo.limit")
    older = f.control is not None and f.control.older
    if f.control is not None and older:
        text = f"{text}; {t('check.limit_older_control', number=f.control.number, target=f.control.target)}"
        todo = t("todo.limit_older", number=f.control.number, target=f.control.target)
    elif f.control is not None and f.control.event not in HELPS and not passed:
        todo = t(order(f.control.event), number=f.control.number, target=f.control.target, event=code(f.control.event))
    if passed and older:
        return Check("limit", "look", value, text, todo, trust=False, said="verdict.limit_older", tone="look", label=label)
    return Check("limit", "good" if passed else "look", value, text, todo, trust=False, tone=tone, label=label)


def _nights(f: Facts, t: Texts) -> list[Check]:
    n = f.nights
    if n is None:
        return []
    level: Level = "look" if n.waiting or n.verdict != "good" or n.former else "good"
    word = t(f"morning.{n.verdict}") if n.verdict in VERDICTS else n.verdict
    # What was said in the night knows nothing of what was decided since.
    headline = n.cause if n.cause and n.verdict == "changed" else n.headline
    dated = sized(as_found(headline, n.record or {}), n.record or {})
    said = instead(dated, "last night", say("check.night_before", date=n.date))  # a report is read tomorrow, too
    age = n.beside(f.paper.measured)
    text = t(
        f"check.nights_{level}",
        date=day(n.date, t),
        said=" ".join(
            [f"{plain(said, f.wishes.units, t, f.cell.machine).rstrip('.')}.", *(spoken_days(t.of(x), t) for x in n.former)]
        ),
        count=n.waiting,
        age=t(f"check.nights_{age}", date=at(f.paper.measured, t)),
    )
    newer = "_newer" if age == "newer" else ""
    owner = n.owner or f.paper.owner
    has = bool(n.has) and not n.asks  # somebody has what is wrong first
    whom = "_also" if has or (n.asks and n.asks in n.todo) else "" if owner else "_nobody"  # nobody calls two about one alarm
    todo = t(f"todo.nights{newer}{whom}", owner=owner)
    told = n.answer(f.wishes.units, t, f.cell.machine, f.wishes.limit)
    tone = LEVELS[told.may]
    return [Check("nights", level, word, text, todo, trust=False, said=f"verdict.nights_{age}", tone=tone, label=told.word)]
