"""The pages of the controls: the example of tango.yaml is one that the post, the read-back and the port accept."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import pytest
import yaml
from support.controls import golden
from support.dialects import EVERY
from support.rows import command, writing

from postprocessors import companions, load, program, settings
from tango_cnc import readback
from tango_cnc.commission import experiments
from tango_cnc.link.protocols import schemes
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError

PAGES = Path(__file__).parent.parent / "docs" / "controls"


WRITE = command("tests/test_controls_pages.py")


DOUBT = "doubt"


def matter(doubt: str) -> str:
    """doubt of a post → what a first page calls it: by the experiments that prove it."""
    found = [f"`{experiment.belief}`" for experiment in experiments() if experiment.settles.search(doubt)]
    return f"{DOUBT} that {', '.join(found)} settles" if found else DOUBT


def draft(name: str) -> str:
    """dialect → a first page: what its post doubts, an example of the profile, the way to the first reading as on the others."""
    post = load(name)
    before, _, last = (PAGES / "brother.md").read_text(encoding="utf-8").partition("## To the first reading")
    first, title = before.partition("## In the cabinet")[0], f"# {post.title}: from the cabinet to the first reading"
    rows = [f"| {matter(doubt)} | {doubt} | unconfirmed |" for doubt in post.doubts or ("nothing yet",)]
    asks = any(option.must and option.name == "probe_state" for option in post.options)
    looking = "`probe_state`: which variable shows the probe; push the stylus aside and watch the page of the variables"
    input_ = example_input(name) if asks else ""
    travels = "The program: say\n   how it comes to the control, and start it there. Records: say how they leave it."
    return "\n".join(
        [
            title,
            "",
            *first.rstrip().split("\n")[2:],
            "",
            "## In the cabinet",
            "",
            "Not looked up yet. Write which input the probe is wired to, and the line to the control.",
            "",
            "## What is known",
            "",
            "| matter | fact | source |",
            "|---|---|---|",
            *rows,
            *([f"| probe variable | {looking} | unconfirmed |"] if asks else []),
            "",
            "## In tango.yaml",
            "",
            "An example. Leave out what you have not looked up: what is not stated stays on the list.",
            "",
            "    controller:",
            f"      post: {name}",
            "      port: socket://192.168.1.20:4001",
            *([f"      probe_state: {input_}  # example: the variable of your probe input, or the word none"] if asks else []),
            "",
            *([failed(name), ""] if post.remedies else []),
            "## To the first reading" + re.sub(r"(?s)The program: .*?(?=\n6\.)", travels, last),
        ]
    )


def example_input(name: str) -> str:
    """dialect → an input of a probe that its post takes: as in the help of its option, or as a relative's page has it.

    Fails where neither gives one: tests/test_probe_state.py accepts no page that states `probe_state: none`.
    """
    post, made = load(name), golden()
    meant = next(option.meaning for option in post.options if option.name == "probe_state")
    pages = [(file.stem, file.read_text(encoding="utf-8")) for file in sorted(PAGES.glob("*.md")) if file.stem in EVERY]
    pages.sort(key=lambda page: load(page[0]).language != post.language)  # those of the same language first
    examples = [found[1] for _, text in pages if (found := re.search(r"(?m)^      probe_state: (\S+)", text))]
    for text in [*examples, *re.findall(r"e\.g\. ([^\s,;]+)", meant)]:
        try:
            stated = {"probe_state": yaml.safe_load(text)}
            settings(post, stated)
            list(program(post, made, stated, plan_hash(made))[2]())
        except InputError:
            continue
        if stated["probe_state"] != "none":
            return text
    raise AssertionError(f"postprocessors/{name}.py: probe_state: name an input in its help, as in 'e.g. 1004': found {meant!r}")


def page(name: str) -> str:
    """dialect → the text of its page. Where a page is missing, the failure prints the command that writes a first one."""
    file = PAGES / f"{name}.md"
    if not file.is_file() and writing():
        file.write_text(draft(name), encoding="utf-8")
    assert file.is_file(), f"docs/controls/{name}.md is missing; this writes a first one, for you to correct: {WRITE} -k {name}"
    return file.read_text(encoding="utf-8")


def stated(name: str) -> dict[str, object]:
    """dialect → what its page states under controller:."""
    text = page(name)
    block = re.search(r"(?m)^    controller:\n(?:      .*\n)+", text)
    assert block, f"docs/controls/{name}.md: found no example of tango.yaml"
    found: dict[str, object] = yaml.safe_load(block[0].replace("\n    ", "\n").removeprefix("    "))["controller"]
    return found


@pytest.mark.few(3)
@pytest.mark.parametrize("name", sorted(EVERY))
def test_the_example_of_a_page_is_accepted(name: str) -> None:
    given = stated(name)
    port = str(given.pop("port"))
    assert given.pop("post") == name
    assert port.partition("://")[0] in {"serial", "socket", *schemes()}
    post, made = load(name), golden()
    lines = program(post, made, given, plan_hash(made))[2]
    options = settings(post, given)
    assert not readback.check(lines, made, options, companions(post, made, given), written_in=post.language)


def test_every_dialect_has_its_page_and_every_row_its_source() -> None:
    for name in EVERY:
        rows = re.findall(r"(?m)^\| (.*) \|$", page(name))
        assert rows and all(len(re.split(r" \| ", row)) == 3 and re.split(r" \| ", row)[2].strip() for row in rows), (
            f"docs/controls/{name}.md: every row has three cells, the last one its source"
        )
    gone = {file.stem for file in PAGES.glob("*.md")} - set(EVERY)
    assert not gone, f"docs/controls/: pages of dialects that do not exist: {', '.join(gone)}"


NOBODY_CAN_LOOK_UP = re.compile(r"\bown\b|\d+ %|not noted|remembered|\blists?\b|of users|inferred|memory|^sources$")


def rows_of(text: str) -> list[list[str]]:
    """page → its rows: what, fact, source."""
    return [cells for row in re.findall(r"(?m)^\| (.*) \|$", text) if len(cells := re.split(r" \| ", row)) == 3]


@pytest.mark.parametrize("name", sorted(EVERY))
def test_a_row_whose_source_nobody_can_look_up_says_that_it_is_unconfirmed(name: str) -> None:
    rows = [row for row in rows_of(page(name)) if row[2] != "source"]
    told = [row for row in rows if NOBODY_CAN_LOOK_UP.search(row[2]) and "unconfirmed" not in row[2]]
    assert not told, f"docs/controls/{name}.md: name a source that others can look up, or say unconfirmed on the row itself: {told}"
    unnamed = [row for row in rows if not re.search(r"[a-zA-Z]{4}|\d", row[2])]
    assert not unnamed, f"docs/controls/{name}.md: no source, name one or say unconfirmed: {unnamed}"


def outdated(text: str, doubts: tuple[str, ...]) -> list[str]:
    """page, doubts of its post → those that a first page took from the post, and that the post no longer has."""
    return [row[1] for row in rows_of(text) if row[0].startswith(DOUBT) and row[2] == "unconfirmed" and row[1] not in doubts]


@pytest.mark.parametrize("name", sorted(EVERY))
def test_a_doubt_that_a_first_page_took_from_the_post_is_still_one_of_it(name: str) -> None:
    """A page keeps what it was drafted with. A post whose doubts change leaves the old ones there."""
    doubts = load(name).doubts or ("nothing yet",)
    assert outdated(draft(name), doubts[1:]) == [doubts[0]]
    gone = outdated(page(name), doubts)
    assert not gone, f"docs/controls/{name}.md: {gone} are no doubts of postprocessors/{name}.py any more; it has: {list(doubts)}"


NEEDED = {  # what a person has to know before the first record arrives
    "cable and connector": r"[Cc]onnector|cable",
    "network": r"[Nn]etwork|share|FTP|Ethernet",
    "where records arrive": r"[Rr]ecords",
    "skip input": r"skip|probe input|input of the probe|probe.{0,40}input",
}


@pytest.mark.parametrize("name", ["fagor", "haas", "mazak", "okuma"])
def test_a_page_without_cable_network_destination_and_input_says_whom_to_ask(name: str) -> None:
    """What is not known is one bullet: unconfirmed, ask the builder for it."""
    cabinet = page(name).partition("## In the cabinet")[2].partition("## What is known")[0]
    bullets = [" ".join(bullet.split()) for bullet in cabinet.split("\n* ")[1:]]
    (asked,) = [bullet for bullet in bullets if bullet.lower().startswith("unconfirmed: ask the builder for")]
    for what, words in NEEDED.items():
        assert re.search(words, asked), f"docs/controls/{name}.md: {what}"


@pytest.mark.parametrize("name", sorted(EVERY))
def test_a_page_is_linked_and_has_no_empty_table(name: str, root: Path) -> None:
    file, link = root / "docs" / "commissioning.md", f"[{name}](controls/{name}.md)"
    links, before = file.read_text(encoding="utf-8"), "Cables, parameters and files of each control are on its own page: "
    if link not in links and writing():
        begin, _, rest = links.partition(before)
        listed, end, rest = rest.partition(".\n\n")
        every = ", ".join(sorted([*listed.replace(",", " ").split(), link]))
        links = begin + textwrap.fill(before + every, 100, break_on_hyphens=False) + end + rest
        file.write_text(links, encoding="utf-8")
    assert link in links, f"docs/commissioning.md: {link} is missing among the pages; {WRITE} -k {name} adds it"
    assert ("| belief |" in page(name)) == bool(load(name).remedies)


def test_a_first_page_says_nothing_of_another_control() -> None:
    for name in EVERY:
        text = draft(name)
        assert "\n\n\n" not in text and not re.search(r"(?m)^\| \d+ \|", text), text
        assert "FTP" not in text and ("brother" not in text.lower() or name == "brother"), text
        assert ("| belief |" in text) == bool(load(name).remedies)


def failed(name: str) -> str:
    """dialect → the section of its page on what mends an experiment that has failed, where no key of the profile does."""
    rows = [f"| `{belief}` | {what} | {source} |" for belief, (what, source) in sorted(load(name).remedies.items())]
    text = "`tango commission` says it too. Every other belief is mended by a key, see docs/commissioning.md."
    return "\n".join(["## When an experiment fails", "", text, "", "| belief | on this control | source |", "|---|---|---|", *rows])


@pytest.mark.parametrize("name", sorted(name for name in EVERY if load(name).remedies))
def test_a_page_says_what_of_the_control_mends_an_experiment(name: str) -> None:
    text = page(name)
    if failed(name) not in text and writing():
        kept = re.sub(r"(?s)## When an experiment fails\n.*?(?=\n## |\Z)", "", text)
        before, _, after = kept.partition("## To the first reading")
        text = f"{before.rstrip()}\n\n{failed(name)}\n\n## To the first reading{after}"
        (PAGES / f"{name}.md").write_text(text, encoding="utf-8")
    assert failed(name) in text, f"docs/controls/{name}.md: {WRITE} -k {name} writes this section anew"


def test_a_brother_gets_no_character_that_its_page_says_it_refuses() -> None:
    assert "a B00 refuses `_`, `>` and `\\`" in page("brother")
    text = "\n".join(program(load("brother"), golden(), {}, plan_hash(golden()))[2]())
    assert not set("_>\\") & set(text)
