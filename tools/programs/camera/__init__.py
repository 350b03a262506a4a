"""`kinespace camera`: a camera's bodies sent as frames."""
