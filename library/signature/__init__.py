"""The signature of a window or a motion: its parts, the body and the basis that they are relative to."""
