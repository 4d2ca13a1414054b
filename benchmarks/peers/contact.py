"""Compare bodies of revolution and a rough punch with boundary element programs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from benchmarks.peers import OURS, installed
from benchmarks.rows import Row, timed, timed_in_turns
from benchmarks.surfaces import punches
from mdr_dask.physics.mdr import power_law_contact
from mdr_dask.physics.mdr.transforms import forward_transform, gauss

GRIDS = (64, 256)
WIDTH, RADIUS = 2.0, 0.5
#: Exponent and amplitude of f = amplitude r^n.
BODIES = {"parabola": (2.0, 0.5), "flat: n = 6": (6.0, 2.0)}
PUNCH, HURST, LINES = 128, 0.8, 200
CHOSEN = slice(2, 7)  # the loads of `punches` that are used
LOADS = punches.LOADS[CHOSEN]


class Pressed(NamedTuple):
    """Indentation depth, and pressure on a grid, for a half-space of unit modulus."""

    depth: float
    pressure: np.ndarray


def tamaas(height: np.ndarray, width: float, force: float, tolerance: float = 1e-10) -> Pressed:
    """Press a surface against a half-space with Tamaas, with free boundaries."""
    import tamaas as tm

    tm.set_log_level(tm.LogLevel.error)
    model = tm.ModelFactory.createModel(tm.model_type.basic_2d, [width, width], list(height.shape))
    model.E, model.nu = 1.0, 0.0
    tm.ModelFactory.registerNonPeriodic(model, "free")
    solver = tm.PolonskyKeerRey(model, height, tolerance)
    solver.setIntegralOperator("free")
    solver.max_iter = 5000
    solver.solve(force / width**2)
    displacement = np.zeros_like(height)
    model.operators["free"](model.traction, displacement)
    pressure = np.array(model.traction)
    return Pressed(np.mean((displacement - height)[pressure > 0]), pressure)


def contact_mechanics(height: np.ndarray, width: float, force: float, tolerance: float = 1e-6) -> Pressed:
    """Press a surface against a half-space with ContactMechanics; the tolerance is relative to the range of heights."""
    from ContactMechanics import FreeFFTElasticHalfSpace
    from ContactMechanics.Systems import NonSmoothContactSystem
    from SurfaceTopography import Topography

    size = width, width
    system = NonSmoothContactSystem(FreeFFTElasticHalfSpace(height.shape, 1.0, size), Topography(height, size))
    found = system.minimize_proxy(external_force=force, pentol=tolerance * np.ptp(height), maxiter=5000)
    if not found.success:
        raise RuntimeError(found.message)
    pressure = found.jac[: height.shape[0], : height.shape[1]] / (width / height.shape[0]) ** 2
    return Pressed(found.offset, pressure)


def peers() -> dict[str, Callable[..., Pressed]]:
    """Return the boundary element programs that are installed."""
    known = (("tamaas", tamaas), ("ContactMechanics", contact_mechanics))
    return {name: solver for package, solver in known if (name := installed(package))}


def transformed(exponent: float, amplitude: float, force: float) -> tuple[float, float]:
    """Return depth and contact radius of a body of revolution from its image, computed from the slope of f."""
    share, weight = gauss(64)

    def image(x: np.ndarray) -> np.ndarray:
        return forward_transform(lambda r: amplitude * exponent * r ** (exponent - 1), x).value

    def missing(radius: float) -> float:
        depth, *inside = image(radius * np.append(1.0, share))
        return 2 * radius * weight @ (depth - np.array(inside)) - force

    radius = brentq(missing, 1e-3, 1.0, xtol=1e-13)
    return float(image(np.array([radius]))[0]), radius


def on_a_grid(press: Callable[..., Pressed], exponent: float, amplitude: float, force: float, points: int):
    """Return depth and contact radius on a grid; the radius follows from the number of points in contact."""
    place = (np.arange(points) - points // 2) * WIDTH / points
    found = press(-amplitude * np.hypot(place[:, None], place) ** exponent, WIDTH, force)
    return found.depth, np.sqrt(np.count_nonzero(found.pressure > 0) / np.pi) * WIDTH / points


def bodies() -> Iterator[Row]:
    """Yield rows with the larger error of depth and radius against closed forms, on increasingly fine grids."""
    solvers = peers()
    for case, (exponent, amplitude) in BODIES.items():
        body = amplitude, exponent
        force = float(power_law_contact.normal_force(RADIUS, *body, 1.0))
        truth = np.array([power_law_contact.depth(RADIUS, *body), RADIUS])
        methods = {(OURS, ""): lambda e=exponent, a=amplitude, f=force: transformed(e, a, f)}
        for name, press in solvers.items():
            for points in GRIDS:
                methods[name, f"{points} x {points}"] = lambda s=press, e=exponent, a=amplitude, f=force, n=points: (
                    on_a_grid(s, e, a, f, n)
                )
        for (name, setting), (found, seconds) in timed_in_turns(methods, 3).items():
            error = max(float(np.max(np.abs(np.array(found) / truth - 1))), 1e-16)
            yield Row("bodies of revolution", case, name, setting, 1, seconds, error)


def stiffness(depths: np.ndarray) -> np.ndarray:
    """Return the stiffness dF/dd between neighbouring loads, over E* L."""
    return np.diff(LOADS) / np.diff(depths)


def by_lines() -> np.ndarray:
    """Return the mean depths of the lines that replace the punch, over the rms height."""
    return np.mean([punches.line(HURST, PUNCH, index)[0][CHOSEN] for index in range(LINES)], axis=0)


def rough() -> Iterator[Row]:
    """Yield rows with the largest error of the stiffness of one rough punch; outside it, the surface is far below."""
    place = (np.arange(PUNCH) + 0.5) / PUNCH - 0.5
    surface = punches.HEIGHT * punches.areal_surface(punches.spectrum(HURST, PUNCH), (PUNCH, PUNCH), (1.0, 1.0), 1, 0)
    surface[np.hypot(place[:, None], place) >= 0.5] = -1.0

    def depths(press, tolerance):
        loads = LOADS * punches.HEIGHT
        return np.array([press(surface, 1.0, load, tolerance).depth for load in loads]) / punches.HEIGHT

    solvers = peers()
    if len(solvers) < 2:
        return
    by_tamaas, by_contact = solvers
    truth = stiffness(depths(contact_mechanics, punches.TOLERANCE * punches.HEIGHT / 10))
    methods = {
        by_contact: lambda: depths(contact_mechanics, punches.TOLERANCE * punches.HEIGHT),
        by_tamaas: lambda: depths(tamaas, 1e-6),
        OURS: by_lines,
    }
    for name, method in methods.items():
        found, seconds = timed(method)
        error = float(np.max(np.abs(stiffness(found) / truth - 1)))
        yield Row("rough surface", "five loads", name, "200 lines" if name == OURS else "", 1, seconds, error)


def compared() -> Iterator[Row]:
    """Yield the rows for bodies of revolution and for the rough punch."""
    yield from bodies()
    yield from rough()
