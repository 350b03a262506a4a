"""`kinespace bench`: the cost of every step, in one run on real recordings."""
