"""What several tests need of `tango design`: its sentences, and the option that repeats its terms."""

from __future__ import annotations

from tango_cnc.commands._design import change_text, longer, no_shorter, option

__all__ = ["change_text", "longer", "no_shorter", "option"]
