"""What every protocol client must do, whatever its protocol; the conversations are the files of tests/transcripts/<protocol>/.

`->` the client sends exactly this, `<-` it receives this, `..` seconds pass, `!!` the line is gone, `^C` the user
wants an end, `=>` what it made of it. `~~` stands where the control speaks before the client has sent all of its program.
"""

import random
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.linkparts import job
from support.rows import behind, command, writing

from sim_controller.languages.macro_b import control as macro_b
from sim_controller.protocols import dnc as sim_dnc
from tango_cnc.link import _punched
from tango_cnc.link.address import SCHEMES, parse, spoken
from tango_cnc.link.client import Asked, Begun, Ended, Failed, Identified, Refused, Touched
from tango_cnc.link.heard import NAMES
from tango_cnc.link.measure import protocol_of
from tango_cnc.link.protocols import dnc, load, names, schemes
from tango_cnc.link.ways import ways
from tango_cnc.records import InputError

FLOW = {"DC1": 0x11, "DC2": 0x12, "DC3": 0x13, "DC4": 0x14}  # ISO/IEC 646 and ISO 6983: send, print, stop sending, end of print
TRANSCRIPTS = Path(__file__).parents[1] / "transcripts"
NEEDED = ("=> Touched", "=> Ended", "=> Failed", "!! closed", ".. ")  # what the pages of a protocol have to show together
WRITE = command("tests/contracts/test_links.py")
PROTOCOLS = names()
CONVERSATIONS = [(name, file) for name in PROTOCOLS for file in sorted((TRANSCRIPTS / name).glob("*.txt"))]

LINKS = Path(__file__).parents[2] / "docs" / "link.md"


def first_pages():
    """→ the pages that a new protocol begins with: of those of `file`, the shortest one with each mark that is needed."""
    pages = {file: file.read_text(encoding="utf-8") for file in sorted((TRANSCRIPTS / "file").glob("*.txt"))}
    return sorted({min((f for f in pages if mark in pages[f]), key=lambda f: len(pages[f])) for mark in NEEDED})


def draft(protocol, name, page):
    """protocol, name and text of a page of another one → a first page; what the client sends before anybody speaks is on top."""
    begins = client(protocol).bytes_to_send(1 << 20)
    title = f"# {name.replace('_', ' ')}: written from another protocol; make it what this control sends"
    kept = [line for line in page.splitlines()[1:] if line[:2] not in ("->", "=>")]
    return "\n".join([title, *([f"-> {escaped(begins)}"] if begins else []), *kept, ""])


every_protocol = pytest.mark.parametrize("protocol", PROTOCOLS)
every_conversation = pytest.mark.parametrize(("protocol", "file"), CONVERSATIONS, ids=[f"{p}-{f.stem}" for p, f in CONVERSATIONS])


def client(protocol, options=None):
    return load(protocol).Client(job(), options or {})


def lines(file):
    for line in file.read_text(encoding="utf-8").splitlines():
        yield line[:2], line[3:]


def options(file):
    words = [word for mark, text in lines(file) if mark == "# " or mark == "#" for word in text.split()]
    return dict(word.split("=") for word in words if "=" in word and not word.startswith("="))


def unescaped(text):
    return text.encode("ascii").decode("unicode_escape").encode("latin-1")


def shown(event):
    match event:
        case Identified(text):
            return f"Identified {text}"
        case Begun(mark, count):
            return f"Begun {mark} {count}"
        case Touched(number, flag, position, _):
            return f"Touched {number} {flag} {' '.join(str(value) for value in position.values())}"
        case Ended(count):
            return f"Ended {count}"
        case Refused(why, text):
            return f"Refused {why}: {text}"
        case Failed(why):
            return f"Failed {why}"
        case Asked(text):
            return f"Asked {text}"


def escaped(data):
    return data.decode("latin-1").encode("unicode_escape").decode("ascii")


