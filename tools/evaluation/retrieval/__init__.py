"""The paper's experiment: a motion asks, and the nearest motion of another actor answers."""
