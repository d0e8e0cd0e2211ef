"""How programs are read back: one file or folder a language, named as posts and simulated control name it, with a `LANGUAGE`."""
