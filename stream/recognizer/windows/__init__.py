"""One performer's last seconds: distance rows smoothed, kept, and the parts of the signature read off them."""
