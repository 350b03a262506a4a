"""The inner loops of a hop: in C where a compiler was found, else in numpy."""
