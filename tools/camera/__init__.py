"""Bodies found in the pictures of an ordinary camera, as BlazePose's networks see them."""
