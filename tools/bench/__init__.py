"""`kinespace bench`: the cost of every step, beside the cost of other methods, in one run on real recordings."""
