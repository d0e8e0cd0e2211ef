"""One file a command; its name is the command's name and `command` in it the click command.

`tango --help` reads two lines of each file and imports none of them: the first, "`tango NAME`: what it is for.", and
`PLACE = "Measure 30"`, the group that it is listed in and its place there.
"""

GROUPS = ("Begin", "Plan", "Measure", "Understand", "Act", "Keep")  # in working order
