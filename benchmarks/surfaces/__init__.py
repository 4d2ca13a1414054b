"""Measured surfaces, and how far rough lines stand for them."""
