"""Performers spread over machines by Zenoh: gateways receive and answer, workers recognise.

`charter` is pure; `bus` opens Zenoh; `gateway` and `node` are the two ends. Only `kinespace gateway` and
`kinespace work` import this package, and only they need Zenoh.
"""
