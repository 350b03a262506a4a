"""A page in the browser that shows a live feed: the board that it shows, the server, and its files in `static/`."""
