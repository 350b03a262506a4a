"""Windows of motions: what is measured of them, how they are compared, and an index of a library's windows."""
