"""Performers spread over processes, of this machine or of several, by Zenoh.

A gateway receives frames and answers; workers recognise. `wire`, `track`, `router` and `worker`
know no socket, clock or process. `bus` opens Zenoh; `gateway` and `node` are its two ends, and `local` starts workers
on this machine. Only `kinespace live --workers`, `gateway` and `work` import this package, and only they need Zenoh.
"""
