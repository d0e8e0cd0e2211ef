"""HEIDENHAIN Klartext, as a control executes it."""

from .control import CONTROLS, Control, Profile, default_profile

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]
