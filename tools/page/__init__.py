"""A page in the browser beside a live feed: what it shows, the server, and the page itself in `static/`."""
