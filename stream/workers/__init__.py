"""Performers spread over processes, of this machine or of several, by Zenoh.

A gateway receives frames and answers; workers recognise, each as an ordinary service. `wire` and `track` know no
socket, clock or process. `bus` opens Zenoh; `gateway` and `worker` are its two ends, and `local` starts workers on this
machine. Only `kinespace live --workers`, `gateway` and `work` open Zenoh, and only they need it.
"""
