"""The joints of a feed: which are sent, which can be believed, and the library restricted to them."""
