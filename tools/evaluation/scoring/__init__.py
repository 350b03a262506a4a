"""Scores of a stream: protocols, timelines, figures with their intervals."""
