"""Estimate → what a control is to hold, what that leaves, and files for it (docs/compensate.md)."""

from .proposal import Proposal, as_json, beyond, capped, propose

__all__ = ["Proposal", "as_json", "beyond", "capped", "propose"]
