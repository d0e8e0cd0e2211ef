"""A process that pretends to be the controller, and the true machine behind it.

    program ──interpreter──▶ Motion ──▶ rig (true machine, true surfaces, effects) ──▶ contacts ──▶ what the control prints

`world` multiplies out every transform of the chain and `roots` solves the contacts; nothing is shared with the kinematics
of `tango_cnc`, so that each can judge the other.
"""
