"""Frames and answers over WebSocket, for pages of other makers, p5, Unity's WebGL and phones: messages, server."""
