"""What a control understands: one file or folder a language, named as the posts and the read-back name it.

A language offers

    Profile                                       what differs between machines with this control, defaults unverified
    CONTROLS                                      what is said of all controls that speak it (those with a name: `controls/`)
    Control(motion, profile, punch, note)         the control's memory; lives as long as it is switched on
    Control.run(lines, streamed)                  executes one tape; `lines` waits for more of it when it is drip-fed

`motion` does the moving (`sim_controller.motion`), `punch` takes the bytes that the control sends, `note` writes the ledger.
What the control would complain about is raised as `Alarm` and never as anything else.
"""

from ._shared.alarm import Alarm, Silence

__all__ = ["Alarm", "Silence"]
