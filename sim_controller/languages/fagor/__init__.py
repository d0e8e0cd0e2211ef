"""Fagor programs, as a control executes them."""

from .control import Control, Profile, default_profile

__all__ = ["Control", "Profile", "default_profile"]
