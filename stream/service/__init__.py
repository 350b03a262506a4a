"""The running service: the loop, its counters, and threads and processes of our own."""
