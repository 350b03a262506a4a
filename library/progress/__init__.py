"""Progress: the phases on which the recordings of a class agree, and the table in which they are found live."""
