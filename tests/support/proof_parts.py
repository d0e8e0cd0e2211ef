"""What several tests need of the proofs of a commissioning: by which values of a cell each of them holds."""

from __future__ import annotations

from tango_cnc.commands._proofs import keys_here, keys_of, remedy_here

__all__ = ["keys_here", "keys_of", "remedy_here"]
