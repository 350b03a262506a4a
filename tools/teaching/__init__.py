"""Teaching while a feed runs: commands and their requests, lessons, keys, and the thread that opens and saves."""
