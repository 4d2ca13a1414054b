"""Rough lines and indenters over which an elastomer slides, and spectra of measured surfaces.

`waves` is the common form of all rough lines. `roughness` generates lines, `measured` prepares recorded lines, and
`shapes` contains the indenters. `rough_line` combines roughness with an indenter or a plane, and `cubic_line` is the
form of a line that the solvers use. `splines` describes the shape of a line between few points, for quantities that
depend on this shape. `maps` and `scans` compute the spectrum of a measured surface. `spectrum` defines the form of this
spectrum, and computes the amplitudes of the waves of its line. `self_affine` fits a power law to such a spectrum.
"""
