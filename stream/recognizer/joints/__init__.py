"""The joints of a feed: which of them a sender has, which can be believed, and a library restricted to them."""
