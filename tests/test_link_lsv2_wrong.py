"""What is wrong with a port of LSV2 is wrong input: exit status 2, nothing is put at the control, no file of the cell changes."""

import socket

import pytest
from support.lsv2 import Control, serving
from support.lsv2_person import Person
from support.profiles import spoken
from support.runs import STRATEGY, Result

from tango_cnc.commands.init import write_example
from tango_cnc.link.protocols import lsv2, remote
from tango_cnc.link.transport import open_port, parse
from tango_cnc.records import InputError

OTHERS = b"my measurements of last year\r\n"
PLACES = [  # behind host and port, what the control has, what is said
    ("/TNC:/NONE/TANGO.TXT?program=TNC:/", {}, "there is no folder /TNC:/NONE at the control; no program can write its records"),
    ("/XYZ:/TANGO.TXT?program=TNC:/", {}, "there is no folder /XYZ: at the control"),
    ("/TNC:/TANGO?program=TNC:/", {}, "/TNC:/TANGO is a folder at the control; allowed: the file of the records"),
    ("/TNC:/TANGO.TXT?program=TNC:/NONE/", {}, "program: there is no folder /TNC:/NONE at the control"),
    ("/TNC:/TANGO.TXT?program=TNC:/NONE/X.H", {}, "program: there is no folder /TNC:/NONE at the control"),
    ("/TNC:/TANGO.TXT?program=TNC:/TANGO", {}, "/TNC:/TANGO is a folder at the control; allowed: program= a file, or a folder"),
    ("/TNC:/TANGO.TXT?program=TNC:/", {"files": {"TNC:\\TANGO.TXT": OTHERS}}, "without a record of a TANGO program"),
    ("/TNC:/TANGO.TXT?program=TNC:/", {"users": {"INSPECT": "x"}}, "state password=env:NAME"),
    ("/TNC:/TANGO.TXT?program=TNC:/&password=env:CELL_WORD", {"users": {"FILE": "x"}}, "(login FILE) with this password"),
    ("/TNC:/TANGO.TXT?program=TNC:/", {"logins": ("INSPECT",)}, "does not let this computer in (login FILE)"),
]
URLS = [  # that say by themselves that no control can mean them
    ("/TANGO.TXT", "path: found '/TANGO.TXT'; allowed: drive, folders, file"),
    ("/TNC:TANGO.TXT", "path: found '/TNC:TANGO.TXT'; allowed: drive"),
    ("/TNC:", "path: found '/TNC:'; allowed: drive"),
    ("/TNC:/%E4%B8%AD.TXT", "path: found '/TNC:/中.TXT'; allowed: drive, folders, file, in Western letters"),
    ("/TNC:/A%00B.TXT", r"path: found '/TNC:/A\x00B.TXT'"),
    ("/TNC:/A%0AB.TXT", r"path: found '/TNC:/A\nB.TXT'"),
    ("/TNC:/A%2AB.TXT", "path: found '/TNC:/A*B.TXT'"),
    ("/TNC:/" + "A" * 241 + ".TXT", "at most 244 characters"),
    ("/TNC:/TANGO.TXT?program=PART.H", "program: found 'PART.H'; allowed: drive"),
    ("/TNC:/TANGO.TXT?program=/", "program: found '/'; allowed: drive"),
    ("/TNC:/TANGO.TXT?program=TNC:/%E4%B8%AD.H", "program: found 'TNC:/中.H'"),
    ("/TNC:/TANGO.TXT?program=", "program: found nothing; allowed: a value, or leave program= out"),
    ("/TNC:/TANGO.TXT?password=", "password: found nothing"),
    ("/TNC:/TANGO.TXT#2", "found #; allowed: %23"),
]


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr("tango_cnc.link.transport._lsv2.BETWEEN", 0.01)
    monkeypatch.setenv("CELL_WORD", "geheim")


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """None of the tests may change it."""
    folder = tmp_path_factory.mktemp("wrong") / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "tango.yaml").write_text(spoken((folder / "tango.yaml").read_text(), "post: heidenhain"))
    assert Result("plan", "-C", folder).code == 0
    return folder


def standing(cell):
    return {file: file.read_bytes() for file in cell.rglob("*") if file.is_file()}


