"""Readers of recorded motion, one format each; `library.recordings` chooses among them by a file's ending."""
