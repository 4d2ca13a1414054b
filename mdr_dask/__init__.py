"""A distributed parameter-study runner for tribology with the method of dimensionality reduction."""
