"""Files that nobody has written are read or refused in a sentence: no traceback, no hang, no number that is none.

make campaign-readers                                               10^5 of each kind of file: two hours of computing
make campaign-readers READER=machine.yaml N=20000 SEED=1000000      some of one kind; a finding says its seed
"""

from __future__ import annotations

import json
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.histories import record
from support.mutants import campaign
from support.nights_parts import machine_of, settings_of
from support.readers import READERS, TEXTS, cell
from support.shopfiles import marked, touched

import postprocessors as posts
from tango_cnc import files
from tango_cnc.asked import as_run, asked
from tango_cnc.files import checked
from tango_cnc.files.readjson import parse_json
from tango_cnc.history import opened
from tango_cnc.link.lock import NAME, holding
from tango_cnc.link.process import alive
from tango_cnc.nc import blocks
from tango_cnc.nearest import printable
from tango_cnc.plan import plan_hash
from tango_cnc.readback.expressions import expression
from tango_cnc.records import InputError, LinkError
from tango_cnc.report import morning

FEW = 8
# What is spoilt there is no value, no origin, no trust, no goal of a run, no holder; a message is sent as it is.
SILENT = (
    "records",
    "nightly.yaml-after-a-mistake",
    "message",
    "readings.origin.json",
    "trusted-posts.txt",
    "readings.json-of-a-run",
    "lock",
    "night-begun",
    "night-message",
    "known_hosts",
    "planned.json",
    "journal-tail",
    "origin-of-a-night",
)
FEW_OF = [  # what takes longest is for the long tests
    pytest.param(kind, marks=pytest.mark.long) if kind.startswith(("taken-", "backup", "form")) else kind for kind in READERS
]
MANY = int(os.environ.get("TANGO_MUTANTS", "100000"))
FIRST = int(os.environ.get("TANGO_SEED") or "1000000")


MEMORY = Path("/dev/shm")  # a folder of this name is in memory: writing a file takes longer than reading most of them


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """→ an empty folder in memory where the computer has such, with the files that a reader makes for a while."""
    if not (MEMORY.is_dir() and os.access(MEMORY, os.W_OK)):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir=MEMORY) as folder:
        monkeypatch.setattr(tempfile, "tempdir", folder)
        yield Path(folder)


@pytest.mark.few(2)
@pytest.mark.untrusted
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", FEW_OF)
def test_a_few_spoilt_files(kind: str, tmp_path: Path) -> None:
    cell(tmp_path)
    assert campaign(READERS[kind], tmp_path, range(FEW)).wrong == {}


@pytest.mark.campaign
@pytest.mark.untrusted
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", READERS)
def test_many_spoilt_files(kind: str, place: Path) -> None:
    cell(place)
    came = campaign(READERS[kind], place, range(FIRST, FIRST + MANY))
    print(
        f"\n{kind}, seeds {FIRST} to {FIRST + MANY - 1}: {came.files} files, {came.refused} refused, {len(came.wrong)} wrong, "
        f"{came.seconds:.0f} s"
    )
    assert came.wrong == {}
    assert came.refused > 0 or kind in SILENT, "a reader that takes everything does not read this file"


def kinds_of_lines(program: str) -> set[str]:
    """program → its lines without numbers, signs, marks, letters of axes and how many there are: what a reader distinguishes."""
    found = set()
    for line in program.splitlines():
        kind = re.sub(r"[0-9A-F]{12}", "MARK", line.replace("FACET TOP", "FACET 1"))
        kind = re.sub(r"#?(?:\d+\.?\d*|\.\d+)", "#", re.sub(r"[][() ]+", " ", kind))
        kind = re.sub(r"(?:[-+] ?)*#(?: ?[-+]? ?#)*", "#", kind)
        kind = re.sub(r"(?<![A-Z])[XYZBC](?![A-Z])|(?<=VAPA)[XYZBC]", "A", kind)
        found.add(re.sub(r"(?<!\S)(\S+(?: \S+)*?)(?: \1)+(?!\S)", r"\1", kind))
    return found


@pytest.mark.long
@pytest.mark.parametrize("post", posts.names())
def test_the_program_that_is_spoilt_has_every_kind_of_line_of_a_longer_one(post: str, tmp_path: Path) -> None:
    cell(tmp_path)
    short, longer = (touched(tmp_path, which)[1] for which in (slice(-1, None), slice(None)))
    one, other = ("\n".join(posts.program(posts.load(post), made, {}, plan_hash(made))[2]()) for made in (short, longer))
    assert len(one) < len(other) and kinds_of_lines(other) - kinds_of_lines(one) == set()


