"""Okuma OSP programs, as a control executes them."""

from .control import CONTROLS, Control, Profile, default_profile

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]
