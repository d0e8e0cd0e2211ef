"""HEIDENHAIN Klartext, as a control executes it."""

from .control import Control, Profile, default_profile

__all__ = ["Control", "Profile", "default_profile"]
