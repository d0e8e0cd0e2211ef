"""What the message of a night says before its causes: what to do about parts first, and who is asked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..report.answer import PARTS, of_moving
from ..report.look import may_move
from ..report.texts import Texts
from ..report.tonight import is_gone, only_set_up
from ..state.changes import change


def owner_of(owner: Any, record: Mapping[str, Any], t: Texts) -> str:
    """who is asked or nobody, record, texts → the same with whoever is asked where nobody answers."""
    deputy = record.get("deputy")
    if not owner:
        return t("mail.nobody_but", deputy=deputy) if deputy else t("mail.nobody")
    return t("mail.deputy", owner=owner, deputy=deputy) if deputy else str(owner)


def parts_first(record: Mapping[str, Any], t: Texts) -> list[str]:
    """record of a night, texts → what to do before anything else, as on its page: [] where nothing keeps parts, or where the
    message says so itself.
    """
    verdict, limits = record["verdict"], record.get("limits") or ()
    if (told := of_moving(record, t, old=int(record.get("stale_nights") or 0))) is not None:
        return [f"{t('may.ask')} {told.word}. {t('morning.cut_off_todo')}"]
    if record.get("stale_nights") or record["status"] == "refused":
        return []
    known = record.get("last_verdict") if verdict == "not_measured" else verdict  # nothing has said otherwise since
    if verdict == "not_measured" and not (record.get("last_measured") or record.get("unread")):
        return [f"{t('may.ask')} {t('may.unknown')}. {t('may.brief_never')}"]
    if known in ("out_of_limits", "doubtful"):
        reasons = (record.get("plausible") or {}).get("reasons") or () if verdict == "doubtful" else ()
        return [" ".join([*may_move(reasons, t), t("may.brief_no")])]
    if verdict not in ("changed", "not_measured") and all(x.get("passed") is not None for x in limits):
        return []
    alarms = (*record["alarms"], *(record.get("standing") or ()))
    probe = verdict == "changed" and bool(alarms) and all(map(only_set_up, alarms))
    scatters = any(change(a.get("cause")).scatters and not is_gone(a.get("now") or "") for a in alarms)
    return [t(PARTS["_probe" if probe else "_beside" if scatters else ""])]
