"""A service in a process of its own, its answers, and the answers that are expected of it."""
