"""The version of the package, on the ground floor: stores and tasks name it without importing what is above them."""

__version__ = "0.2.0"
