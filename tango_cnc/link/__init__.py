"""Plan and program → readings: the only part that talks to a controller.

    transport (bytes) ↔ client of a protocol (events) → trust (readings) → journal (disk), turned by session

A protocol is a file of `protocols/`; what only some of them share is a file here whose name begins with `_`. `client` says what a
protocol is, `session` and `measure` run it, `trust` judges what it brings.
"""
