"""`kinespace bench`: the cost of every step, and of other methods, in one run on real recordings."""
