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
        own = ", ".join(post.links)
        return f"port {parsed.url}: {post.title} cannot use the link {name}; its post allows {own}. See docs/link.md"
    if protocol.SCHEMES and parsed.scheme not in protocol.SCHEMES.values():
        schemes = ", ".join(f"{scheme}://" for scheme in protocol.SCHEMES)
        return f"port {parsed.url}: the link {name} needs a URL that begins with {schemes}. See docs/link.md"
    return ""


def say_doubt(post: Post, address: str) -> None:
    """post, port of its control → says why nothing may come of this link, where something speaks against it."""
    if why := doubted(post, address):
        said(why)
