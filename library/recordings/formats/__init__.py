"""Readers of recorded motion, one for each format; `library.recordings` chooses the reader by a file's ending."""
