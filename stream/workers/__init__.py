"""Performers spread over worker processes: each performer's worker, the messages to and from it, and the processes.

`partition`, `wire`, `ledger` and `worker` know no socket, clock or process; `stream.cluster` uses them over a network.
"""
