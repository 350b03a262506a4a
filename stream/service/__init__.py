"""The running service: the loop, its counters, and the thread that prepares libraries."""
