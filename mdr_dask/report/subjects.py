"""Texts about the method of each model, for the report: a paragraph, equations, papers, and limits of the method."""

from __future__ import annotations

from typing import NamedTuple


class Equation(NamedTuple):
    """An equation in LaTeX, and the meaning of the equation."""

    latex: str
    meaning: str


class Subject(NamedTuple):
    """The description of the method of a model: a paragraph for a paper, the equations, and the papers to cite.

    `can` lists statements that the results support. `cannot` lists statements that the results do not support. `page`
    is the path of a page of the documentation.
    """

    method: str
    equations: tuple[Equation, ...]
    papers: tuple[str, ...]
    can: tuple[str, ...]
    cannot: tuple[str, ...]
    page: str


BOOK = "V. L. Popov, M. Heß, Method of Dimensionality Reduction in Contact Mechanics and Friction. Springer, 2015."
OBJECTION = (
    "I. A. Lyashenko, L. Pastewka, B. N. J. Persson, On the validity of the method of reduction of dimensionality: "
    "area of contact, average interfacial separation and contact stiffness. Tribology Letters 52, 223 (2013)."
)
PRL = (
    "Q. Li, M. Popov, A. Dimaki, A. E. Filippov, S. Kürschner, V. L. Popov, Friction between a viscoelastic body and a "
    "rigid surface with random self-affine roughness. Physical Review Letters 111, 034301 (2013)."
)
SHAPES = (
    "V. L. Popov, L. Voll, Q. Li, Y. S. Chai, M. Popov, Generalized law of friction between elastomers and differently "
    "shaped rough bodies. Scientific Reports 4, 3750 (2014)."
)
KINETICS = (
    "Q. Li, A. V. Dimaki, M. Popov, S. G. Psakhie, V. L. Popov, Kinetics of the coefficient of friction of elastomers. "
    "Scientific Reports 4, 5795 (2014)."
)
ROLLING = (
    "Q. Li, R. Pohrt, Mixed and boundary lubrication in rolling contact: experiment and simulation. "
    "Facta Universitatis, Series: Mechanical Engineering 11, 123-131 (2013)."
)
FRETTING = (
    "Q. Li, A. E. Filippov, A. V. Dimaki, Y. S. Chai, V. L. Popov, Simplified simulation of fretting wear using the "
    "method of dimensionality reduction. Physical Mesomechanics 17, 236-241 (2014)."
)
SHARED_LOAD = (
    "K. L. Johnson, J. A. Greenwood, S. Y. Poon, A simple theory of asperity contact in EHL. Wear 19, 91 (1972)."
)

#: Limits of the method for rough surfaces, common to several models.
_ROUGH = (
    "Friction and forces of rough lines with the given spectrum, as means over an ensemble and their scatter.",
    "Trends with load, velocity, modulus and spectrum, and the exponents of laws of friction.",
)
_NOT_ROUGH = (
    "Area in contact, pressure in contact, separation and gaps of a surface: the length of the line in contact is "
    "proportional to the contact stiffness and does not give the area.",
    "Friction of a surface in partial contact to better than a factor of about two: the lines had 0.60 to 2.17 times "
    "the friction of a sliding half-space.",
    "The friction of one sample at one place, because the phases of the lines are random.",
    "Adhesion and heat, which the model does not contain.",
)