@pytest.mark.parametrize("name", ["m" * 300 + ".yaml", "x/" * 3000, "a\\0b"], ids=["long", "deep", "with a NUL"])
@pytest.mark.parametrize("key", ["machine", "artefact", "strategy"])
def test_a_name_that_no_file_can_have_is_said_with_its_line(tmp_path: Path, key: str, name: str) -> None:
    cell(tmp_path)
    (tmp_path / "tango.yaml").write_text(TEXTS["tango.yaml"].replace(f"{key}.yaml", f'"{name}"'))
    with pytest.raises(InputError, match=rf"tango.yaml:\d: {key}: found .*; allowed: a name that a file can have"):
        files.read_cell(tmp_path)


@pytest.mark.parametrize(
    "text", ["[NaN]", "[Infinity]", "[1e999]", "[-1e999]", '["\\ud800"]', "[" * 3000, "9" * 5000], ids=lambda text: text[:9]
)
def test_json_without_finite_numbers_and_whole_characters_is_none(text: str) -> None:
    with pytest.raises(ValueError):
        parse_json(text)
    assert parse_json(json.dumps(["😀", 1e308])) == ["😀", 1e308]


def test_a_message_shows_the_beginning_and_the_end_of_what_is_too_long() -> None:
    shown = printable("found " + "x" * 5000 + "; correct it", 100)
    assert len(shown) < 120 and shown.startswith("found x") and shown.endswith("; correct it")
    assert printable("\ud800") == "\\ud800"


def test_a_certificate_says_no_length_that_nothing_has(tmp_path: Path) -> None:
    cell(tmp_path)
    for length in ("9" * 5000, "1000000000"):
        (tmp_path / "acceptance.yaml").write_text(TEXTS["acceptance.yaml"].replace("304.6686", length), encoding="utf-8")
        with pytest.raises(InputError, match=r"value: .*at most .* mm"):
            READERS["acceptance.yaml"].read(tmp_path)


@pytest.mark.parametrize("datum", ["null", "5", "A", "{A: C}"])
def test_a_datum_that_is_no_list_is_refused_with_its_line(tmp_path: Path, datum: str) -> None:
    cell(tmp_path)
    text = TEXTS["features.yaml"].replace("datum: [A, C, D]", f"datum: {datum}")
    (tmp_path / "features.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"features.yaml:6: checks\[2\].datum: found"):
        READERS["features.yaml"].read(tmp_path)


def test_a_setting_of_a_port_is_shown_as_far_as_anybody_reads(tmp_path: Path) -> None:
    (tmp_path / "ports.txt").write_text(f"serial:///dev/ttyUSB0?{'[' * 1500}=1")
    with pytest.raises(InputError, match="unknown setting") as refused:
        READERS["ports"].read(tmp_path)
    assert len(str(refused.value)) < 2000


@pytest.mark.parametrize("value", ["9" * 5000, f"'{'A' * 5000}'", f"{{a: {'9' * 3000}}}"])
@pytest.mark.parametrize("key", ["program_number", "probe_on", "must_be_off"])
def test_a_key_of_a_post_is_shown_as_far_as_anybody_reads(tmp_path: Path, key: str, value: str) -> None:
    cell(tmp_path)
    (tmp_path / "tango.yaml").write_text(TEXTS["tango.yaml"].replace("program_number: 8700", f"{key}: {value}"))
    with pytest.raises(InputError, match=rf"controller.{key}") as refused:
        READERS["profile"].read(tmp_path)
    assert len(str(refused.value)) < 1000


def test_a_shops_template_reaches_nothing_beyond_its_page(tmp_path: Path) -> None:
    shop = tmp_path / "shop"
    shop.mkdir()
    for text, said in {
        "{{ ''.__class__.__mro__[1].__subclasses__() }}": "unsafe",
        "{% for i in range(10 ** 9) %}{% endfor %}": "too big|range",
        "{% include 'morning.html' %}": "recursion",
        "{{ 1 / 0 }}": "ZeroDivisionError",
        "{{ t('nothing') }}": "KeyError",
    }.items():
        (shop / "morning.html").write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=rf"(?i)morning.html.*({said})"):
            morning.render(record(1), folder=shop)
    (shop / "morning.html").write_bytes(b"\xff")
    with pytest.raises(InputError, match="UTF-8"):
        morning.render(record(1), folder=shop)


