"""`kinespace bench`: what every step costs, and what a user would take instead costs, in one run on real recordings."""
