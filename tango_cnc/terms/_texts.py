"""What the files of the causes say to people; here, so that a list of nights does not have to load the diagnosis for it."""

from __future__ import annotations

from . import causes


def cause_texts() -> dict[str, str]:
    """→ name, text, says, meaning and advice of every cause, as its file has them: `chip.meaning` → sentence."""
    found: dict[str, str] = {}
    for name, cause in causes().items():
        own = {"text": cause.text, "says": cause.says, "meaning": cause.meaning, "advice": cause.advice}
        found |= {f"{name}.{what}": text for what, text in own.items()} | {f"{name}.name": name.replace("_", " ")}
    return found
