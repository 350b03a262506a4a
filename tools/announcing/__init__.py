"""A recogniser announced by mDNS, and its OSC addresses described by OSCQuery."""
