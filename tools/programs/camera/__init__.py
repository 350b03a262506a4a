"""`kinespace camera`: bodies found in an ordinary camera's pictures, sent as frames."""
