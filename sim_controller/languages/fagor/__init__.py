"""Fagor programs, as a control executes them."""

from .control import SPOKEN, Control, Profile, default_profile

__all__ = ["SPOKEN", "Control", "Profile", "default_profile"]
