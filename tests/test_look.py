"""A night that is not believed says what to look at, by its reasons; and every text for it belongs to a reason that is said."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.nights import night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.history import opened
from tango_cnc.nightly.mail import message
from tango_cnc.report import morning
from tango_cnc.report.look import MOST, looks
from tango_cnc.report.texts import texts
from tango_cnc.texts import joined, say

CHIP = say("plausible.groups.facet_elsewhere_in_touches", facet="12", size="212", numbers="20, 33")
SLIP = say(
    "plausible.groups.something_moved_between_touches_after",
    before="20",
    after="21",
    at="90",
    place="x",
    size="9",
    where="y",
    more="",
)
FEW = say("plausible.judge.touches_do_not_fit", count="41", count2="74", numbers="3, 7 …")


def test_each_reason_has_its_own_place_to_look_at() -> None:
    t = texts()
    assert looks([CHIP], t) == [t("look.plausible.groups.facet_elsewhere_in_touches")]
    assert looks([joined("; ", [CHIP, "measure again"])], t) == looks([CHIP], t)  # what is filled in counts as well
    assert looks([say("plausible.judge.nobody_can_tell_which_wrong", text=FEW)], t)[0].startswith("Look for chips")
    assert looks([FEW, CHIP, CHIP, SLIP], t) == [*looks([FEW], t), *looks([CHIP], t), *looks([SLIP], t)]
    assert looks(["what an old record said"], t) == [t("look.other")] == looks([], t)
    assert len(looks([FEW, CHIP, SLIP, say("night.warming")], t)) == MOST


def test_every_text_belongs_to_a_reason_of_the_program() -> None:
    t = texts()
    keys = [k.removeprefix("look.") for k in t.keys if k.startswith("look.") and k != "look.other"]
    assert len(keys) > 25 and [k for k in keys if k not in t] == []


@pytest.mark.long
def test_the_page_the_mail_and_the_record_say_it(tmp_path: Path) -> None:
    """Also after a way through the history, where a sentence is kept with its key."""
    record = night("HU40T-like", 1, "doubtful", plausible={"verdict": "implausible", "reasons": [FEW, CHIP]}, owner="Ann")
    wanted = "Look at that facet: a chip, a drop of coolant, a burr. Clean it. Feel whether its fixture is loose."
    page = morning.render(record).partition("For the engineer")[0]
    assert wanted in page and page.index(wanted) < page.index("Run the full measurement after that.")
    assert wanted in message({**record, "carried": False}, (), ())[1]
    place = cell(tmp_path / "one", records=[night("HU40T-like", 0), record])
    with opened(place / "history.db") as history:
        assert json.dumps(history.night(2).record)
    from tango_cnc.web.app import create
    from tango_cnc.web.settings import Settings

    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        assert wanted in client.get("/machine/HU40T-like").text.partition("For the engineer")[0]
