"""Optical markers: readers of C3D and TRC, and the segments between markers."""
