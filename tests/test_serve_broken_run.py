"""A run that broke off on a machine that no night has measured: every page says not yet, and nobody is told to start a program."""

from pathlib import Path

import pytest
from starlette.testclient import TestClient
from support.nights import night
from support.runs import Control, Result, cell  # noqa: F401
from support.server import cell as served

from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings


def pages(folder: Path) -> dict[str, str]:
    """folder of a cell → {address: text of the page}."""
    with TestClient(create(Settings((folder,))), base_url="http://127.0.0.1") as site:
        listed = site.get("/").text
        address = listed.partition('href="/machine/')[2].partition('"')[0]
        own = {path: site.get(f"/machine/{address}{path}").text for path in ("", "/run", "/files")}
    return {"list": listed, **own}


def test_a_run_that_broke_off_is_not_yet_although_no_night_was_measured(cell: Path) -> None:
    before = pages(cell)
    assert "Nobody knows" in before["list"] and "tango nightly -C" in before[""]
    assert Result("run", "-C", cell, "--port", Control(cell, stop=4).url, "--timeout", "0.4").code == 3
    found = pages(cell)
    for name, text in found.items():
        assert "Not yet" in text and "Nobody knows" not in text, name
        assert "tango nightly" not in text and "Have it measured" not in text, name
    assert "Look at the machine first" in found["list"] and "of the run that broke off on" in found["list"]
    assert "may still execute" in found["/run"]
    assert "Look at the machine first: its control may still execute the program" in found[""]
    status = Result("nightly", "-C", cell, "--status")
    assert status.code == 1 and "May I make parts? Not yet. Look at the machine first" in status.out + status.err


@pytest.mark.few(0)
def test_the_list_counts_each_answer_by_its_own_word(cell: Path, tmp_path: Path) -> None:
    """Machines that may still move were counted as a No."""
    assert Result("run", "-C", cell, "--port", Control(cell, stop=4).url, "--timeout", "0.4").code == 3
    limit = {"what": "volume", "value": 51.0, "low": 50.0, "high": 52.0, "limit": 45.0, "unit": "µm", "passed": False}
    others = {"Ash": [night("Ash", 0)], "Elm": [night("Elm", 0, "out_of_limits", limits=[limit])], "Fir": []}
    folders = [served(tmp_path / name, name, records) for name, records in others.items()]
    with TestClient(create(Settings((cell, *folders))), base_url="http://127.0.0.1") as site:
        listed = site.get("/").text
    assert "All: 4. Yes: 0. Yes, but: 1. No: 1. Not yet: 1. Nobody knows: 1." in listed


def test_a_machine_that_was_never_measured_has_the_sign_of_nobody_knows(tmp_path: Path) -> None:
    place = served(tmp_path / "Fir", "Fir", [])
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1") as site:
        for text in (site.get("/").text, site.get("/machine/Fir").text.partition('class="verdict')[2]):
            assert "Nobody knows" in text and 'fill="#5b3f95"' in text and "stroke-dasharray" not in text
