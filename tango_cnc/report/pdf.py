"""Facts → the report as PDF, by typst (the optional extra `pdf`): the same numbers, pictures and sentences as the HTML page."""

from __future__ import annotations

import html
import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ..records import InputError
from ..texts.handed import of_cell
from .decimals import decimals, decimals_of_page
from .facts import Facts
from .glyphs import note
from .page import context
from .svg import GOOD, LOOK, STOP
from .template import environment, rendered
from .texts import texts, texts_of

LONG, STEP, BREAK = re.compile(r"(?<!\S)(?![0-9a-f]{64}\b)\S{25,}"), 12, "\u200b"  # a hash stays whole: it is copied
A4, LETTER, GUTTER = 493.2, 510.0, 6.0  # pt between the margins of report.typ, and between two pictures
LEAST = 6.5  # pt that letters in pictures have on paper
SIZE, ACROSS = re.compile(r'font-size="([\d.]+)"'), re.compile(r'<svg[^>]*? width="([\d.]+)"')
TONES = {"good": GOOD, "look": LOOK, "stop": STOP, "unknown": "#5b3f95", "none": "#52606d"}


def available() -> bool:
    """→ whether typst is installed."""
    try:
        import typst  # noqa: F401
    except ImportError:
        return False
    return True


def quoted(value: object) -> str:
    """anything → string literal of typst: nothing in it is read as markup, and a word as long as a line can be broken."""
    text = LONG.sub(lambda m: BREAK.join(m[0][i : i + STEP] for i in range(0, len(m[0]), STEP)), str(value))
    text = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + text.replace("\n", " ").replace("\r", " ") + '"'


def _silent(text: str) -> None:
    """Most callers have nobody to tell."""


def render(
    f: Facts, folder: Path | None = None, made: Mapping[str, Any] | None = None, say: Callable[[str], object] = _silent
) -> bytes:
    """facts, folder of a shop's templates and fonts or None, `context` of the page where it was made before → PDF.

    `say` is told of letters that no font has; the PDF says so at its head. Raises InputError when typst is not installed or the
    template is wrong.
    """
    try:
        import typst
    except ImportError:
        raise InputError("--pdf: typst is not installed; pip install 'tango-cnc[pdf]'") from None
    env = environment(folder)
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        count, drawn, fonts = 0, [""], [folder] if folder else []

        def image(svg: object, width: str = "100%", columns: int = 1) -> str:
            nonlocal count
            if not svg:
                return "[]"
            count += 1
            paper = (LETTER if f.wishes.units.system == "inch" else A4) / columns - (GUTTER / 2 if columns > 1 else 0.0)
            wide = float(width.removesuffix("pt")) if width.endswith("pt") else float(width.removesuffix("%")) / 100 * paper
            (root / f"{count}.svg").write_text(decimals_of_page(legible(_plain(str(svg)), wide), t), encoding="utf-8")
            drawn.append(str(svg))
            return f'image("{count}.svg", width: {width})'

        t = texts_of(folder)
        env.filters["q"] = lambda value: Markup(quoted(decimals(of_cell(str(value), f.cell.folder.resolve().name), t)))
        env.filters["image"] = lambda value, width="100%", columns=1: Markup(image(value, width, columns))
        values: dict[str, Any] = {**(made or context(f, texts_of(folder))), "tones": TONES, "no_font": ""}
        source, text = root / "report.typ", rendered(env, "report.typ", values)
        boxes = note(text + html.unescape("".join(drawn)), texts_of(folder), fonts)
        if boxes:
            text = rendered(env, "report.typ", {**values, "no_font": boxes})
            say(f"{boxes} {texts()('report.no_font_install')}")
        source.write_text(text, encoding="utf-8")
        try:
            return bytes(typst.compile(str(source), root=place, font_paths=[str(one) for one in fonts]))
        except (typst.TypstError, RuntimeError) as error:
            raise InputError(f"report.typ: {error}; correct the template") from None


def compiled(source: str, say: Callable[[str], object] = _silent) -> bytes:
    """typst source without pictures → PDF; `say` is told of letters that no font has, and the end of the PDF says so.

    Raises InputError when typst is not installed.
    """
    try:
        import typst
    except ImportError:
        raise InputError("--pdf: typst is not installed; pip install 'tango-cnc[pdf]'") from None
    if boxes := note(source, texts_of(None)):
        source += f"\n#text({quoted(boxes)})\n"
        say(f"{boxes} {texts()('report.no_font_install')}")
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "page.typ"
        file.write_text(source, encoding="utf-8")
        return bytes(typst.compile(str(file), root=place))


def legible(svg: str, wide: float) -> str:
    """SVG for browsers, its width on paper (pt) → the same; letters that would be smaller than `LEAST` there have that size."""
    across = ACROSS.match(svg)
    if across is None:
        return svg
    least = LEAST * float(across[1]) / wide
    return SIZE.sub(lambda m: f'font-size="{max(float(m[1]), least):.4g}"', svg)


def _plain(svg: str) -> str:
    """SVG for browsers → for typst: its fonts are those that typst brings or finds."""
    return svg.replace(
        "system-ui, -apple-system, &#x27;Segoe UI&#x27;, Helvetica, Arial, sans-serif", "Liberation Sans, DejaVu Sans"
    )
