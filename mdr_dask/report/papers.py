"""The papers to cite for each model, and the page of the documentation about the model."""

from __future__ import annotations

from typing import NamedTuple

BOOK = "V. L. Popov, M. Heß, Method of Dimensionality Reduction in Contact Mechanics and Friction. Springer, 2015."
OBJECTION = (
    "I. A. Lyashenko, L. Pastewka, B. N. J. Persson, On the validity of the method of reduction of dimensionality: "
    "area of contact, average interfacial separation and contact stiffness. Tribology Letters 52, 223 (2013)."
)
FRICTION = (
    "Q. Li, M. Popov, A. Dimaki, A. E. Filippov, S. Kürschner, V. L. Popov, Friction between a viscoelastic body and a "
    "rigid surface with random self-affine roughness. Physical Review Letters 111, 034301 (2013)."
)


class Source(NamedTuple):
    """A page of the documentation, and the papers to cite."""

    page: str
    papers: tuple[str, ...]


SOURCES: dict[str, Source] = {
    "sliding_friction": Source(
        "docs/friction.md",
        (
            FRICTION,
            "V. L. Popov, L. Voll, Q. Li, Y. S. Chai, M. Popov, Generalized law of friction between elastomers and "
            "differently shaped rough bodies. Scientific Reports 4, 3750 (2014).",
            BOOK,
            OBJECTION,
        ),
    ),
    "velocity_jump": Source(
        "docs/kinetics.md",
        (
            "Q. Li, A. V. Dimaki, M. Popov, S. G. Psakhie, V. L. Popov, Kinetics of the coefficient of friction of "
            "elastomers. Scientific Reports 4, 5795 (2014).",
            FRICTION,
            BOOK,
            OBJECTION,
        ),
    ),
    "mixed_lubrication": Source(
        "docs/mixed-lubrication.md",
        (
            "Q. Li, R. Pohrt, Mixed and boundary lubrication in rolling contact: experiment and simulation. Facta "
            "Universitatis, Series: Mechanical Engineering 11, 123-131 (2013).",
            "K. L. Johnson, J. A. Greenwood, S. Y. Poon, A simple theory of asperity contact in EHL. Wear 19, 91 "
            "(1972).",
            BOOK,
        ),
    ),
    "ehl_line": Source(
        "docs/ehl.md",
        (
            "Q. Li, dissertation, appendix B (Technische Universität Berlin).",
            "P. Pan, B. J. Hamrock, Simple formulas for performance parameters used in elastohydrodynamically "
            "lubricated line contacts. Journal of Tribology 111, 246 (1989).",
        ),
    ),
    "fretting_wear": Source(
        "docs/wear.md",
        (
            "Q. Li, A. E. Filippov, A. V. Dimaki, Y. S. Chai, V. L. Popov, Simplified simulation of fretting wear "
            "using the method of dimensionality reduction. Physical Mesomechanics 17, 236-241 (2014).",
            "A. V. Dimaki, A. I. Dmitriev, Y. S. Chai, V. L. Popov, Rapid simulation procedure for fretting wear on "
            "the basis of the method of dimensionality reduction. International Journal of Solids and Structures 51, "
            "4215 (2014).",
            BOOK,
        ),
    ),
}
