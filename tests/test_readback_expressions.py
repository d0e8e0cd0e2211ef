"""Expressions of parametric programs: what a control compares and computes, and what the read-back makes of it."""

from __future__ import annotations

import pytest

from tango_cnc.readback.expressions import constant, expression

HELD = {1: 2.0, 2: 3.0, 3: None}  # variable → what it holds


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(("#1LT2", 0.0), ("#1LT2.001", 1.0), ("#1LE2", 1.0), ("#1LE1.999", 0.0)),
        *(("#1GT2", 0.0), ("#1GT1.999", 1.0), ("#1GE2", 1.0), ("#1GE2.001", 0.0)),
        *(("#1EQ2", 1.0), ("#1EQ3", 0.0), ("#1NE2", 0.0), ("#1NE3", 1.0)),
        *(("#3EQ0", 0.0), ("#3NE0", 1.0), ("#3EQ#3", 1.0), ("#3GE0", 1.0)),  # nothing is no zero, but for what computes
        *(("[#1EQ2]AND[#2EQ3]", 1.0), ("[#1EQ2]AND[#2EQ4]", 0.0), ("[#1EQ1]OR[#2EQ3]", 1.0), ("[#1EQ1]OR[#2EQ4]", 0.0)),
        *(("#1+#2*2", 8.0), ("[#1+#2]*2", 10.0), ("#2-#1-1", 0.0), ("#2/#1", 1.5), ("#1**#2", 8.0), ("-#1+1", -1.0)),
        *(("ABS[1-#2]", 2.0), ("SQRT[#1+2]", 2.0), ("FIX[0-2.7]", -2.0), ("POT[#2]", 9.0), ("#[#1]", 3.0)),
    ],
)
def test_an_expression_is_what_the_control_makes_of_it(text: str, value: float) -> None:
    assert expression(text)(lambda key: HELD[int(key)]) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("text", ["3000.", "0", "-119.04", "+5", ".5", "-0.", "#1", "1+1", "", "-", "1E3", "--1"])
def test_what_is_one_number_needs_no_control(text: str) -> None:
    """It is the same wherever something has gone wrong: it must be what the expression is, and nothing else may count as one."""
    if found := constant(text):
        assert found == (expression(text)(lambda key: None) or 0.0,)
    else:
        assert text not in ("3000.", "0", "-119.04", "+5", ".5", "-0.")
