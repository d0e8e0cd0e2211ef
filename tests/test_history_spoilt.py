"""A history that a bad disk or a stranger has changed: what cannot be read is said with what to do, and nothing stays open."""

from __future__ import annotations

import os
import sqlite3
import sys
import zlib
from pathlib import Path
from typing import Any

import pytest
from support.databases import good

from tango_cnc.history import History, opened
from tango_cnc.history.copy import copied
from tango_cnc.records import InputError, LinkError, TangoError

CHANGES = {
    "no JSON": ("UPDATE night_record SET json = '{'", "the record of night 2: .*'tango history verify'"),
    "a number that is none": ("UPDATE night_record SET json = replace(json, '240.0', 'NaN')", "NaN is no number"),
    "no alarms": (
        "UPDATE night_record SET json = replace(json, '\"alarms\"', '\"alarm\"')",
        "alarms: found nothing",
    ),
    "a text for a number": ("UPDATE night SET touches = 'many'", "touches: found 'many'; allowed: a number"),
    "an infinite number": ("UPDATE night SET rms_um = 9e999", "rms_um: found inf; allowed: a number"),
    "readings": ("UPDATE night_readings SET csv = x'00'", "readings that cannot be unpacked"),
    "an estimate": ("UPDATE night_estimate SET names = '[\"EX0C\"]'", "an estimate that cannot be unpacked"),
}


def spoilt(folder: Path, change: str, value: Any = None) -> Path:
    file = folder / "history.db"
    file.write_bytes(good(folder))
    with sqlite3.connect(file) as plain:
        plain.execute(change, () if value is None else (value,))
    plain.close()
    return file


def read(history: History) -> None:
    for night in history.nights():
        history.night(night.entry)


@pytest.mark.few(1)
@pytest.mark.parametrize("what", CHANGES)
def test_a_changed_night_is_refused_and_named_by_verify(what: str, tmp_path: Path) -> None:
    change, said = CHANGES[what]
    with opened(spoilt(tmp_path, change), create=False) as history:
        with pytest.raises(InputError, match=said):
            read(history)
        try:
            assert history.verify()
        except TangoError as error:
            assert "tango history restore" in str(error)


SLIPPED = {
    "a hash of readings": ("UPDATE night_readings SET sha256 = 'f' || substr(sha256, 2)", "is not what was added"),
    "a number of touches": ("UPDATE night_readings SET rows = rows + 1", "is not what was added"),
    "a value for a trend": (
        "INSERT INTO night_parameter SELECT machine_id, 'EXX1', 999, start_utc, 5.0, std, unit FROM night_parameter LIMIT 1",
        "night_parameter 999 belongs to no entry",
    ),
    "readings": (
        "INSERT INTO night_readings SELECT 999, rows, sha256, csv FROM night_readings LIMIT 1",
        "night_readings 999 belongs to no",
    ),
    "a record": ("INSERT INTO night_record SELECT 999, json FROM night_record LIMIT 1", "night_record 999 belongs to no entry"),
    "an estimate": (
        "INSERT INTO night_estimate SELECT 999, names, numbers FROM night_estimate LIMIT 1",
        "night_estimate 999 belongs to no",
    ),
    "the name of the machine": ("DELETE FROM machine", "entries of a machine that is not there"),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("what", SLIPPED)
def test_what_was_slipped_in_or_hidden_shows(what: str, tmp_path: Path) -> None:
    change, said = SLIPPED[what]
    with opened(spoilt(tmp_path, "SELECT 1"), create=False) as history:
        assert history.verify() == ()
    with opened(spoilt(tmp_path, change), create=False) as history:
        assert any(said in text for text in history.verify())


@pytest.mark.long
def test_readings_that_unpack_to_gigabytes_are_not_unpacked(tmp_path: Path) -> None:
    packed = zlib.compress(bytes(100 << 20))
    with (
        opened(spoilt(tmp_path, "UPDATE night_readings SET csv = ?", packed), create=False) as history,
        pytest.raises(InputError, match="cannot be unpacked"),
    ):
        read(history)


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is of Linux")
def test_a_history_that_is_refused_is_closed(tmp_path: Path) -> None:
    file = spoilt(tmp_path, "UPDATE alembic_version SET version_num = '9999'")
    for _ in range(3):
        with pytest.raises(InputError, match="newer version"), opened(file, create=False):
            pass
    assert not [one for one in Path("/proc/self/fd").iterdir() if os.path.exists(one) and os.readlink(one).startswith(str(file))]


def test_a_backup_of_a_damaged_file_is_refused_and_nothing_is_left(tmp_path: Path) -> None:
    file = tmp_path / "history.db"
    data = bytearray(good(tmp_path))
    at = data.index(b"nothing has changed") // 4096 * 4096
    data[at : at + 4096] = bytes(4096)
    file.write_bytes(data)
    with opened(file, create=False) as history, pytest.raises(LinkError, match=r"malformed|not what was copied"):
        copied(history, tmp_path / "copy.db")
    assert not (tmp_path / "copy.db").exists() and file.exists()


def test_a_long_name_of_a_schema_is_cut_in_the_message(tmp_path: Path) -> None:
    file = spoilt(tmp_path, "UPDATE alembic_version SET version_num = ?", "[" * 3000)
    with pytest.raises(InputError, match="newer version") as refused, opened(file, create=False):
        pass
    assert len(str(refused.value)) < 300