def replay(protocol, file, pieces):
    """Plays a transcript; `pieces(data)` cuts what is received. → (events seen, what the transcript expects of them)

    All that the client has to send stands on the page, before the control speaks again and until the page ends.
    """
    one = client(protocol, options(file))
    events, expected, before = [], [], ""
    for mark, text in lines(file):
        if mark == "<-" and before != "~~":
            nothing_left(one, file, f" before\n<- {text}")
        if mark == "->":
            wanted, sent = unescaped(text), b""
            while len(sent) < len(wanted) and (piece := one.bytes_to_send(len(wanted) - len(sent))):
                sent += piece
            assert sent == wanted
        elif mark == "<-":
            for piece in pieces(unescaped(text)):
                events += one.receive(piece)
        elif mark == "..":
            events += one.elapsed(float(text))
        elif mark == "!!":
            events += one.closed()
        elif mark == "^C":
            one.stop()
        elif mark == "=>":
            expected.append(text)
        elif mark == "~~":
            assert one.sent[0] < one.sent[1], f"{file}: ~~ stands where the client has sent its whole program; take it away"
        else:
            assert mark in ("# ", "#"), f"{file}: {mark!r} is no mark of a transcript"
        before = mark
    nothing_left(one, file, "")
    return events, expected


def nothing_left(one, file, where):
    """Raises AssertionError when the client has something to send that its page lacks."""
    left = one.bytes_to_send(1 << 20)
    assert not left, f"{file}: the client sends what the page lacks: {WRITE} writes the line\n-> {escaped(left)}{where}"


def rewritten(protocol, file):
    """A transcript with what the client makes of it now: every line stays but those of `=>`, and a `->` that it lacks is added."""
    one = client(protocol, options(file))
    acts = {
        "<-": lambda text: one.receive(unescaped(text)),
        "..": lambda text: one.elapsed(float(text)),
        "!!": lambda _: one.closed(),
    }
    acts |= {"->": lambda text: one.bytes_to_send(len(unescaped(text))) and [], "^C": lambda _: [one.stop()][:0]}
    page = []

    def unsent():
        left = one.bytes_to_send(1 << 20)
        return [f"-> {escaped(left)}"] if left else []

    for line in file.read_text(encoding="utf-8").splitlines():
        if line[:2] == "<-" and not (page and page[-1].startswith("~~")):
            page += unsent()
        if line[:2] != "=>":
            page += [line, *(f"=> {shown(event)}" for event in acts.get(line[:2], lambda _: [])(line[3:]))]
    return "\n".join([*page, *unsent(), ""])


@every_protocol
def test_every_protocol_has_conversations_with_touches_silence_and_a_lost_line(protocol):
    folder = TRANSCRIPTS / protocol
    if writing() and not folder.is_dir():
        folder.mkdir()
        for page in first_pages():
            name = page.stem.replace("share_is_gone", "line_is_lost")  # no share is known to this protocol
            (folder / f"{name}.txt").write_text(draft(protocol, name, page.read_text(encoding="utf-8")), encoding="utf-8")
    files = sorted(folder.glob("*.txt"))
    for file in files if writing() else ():
        file.write_text(rewritten(protocol, file), encoding="utf-8")
    text = "".join(file.read_text(encoding="utf-8") for file in files)
    assert text, f"tests/transcripts/{protocol}/ is missing; this writes first pages, for you to correct: {WRITE} -k {protocol}"
    for mark in NEEDED:
        assert mark in text, (
            f"tests/transcripts/{protocol}/: no page has {mark!r}. Write what is sent (->), received (<-), waited (..), lost (!!); "
            f"{WRITE} -k {protocol} adds what the client makes of it (=>). Where the client speaks first, begin each page with "
            "what it sends (->) and what the control answers (<-)"
        )
    assert not client(protocol).sent[1] or any(mark == "->" for file in files for mark, _ in lines(file)), (
        f"tests/transcripts/{protocol}/: the client sends a program, and no page shows it (->). Write on a page what the control "
        f"says (<-) before it takes the program; {WRITE} -k {protocol} adds what the client then sends"
    )


