"""The campaign file: text to checked, frozen data."""
