"""Performers spread over processes of this machine: a gateway receives frames and answers, workers recognise."""
