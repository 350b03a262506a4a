"""The command line: where `kinespace` starts, and what its options mean."""
