"""HEIDENHAIN Klartext, as a control executes it."""

from .control import SPOKEN, Control, Profile, default_profile

__all__ = ["SPOKEN", "Control", "Profile", "default_profile"]
