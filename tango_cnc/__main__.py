"""`python -m tango_cnc`: the same as `tango`, where scripts are not on the path."""

from .cli import main

if __name__ == "__main__":
    main()
