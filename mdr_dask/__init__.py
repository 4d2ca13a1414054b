"""A distributed parameter-study runner for tribology with the method of dimensionality reduction."""

__version__ = "0.1.0"
