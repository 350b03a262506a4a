"""A service in a process of its own, its answers, and the answers expected of it."""
