"""Optical markers: readers of C3D and TRC."""
