"""A link that a control cannot have, as far as its post states: said before anything waits for what cannot come."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..link.address import linked, spoken
from ..link.measure import protocol_of
from ._progress import said

if TYPE_CHECKING:
    from postprocessors import Post


def doubted(post: Post, address: str) -> str:
    """post, port of its control → why nothing may come of this link; '' where nothing is known against it."""
    protocol, parsed = protocol_of(address, post.link)
    name = spoken(address) or linked(address) or post.link
    if post.links and name not in post.links:
        return f"port {parsed.url}: link {name} is none of {post.title}, by its post: {', '.join(post.links)} are. See docs/link.md"
    if protocol.SCHEMES and parsed.scheme not in protocol.SCHEMES.values():
        schemes = ", ".join(f"{scheme}://" for scheme in protocol.SCHEMES)
        return f"port {parsed.url}: link {name} is not read from such a line: {schemes} is. See docs/link.md"
    return ""


def say_doubt(post: Post, address: str) -> None:
    """post, port of its control → says why nothing may come of this link, where something speaks against it."""
    if why := doubted(post, address):
        said(why)
