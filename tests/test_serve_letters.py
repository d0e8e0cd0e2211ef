"""Names of users have the letters of their language, and an address that shows no page says so in the texts of the shop."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tango_cnc.records import InputError
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import add_user, read_users, remove_user, verified

WORD = "a long password"


@pytest.mark.parametrize("name", ["Zoë", "Łukasz", "Ольга", "田中", "ann.meier@shop"])
def test_a_user_may_have_the_letters_of_every_language(tmp_path: Path, name: str) -> None:
    file = tmp_path / "users.json"
    add_user(file, unicodedata.normalize("NFD", name), WORD, "operate")
    assert list(read_users(file)) == [unicodedata.normalize("NFC", name)]
    for typed in (unicodedata.normalize("NFC", name), unicodedata.normalize("NFD", name)):  # one key, or two
        assert (user := verified(file, typed, WORD)) is not None and user.name == unicodedata.normalize("NFC", name)
    remove_user(file, name)
    assert read_users(file) == {}


@pytest.mark.parametrize("name", ["", "Zoë Ott", "a\nb", "<b>", "-x", "_x", "\u200bx", "x" * 65, "a/b"])
def test_what_is_no_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="allowed: letters, digits"):
        add_user(tmp_path / "users.json", name, WORD, "view")


def test_an_address_that_takes_a_form_says_so(tmp_path: Path) -> None:
    with TestClient(create(Settings((tmp_path,))), base_url="http://127.0.0.1:8125", client=("127.0.0.1", 5000)) as site:
        answer = site.get("/sign-out")
        assert answer.status_code == 405 and "press the button" in answer.text and "Method Not Allowed" not in answer.text