def test_a_first_page_of_a_client_that_speaks_first_begins_with_what_it_sends():
    """Silence stood above the program that the client had sent before it."""
    page = "# gone\n.. 200.0\n=> Failed\n<- x\n"
    speaks, listens = (draft(name, "three_touches", page).splitlines() for name in ("grbl", "file"))
    assert speaks[0].startswith("# three touches: written from") and speaks[1].startswith("-> ")
    assert speaks[2:] == listens[1:] == [".. 200.0", "<- x"]


def page_of(tmp_path, *lines):
    page = tmp_path / "page.txt"
    page.write_text("\n".join(["# a page", *lines, ""]), encoding="utf-8")
    return page


def test_a_page_that_lacks_what_is_sent_before_the_control_speaks_is_refused_and_the_line_is_written(tmp_path):
    """The client is over at the end of this page and sends nothing more: only before the answer can the line be missed."""
    held = ("-> %\\nO0001 (TANGO", "<- \\x13", "!! closed", "=> Failed")
    page = page_of(tmp_path, *held)
    with pytest.raises(AssertionError, match=r"the client sends what the page lacks(.|\n)*before\s+<- "):
        replay("dnc", page, lambda data: [data])
    page.write_text(rewritten("dnc", page), encoding="utf-8")
    assert [text for mark, text in lines(page) if mark == "->"] == [held[0][3:], " 5AFE0001)\\nG31 X25. F180\\nM30\\n%\\n"]
    replay("dnc", page, lambda data: [data])


def test_a_control_may_speak_before_all_is_sent_where_the_page_says_so_and_only_there(tmp_path):
    first = "-> %\\nO0001 (TANGO"
    replay("dnc", page_of(tmp_path, first, "~~", "<- \\x13", "!! closed"), lambda data: [data])
    rest = "->  5AFE0001)\\nG31 X25. F180\\nM30\\n%\\n"
    with pytest.raises(AssertionError, match="~~ stands where the client has sent its whole program"):
        replay("dnc", page_of(tmp_path, first, rest, "~~", "<- \\x13", "!! closed"), lambda data: [data])


@pytest.mark.few(24)
@every_conversation
def test_the_conversation_means_what_its_page_says(protocol, file):
    if writing():
        file.write_text(rewritten(protocol, file), encoding="utf-8")
    events, expected = replay(protocol, file, lambda data: [data])
    assert len(events) == len(expected), (
        f"{file}: found {[shown(event) for event in events]}; if this is meant: {WRITE} -k {protocol}"
    )
    for event, text in zip(events, expected, strict=True):
        name, _, rest = text.partition(" ")
        assert shown(event).startswith(name + " ") and rest in shown(event), (
            f"{file}: found {shown(event)!r}; if this is meant: {WRITE} -k {protocol}"
        )


@pytest.mark.few(24)
@every_conversation
def test_writing_a_page_anew_changes_only_what_the_client_makes_of_it(protocol, file):
    page, anew = (text.splitlines() for text in (file.read_text(encoding="utf-8"), rewritten(protocol, file)))
    assert [line for line in anew if line[:2] != "=>"] == [line for line in page if line[:2] != "=>"]


@pytest.mark.few(24)
@every_conversation
def test_byte_by_byte_equals_all_at_once(protocol, file):
    whole, _ = replay(protocol, file, lambda data: [data])
    single, _ = replay(protocol, file, lambda data: [data[i : i + 1] for i in range(len(data))])
    assert single == whole


@pytest.mark.few(18)
@every_conversation
def test_any_cut_equals_all_at_once(protocol, file):
    whole, _ = replay(protocol, file, lambda data: [data])
    for seed in range(10):
        chance = random.Random(seed)

        def pieces(data, chance=chance):
            cuts = sorted(chance.sample(range(len(data) + 1), min(3, len(data))))
            return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]

        assert replay(protocol, file, pieces)[0] == whole


@pytest.mark.few(12)
@every_conversation
def test_leader_and_print_codes_are_no_characters_of_a_line(protocol, file):
    """Paper tape lives on: a control that prints puts NUL, DEL and codes around a line, and some do into files, too."""
    if not any(mark == "<-" and text.startswith("TANGO START") for mark, text in lines(file)) or protocol == "dnc":
        return  # no lines of text; to dnc these codes mean something, which its own pages say

    def taped(data):
        return [b"\0\x12" + line + b"\x14\x7f" for line in data.splitlines(keepends=True)]

    assert replay(protocol, file, taped)[0] == replay(protocol, file, lambda data: [data])[0]


