"""`kinespace replay`: sends recordings, or motions of the built-in library, as a fake live feed; scores the answers."""
