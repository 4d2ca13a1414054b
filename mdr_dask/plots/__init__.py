"""Figures drawn from a store."""
