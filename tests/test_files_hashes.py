"""A hash is text, also one that looks like a number: some twenty of a commissioning are one in 300 each."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tango_cnc.files.commissioning import NAME, Proof, add_proofs, read_commissioning
from tango_cnc.files.write import dump
from tango_cnc.records import InputError

HASHES = ["2E9312264611", "1234E5678901", "123456789012", "0E0000000000", "00000000000E", "8C01F3A2B4D6"]


@pytest.mark.parametrize("text", HASHES)
def test_a_proof_is_read_as_it_was_written(text: str, tmp_path: Path) -> None:
    proof = Proof("alive", "PASS", "the finger stopped the slow move", 1.5, "mm", "2026-11-23T06:00:00Z", text, text, text)
    add_proofs(tmp_path, "mazak", [proof])
    add_proofs(tmp_path, "mazak", [proof])
    assert read_commissioning(tmp_path) == (proof, proof)


@pytest.mark.parametrize("text", HASHES)
def test_a_file_of_before_has_them_without_quotes(text: str, tmp_path: Path) -> None:
    add_proofs(tmp_path, "mazak", [Proof("alive", "PASS", "seen", program=text, profile=text)])
    file = tmp_path / NAME
    file.write_text(file.read_text().replace(f"'{text}'", text))
    assert [(proof.program, proof.profile) for proof in read_commissioning(tmp_path)] == [(text, text)]


def test_a_value_is_still_a_number(tmp_path: Path) -> None:
    add_proofs(tmp_path, "mazak", [Proof("alive", "PASS", "seen", 1.5)])
    file = tmp_path / NAME
    file.write_text(file.read_text().replace("1.5", "2E9312264611"))
    with pytest.raises(InputError, match=r"value: found '2E9312264611'; allowed: a finite number"):
        read_commissioning(tmp_path)


@pytest.mark.parametrize("text", [*HASHES, "1e5", "+.5", "1_000", "nan", "-inf", "12", "0x1F"])
def test_what_is_text_is_text_for_every_reader(text: str) -> None:
    assert yaml.safe_load(dump({"hash": text})) == {"hash": text}
    written = dump({"hash": text}).split(": ")[1].strip(" }\n")
    assert written in (f"'{text}'", text)
    if written == text:
        with pytest.raises(ValueError, match="could not convert"):
            float(text)
