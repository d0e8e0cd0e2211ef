"""What commissioning.yaml of a cell proves today, for the commands that rest on it, and what a try adds to it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..commission import Experiment, Judged, experiments, keys
from ..files import write_text
from ..files.commissioning import Proof, add_proofs, latest, read_commissioning
from ..link.secrets import shown
from ..records import Cell
from . import _trusted
from ._common import json_text, table

if TYPE_CHECKING:
    from postprocessors import Post


def keys_of(cell: Cell, post: Post) -> dict[str, str]:
    """cell with a controller, its post → {belief: key of what it depends on}. Raises InputError for unknown options."""
    import postprocessors as posts

    assert cell.controller is not None
    name = cell.controller.post
    code = _trusted.digest(cell.folder / name) if posts.is_own(name) else ""
    return keys(cell.machine, name, code, posts.settings(post, cell.controller.options), shown(cell.controller.port or ""))


def proven(cell: Cell, post: Post) -> dict[str, Proof]:
    """cell with a controller, its post → {belief: its latest proof that still holds, PASS or FAIL}."""
    return latest(read_commissioning(cell.folder), keys_of(cell, post))


def unproven(found: dict[str, Proof]) -> list[Experiment]:
    """what is proven → the experiments of beliefs without PASS, the most dangerous first."""
    return [e for e in experiments() if e.belief not in found or found[e.belief].verdict != "PASS"]


def remedy_here(post: Post, belief: str) -> str:
    """post, belief → what of this control mends it, a sentence; empty where only the profile does."""
    what, source = post.remedies.get(belief, ("", ""))
    mirror, of = post.remedies.get("mirror", ("", "")) if belief == "frames" else ("", "")
    said = f" On this control: {what} ({source})." if what else ""
    return f"{said} A mirror image here: {mirror} ({of})." if mirror else said


def keys_here(post: Post, experiment: Experiment) -> str:
    """post, experiment that fails → which of the keys that its advice names this post has, a sentence; empty where it has all."""
    every = {key for one in experiments() for key in one.rests}
    named = [word for word in dict.fromkeys(re.findall(r"[a-z_0-9]+", experiment.advice)) if word in every]
    own = {option.name for option in post.options}
    have = [key for key in named if key in own]
    if have == named:
        return ""
    return f" Of the keys that are named here, {post.title} has {', '.join(have) if have else 'none'}."


def told(cell: Cell, post: Post, judged: Sequence[Judged], mark: str, control: str, json_file: str | None) -> bool:
    """what came of a try → written into commissioning.yaml and shown, with what to do; whether a belief has failed."""
    assert cell.controller is not None
    date = datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    key = keys_of(cell, post)
    proofs = []
    for each in judged:
        belief, verdict = each.experiment.belief, each.verdict
        found = (verdict.verdict, verdict.found, verdict.value, verdict.unit)
        proofs.append(Proof(belief, *found, date, mark, control, key[belief]))
    file = add_proofs(cell.folder, cell.controller.post, proofs)
    result: dict[str, Any] = {
        "format": "tango-commission/1",
        "file": str(file),
        "program_hash": mark,
        "control": control,
        "beliefs": [{"belief": p.belief, "verdict": p.verdict, "found": p.found, "value": p.value, "unit": p.unit} for p in proofs],
    }
    failed = [each for each in judged if each.verdict.verdict == "FAIL"]
    if json_file == "-":
        click.echo(json_text(result))
        return bool(failed)
    click.echo(table([["belief", "", "what was found"], *([p.belief, p.verdict, p.found] for p in proofs)], "<<<"))
    for each in failed:
        one = each.experiment
        advice = each.verdict.do or f"{one.advice}.{keys_here(post, one)}{remedy_here(post, one.belief)}"
        click.echo(f"{one.belief}: {one.says}. It is not so. What to do: {advice}")
    click.echo(f"→ {file}")
    if json_file is not None:
        write_text(Path(json_file), json_text(result) + "\n")
    return bool(failed)
