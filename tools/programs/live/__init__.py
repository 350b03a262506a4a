"""`kinespace live`: recognises a feed until Ctrl-C."""
