"""Optical markers: the reader of C3D, and clips of markers."""