@every_protocol
def test_two_messages_in_one_chunk(protocol):
    """All that the control says in a conversation of one go, delivered at once, is all events in order."""
    for name, file in CONVERSATIONS:
        if name != protocol or not any(mark == "=>" and text.startswith("Ended") for mark, text in lines(file)):
            continue
        one = client(protocol, options(file))
        first = next(i for i, (mark, _) in enumerate(lines(file)) if mark == "<-")
        received = [unescaped(text) for mark, text in list(lines(file))[first:] if mark == "<-"]
        one.bytes_to_send(1 << 20)
        if any(mark == "->" for mark, _ in list(lines(file))[first:]) and protocol != "dnc":
            continue  # a dialogue: the control answers what it was asked in between
        assert [shown(event) for event in one.receive(b"".join(received))] == replay_texts(protocol, file)


def replay_texts(protocol, file):
    return [shown(event) for event in replay(protocol, file, lambda data: [data])[0]]


@every_protocol
def test_garbage_is_never_a_touch(protocol):
    for seed in range(50):
        chance = random.Random(seed)
        one = client(protocol)
        one.bytes_to_send(1 << 20)
        events = [event for _ in range(20) for event in one.receive(chance.randbytes(100))]
        assert not any(isinstance(event, (Begun, Touched, Ended)) for event in events)


@every_protocol
def test_silence_ends_in_a_failure_that_is_said_once(protocol):
    one = client(protocol)
    one.bytes_to_send(1 << 20)
    events = [event for _ in range(2000) for event in one.elapsed(1.0)]
    assert [type(event) for event in events] == [Failed]
    assert one.bytes_to_send(1 << 20) == b""


@every_protocol
def test_a_closed_line_is_a_failure_that_is_said_once(protocol):
    one = client(protocol)
    assert [type(event) for event in [*one.closed(), *one.closed(), *one.elapsed(1e6)]] == [Failed]


@every_protocol
def test_no_time_is_no_silence(protocol):
    one = client(protocol)
    assert all(not one.elapsed(0.0) for _ in range(1000))


HEAD = "| `controller.port`, `--port` | is |"
PLACES_OF = {
    "host": "192.168.1.20:8193",
    "device": "/dev/ttyUSB0",
    "disk": "user@192.168.1.20/TANGO.TXT",
    "file": "/mnt/TANGO.TXT",
    "path": "/run/control",
}


def row(protocol, scheme):
    """protocol, scheme of its URLs → the row of the table of ports: an example, what it is, its settings with their values."""
    module = load(protocol)
    what = (module.__doc__ or "what it is").strip().partition("\n")[0].rstrip(".")
    values = [f"`{name}` ({', '.join(allowed) or 'any text'})" for name, allowed in module.OPTIONS.items()]
    way = ways()[module.SCHEMES[scheme]]
    example = way.example if way.example.startswith(f"{scheme}://") else f"{scheme}://{PLACES_OF[way.needs]}"
    return f"| `{example}` | {what}{'; settings: ' if values else ''}{', '.join(values)} |"


@every_protocol
def test_every_scheme_leads_to_its_protocol_alone_and_travels_some_way_there_is(protocol):
    module = load(protocol)
    assert set(module.SCHEMES.values()) <= set(ways()), (
        f"{protocol}.py: SCHEMES: allowed: {', '.join(ways())}. A new way is one file: tango_cnc/link/transport/_<way>.py "
        "with its WAYS (docs/link.md, Another protocol)"
    )
    for scheme in module.SCHEMES:
        page = LINKS.read_text(encoding="utf-8")
        if f"{scheme}://" not in page and writing():
            page = behind(page, HEAD, "://", row(protocol, scheme))
            LINKS.write_text(page, encoding="utf-8")
        assert f"{scheme}://" in page, (
            f"docs/link.md, Ports: the table lacks this row; {WRITE} -k {protocol} adds it, for you to correct:\n"
            f"{row(protocol, scheme)}"
        )
    assert not set(module.SCHEMES) & set(SCHEMES), f"{protocol}.py: SCHEMES names one that every protocol may have"
    assert {spoken(f"{scheme.upper()}://somewhere") for scheme in module.SCHEMES} <= {protocol}
    assert sum(name == protocol for name, _ in schemes().values()) == len(module.SCHEMES), f"{protocol}.py shares a scheme"


