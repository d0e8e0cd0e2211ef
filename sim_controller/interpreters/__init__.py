"""What a control understands: one file a family of languages, named after it; `_name` is a helper.

A family file offers

    Profile                                       what differs between machines with this control, defaults unverified
    Control(motion, profile, punch, note)         the control's memory; lives as long as it is switched on
    Control.run(lines, streamed)                  executes one tape; `lines` waits for more of it when it is drip-fed

`motion` does the moving (`sim_controller.motion`), `punch` takes the bytes that the control sends, `note` writes the ledger.
What the control would complain about is raised as `Alarm` and never as anything else.
"""

from ._alarm import Alarm, Silence

__all__ = ["Alarm", "Silence"]
