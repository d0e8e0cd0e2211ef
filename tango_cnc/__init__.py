"""Calibration of five-axis machine tools with the machine's own probe and table (TANGO: touch and go).

    machine + artefact + strategy ──plan──▶ Plan ──post──▶ NC program ──link──▶ controller ──▶ Readings
    Readings ──estimate──▶ Estimate ──uncertainty / diagnose / verify──▶ report, compensate, history

`records` holds what crosses the stages and `files` reads and writes it; `kinematics` turns axis positions and errors into
tip positions and their exact derivatives, `terms` says which errors there may be, `model` turns both into residuals and
`estimate` fits them. `plan` decides where to touch and how to get there, `postprocessors` say it in a control's dialect, and
`link` carries it there and the readings back. Lengths are mm, angles rad; only files and people see degrees.
"""

__version__ = "0.1.0"
