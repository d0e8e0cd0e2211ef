"""One file a command; its name is the command's name and `command` in it the click command."""
