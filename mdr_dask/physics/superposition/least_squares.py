"""The least squares of shifts and curve, linearised: its solution, and what it knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.superposition import spline_system
from mdr_dask.physics.superposition.problem import DEGREE, Problem

SMOOTHING = np.logspace(-8, 6, 15)
"""Weights of the curvature among which the restricted likelihood chooses, relative to the data's own."""

LEAST_SHARE = 1e-3
"""Likelihood of a smoothing, relative to all, below which it is left out."""


@dataclass(frozen=True)
class Settled:
    """Weight of the curvature, and variance of the scatter by which the expected overlap is weighed."""

    weight: float
    variance: float


@dataclass(frozen=True)
class System:
    """The least-squares problem linearised at given shifts: unknown are spline coefficients, then steps of the
    shifts.
    """

    splines: int
    low: float
    step: float
    first: NDArray[np.intp]
    value: FloatArray
    steepness: FloatArray
    member: NDArray[np.intp]
    target: FloatArray
    normal: FloatArray
    right: FloatArray
    total: float
    penalty: FloatArray

    @classmethod
    def at(cls, problem: Problem, shifts: FloatArray, settled: Settled) -> System:
        """Linearise about the curve of a smoothing: a rougher one has steeper slopes, and promises too much."""
        horizontal, vertical = problem.split(shifts)
        x, target = problem.x + horizontal[problem.member], problem.y + vertical[problem.member]
        low, step, cells = problem.cells(x)
        splines, first = cells + DEGREE, np.empty(x.size, np.intp)
        value, slope = np.empty((x.size, DEGREE + 1)), np.empty((x.size, DEGREE + 1))
        spline_system.spline_rows(x, low, step, cells, first, value, slope)
        size = splines + problem.free
        normal, right = np.empty((size, size)), np.empty(size)
        shape = problem.curves, splines, problem.vertical, target, normal, right
        spline_system.normal_equations(first, value, np.zeros(x.size), problem.member, *shape)
        gram = normal[:splines, :splines].copy()
        curvature = _curvature(splines) * np.trace(gram) / splines
        smooth = gram + settled.weight * curvature
        spline_system.factorise(smooth)
        curve = spline_system.solve(smooth, right[:splines].copy())
        steepness = np.einsum("ij,ij->i", slope, curve[first[:, None] + np.arange(DEGREE + 1)])
        spline_system.normal_equations(first, value, steepness, problem.member, *shape)
        penalty = np.zeros((size, size))
        penalty[:splines, :splines] = curvature
        rows, wanted = problem.expected()
        missing = wanted - rows @ shifts
        normal[splines:, splines:] += settled.variance * (rows.T @ rows)
        right[splines:] += settled.variance * (rows.T @ missing)
        total = float(target @ target + settled.variance * (missing @ missing))
        return cls(splines, low, step, first, value, steepness, problem.member, target, normal, right, total, penalty)

    def _factor(self, weight: float) -> FloatArray:
        matrix: FloatArray = self.normal + weight * self.penalty
        spline_system.factorise(matrix)
        return matrix

    def solve(self, weight: float) -> FloatArray:
        """Return spline coefficients and steps of the shifts that fit best at a smoothing weight."""
        solution: FloatArray = spline_system.solve(self._factor(weight), self.right)
        return solution

    def best_curve(self, weight: float) -> FloatArray:
        """Return the spline coefficients that fit best at these shifts."""
        inner = slice(self.splines)
        matrix = self.normal[inner, inner] + weight * self.penalty[inner, inner]
        spline_system.factorise(matrix)
        found: FloatArray = spline_system.solve(matrix, self.right[inner].copy())
        return found

    def misfit(self, weight: float) -> float:
        """Return the sum of squares with its penalty for the best curve through these shifts."""
        return self.total - float(self.right[: self.splines] @ self.best_curve(weight))

    def _scores(self) -> FloatArray:
        numbers = self.right, self.total, self.target.size, self.splines - 2, SMOOTHING
        scores: FloatArray = spline_system.likelihoods(self.normal, self.penalty, *numbers)
        return scores

    def likeliest(self) -> Settled:
        """Return the smoothing weight of largest restricted likelihood, and the scatter with it."""
        weight = float(SMOOTHING[int(np.argmin(self._scores()))])
        return Settled(weight, max(self.misfit(weight), 0.0) / max(self.target.size - self.right.size, 1))

    def _given(self, weight: float) -> tuple[FloatArray, FloatArray, float, float]:
        """Return the solution, its covariance, the variance of the scatter and its degrees of freedom."""
        inverse = spline_system.inverse(self._factor(weight))
        solution = inverse @ self.right
        freedom = max(self.target.size - float(np.sum(inverse * self.normal)), 1.0)
        variance = float(np.sum((self.target - self.design() @ solution) ** 2)) / freedom
        return solution, variance * inverse, variance, freedom

    def posterior(self, weight: float) -> tuple[FloatArray, FloatArray, float, float]:
        """Return the solution, its covariance, the scatter and its degrees of freedom.

        Smoothness counts as prior knowledge; that it is known only from the data adds to the covariance, by the mean
        over all smoothing weights with their likelihoods.
        """
        best, _, variance, freedom = self._given(weight)
        scores = self._scores()
        share = np.exp(-0.5 * (scores - scores.min()))
        covariance = np.zeros_like(self.normal)
        for part, other in zip(share / share.sum(), SMOOTHING, strict=True):
            if part > LEAST_SHARE:
                solution, spread, _, _ = self._given(float(other))
                covariance += part * (spread + np.outer(solution - best, solution - best))
        return best, covariance, float(np.sqrt(variance)), freedom

    def design(self) -> FloatArray:
        """Return the matrix of the linearised problem, shape (points, unknowns)."""
        rows = np.arange(self.target.size)
        design = np.zeros((rows.size, self.right.size))
        design[rows[:, None], self.first[:, None] + np.arange(DEGREE + 1)] = self.value
        moved = self.member > 0
        design[rows[moved], self.splines + self.member[moved] - 1] = self.steepness[moved]
        curves = int(self.member.max()) + 1
        if self.right.size > self.splines + curves - 1:
            design[rows[moved], self.splines + curves - 1 + self.member[moved] - 1] = -1.0
        return design

    def curve(self, x: FloatArray) -> FloatArray:
        """Return the rows of the splines at any x within their range, shape (points, splines)."""
        first, cells = np.empty(x.size, np.intp), self.splines - DEGREE
        value, slope = np.empty((x.size, DEGREE + 1)), np.empty((x.size, DEGREE + 1))
        spline_system.spline_rows(x, self.low, self.step, cells, first, value, slope)
        rows = np.zeros((x.size, self.splines))
        np.put_along_axis(rows, first[:, None] + np.arange(DEGREE + 1), value, axis=1)
        return rows

    def residuals(self, weight: float) -> tuple[FloatArray, FloatArray]:
        """Return fitted values, and residuals enlarged by their leverage."""
        inverse, design = spline_system.inverse(self._factor(weight)), self.design()
        fitted = design @ (inverse @ self.right)
        leverage = np.sum((design @ inverse) * design, axis=1)
        scatter = (self.target - fitted) / np.sqrt(np.maximum(1 - leverage, 0.05))
        return fitted, np.asarray(scatter, dtype=np.float64)


def _curvature(size: int) -> FloatArray:
    """Return the matrix of the sum of squared second differences."""
    second = np.diff(np.eye(size), 2, axis=0)
    return np.asarray(second.T @ second, dtype=np.float64)
