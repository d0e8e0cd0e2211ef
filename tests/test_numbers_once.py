"""A number of a sentence is rounded once, where it is shown, in the unit of the page: a record carries it exact."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import pytest
from support.nights import M, knock, night
from support.pages import words_of
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.history import opened
from tango_cnc.nightly.words import cause_texts, changed, headline, value
from tango_cnc.report.alarm import sentence
from tango_cnc.report.plain import plain
from tango_cnc.report.texts import texts, texts_of
from tango_cnc.report.units import Units
from tango_cnc.texts import MEMBER, Said, carried, revived, say
from tango_cnc.texts.number import EXACT, Number, number
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

SIZE, WORST = 0.021456, 85.4702  # mm, µm: as 21.5 and 85.5 they would be 22 and 86


def moved(**more: Any) -> dict[str, Any]:
    """a night on which an axis moved and a limit is crossed → its record."""
    record = night(M, 12, "out_of_limits", volume={"worst_um": WORST, "rms_um": 40.0, "std_um": 0.9})
    limit = {"what": "volume", "value": WORST, "unit": "µm", "low": WORST - 2, "high": WORST + 2, "limit": 60.0, "passed": False}
    since = "2026-11-04"
    text = changed("EX0C", value(SIZE, "mm", 0.000412), since)
    on_part, do = cause_texts("axis_location", 1e3 * SIZE, since)
    alarm = {**knock(record["night"]), "text": text, "size": SIZE, "std": 0.000412, "on_part_um": 1e3 * SIZE}
    record |= {"limits": [limit], "alarms": [{**alarm, "on_part": on_part, "do": do}], **more}
    return record | {"headline": headline(record)}


def as_read(record: dict[str, Any], *, exact: bool = True) -> Any:
    """record, whether its sentences carry what numbers were rounded from → the same as a history gives it back."""
    data = json.loads(json.dumps(carried(record)))
    for _, values in () if exact else data[MEMBER].values():
        for name in [x for x in values if x.endswith(EXACT)]:
            del values[name]
    return revived(data)


@pytest.mark.parametrize("exact", [True, False], ids=["carried", "recorded before"])
def test_a_size_is_rounded_from_the_record_and_not_from_its_text(exact: bool) -> None:
    record, t = as_read(moved(), exact=exact), texts()
    assert "+21.5 ± 0.4 µm" in record["headline"] and "is 85.5 µm" in record["headline"]  # what a message says
    shop = plain(record["headline"], Units(), t)
    assert "+21 µm" in shop and "is 85 µm" in shop and "22 µm" not in shop and "86 µm" not in shop
    assert "up to 21 µm" in plain(record["alarms"][0]["on_part"], Units(), t)
    inch = plain(record["headline"], Units("inch"), t)
    assert "+0.00084 in" in inch and "0.0034 in" in inch
    told = sentence(record["headline"], Units("inch"), t)
    assert "+844.7 ± 16.2 µin" in told and "3365.0 µin" in told  # 85.5 µm would be 3366.1


def test_what_a_number_was_rounded_from_is_in_no_sentence_of_a_message() -> None:
    record = as_read(moved())
    alarm = record["alarms"][0]
    assert "21.45" not in " ".join([record["headline"], alarm["text"], alarm["on_part"], texts().of(alarm["text"])])
    assert sentence(record["headline"], Units(), texts()).startswith("Volume is 85.5 µm, 60 µm are allowed: ")


def test_a_text_of_the_shop_rounds_no_more_often(tmp_path: Path) -> None:
    (tmp_path / "texts.toml").write_text('[morning]\nnow_of = "{told} (Nacht bis {date})"\n', encoding="utf-8")
    t = texts_of(tmp_path)
    told = t("morning.now_of", told=as_read(moved())["alarms"][0]["text"], date="heute")
    assert "+21 µm" in plain(told, Units(), t) and "Nacht bis heute" in told


def test_a_number_that_the_record_lacks_stays_as_it_was_said() -> None:
    record = moved()
    record["alarms"][0] |= {"size": 0.5, "std": 0.1, "on_part_um": 500.0}  # of another sentence
    assert "+22 µm" in plain(as_read(record, exact=False)["alarms"][0]["text"], Units(), texts())


@pytest.mark.parametrize(
    ("made", "said", "more"),
    [
        (value(-0.0214561, "mm", 0.00041), "-21.5 ± 0.4 µm", "-21.4561 ± 0.4100 µm"),
        (value(2.34e-5, "rad"), "+23.4 µrad", "+23.4000 µrad"),
        (value(1.25e-6, "mm/mm", signed=False), "1.2 µm/m", "1.2500 µm/m"),
        (number(0.7123, "µm", signed=False, decimals=2), "0.71 µm", "0.71230 µm"),
        (number(WORST, signed=False), "85.5", "85.4702"),
    ],
)
def test_a_number_has_as_many_decimals_as_are_asked_for(made: Number, said: str, more: str) -> None:
    assert (made, made.more(3), made.more(0)) == (said, more, said)
    again = pickle.loads(pickle.dumps(made))
    assert (again, again.value, again.std) == (made, made.value, made.std)


def test_damaged_numbers_of_a_record_are_refused() -> None:
    data = json.loads(json.dumps(carried(moved())))
    key = next(text for text, (_, values) in data[MEMBER].items() if f"size{EXACT}" in values)
    data[MEMBER][key][1][f"size{EXACT}"] = "many"
    with pytest.raises(ValueError, match="many"):
        revived(data)


@pytest.mark.few(0)
def test_the_row_of_a_night_says_the_size_of_its_box(tmp_path: Path) -> None:
    place = cell(
        tmp_path / "one",
        records=[night(M, 11, headline="as before", volume={"worst_um": 40.0, "rms_um": 9.0, "std_um": 0.9}), moved()],
    )
    with opened(place / "history.db") as history:
        assert isinstance(history.night(2).record["headline"], Said)
    app = create(Settings((place,)))
    with TestClient(app, base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        for path in ("/", "/machine/HU40T-like", "/machine/HU40T-like/nights", "/alarms"):
            text = words_of(site.get(path).text)
            assert "+21 µm" in text and "22 µm" not in text and "86 µm" not in text, (path, text)
        app.state.tango.units = Units("inch")
        text = words_of(site.get("/machine/HU40T-like").text)
        assert "3365.0 µin" in text and "3366" not in text


def test_two_numbers_that_are_rounded_to_the_same_words_stay_two() -> None:
    """21.46 and 21.54 µm are both 21.5 in a message, and 21 and 22 on a page."""
    sizes = (0.021456, 0.021544)
    texts_of_both = [changed("EX0C", value(size, "mm", 0.000412), "2026-11-04") for size in sizes]
    assert texts_of_both[0][:] == texts_of_both[1][:]
    record = {"alarms": [{"text": texts_of_both[0]}], "standing": [{"text": t, "in": [t]} for t in reversed(texts_of_both)]}
    record |= {"headline": say("changed.after_repair", text=texts_of_both[1], owner="Ann", date="2026-11-05", what="")}
    carried_ = json.loads(json.dumps(carried(record), sort_keys=True))  # a history keeps no order of names
    read: Any = revived(carried_)
    told = [read["alarms"][0]["text"], *(a["text"] for a in read["standing"]), read["standing"][1]["in"][0]]
    exact = [t.values["size"].value for t in (*told, read["headline"].values["text"])]
    assert exact == pytest.approx([21.456, 21.544, 21.456, 21.456, 21.544], abs=1e-9)
    on_page = [plain(t, Units(), texts()) for t in told]
    assert ["+21 µm" in t for t in on_page] == [True, False, True, True] and "+22 µm" in on_page[1]
    assert revived(json.loads(json.dumps(carried(read)))) == read


def test_a_text_whose_words_are_said_once_has_no_place_beside_it() -> None:
    assert not [key for key in carried(moved())[MEMBER] if key.startswith("@")]
