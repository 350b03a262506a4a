"""How far in a motion each moment is: phases that the recordings of a class agree on, and what finds them live."""
