"""Programs on recordings: record a feed; convert, cut and describe recordings; build a library of them."""