@pytest.mark.parametrize("text", ["[" * 1900, '{"what": "x", "pid": "1"}', "[]", "\0"])
def test_a_lock_whose_text_names_nobody_holds_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / NAME).write_text(text, encoding="utf-8")
    with holding(tmp_path, "tango run"):
        assert "tango run" in (tmp_path / NAME).read_text(encoding="utf-8")


@pytest.mark.parametrize("position", [{"B": None}, {"B": {}}, {"B": "1"}, {"B": 10**400}, []])
def test_a_goal_with_a_position_that_is_none_is_left_out(tmp_path: Path, position: Any) -> None:
    cell(tmp_path)
    one = files.read_cell(tmp_path)
    run = {"until": {"strategy": [{"position": position, "facets": ["1"]}]}}
    assert as_run(one, run) is one and len(asked(one, run))


def test_an_expression_deeper_than_any_control_takes_is_refused() -> None:
    for text in ("[" * 3000, "-" * 3000 + "1", "1" + "+1" * 400, "#[" * 50 + "1" + "]" * 50):
        with pytest.raises(ValueError, match="no control takes"):
            expression(text)
    assert expression("[" * 40 + "#1" + "]" * 40)(lambda name: 2.0) == 2.0


def test_a_history_of_long_names_lists_them_as_far_as_anybody_reads(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(1, "M" * 3000))
        with pytest.raises(InputError, match="no machine") as refused:
            history.trend("another", "EX0C")
    assert len(str(refused.value)) < 1500


def test_a_holder_whose_name_no_terminal_can_show_is_named_all_the_same(tmp_path: Path) -> None:
    other = {"what": "\ud800" * 200, "pid": 9**99, "host": "~", "since": "?", "process": "0a", "thread": 7}
    (tmp_path / NAME).write_text(json.dumps(other), encoding="utf-8")
    with pytest.raises(LinkError, match="is at work in this folder") as refused, holding(tmp_path, "tango run"):
        pass
    assert str(refused.value).encode() and len(str(refused.value)) < 1000 + len(str(tmp_path))
    assert not alive(9**99)


def test_a_block_of_brackets_is_refused_at_once(tmp_path: Path) -> None:
    cell(tmp_path)
    (tmp_path / "part.nc").write_text("%\n" + '({"a":' * 3000 + "\n%\n")
    with pytest.raises(InputError, match="a block of 18000 characters"):
        READERS["part.nc"].read(tmp_path)


def test_a_line_longer_than_any_control_reads_is_refused_by_its_number(tmp_path: Path) -> None:
    cell(tmp_path)
    reader = READERS["program-siemens"]
    text = reader.text(tmp_path).decode()
    at = text.index("\n", text.index("G1"))
    (tmp_path / reader.name).write_bytes(marked(text[:at] + "9" * 5000 + text[at:]))
    with pytest.raises(InputError, match=r"line \d+ has 5[01]\d\d characters; allowed: at most 1000"):
        reader.read(tmp_path)


@pytest.mark.parametrize("slip", [r"\1A=", "\\1A\x0b", "\\1A\xa0"], ids=["two signs", "another white space", "one beyond ASCII"])
def test_an_argument_with_two_signs_of_equality_or_a_gap_is_no_line_of_okuma(tmp_path: Path, slip: str) -> None:
    cell(tmp_path)
    reader = READERS["program-okuma"]
    text = reader.text(tmp_path).decode()
    (tmp_path / reader.name).write_bytes(marked(re.sub(r"(CALL O\w+ P[A-Z]=)", slip, text, count=1)))
    with pytest.raises(InputError, match=r"program line \d+ 'CALL"):
        reader.read(tmp_path)


def test_a_record_without_a_text_is_an_alarm_of_the_simulated_siemens(tmp_path: Path) -> None:
    cell(tmp_path)
    reader = READERS["taken-siemens"]
    text = reader.text(tmp_path).decode()
    (tmp_path / reader.name).write_text(re.sub(r'(WRITE\(TG_ERROR,"/dev/ext/1"),.*(?=\))', r"\1", text, count=1))
    with pytest.raises(InputError, match=r"12090|WRITE"):
        reader.read(tmp_path)


