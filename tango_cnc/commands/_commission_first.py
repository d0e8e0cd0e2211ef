"""Before anything is sent: a hand at the stylus and one at the handwheel, while the person looks at control and machine.

A dead probe guards no move. An axis that goes the other way than machine.yaml says takes the first move, up, down to the table.
Both are seen by hand, and then no program has to find them.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import click

from ..gate import step
from ..records import Plan
from ._asking import answered
from ._proofs import told
from ._start import in_spindle

SIGNAL = (
    "{probe} in the spindle and on. Push the stylus aside by hand, then let it go: does the control show the signal come and go at "
    "its skip input ({page})? The lamp of the probe alone is not enough."
)
WAY = "Jog {name} by 1 mm towards {sign} by hand, with room on both sides: does the probe move away from the table?"
UNSEEN = "by hand, before anything was sent: the control does not show that the stylus is touched"
WRONG_WAY = "{name}: by hand, before anything was sent: the person at the machine says no"
NOTHING_SENT = "Nothing was sent, and nothing has moved by program."


def questions(made: Plan, wanted: Collection[str], post: str) -> dict[str, tuple[str, str]]:
    """plan in the air, beliefs to try, name of the post → {belief: what is asked, what is found where the answer is no}, in the
    order in which they are asked: whether the probe is heard, then whether up is up.
    """
    name, by = step(made)
    asked = {
        "alive": (SIGNAL.format(probe=in_spindle(made), page=f"docs/controls/{post}.md says where it stands"), UNSEEN),
        "directions": (WAY.format(name=name, sign="minus" if by > 0 else "plus"), WRONG_WAY.format(name=name)),
    }
    return {belief: each for belief, each in asked.items() if belief in wanted}


def by_hand(cell: Any, post: Any, made: Plan, wanted: Collection[str], mark: str, json_file: str | None) -> bool:
    """cell, post, plan in the air, beliefs to try, hash of its program, file for JSON → whether nothing speaks against sending it.

    The first no ends it: that belief has failed, is written into commissioning.yaml, and nothing else is asked.
    """
    from .. import commission

    every = {experiment.belief: experiment for experiment in commission.experiments()}
    for belief, (text, found) in questions(made, wanted, cell.controller.post).items():
        if answered(text, waits=True) is False:
            told(cell, post, [commission.Judged(every[belief], commission.Ruling("FAIL", found))], mark, "", json_file)
            click.echo(NOTHING_SENT, err=True)
            return False
    return True
