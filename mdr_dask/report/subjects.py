"""Texts of the report on the method of each model: a paragraph, equations, papers, and the limits of the method."""

from __future__ import annotations

from typing import NamedTuple


class Equation(NamedTuple):
    """An equation in LaTeX, and its meaning."""

    latex: str
    meaning: str


class Subject(NamedTuple):
    """The description of the method of a model.

    Attributes
    ----------
    method : str
        A paragraph that can be used in a paper.
    equations : tuple of Equation
        The equations that are solved.
    papers : tuple of str
        Papers to cite.
    can, cannot : tuple of str
        Statements that the results support (`can`) and statements that the results do not support (`cannot`).
    page : str
        The page of the documentation with more details.
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
    "Friction and forces of one-dimensional lines with the spectrum given, as means and scatter of an ensemble.",
    "Trends with load, velocity, modulus and spectrum, and the exponents of its laws.",
)
_NOT_ROUGH = (
    "Area in contact, pressure in contact, separation and gaps of a surface: the length in contact of the line is its "
    "stiffness once more, and says nothing about the area.",
    "Friction of a surface in partial contact to better than a factor of about two: beside a sliding half-space the "
    "lines had 0.60 to 2.17 of its friction.",
    "One sample at one place: phases are random.",
    "Adhesion and heat are left out.",
)

SUBJECTS: dict[str, Subject] = {
    "sliding_friction": Subject(
        "A viscoelastic body slides steadily over a rigid rough line. The method of dimensionality reduction puts "
        "independent elements in the place of the half-space. Their displacement is the largest of what pressed them "
        "before, faded by relaxation; one pass over cubic cells gives it without running in. The depth follows from "
        "the normal force. Lines are self-affine with random phases, or measured; results are means over them.",
        (
            Equation(r"f = 4 G \, \mathrm{d}x \, (u + \tau \dot{u}) \geq 0", "force of an element of a Kelvin solid"),
            Equation(
                r"u(s) = \max_{s' \leq s} w(s') \, e^{-(s - s') / (v \tau)}",
                "displacement of an element that the line w has passed under at velocity v",
            ),
            Equation(r"F_N = 4 G \int u \, \mathrm{d}s", "normal force"),
            Equation(
                r"F_x = 4 G \left[ v \tau \int_{c} w'^2 \, \mathrm{d}s + \sum_{f} \frac{u_l^2 - u_t^2}{2} \right], "
                r"\quad \mu = \frac{F_x}{F_N}",
                "friction: the part in contact c, and what every flight f dissipates between leaving l and touching t",
            ),
        ),
        (PRL, SHAPES, BOOK, OBJECTION),
        _ROUGH,
        _NOT_ROUGH,
        "docs/friction.md",
    ),
    "velocity_jump": Subject(
        "A body slides steadily over a rough line under a constant load until its velocity jumps. The ends are steady "
        "solutions; between them the depth is marched in time, and at each moment one pass over the line finds the "
        "patches in contact, whose forces are closed forms. Every line has its own steady friction after the jump.",
        (
            Equation(
                r"u(x, t) = \max_{t' \leq t} \left( d(t') + p(x') \right) e^{-(t - t')}, \quad x' = x - V (t - t')",
                "displacement, with the time in relaxation times and V = v tau / L",
            ),
            Equation(
                r"\Delta\mu_0 = \mu(t_0 + 0) - \mu_1", "the jump of friction, as depth and displacements do not jump"
            ),
            Equation(
                r"\mu(t) - \mu_2 \propto e^{-b (t - t_0) / \tau}", "one exponential, where the fit says that it holds"
            ),
        ),
        (KINETICS, PRL, BOOK, OBJECTION),
        (*_ROUGH, "The change of friction after a jump, and how fast it relaxes."),
        (*_NOT_ROUGH, "The course after a jump was not compared with a half-space."),
        "docs/kinetics.md",
    ),
    "mixed_lubrication": Subject(
        "Two rough rollers are pressed together on an oil film. Film and asperities share the load after Johnson, "
        "Greenwood and Poon. The film is that of a line contact; the asperities are springs of the method of "
        "dimensionality reduction. Where lines overlap by more than the film, clusters of points break the boundary "
        "layer if they squeeze it thinner than its least thickness.",
        (
            Equation(r"F_a(h) + \gamma F = F", "load on asperities and on the film h, which has the share gamma"),
            Equation(
                r"\frac{h_0}{R^*} = 2.922 \, W^{-0.166} U^{0.692} G^{0.470}",
                "central film after Pan and Hamrock, where the campaign asks for it",
            ),
            Equation(
                r"h_{layer} = \frac{\pi \tau_0 D^3}{12 F}",
                "thickness to which a cluster of length D under the force F squeezes a layer of strength tau_0",
            ),
            Equation(r"R = \rho / L", "electrical resistance of a length L in intimate contact"),
        ),
        (ROLLING, SHARED_LOAD, BOOK),
        (
            "Film, shares of the load and friction of the model's assumptions.",
            "Share of time with any breakthrough of the layer, as a twin-disc rig measures it.",
        ),
        (
            "Area in contact and gaps of the surfaces, since lines stand for them.",
            "Heat in the contact, rolling friction and the chemistry of layers are left out.",
            "Layer strength and thickness apart from each other: only their ratio counts.",
        ),
        "docs/mixed-lubrication.md",
    ),
    "ehl_line": Subject(
        "Two rollers run on a film of oil. Reynolds' equation, the elastic deformation and the balance of load are "
        "solved together by Newton's method on grids that are halved until the errors of the films meet the accuracy. "
        "Where the film is torn the pressure is zero.",
        (
            Equation(
                r"\frac{\mathrm{d}}{\mathrm{d}X} \left( \frac{\rho H^3}{\eta} \frac{\mathrm{d}P}{\mathrm{d}X} \right) "
                r"= K \frac{\mathrm{d}(\rho H)}{\mathrm{d}X}, \quad K = \frac{3 \pi^2}{4} \frac{U}{W^2}",
                "Reynolds' equation in Hertz units",
            ),
            Equation(
                r"H(X) = H(0) + \frac{X^2}{2} - \frac{1}{\pi} \int P(s) \ln \left| \frac{X - s}{s} \right| \mathrm{d}s",
                "film between deformed rollers",
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
            "Heat, shear thinning in the film, roughness and time are left out.",
            "Traction is laid over the film of rolling, so it holds for small sliding.",
            "With Barus' law the pressure spike does not converge.",
        ),
        "docs/ehl.md",
    ),
    "fretting_wear": Subject(
        "A body of revolution is pressed into a half-space and oscillates tangentially. It wears where it slips, by "
        "the local law of Reye, Archard and Khrushchov. Normal and tangential contact are solved by the method of "
        "dimensionality reduction, which is exact for such bodies.",
        (
            Equation(r"\Delta h = \frac{k}{\sigma_0} \, p \, \Delta u", "wear of a place under the pressure p"),
            Equation(r"g(x) = |x| \int_0^{|x|} \frac{f'(r)}{\sqrt{x^2 - r^2}} \, \mathrm{d}r", "line of the body f(r)"),
            Equation(r"\mu E^* \left( d - g(c) \right) = G^* U_0", "radius c of the part that sticks"),
        ),
        (
            FRETTING,
            "A. V. Dimaki, A. I. Dmitriev, Y. S. Chai, V. L. Popov, Rapid simulation procedure for fretting wear on "
            "the basis of the method of dimensionality reduction. International Journal of Solids and Structures 51, "
            "4215 (2014).",
            BOOK,
        ),
        (
            "Worn profile, volume, radius of contact and pressure of one body of revolution, exact in its limits and "
            "with an error between them.",
            "With the fast rule, its own simplified law: its distance from the exact evolution is up to 0.32 d_0.",
        ),
        (
            "Bodies that are not of revolution, rough bodies, wear particles that stay in the contact.",
            "The wear coefficient itself: it is an input, or is fitted to a measurement.",
        ),
        "docs/wear.md",
    ),
}


def subject_of(model: str) -> Subject | None:
    """Return the description of the method of a model; None for a model from outside this package."""
    return SUBJECTS.get(model)
