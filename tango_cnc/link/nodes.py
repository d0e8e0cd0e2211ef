"""Which OPC UA variable means what: a YAML file (`opcua.yaml`, or the user's copy of it) → the names of the nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..files.checked import Node, load
from ..files.composed import Pairs
from ..records import InputError

STANDARD = Path(__file__).with_name("opcua.yaml")
WORDS = ("record", "taken", "point", "flag", "count")  # one node each
DIGITS = 12  # of a mark


@dataclass(frozen=True)
class Nodes:
    """The variables of a control, by what they mean; `state` and `text` are empty where the server does not say them."""

    words: Mapping[str, str]
    mark: tuple[str, ...]
    position: Mapping[str, str]
    sum: str = ""
    state: str = ""
    alarms: tuple[int, ...] = ()
    text: str = ""

    @property
    def looked_at(self) -> dict[str, str]:
        """→ {what it means: NodeId} of all that is read at each look, in one request."""
        found = dict(self.words) | {f"mark{i}": node for i, node in enumerate(self.mark)} | dict(self.position)
        return found | {name: node for name, node in (("sum", self.sum), ("state", self.state)) if node}


def read_nodes(file: str = "") -> Nodes:
    """name of a YAML file, nothing for the one that comes with this program → nodes.

    Raises InputError naming file, line and key of what is wrong.
    """
    root = load(Path(file) if file else STANDARD)
    if not isinstance(root.raw, Pairs):  # not shown: it may be any file of this computer
        raise InputError(f"nodes: {file} names no variables; allowed: a copy of {STANDARD.name}, which comes with this program")
    keys = root.fields(("nodes", "position"), ("state",))
    nodes = keys["nodes"].fields((*WORDS, "mark"), ("sum",))
    mark = nodes["mark"].list()
    if not mark or DIGITS % len(mark):
        raise nodes["mark"].wrong("1, 2, 3, 4, 6 or 12 nodes, which share the twelve digits")
    letters = dict(keys["position"].items())
    for letter, node in letters.items():
        if letter not in tuple("XYZABCS"):
            raise node.wrong("axes X Y Z A B C S")
    state = keys["state"].fields(("node", "alarm"), ("text",)) if "state" in keys else {}
    found = Nodes(
        {name: _named(nodes[name]) for name in WORDS},
        tuple(_named(node) for node in mark),
        {letter: _named(node) for letter, node in letters.items()},
        _named(nodes["sum"]) if "sum" in nodes else "",
        _named(state["node"]) if state else "",
        tuple(value.integer() for value in state["alarm"].list()) if state else (),
        _named(state["text"]) if "text" in state else "",
    )
    names = [*found.looked_at.values()]
    for name in names:
        if names.count(name) > 1:
            raise root.wrong(f"a node of its own for each: {name} is there twice")
    return found


def _named(node: Node) -> str:
    text = node.text()
    if not all(part[:2] in ("ns", "i=", "s=", "g=", "b=") for part in text.split(";", 1)) or not text.isprintable():
        raise node.wrong('a NodeId, e.g. "ns=2;s=/Channel/Parameter/R[u1,700]"')
    return text
