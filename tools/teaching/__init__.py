"""Teaching while a feed runs: the desk between service, teacher and file, and the doors for commands."""
