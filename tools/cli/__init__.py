"""The command line: the start of `kinespace`, and the meaning of its options."""
