"""The transforms of the method of dimensionality reduction (MDR) for bodies of revolution."""
