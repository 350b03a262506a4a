"""Measures how well motions are named: protocols, timelines, scores, and the learning of `unknown`."""
