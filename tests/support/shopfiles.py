"""Files of a shop that are no data: programs, posts, templates, the lock of a folder, what a night left behind, a password."""

from __future__ import annotations

import hashlib
import json
import random
import socket
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import postprocessors as posts
from support.histories import knowledge, record
from support.mutants import Reader, spoilt
from support.nights_parts import RealDisk
from support.remembered import remembered
from tango_cnc.commands._trusted import digest, parts
from tango_cnc.files import read_cell
from tango_cnc.link.lock import NAME, Holder, holding
from tango_cnc.link.secrets import secret
from tango_cnc.nc import blocks
from tango_cnc.nc.follow import Setup, follow
from tango_cnc.nightly.left_behind import UNKEPT, added, packed
from tango_cnc.plan import plan, plan_hash
from tango_cnc.program import from_file
from tango_cnc.records import Cell, InputError, LinkError, Plan
from tango_cnc.report import morning

STAMP = "2026-10-01T02-00-00"
PARTS = {
    "rs274": "%\nG21 G90 G17 G54 G94\nT1 M6\nG0 X0 Y0 Z50\nG1 Z-2 F300\nX40.5 Y10\nG2 X50.5 Y20 I0 J10\nG3 X40 Y30 R10\nG0 Z50\n"
    "M2\n%\n",
    "siemens": "; part\nG90 G71 G17 G54 G94\nT1 D1\nM6\nG0 X0 Y0 Z50\nG1 Z-2 F300\nX40.5 Y10\nG2 X50.5 Y20 I0 J10\n"
    "G3 X40 Y30 CR=10\n"
    "G0 Z50\nM30\n",
    "klartext": "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S3000\n2 L X+0 Y+0 Z+50 R0 FMAX M3\n3 L Z-2 F300\n4 L X+40.5 Y+10\n"
    "5 CC X+40.5 Y+20\n"
    "6 C X+50.5 Y+20 DR+\n7 L Z+50 FMAX\n8 END PGM A MM\n",
}
POST = b'''"""A post of a shop."""

from __future__ import annotations

import beside
from . import helper
from postprocessors.fanuc import POST as FANUC

POST = FANUC
NAMES = {"one": [1, 2.5], "two": (lambda x: x)}
'''


@cache
def whole(folder: Path) -> tuple[Cell, Plan]:
    """folder → its cell, and the plan of one touch where both rotary axes have turned, made once: it has every kind of line."""
    return touched(folder, slice(-1, None))


def touched(folder: Path, which: slice) -> tuple[Cell, Plan]:
    """folder, which indexations → its cell, and the plan of the first touch of each of them."""
    cell = read_cell(folder)
    few = tuple(replace(one, facets=one.facets[:1]) for one in cell.strategy.indexations[which])
    return cell, plan(replace(cell, strategy=replace(cell.strategy, indexations=few)))


def _part(language: str) -> Reader:
    name = f"part-{language}.nc"

    def read(folder: Path) -> Any:
        setup = Setup(whole(folder)[0].machine, dict.fromkeys(whole(folder)[0].machine.names, 0.0), 100.0)
        with (folder / name).open(encoding="utf-8", errors="surrogateescape", newline="") as text:
            return list(follow(text, blocks.language(language), setup))

    return Reader(name, lambda folder: PARTS[language].encode(), read)


def remarked(data: bytes, rng: random.Random) -> bytes:
    """program → the same with something wrong and its mark made anew, so that its lines are read."""
    return marked(spoilt(data, rng).decode("utf-8", "replace"))


def marked(text: str) -> bytes:
    """text of a program → the same with its mark made anew."""
    found = posts.MARK.search(text)
    if found is None:
        return text.encode()
    blank = text.replace("\r\n", "\n").replace(found[1], posts.BLANK)
    mark = hashlib.sha256(blank.encode()).hexdigest()[: len(posts.BLANK)].upper()
    return blank.replace(posts.BLANK, mark).encode()


_post = cache(posts.load)


def _program(post: str) -> Reader:
    def good(folder: Path) -> bytes:
        made = whole(folder)[1]
        return "\n".join([*posts.program(_post(post), made, {}, plan_hash(made))[2](), ""]).encode()

    def read(folder: Path) -> Any:
        with remembered():
            return from_file(folder / f"{post}.nc", _post(post), whole(folder)[1], {}) and None

    return Reader(f"{post}.nc", good, read, remarked)


def _lock(folder: Path) -> bytes:
    return json.dumps(asdict(Holder("tango run", 1 << 22, socket.gethostname(), "2026-10-01 02:00 UTC", "0a", 7))).encode()


def _held(folder: Path) -> None:
    with holding(folder, "tango run"):
        pass


class _Past:
    """A history that takes every night which is whole."""

    def add_night(self, told: Any, readings: Any, known: Any) -> int:
        if not isinstance(told, dict) or told.get("format") != "tango-night/1":
            raise InputError("no night")
        self.found = known
        return 1


class _World:
    def __init__(self, folder: Path) -> None:
        self.disk, self.past = RealDisk(folder), _Past()


def _unkept(folder: Path) -> Any:
    world = _World(folder)
    if not added(world, STAMP):  # type: ignore[arg-type]
        raise InputError("not whole")
    return world.past.found


def _left(folder: Path) -> Any:
    disk = RealDisk(folder)
    return disk.unfinished(), disk.unsent()


def _password(folder: Path) -> str:
    return secret("password", f"file:{folder / 'word'}")


def _own_post(folder: Path) -> Any:
    (folder / "beside.py").write_text("import json\n", encoding="utf-8")
    return digest(folder / "mine.py"), parts(folder / "mine.py")


def _morning(folder: Path) -> bytes:
    return Path(morning.__file__).with_name("templates").joinpath("morning.html").read_bytes()


SHOP: dict[str, Reader] = {
    **{f"part-{language}": _part(language) for language in PARTS},
    **{f"program-{post}": _program(post) for post in posts.names()},
    "lock": Reader(NAME, _lock, _held, refuses=(LinkError,)),
    "night-kept": Reader(f"nights/{STAMP}/{UNKEPT}", lambda f: packed(record(1), "touch\n1\n", knowledge(1)).encode(), _unkept),
    "night-begun": Reader(f"nights/begun/{STAMP}", lambda f: b"2026-10-01T02:00:00Z check\n", _left),
    "night-message": Reader(f"nights/outbox/{STAMP}.txt", lambda f: "M: good\n\nNothing has changed, 12 µm\n".encode(), _left),
    "password": Reader("word", lambda f: b"geheim\n", _password),
    "post.py": Reader("mine.py", lambda f: POST, _own_post),
    "template": Reader("shop/morning.html", _morning, lambda f: morning.render(record(1), folder=f / "shop")),
}
