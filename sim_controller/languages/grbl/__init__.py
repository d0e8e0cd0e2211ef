"""The lines of grbl 1.1, grblHAL and FluidNC, as these firmwares execute them."""

from .control import CONTROLS, REALTIME, RESET, Control, Profile, default_profile, switched_on

__all__ = ["CONTROLS", "REALTIME", "RESET", "Control", "Profile", "default_profile", "switched_on"]