@pytest.mark.parametrize("axis", ["X0", "Q", "XY", ""])
def test_the_position_of_an_axis_that_is_none_has_no_value_for_okuma(tmp_path: Path, axis: str) -> None:
    cell(tmp_path)
    reader = READERS["program-okuma"]
    text = reader.text(tmp_path).decode()
    (tmp_path / reader.name).write_bytes(marked(text.replace("X=VAPAX-", f"X=VAPA{axis}-", 1)))
    with pytest.raises(InputError, match=r"program line \d+ 'G1 X=VAPA"):
        reader.read(tmp_path)


@pytest.mark.parametrize("line", ["2 L X+\x0b40", "2 L Z+50 F" + "9" * 400, "1 TOOL CALL " + "9" * 5000 + " Z", "M" + "9" * 5000])
def test_a_number_that_no_control_takes_is_refused_in_klartext(line: str) -> None:
    with pytest.raises(InputError, match=r"line 7: found .*no (number that a control takes|control reads|machine goes there)"):
        blocks.language("klartext").read(line, 7, blocks.Modal(), "XYZ")


@pytest.mark.parametrize("language", ["macro_b", "rs274", "siemens"])
def test_an_infinite_number_is_refused_in_words_of_letters(language: str) -> None:
    for word in ("M", "T", "F", "S", "N", "G"):
        with pytest.raises(InputError, match="no number that a control takes"):
            blocks.language(language).read(word + "9" * 400, 7, blocks.Modal(), "XYZ")


def test_a_table_of_more_points_than_a_control_holds_is_refused_before_it_is_made(tmp_path: Path) -> None:
    reader = READERS["control-siemens"]
    text = reader.text(tmp_path).decode()
    for step in ("1e-320", "1e-9"):
        (tmp_path / reader.name).write_text(re.sub(r"(AN_CEC_STEP\[\d+\]=)\S+", rf"\g<1>{step}", text))
        with pytest.raises(InputError, match="above 5000 points"):
            reader.read(tmp_path)


def test_a_file_that_was_changed_is_parsed_anew(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    for text in ("a: 1\n", "a: 2\n", "a: [017, +3, 0x1F]\n"):
        file.write_text(text)
        assert checked.load(file).plain() == yaml.safe_load(text)


def test_a_long_name_of_a_file_is_shown_as_far_as_anybody_reads(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no such file|cannot be read") as refused:
        files.read_machine(Path("m/" * 1800, "machine.yaml"))
    assert len(str(refused.value)) < 1500


UNCLOSED = '"' + "x" * 150_000
WIDE = "1,2,3," + "9" * 150_000


LINES = [UNCLOSED, WIDE, '"' * 1_000_001, "x" * 10**6, '{"a":' * 50_000]


@pytest.mark.few(8)
@pytest.mark.parametrize("text", LINES, ids=["quote", "wide", "quotes", "long", "json"])
@pytest.mark.parametrize("kind", ["readings.csv", "plan.csv", "table.csv", "cmm.csv", "ballbar.csv"])
def test_a_value_that_no_program_would_write_is_refused_with_its_line(tmp_path: Path, kind: str, text: str) -> None:
    """Its quote was never closed: Python's reader of tables has an error of its own for it."""
    cell(tmp_path)
    reader = READERS[kind]
    head = reader.text(tmp_path).decode().splitlines()[0]
    for whole in (text, f"{head}\n{text}\n"):
        (tmp_path / reader.name).write_text(whole, encoding="utf-8")
        with pytest.raises(InputError) as refused:
            reader.read(tmp_path)
        assert len(str(refused.value)) < 2500


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices of POSIX")
@pytest.mark.parametrize("what", ["pipe", "/dev/zero"])
def test_settings_of_nights_that_are_no_file_are_refused_at_once(tmp_path: Path, what: str) -> None:
    """Who is to be told of the mistake was looked for in it: a night waited for ever, or took all memory."""
    cell(tmp_path)
    for name in ("nightly.yaml", "machine.yaml"):
        (tmp_path / name).unlink(missing_ok=True)
        os.mkfifo(tmp_path / name) if what == "pipe" else (tmp_path / name).symlink_to(what)
    settings, wrong = settings_of(tmp_path)
    assert settings.notify == () and "a device or a pipe" in str(wrong)
    assert machine_of(tmp_path, ()) == tmp_path.resolve().name
