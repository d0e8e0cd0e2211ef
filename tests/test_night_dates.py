"""What the dates on record say of a night: nights that are missing, a clock that went back."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

from support.histories import knowledge, record

from tango_cnc.history import opened
from tango_cnc.nightly.dates import dated
from tango_cnc.nightly.words import headline, message

MEASURED = datetime(2026, 10, 3, 2, 0, tzinfo=UTC)


def test_a_clock_that_went_back_is_said(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(3), "touch\n1\n", knowledge(3))
        assert dated({}, history, "M", MEASURED + timedelta(days=1), 1.0) == {}
        found = dated({}, history, "M", MEASURED - timedelta(days=9), 1.0)
        assert dated({}, history, "a machine without nights", MEASURED, 1.0) == {}
    assert found == {"clock_back": record(3)["night"]}
    night = (
        record(1) | {"limits": [], "preflight": [], "status": "complete", "machine_time_s": 60.0, "planned": 1, "cell": "c"} | found
    )
    assert "its date is before 2026-10-03" in headline(night)
    assert "Look at the date and time of this computer" in message(night | {"headline": headline(night)}, (), ())[1]


def test_all_missing_nights_are_counted_not_only_those_on_record(tmp_path: Path) -> None:
    seven = {"last_measured": "2026-10-03", "unmeasured": [f"night {n}" for n in range(7)]}
    with opened(tmp_path / "history.db") as history:
        for every, missing in ((1.0, 109), (7.0, 15)):
            found = dated(seven, history, "M", MEASURED + timedelta(days=110), every)
            assert found == {"unmeasured_count": missing}
            assert f"; {missing} nights before were not measured" in headline(record(113) | {"limits": []} | seven | found)
        assert dated(seven, history, "M", MEASURED + timedelta(days=8), 1.0) == {}, "all of them are on record"
