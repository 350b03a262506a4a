"""Performers spread over worker processes: who has which, what goes to a worker and comes back, and the processes.

`partition`, `wire`, `ledger` and `worker` know no socket, clock or process; `stream.cluster` uses them over a network.
"""
