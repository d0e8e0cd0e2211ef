"""RS-274/NGC with O words, as LinuxCNC executes it."""

from .control import CONTROLS, Control, Profile, default_profile

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]
