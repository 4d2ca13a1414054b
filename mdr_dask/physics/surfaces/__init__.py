"""Rough lines and indenters over which an elastomer slides, and spectra of measured surfaces."""