def test_a_protocol_with_a_scheme_is_one_file(monkeypatch):
    """A file of the folder is enough: its scheme is known, its URL is taken apart, and its setting reaches the client."""
    monkeypatch.setattr("tango_cnc.link.address.schemes", lambda: {"toy": ("toy", "socket")})
    assert spoken("toy://192.168.1.20:8193") == "toy"
    address = parse("toy://192.168.1.20:8193?pace=slow", {"pace": ("fast", "slow")})
    assert (address.scheme, address.target, address.options) == ("socket", "192.168.1.20:8193", {"pace": "slow"})


@every_protocol
def test_every_setting_of_a_port_is_documented(protocol):
    page = LINKS.read_text(encoding="utf-8")
    missing = [key for key in load(protocol).OPTIONS if f"`{key}`" not in page and f"{key}=" not in page]
    assert not missing, f"docs/link.md: say what the settings {', '.join(missing)} of the protocol {protocol} mean, each as `key`"


def test_every_way_is_opened_by_a_test():
    tests = {file: file.read_text(encoding="utf-8") for file in TRANSCRIPTS.parent.glob("test_link*.py")}
    schemes_of = {way: [scheme for scheme, (_, by) in schemes().items() if by == way] for way in ways()}
    for way, names_ in schemes_of.items():
        spelled = [f"{name}://" for name in (way, *names_)]
        assert any(word in text for text in tests.values() for word in spelled), (
            f"tango_cnc/link/transport/: no test opens {' or '.join(spelled)}: write tests/test_link_{way}.py, with a control that "
            "answers, is silent, closes and is not there"
        )


@every_protocol
def test_what_only_some_clients_can_do_has_an_answer_in_all(protocol):
    one, made = client(protocol), load(protocol).Client
    assert isinstance(one.brought, bool) and isinstance(one.drives, bool) and isinstance(made.punches, bool)
    assert isinstance(one.before, str) and isinstance(one.advice, str)
    told = made.told(b"", {})
    assert isinstance(made.hello({}), bytes) and (told is None or not told[0]), "silence is no control that can be worked with"
    assert one.stop() in (True, False)


def test_the_characters_of_the_line_mean_the_same_on_both_ends():
    """Product and simulator write them down separately; each place that knows one knows it as the standard does."""
    for end in (dnc, sim_dnc, macro_b):
        known = {name: vars(end)[name] for name in FLOW if name in vars(end)}
        assert len(known) >= 2, end.__name__
        for name, value in known.items():
            assert (value if isinstance(value, int) else value[0]) == FLOW[name], f"{end.__name__}.{name}"
    assert {code: text.split()[0] for code, text in NAMES.items()} == {code: name for name, code in FLOW.items()}
    assert set(FLOW.values()) <= set(_punched.CODES), "a tape is punched with the codes of the line in it"


@pytest.mark.parametrize("scheme", sorted(schemes()))
def test_a_scheme_and_a_setting_that_name_two_protocols_are_refused(scheme):
    own, _ = schemes()[scheme]
    other = next(name for name in PROTOCOLS if name != own)
    with pytest.raises(InputError, match=f"link: found '{other}'; allowed: {own}, which"):
        protocol_of(f"{scheme}://there:1?link={other}", other)


@pytest.mark.parametrize("scheme", sorted({*schemes(), *SCHEMES}))
def test_a_port_without_a_place_gets_an_example_of_its_own_scheme(scheme):
    with pytest.raises(InputError) as error:
        parse(f"{scheme}://", {})
    assert f"e.g. {scheme}://" in str(error.value), "tango_cnc/link/address.py: its example is of another scheme"