SUBJECTS: dict[str, Subject] = {
    "sliding_friction": Subject(
        "A viscoelastic body slides steadily over a rigid rough line. The method of dimensionality reduction replaces "
        "the half-space by independent elements. The displacement that the line imposes on an element decays "
        "exponentially after the line has moved on. The displacement of an element is the largest of all "
        "displacements imposed on it so far, each reduced by its decay since then. The line consists of cubic pieces, "
        "and one pass along the line finds the steady displacements. The indentation depth follows from the normal "
        "force. The lines are self-affine with random phases, or measured, and the results are means over the lines.",
        (
            Equation(r"f = 4 G \, \mathrm{d}x \, (u + \tau \dot{u}) \geq 0", "force of an element of a Kelvin solid"),
            Equation(
                r"u(s) = \max_{s' \leq s} w(s') \, e^{-(s - s') / (v \tau)}",
                "displacement of an element at the position s, after the line w has moved past it at the velocity v",
            ),
            Equation(r"F_N = 4 G \int u \, \mathrm{d}s", "normal force"),
            Equation(
                r"F_x = 4 G \left[ v \tau \int_{c} w'^2 \, \mathrm{d}s + \sum_{f} \frac{u_l^2 - u_t^2}{2} \right], "
                r"\quad \mu = \frac{F_x}{F_N}",
                "friction: integral over the intervals c in contact, and the energy that is dissipated in every free "
                "recovery f, from the end l of a contact to the beginning t of the next one",
            ),
        ),
        (PRL, SHAPES, BOOK, OBJECTION),
        _ROUGH,
        _NOT_ROUGH,
        "docs/friction.md",
    ),
    "velocity_jump": Subject(
        "A body slides steadily over a rough line under a constant load until its velocity jumps. The friction before "
        "the jump and the friction long after the jump follow from steady solutions. In the transient, the "
        "indentation depth is computed in time steps. In each step, one pass along the line finds the patches in "
        "contact, and the forces of these patches have closed forms. The steady friction after the jump is computed "
        "for every line separately.",
        (
            Equation(
                r"u(x, t) = \max_{t' \leq t} \left( d(t') + p(x') \right) e^{-(t - t')}, \quad x' = x - V (t - t')",
                "displacement, with the time in relaxation times and V = v tau / L",
            ),
            Equation(
                r"\Delta\mu_0 = \mu(t_0 + 0) - \mu_1",
                "jump of friction at the time of the velocity jump; depth and displacements do not jump",
            ),
            Equation(
                r"\mu(t) - \mu_2 \propto e^{-b (t - t_0) / \tau}",
                "relaxation as one exponential, if the fit finds that this law holds",
            ),
        ),
        (KINETICS, PRL, BOOK, OBJECTION),
        (*_ROUGH, "The change of friction after a jump, and how fast it relaxes."),
        (*_NOT_ROUGH, "The transient after a jump, to a known accuracy: it was not compared with a half-space."),
        "docs/kinetics.md",
    ),
    "mixed_lubrication": Subject(
        "Two rough rollers are pressed together with an oil film between them. Film and asperities share the load as "
        "in the theory of Johnson, Greenwood and Poon. The film is that of a smooth line contact, and the asperities "
        "are springs of the method of dimensionality reduction. Where the sum of the heights of both lines exceeds "
        "the film thickness, clusters of points are in contact. A cluster breaks through the boundary layer if it "
        "squeezes the layer to less than a critical thickness.",
        (
            Equation(
                r"F_a(h) + \gamma F = F",
                "balance of loads: asperities carry F_a at the film thickness h, the film carries the share gamma",
            ),
            Equation(
                r"\frac{h_0}{R^*} = 2.922 \, W^{-0.166} U^{0.692} G^{0.470}",
                "central film thickness of Pan and Hamrock, if the campaign selects this formula",
            ),
            Equation(
                r"h_{layer} = \frac{\pi \tau_0 D^3}{12 F}",
                "thickness to which a cluster of length D and force F squeezes a layer with the shear strength tau_0",
            ),
            Equation(r"R = \rho / L", "electrical resistance of a length L in intimate contact"),
        ),
        (ROLLING, SHARED_LOAD, BOOK),
        (
            "Film thickness, shares of the load and friction, under the assumptions of the model.",
            "Share of time with at least one breakthrough of the layer, which a twin-disc rig measures.",
        ),
        (
            "Area in contact and gaps of the surfaces, because lines represent them.",
            "Heat in the contact, rolling friction and the chemistry of layers, which the model does not contain.",
            "Strength and thickness of the layer separately: the results depend on their ratio only.",
        ),
        "docs/mixed-lubrication.md",
    ),
    "ehl_line": Subject(
        "A film of oil separates two rollers. Newton's method solves Reynolds' equation, the elastic deformation and "
        "the balance of load together. The spacing of the grid is halved until the errors of the film thicknesses "
        "meet the accuracy. The pressure is zero where the film cavitates.",
        (
            Equation(
                r"\frac{\mathrm{d}}{\mathrm{d}X} \left( \frac{\rho H^3}{\eta} \frac{\mathrm{d}P}{\mathrm{d}X} \right) "
                r"= K \frac{\mathrm{d}(\rho H)}{\mathrm{d}X}, \quad K = \frac{3 \pi^2}{4} \frac{U}{W^2}",
                "Reynolds' equation in Hertz units",
            ),
            Equation(
                r"H(X) = H(0) + \frac{X^2}{2} - \frac{1}{\pi} \int P(s) \ln \left| \frac{X - s}{s} \right| \mathrm{d}s",
                "film thickness between the deformed rollers",
            ),
            Equation(r"\int P \, \mathrm{d}X = \frac{\pi}{2}, \quad P \geq 0", "balance of load"),
        ),
        (
            "Q. Li, dissertation, appendix B (Technische Universität Berlin).",
            "P. Pan, B. J. Hamrock, Simple formulas for performance parameters used in elastohydrodynamically "
            "lubricated line contacts. Journal of Tribology 111, 246 (1989).",
        ),
        ("Film thickness and pressure of a smooth, isothermal, steady line contact, each with its error.",),
        (
            "Heat, shear thinning in the film, roughness and changes in time, which the model does not contain.",
            "Traction at large sliding: it is computed from the film of pure rolling.",
            "The height of the pressure spike with Barus' law, which does not converge on finer grids.",
        ),
        "docs/ehl.md",
    ),
    "fretting_wear": Subject(
        "A body of revolution is pressed into a half-space and oscillates tangentially. Where it slips, it wears "
        "according to the local law of Reye, Archard and Khrushchov. The method of dimensionality reduction, which is "
        "exact for bodies of revolution, solves the normal and the tangential contact.",
        (
            Equation(
                r"\Delta h = \frac{k}{\sigma_0} \, p \, \Delta u",
                "depth of wear at a point with the pressure p and the slip Delta u",
            ),
            Equation(
                r"g(x) = |x| \int_0^{|x|} \frac{f'(r)}{\sqrt{x^2 - r^2}} \, \mathrm{d}r",
                "line g(x) that replaces the body with the profile f(r)",
            ),
            Equation(r"\mu E^* \left( d - g(c) \right) = G^* U_0", "radius c of the stick area"),
        ),
        (
            FRETTING,
            "A. V. Dimaki, A. I. Dmitriev, Y. S. Chai, V. L. Popov, Rapid simulation procedure for fretting wear on "
            "the basis of the method of dimensionality reduction. International Journal of Solids and Structures 51, "
            "4215 (2014).",
            BOOK,
        ),
        (
            "Worn profile, worn volume, contact radius and pressure of one body of revolution: exact in the limits of "
            "few and very many cycles, and with an estimated error between them.",
            "With the fast rule, results of a simplified law, whose profiles differ from the exact evolution by up to "
            "0.32 d_0.",
        ),
        (
            "Wear of rough bodies and of bodies that are not of revolution, and effects of wear particles.",
            "The wear coefficient, which is an input or is fitted to a measurement.",
        ),
        "docs/wear.md",
    ),
}


def subject_of(model: str) -> Subject | None:
    """Return the description of the method of a model, or None for a model from outside this package."""
    return SUBJECTS.get(model)
