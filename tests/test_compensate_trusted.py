"""Parameters that are not to be trusted are neither written into a control nor prove that what was written helps."""

from __future__ import annotations

import pytest
from support.compensated import first

from tango_cnc.compensate import as_json, propose
from tango_cnc.compensate.trusted import undecided, worth_acting
from tango_cnc.records import TangoError


def test_an_error_that_is_not_to_be_trusted_is_not_written() -> None:
    result = first("trunnion")
    proposal = propose(result, "siemens", tcp=False)
    by_size = sorted((s for s in proposal.fit.shares if s.word != "set-up"), key=lambda s: -s.effect_um)
    names = [result.selection.label(s.name) for s in by_size]
    worth_acting(proposal.fit, result, names[-3:], despite=False)  # the small ones do not hold the large ones up
    with pytest.raises(TangoError, match=rf"most of the error comes of {names[0]}, .* Nothing was written"):
        worth_acting(proposal.fit, result, names, despite=False)
    worth_acting(proposal.fit, result, names, despite=True)


def test_a_run_that_is_not_to_be_trusted_proves_nothing() -> None:
    result = first("trunnion")
    record = as_json(propose(result, "siemens", tcp=False))
    assert undecided(record, result, ()) == ""
    everything = [result.selection.label(c["name"]) for c in record["coefficients"]]
    assert "decides nothing" in undecided(record, result, everything)
