"""A control that does not know a word of the program says so: which of the doubts in its header that word belongs to."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import pairwise

from .experiment import Ruling

NOT_KNOWN = re.compile(  # alarms of controls that cannot read a block, or have no variable, file or option of that name
    r"IMPROPER G|\bPS0?(010|076|115)\b|VARIABLE NO|\b12550\b|NOT DEFINED|NOT AVAILABLE|FAULTY|NO SUCH|NOT THERE|NOT FOUND|"
    r"DOES NOT EXIST|INVALID (G|M)|UNKNOWN|UNSUPPORTED|SYNTAX|IS NO VARIABLE"
)
WORD = re.compile(r"[$#]?[A-Z][A-Z0-9_.]*[A-Z0-9_]|#\d+")
AXIS = re.compile(r"[.]?[XYZABC]\d?")  # what a post adds to the name of a variable
ORDINARY = re.compile(  # words of programs that stand in sentences too: one of them alone says nothing
    r"AXIS|BLOCK|CALL|CODE|CYCLE|ERROR|FORMAT|FORM|FUNCTION|LINE|MOVE|NAME|NUMBER|PLANE|POSITION|PROBE|PROGRAM|REFERENCE|RESET|"
    r"SKIP|SPINDLE|STOP|SYNC|SYSTEM|TABLE|TEST|TOOL|TOUCH|TRACK|WAIT|WITH|WORD"
)
ASIDE = re.compile(r'"[^"]*"|\([^()]*[a-z ][^()]*\)|;.*')  # strings and comments of a program
KEYED = re.compile(r"[a-z_0-9]+ = ")  # a doubt that a key of the profile settles


def lacking(said: str, doubts: Iterable[str]) -> tuple[str, str] | None:
    """text of a stop, doubts of the header → the word that the control does not know, and the doubt that has most of the words.

    None where the text says nothing of the kind, or no word of it stands in a doubt. `O8832` is the program that P8832 calls.
    """
    text = said.upper()
    if not NOT_KNOWN.search(text):
        return None
    words = {*WORD.findall(text), *(f"P{number}" for number in re.findall(r"\bO(\d+)", text))}
    shared = [(sorted(w for w in words if any(_is(w, d) for d in WORD.findall(doubt))), doubt) for doubt in doubts]
    most, doubt = max(shared, key=lambda each: len(each[0]), default=([], ""))
    if not most:
        return None
    word, shown = max(most, key=len), set(WORD.findall(text.partition("(")[2]))  # the block, where the screen shows it
    others = {d: sorted((set(own) & shown) - set(most)) for own, d in shared if KEYED.match(d) and not KEYED.match(doubt)}
    more = {d: max(own, key=len) for d, own in others.items() if own}
    return " or ".join([word, *more.values()]), "; or: ".join([doubt, *more])


def _is(word: str, doubted: str) -> bool:
    word = word.removeprefix("#") if word[1:2].isalpha() else word  # `#TLC OFF` is written of TLC
    return word == doubted or (word.startswith(doubted) and AXIS.fullmatch(word[len(doubted) :]) is not None)


def ruled(said: str, word: str, doubt: str) -> Ruling:
    """text of a stop, word, doubt → FAIL with what the header says of it."""
    key = doubt.partition(" = ")[0]
    do = (
        f"this comes from {key} under controller: in tango.yaml ({doubt}). State it otherwise, or give the control what it lacks"
        if re.fullmatch(r"[a-z_0-9]+", key)
        else f"the program relies on this: {doubt}. Look it up in the manual of the control (docs/controls/)"
    )
    return Ruling("FAIL", f"the program stopped: {said}. The control does not know {word}", do=do)


def mentioned(said: str, doubts: Iterable[str], program: str) -> str:
    """text of a stop, doubts of the header, text of the program → which words of the program it names and the keys that they come
    from, a sentence that blames none; empty where it names no word of it.
    """
    text = re.sub(r"\b([GM])[- ]?(?:FUNCTION|CODE)?[- ]+(\d+)\b", r"\1\2", said.upper())
    single = [w for w in WORD.findall(text) if not ORDINARY.fullmatch(w) and (re.search(r"\d", w) or len(w) >= 4)]
    spoken = re.findall(r"[A-Z]+", text)
    pairs = [f"{one} {two}" for one, two in pairwise(spoken) if ORDINARY.fullmatch(one) and ORDINARY.fullmatch(two)]
    blocks = ASIDE.sub(" ", program)
    stated = [d.partition(", e.g.")[0] for d in doubts if KEYED.match(d)]
    by_key: dict[str, list[str]] = {}
    for word in dict.fromkeys([*single, *pairs]):
        if _stands(word, blocks):
            keys = [d.partition(" = ")[0] for d in stated if _stands(word, d) or (word[0] == "#" and _stands(word[1:], d))]
            by_key.setdefault(" or ".join(keys), []).append(word)
    if len(by_key) > 1:
        by_key.pop("", None)
    return "; ".join(
        f"{' and '.join(words)} {'is' if len(words) == 1 else 'are'} in the program"
        + (f", from {keys} under controller: in tango.yaml" if keys else "")
        for keys, words in by_key.items()
    )


def _stands(word: str, text: str) -> bool:
    """word, text → whether it stands there whole; `G69` in `G49G69G80`, too."""
    after = r"(?![\d.])" if word[-1].isdigit() else r"(?![A-Za-z0-9_])"
    before = r"(?<![A-Za-z_$#])" if word[0].isalpha() else r"(?<![\w.])"
    return re.search(before + re.escape(word) + after, text) is not None
