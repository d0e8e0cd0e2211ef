"""What somebody brings and is damaged: backups, certificates, programs of a simulated control, budgets, facts of a profile."""

from __future__ import annotations

import shutil
import sqlite3
import subprocess
from pathlib import Path

import click
import pytest
from support.histories import record

from postprocessors._confirmed import confirmed
from sim_controller.languages import Alarm
from sim_controller.probing import rig
from sim_controller.session import Session, Setup
from sim_controller.started import start
from tango_cnc.asked import asked
from tango_cnc.commands.capability import _merge
from tango_cnc.commands.history import restore
from tango_cnc.files import read_cell
from tango_cnc.history import copy, opened
from tango_cnc.records import InputError, LinkError, World
from tango_cnc.web.tls import checked

ROOT = Path(__file__).parents[1]


@pytest.mark.long
def test_a_backup_that_cannot_be_restored_leaves_the_history_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, nights in {"history.db": 2, "backup.db": 1}.items():
        with opened(tmp_path / name) as history:
            for number in range(1, 1 + nights):
                history.add_night(record(number))

    with monkeypatch.context() as broken, click.Context(restore):
        found = {"M": ["not what was copied"]}
        broken.setattr(copy.History, "broken", lambda self: {} if "backup.db" in str(self.engine.url) else found)
        with pytest.raises(LinkError, match="the copy is not what was copied"):
            restore.callback(tmp_path / "backup.db", tmp_path, str(tmp_path / "history.db"))  # type: ignore[misc]
    with opened(tmp_path / "history.db", create=False) as history:
        assert len(history.nights()) == 2 and not history.verify()
    assert not list(tmp_path.glob("history.db.2*"))
    with click.Context(restore):
        restore.callback(tmp_path / "backup.db", tmp_path, str(tmp_path / "history.db"))  # type: ignore[misc]
    with opened(tmp_path / "history.db", create=False) as history:
        assert len(history.nights()) == 1
    kept = [f for f in tmp_path.glob("history.db.2*") if not f.name.endswith(("-wal", "-shm"))]
    assert len(kept) == 1 and sqlite3.connect(kept[0]).execute("SELECT count(*) FROM entry").fetchone() == (2,)


@pytest.fixture(scope="module")
def pems(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pems")
    if shutil.which("openssl") is None:
        pytest.skip("needs the command openssl (apt install openssl)")

    def made(*words: str) -> None:
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)

    for name in ("one", "two"):
        made("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "9", "-subj", "/CN=x",
             "-keyout", f"{name}.key", "-out", f"{name}.crt")  # fmt: skip
    made("pkey", "-aes128", "-passout", "pass:abcd", "-in", "one.key", "-out", "locked.key")
    text = (folder / "one.crt").read_text()
    (folder / "half.crt").write_text(text[: len(text) // 2])
    key = (folder / "one.key").read_text().splitlines(keepends=True)
    (folder / "gap.key").write_text("".join(key[:1] + key[2:]))
    (folder / "bytes.crt").write_bytes(b"\xff\x00" * 50)
    return folder


@pytest.mark.parametrize(
    ("certificate", "key", "said"),
    [
        ("half.crt", "one.key", r"half.crt: cannot be read as a certificate; allowed: a whole PEM file"),
        ("bytes.crt", "one.key", r"bytes.crt: found no certificate in it"),
        ("one.key", "one.crt", r"one.key: found no certificate in it"),
        ("one.crt", "one.crt", r"one.crt: found no private key in it"),
        ("one.crt", "two.key", r"two.key: it is not the key of .*one.crt"),
        ("one.crt", "gap.key", r"gap.key: cannot be used with .*one.crt"),
        ("one.crt", "locked.key", r"locked.key: found a key with a pass phrase; allowed: one without"),
    ],
)
def test_pem_files_that_no_server_can_use_are_named(certificate: str, key: str, said: str, pems: Path) -> None:
    with pytest.raises(InputError, match=said):
        checked(pems / certificate, pems / key)
    checked(pems / "one.crt", pems / "one.key")


@pytest.mark.parametrize("text", ["[]", "contributions: 5", "contributions: [5]", "contributions: [{source: [1]}, null]", "x: [1"])
def test_a_budget_that_is_none_is_refused_and_stays_what_it_was(text: str, tmp_path: Path) -> None:
    file = tmp_path / "uncertainty.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"uncertainty\.yaml"):
        _merge(file, "contributions", "source", [{"source": "repeatability", "std": 0.1}])
    assert file.read_text() == text


def test_a_budget_keeps_lines_whose_source_is_no_word(tmp_path: Path) -> None:
    file = tmp_path / "uncertainty.yaml"
    file.write_text("contributions: [{source: [1], std: 2}, {source: repeatability, std: 5}]")
    _merge(file, "contributions", "source", [{"source": "repeatability", "std": 0.1}])
    assert "std: 2" in file.read_text() and "std: 0.1" in file.read_text() and "std: 5" not in file.read_text()


def test_a_fact_is_shown_as_far_as_anybody_reads() -> None:
    for stated in (["x/" * 3000], ["a" * 20, {"b": "c" * 4000}], "d" * 5000, [["e" * 5000]]):
        with pytest.raises(InputError, match=r"controller\.confirmed: found") as refused:
            confirmed(stated, ["G53 holds for all axes"], [])
        assert len(str(refused.value)) < 1000


@pytest.mark.parametrize(
    ("stated", "said"),
    [("skip = G31", "which is a key of its own"), ("skip = G38", "is no fact that this post leaves open"), ("wait", "is no fact")],
)
def test_a_key_with_its_value_is_told_from_a_wrong_fact(stated: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        confirmed([stated], ["G53 holds for all axes"], ["skip = G31"])


def test_a_number_of_a_touch_has_no_thousands_of_digits() -> None:
    cell = read_cell(ROOT / "examples" / "trunnion")
    assert asked(cell, {"left_out": [f"touch {'9' * 5000} on facet 1: too far"]}).made == asked(cell, {"left_out": []}).made


@pytest.mark.parametrize(
    ("family", "lines", "said"),
    [
        ("fagor", ["%A", "P1 = " + "[" * 450 + "1" + "]" * 450], "brackets too deep"),
        ("macro_b", ["#[" + "*".join(["99999999"] * 50) + "]=1"], "number too large"),
        ("rs274", ["G0 X" + "9" * 5000], "block too long"),
    ],
)
def test_a_simulated_control_stops_with_an_alarm_at_what_is_beyond_it(family: str, lines: list[str], said: str) -> None:
    cell = read_cell(ROOT / "examples" / "trunnion")
    session = Session(rig(cell.machine, cell.artefact, World(), None), Setup(family=family))
    with pytest.raises(Alarm, match=said):
        session.run(session.control(lambda data: None), iter(lines))


def test_a_program_with_a_character_that_no_control_has_is_an_alarm(tmp_path: Path) -> None:
    cell = read_cell(ROOT / "examples" / "trunnion")
    session = Session(rig(cell.machine, cell.artefact, World(), None), Setup())
    (tmp_path / "O1.nc").write_text("%\nO1 (TÄNGO)\nM30\n%\n", encoding="utf-8")
    with pytest.raises(LinkError, match="a character that this control does not have"):
        start(tmp_path / "O1.nc", tmp_path / "records.txt", session)
