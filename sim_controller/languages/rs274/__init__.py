"""RS-274/NGC with O words, as LinuxCNC executes it."""

from .control import SPOKEN, Control, Profile, default_profile

__all__ = ["SPOKEN", "Control", "Profile", "default_profile"]
