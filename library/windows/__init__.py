"""Windows of motions: their parts, how they are compared, and an index of a library's windows."""
