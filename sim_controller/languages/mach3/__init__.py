"""Mach3 programs and the Basic of its macros, as Mach3 executes them."""

from .control import CONTROLS, Control, Profile, default_profile

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]
