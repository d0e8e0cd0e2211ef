"""A PDF says which letters it cannot show; boxes in place of a name are read as nothing."""

from pathlib import Path

import pytest
import typst
from support.runs import Result

from tango_cnc.commands.init import write_example
from tango_cnc.report.glyphs import lacking, note
from tango_cnc.report.pdf import compiled, quoted
from tango_cnc.report.texts import texts

LINEAR_B = "\U00010000"  # no font that computers come with has it
NAME = f"Mill {LINEAR_B}"


def test_a_writing_that_no_font_has_is_named():
    assert lacking(f"Mill 7 {LINEAR_B} Ω Привет ▲ ⁶") == ("Linear",)


def test_latin_greek_cyrillic_and_the_signs_of_the_program_are_there():
    assert lacking("Fräse Ø 12 µm, Ω, Станок, ▲ ✓ ✕ → ± ² ⁶ … «»") == ()


def test_a_text_without_such_letters_asks_nobody(monkeypatch):
    monkeypatch.setattr(typst, "compile", lambda *args, **how: pytest.fail("typst was asked"))
    assert lacking("Fräse, Станок, Ω, ▲") == () and note("Fräse", texts()) == ""


def test_letters_of_a_font_that_is_there_are_no_reason(monkeypatch):
    """A font that has some letters of a text: the others alone are named, whichever comes first."""
    asked = []

    def compile_(source, **how):
        asked.append(source.decode())
        if "中" in asked[-1]:
            raise typst.TypstError('PDF/A-2u error: the text `"中"` could not be displayed with font `"Liberation Sans"`')

    monkeypatch.setattr(typst, "compile", compile_)
    assert lacking("あ中村") == ("Chinese characters",) and len(asked) == 2 and "あ" in asked[-1]


def test_another_error_of_typst_is_no_letter(monkeypatch):
    def compile_(source, **how):
        raise typst.TypstError("unknown standard")

    monkeypatch.setattr(typst, "compile", compile_)
    assert lacking("中村") == ()


def test_a_signed_page_says_so_on_the_screen_and_at_its_end():
    told = []
    whole = compiled(f"#text({quoted(NAME)})", told.append)
    assert whole.startswith(b"%PDF-") and told[0].startswith("The computer that made this PDF has no font with: Linear.")
    assert "Install a font that has them" in told[0]
    plain = compiled('#text("Mill 7")', told.append)
    assert len(told) == 1 and len(whole) > len(plain)


@pytest.mark.long
def test_a_report_says_at_its_head_and_on_the_screen_what_it_cannot_show(tmp_path, monkeypatch):
    folder, sources = tmp_path / "cell", []
    write_example(folder, "hu40t")
    assert Result("simulate", "-C", folder).code == 0
    compile_ = typst.compile

    def seen(source, **how):
        sources.append(source.decode() if isinstance(source, bytes) else Path(source).read_text(encoding="utf-8"))
        return compile_(source, **how)

    monkeypatch.setattr(typst, "compile", seen)
    options = ("-C", folder, "--no-diagnosis", "--no-pictures", "--pdf", folder / "report.pdf")
    result = Result("report", *options, "--owner", NAME)
    assert "no font with: Linear. Boxes stand" in result.err and "Install a font" in result.err
    head, _, _ = sources[-1].partition("May this machine")
    assert "no font with: Linear" in head and (folder / "report.pdf").stat().st_size > 1000
    count = len(sources)
    result = Result("report", *options, "--owner", "Anna Fräser")
    assert "no font" not in result.err and len(sources) == count + 1 and "no font with" not in sources[-1]
