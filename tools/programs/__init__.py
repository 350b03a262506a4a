"""The programs, one file each: `add_arguments` adds a program's options, `run` runs it."""
