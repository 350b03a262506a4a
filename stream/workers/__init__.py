"""Performers spread over processes, of this machine or of several, by Zenoh.

A gateway receives frames and answers; workers recognise. `wire`, `track`, `router` and `worker`
know no socket, clock or process. `bus` opens Zenoh; `gateway` and `node` are its two ends, and `local` starts workers
on this machine. Only `kinespace live --workers`, `gateway` and `work` open Zenoh, and only they need it.
`background_opener` and `child_process`, about threads and processes, serve other programs, too.
"""
