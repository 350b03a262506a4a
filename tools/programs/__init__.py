"""The programs a person starts, one file each: `add_arguments` says what it takes, `run` does it."""
