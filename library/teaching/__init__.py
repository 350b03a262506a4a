"""Examples of motions that a person taught, and when a body moves."""
