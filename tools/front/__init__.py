"""kinespace names the movement a performer is doing, live; `kinespace.stream` and `kinespace.library` are its parts."""
