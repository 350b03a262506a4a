"""What strangers and faults do to a running recogniser: `make chaos`."""
