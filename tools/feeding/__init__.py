"""Motions turned into a live feed: cues, senders and their pace."""
