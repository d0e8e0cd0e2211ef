"""Mach3 programs and the Basic of its macros, as Mach3 executes them."""

from .control import SPOKEN, Control, Profile, default_profile

__all__ = ["SPOKEN", "Control", "Profile", "default_profile"]