def port_of(number, rest):
    return f"lsv2://127.0.0.1:{number}{rest}"


@pytest.mark.few(2)
@pytest.mark.parametrize("command", [("run", "--yes"), ("link-test",)], ids=["run", "link-test"])
@pytest.mark.parametrize(("rest", "there", "why"), PLACES)
def test_what_the_control_says_is_wrong_ends_with_2_and_changes_nothing(cell, command, rest, there, why):
    """Some of them went on to the touch that was due, with the program at the control and a journal in the cell."""
    control = Control(**there)
    before, files = standing(cell), dict(control.files)
    with serving(control) as number:
        name, *more = command
        result = Result(name, "-C", cell, "--port", port_of(number, rest), *more)
    assert result.code == 2 and why in result.err, result.err
    assert standing(cell) == before and control.files == files and control.acted() == []
    assert "geheim" not in result.err


@pytest.mark.parametrize(("rest", "why"), URLS)
def test_a_place_that_no_control_has_is_refused_before_anybody_is_asked(rest, why):
    with pytest.raises(InputError) as error:
        open_port(parse(port_of(1, rest), lsv2.OPTIONS), rests=True)
    assert why in str(error.value)


@pytest.mark.parametrize(
    "rest", ["/TNC:/TANGO.TXT", "/TNC:%5CTANGO.TXT?program=TNC:%5C", "/tnc:/%C3%9C%20(1).TXT?program=TNC:/TANGO/"]
)
def test_places_that_a_control_has_are_taken(rest):
    with serving(Control()) as number:
        open_port(parse(port_of(number, rest), lsv2.OPTIONS), rests=True).close()


def test_a_user_is_refused_where_nobody_asks_for_one():
    """LSV2 has no users, and the name was left out without a word."""
    with pytest.raises(InputError, match="found a user; allowed: none"):
        open_port(parse("lsv2://anna@127.0.0.1:1/TNC:/TANGO.TXT", lsv2.OPTIONS))


@pytest.mark.parametrize("scheme", ["ftp", "sftp", "smb"])
def test_a_sharp_in_a_path_is_refused_and_not_cut_off(scheme):
    """The records of S/A#1.TXT were waited for in S/A."""
    with pytest.raises(InputError, match="found #; allowed: %23"):
        parse(f"{scheme}://anna@192.168.1.20/S/A#1.TXT", remote.OPTIONS)
    assert parse(f"{scheme}://anna@192.168.1.20/S/A%231.TXT", remote.OPTIONS)


@pytest.mark.few(0)
def test_a_login_that_is_refused_to_a_resumed_run_is_wrong_input_too(cell, tmp_path, monkeypatch):
    """It asks somebody first, so that the journal has it; the readings stay what they were."""
    control = Control()
    folder = tmp_path / "cell"
    folder.mkdir()
    for file in cell.glob("*.yaml"):
        (folder / file.name).write_bytes(file.read_bytes())
    with serving(control) as number:
        url = port_of(number, "/TNC:/TANGO.TXT?program=TNC:/")
        assert Result("run", "-C", folder, "--yes", "--port", url).code == 3  # nobody is there to press Enter
        control.users, person = {"FILE": "x"}, Person(control, folder)
        monkeypatch.setattr("tango_cnc.link.transport._lsv2.Person", lambda: person)
        person._ran.set()
        result = Result("run", "-C", folder, "--yes", "--resume", "--port", url)
    assert result.code == 2 and "does not let this computer in (login FILE)" in result.err, result.err


def test_nobody_there_is_no_wrong_input(cell):
    """The same command may work once the control is switched on."""
    result = Result("link-test", "-C", cell, "--port", port_of(1, "/TNC:/TANGO.TXT"))
    assert result.code == 3 and "does not open: Connection refused. Is the controller or converter switched on" in result.err


@pytest.mark.skipif(not socket.has_ipv6, reason="this computer has no IPv6")
def test_an_address_of_ipv6_is_one(cell):
    """pyLSV2 knows IPv4 alone: the address family was not supported."""
    result = Result("link-test", "-C", cell, "--port", "lsv2://[::1]:1/TNC:/TANGO.TXT")
    assert result.code == 3 and "family" not in result.err.lower(), result.err
