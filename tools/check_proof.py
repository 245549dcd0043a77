#!/usr/bin/env python3
"""Checks a proof that `elastocal ... --proof-out FILE` wrote.

    python3 tools/check_proof.py FILE

It needs NumPy, and shares no code with the prover: its own reading of the arm, its own Taylor models,
vectorised over boxes, in the frame of the base or whichever frame the file names.

What is checked
  1. The variables and ranges that the file names cover the whole region, but for what exact symmetries
     repeat (see `check_domain`).
  2. The tree of halvings covers that box, and in every box that is done with, either one of the region's
     margins is negative everywhere, or d + sum of lambda g <= T with the file's multipliers lambda >= 0.
     A box whose own bound here is a little above is halved further, but the proof must be in the file: all in
     all there may be PATIENCE times as many boxes.
  3. The bounds of rho_0 follow from T, and from what earlier identifications tell, which is
     worked out here; the weights of the test poses sum to one.

What is proved is a statement about the question in the file: test poses, loads, region, noise and lengths of links, which are
printed. That these, and what else describes arm and knowledge, are those of a scenario is the file's word; its
hash is that in the results of the same scenario.

Rounding. Every operation adds ROUNDING times a bound of all that it adds up to the remainder; no operation has more
than 200 roundings of 1.2e-16 each on the way of one term, and ROUNDING is 1e-13. A sum of products of models is one operation, and
has more of both where its terms are many (see `roundings`). Sine and cosine are NumPy's, taken
to be within 1e-14, Bessel's functions are summed up here. Underflow adds less than TINY.

Exit codes: 0 the proof holds; 1 it does not, with the reason; 2 it cannot be checked here.
"""

import collections
import concurrent.futures
import functools
import itertools
import json
import math
import os
import sys
from fractions import Fraction

try:
    # Batches are what threads share.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import numpy as np
except ImportError:
    print("check_proof: NumPy is needed (pip install numpy)", file=sys.stderr)
    sys.exit(2)

ROUNDING = 1e-13
TRIGONOMETRY = 1e-14
TINY = 1e-280
BATCH = 512
# How many batches are looked at beside each other, and how many are made ahead.
WORKERS = min(os.cpu_count() or 1, 8)
WINDOW = 16
PATIENCE = 10
# Rounds over the coordinates in search of a concave function's largest value.
SWEEPS = 12
# As the prover chooses; whatever is chosen, the bound holds.
RIDGE = 10.0
NOTABLE = 0.5


class Refused(Exception):
    """The proof does not hold."""


class Unknown(Exception):
    """The proof is of a kind that this checker does not know."""


# --- Taylor models: c + g.x + sum_i h_i T2(x_i) + sum_{i<j} h_ij x_i x_j, within r, over -1 <= x <= 1


@functools.lru_cache(maxsize=None)
def layout(n):
    """The pairs i < j of n variables in the order in which their coefficients stand, and the place of each x_i x_j among h."""
    first, second = np.triu_indices(n, 1)
    full = np.empty((n, n), int)
    full[range(n), range(n)] = range(n)
    full[first, second] = full[second, first] = n + np.arange(len(first))
    return first, second, full


@functools.lru_cache(maxsize=None)
def places(some, variables):
    """Where the coefficients of models of some variables stand in models of more of them."""
    n, at = len(variables), [variables.index(v) for v in some]
    first, second, _ = layout(len(some))
    full = layout(n)[2]
    pairs = [1 + n + full[at[i], at[j]] for i, j in zip(first, second)]
    return np.array([0, *(1 + i for i in at), *(1 + n + i for i in at), *pairs])


@functools.lru_cache(maxsize=None)
def thirds(n):
    """Where the products x_i h_jk, n times those of h, are that make up each of T3(x_i); T2(x_i) x_j, with half of the second; and
    x_i x_j x_k. And those that leave half of themselves linear: x_i h_ij, in columns j."""
    full, count = layout(n)[2], n * (n + 1) // 2
    at = lambda i, j, k: i * count + full[j, k]
    two = [(i, j) for i in range(n) for j in range(n) if i != j]
    three = list(itertools.combinations(range(n), 3))
    alone = np.array([at(i, i, i) for i in range(n)], int)
    pairs = np.array([[at(j, i, i), at(i, i, j)] for i, j in two], int).reshape(-1, 2)
    triples = np.array([[at(i, j, k), at(j, i, k), at(k, i, j)] for i, j, k in three], int).reshape(-1, 3)
    return alone, pairs, triples, np.array([[at(i, i, j) for j in range(n)] for i in range(n)])


def coefficients_of(n):
    return 1 + 2 * n + n * (n - 1) // 2


def union(*models):
    return tuple(sorted({variable for model in models for variable in model.variables}))


class Model:
    """Models of quantities over many boxes, of which the first axes count quantities and the last one boxes: coefficients
    (..., 1 + 2 n + n (n - 1) / 2, N) of the n variables that matter to them, r (..., N), and rough (..., N), a bound of their sizes
    that need not be near. Models that have no variables may have N = 1 and stand for all boxes."""

    def __init__(self, variables, coefficients, r, rough, is_linear=False, norms=None):
        self.variables, self.coefficients, self.r, self.rough = variables, coefficients, r, rough
        self.is_linear = is_linear
        self.known_norms = norms

    def __getitem__(self, index):
        return self.with_arrays(lambda array, _: array[index])

    def with_arrays(self, change):
        """The same change of the axes of quantities in all arrays; it is told how many axes follow them."""
        norms = None if self.known_norms is None else change(self.known_norms, 2)
        r, rough = change(self.r, 1), change(self.rough, 1)
        return Model(self.variables, change(self.coefficients, 2), r, rough, self.is_linear, norms)

    def flat(self):
        """With one axis of quantities."""
        return self.with_arrays(lambda array, after: array.reshape(-1, *array.shape[-after:]))

    def of_boxes(self, chosen):
        """Those of some boxes."""
        return self.with_arrays(lambda array, _: array[..., chosen])

    def as_term(self):
        """With a last axis of one, of sums of one product."""
        return self.with_arrays(lambda array, after: array[..., None, :] if after == 1 else array[..., None, :, :])

    @property
    def c(self):
        return self.coefficients[..., 0, :]

    @property
    def g(self):
        return self.coefficients[..., 1 : 1 + len(self.variables), :]

    @property
    def h(self):
        """All x_i x_j, those with i > j, too: (..., n, n, N)."""
        n = len(self.variables)
        return self.coefficients[..., 1 + n + layout(n)[2], :]

    @property
    def norms(self):
        """The size of all, and the sum of |h|."""
        if self.known_norms is None:
            wide = np.abs(self.coefficients)
            bend = wide[..., 1 + len(self.variables) :, :].sum(-2)
            self.known_norms = np.stack([wide[..., : 1 + len(self.variables), :].sum(-2) + bend, bend], -2)
        return self.known_norms

    @property
    def size(self):
        return self.norms[..., 0, :]

    @property
    def bend(self):
        return self.norms[..., 1, :]

    def of(self, variables):
        """The same as models of more variables."""
        if variables == self.variables:
            return self
        wide = np.zeros((*self.coefficients.shape[:-2], coefficients_of(len(variables)), self.coefficients.shape[-1]))
        wide[..., places(self.variables, variables), :] = self.coefficients
        return Model(variables, wide, self.r, self.rough, self.is_linear)

    def scaled(self, factor, error=0.0):
        """Times numbers, one for all boxes or for each."""
        factor = np.asarray(factor, float)
        deep = factor[..., None, :] if factor.ndim else factor
        wide = np.abs(factor)
        r = wide * self.r + error * (self.rough + self.r) + ROUNDING * wide * self.rough + TINY
        return Model(self.variables, self.coefficients * deep, r * (1 + ROUNDING), (wide + error) * self.rough)

    def __neg__(self):
        return Model(self.variables, -self.coefficients, self.r, self.rough)

    def __add__(self, other):
        variables = union(self, other)
        one, other = self.of(variables), other.of(variables)
        rough = one.rough + other.rough
        r = one.r + other.r + ROUNDING * rough
        total = one.coefficients + other.coefficients
        return Model(variables, total, r * (1 + ROUNDING), rough)

    def __sub__(self, other):
        return self + (-other)

    def shifted(self, value, error=0.0):
        rough = self.rough + abs(value)
        r = self.r + error + ROUNDING * rough
        total = self.coefficients.copy()
        total[..., 0, :] += value
        return Model(self.variables, total, r * (1 + ROUNDING), rough)

    def largest(self):
        """A bound of the largest value over each box."""
        n = len(self.variables)
        first, second, _ = layout(n)
        slope, own = np.abs(self.g), self.coefficients[..., 1 + n : 1 + 2 * n, :]
        pairs = np.abs(self.coefficients[..., 1 + 2 * n :, :])
        # Half of |h_ij| for each of its two variables.
        bend = np.zeros_like(slope)
        for k, (i, j) in enumerate(zip(first, second)):
            bend[..., i, :] += pairs[..., k, :] / 2
            bend[..., j, :] += pairs[..., k, :] / 2
        square = 2 * own + bend
        corner = slope + square
        with np.errstate(divide="ignore", invalid="ignore"):
            vertex = slope * slope / (-4 * square)
        inside = (square < 0) & (slope < -2 * square)
        top = np.where(inside, vertex, corner) - own
        bound = self.c + self.r + top.sum(-2)
        bound = bound + ROUNDING * (self.size + self.bend + self.r) * 4 + TINY
        return np.where(np.isfinite(bound), bound, np.inf)

    def largest_of_concave(self):
        """The same by a concave function that is nowhere below: with the quadratic form M, r_i at least the sums of |M+|'s rows, and
        B = 2 (diag(r) - M) positive semidefinite, at most sum r + y B y / 2 + sum |g - B y| for any y."""
        n = len(self.variables)
        half = np.full((n, n), 0.5)
        half[range(n), range(n)] = 2.0
        form = np.moveaxis(self.h * half[..., None], -1, 0)
        slopes = self.g.T
        scale = np.abs(form).sum((1, 2))
        good = np.isfinite(scale) & np.isfinite(slopes).all(1) & np.isfinite(self.r)
        form, slopes = np.where(good[:, None, None], form, 0.0), np.where(good[:, None], slopes, 0.0)
        values, vectors = np.linalg.eigh(form)
        convex = np.einsum("nik,nk,njk->nij", vectors, np.maximum(values, 0.0), vectors)
        rows = np.abs(convex).sum(2) + 1e-11 * scale[:, None]
        own = -2 * form
        own[:, range(n), range(n)] += 2 * rows
        # Eigenvalues are within 1e-13 of the size.
        good &= np.linalg.eigvalsh(own)[:, 0] > 1e-12 * scale
        diagonal = np.where(own[:, range(n), range(n)] > 0, own[:, range(n), range(n)], 1.0)
        safe = np.where(good[:, None, None], own, np.eye(n))
        y = np.clip(np.linalg.solve(safe, slopes[..., None])[..., 0], -1, 1)
        for j in [*range(n)] * SWEEPS:
            others = np.einsum("ni,ni->n", own[:, j], y) - own[:, j, j] * y[:, j]
            y[:, j] = np.clip((slopes[:, j] - others) / diagonal[:, j], -1, 1)
        pull = np.einsum("nij,nj->ni", own, y)
        top = rows.sum(1) + (y * pull).sum(1) / 2 + np.abs(slopes - pull).sum(1)
        bound = self.c + self.r - self.coefficients[1 + n : 1 + 2 * n].sum(0) + top
        bound = bound + ROUNDING * (self.size + self.bend + self.r + 8 * (rows.sum(1) + scale)) * 4 + TINY
        return np.where(good & np.isfinite(bound), bound, np.inf)

    def shares(self):
        """By how much each of the variables moves it, those of others left out: (..., n, N)."""
        return np.abs(self.g) + np.abs(self.h).sum(-2)


def constant(value, error=0.0):
    """Constants, of any number of axes, for all boxes."""
    value = np.asarray(value, float)
    r = np.broadcast_to(np.asarray(error, float), value.shape)
    return Model((), value[..., None, None], r[..., None].copy(), np.abs(value)[..., None] + r[..., None])


def stacked(models, axis=0):
    """Models side by side, along a new axis."""
    variables = union(*models)
    shape = np.broadcast_shapes(*(model.r.shape for model in models))
    coefficients = np.zeros((len(models), *shape[:-1], coefficients_of(len(variables)), shape[-1]))
    r, rough = np.empty((2, len(models), *shape))
    for index, model in enumerate(models):
        coefficients[index][..., places(model.variables, variables), :] = model.coefficients
        r[index], rough[index] = model.r, model.rough
    whole = Model(variables, coefficients, r, rough)
    return whole if axis == 0 else whole.with_arrays(lambda array, _: np.moveaxis(array, 0, axis))


def summed(a, b):
    """The sum of products over the last axis of quantities."""
    if not a.variables or (a.is_linear and b.variables):
        a, b = b, a
    if not b.variables:
        total = np.einsum("...kn,...kqn->...qn", b.c, a.coefficients)
        wide = np.abs(b.c)
        rough = np.einsum("...kn,...kn->...n", wide, a.size)
        r = np.einsum("...kn,...kn->...n", wide, a.r) + np.einsum("...kn,...kn->...n", b.r, a.size + a.r)
        r = r + roundings(a.r.shape[-2], 1) * rough + TINY
        return Model(a.variables, total, r * (1 + ROUNDING), rough)
    variables, is_square = union(a, b), a is b
    a, b = a.of(variables), b.of(variables)
    n = len(variables)
    first, second, _ = layout(n)
    total = np.einsum("...kn,...kqn->...qn", b.c, a.coefficients)
    here = slice(1, 1 + n if b.is_linear else None)
    total[..., here, :] += np.einsum("...kn,...kqn->...qn", a.c, b.coefficients[..., here, :])
    outer = np.einsum("...kin,...kjn->...ijn", a.g, b.g)
    # x^2 = (1 + T2)/2
    squares = outer[..., range(n), range(n), :] / 2
    total[..., 0, :] += squares.sum(-2)
    total[..., 1 + n : 1 + 2 * n, :] += squares
    total[..., 1 + 2 * n :, :] += outer[..., first, second, :] + outer[..., second, first, :]
    # The third order, of all products together: x T2(x) and x (x y) leave half of themselves linear.
    order = np.einsum("...kin,...kpn->...ipn", b.g, a.coefficients[..., 1 + n :, :])
    if is_square:
        order *= 2
    elif not b.is_linear:
        order += np.einsum("...kin,...kpn->...ipn", a.g, b.coefficients[..., 1 + n :, :])
    order = order.reshape(*order.shape[:-3], -1, order.shape[-1])
    alone, pairs, triples, linear = thirds(n)
    total[..., 1 : 1 + n, :] += order[..., linear, :].sum(-3) / 2
    third = np.abs(order[..., alone, :]).sum(-2) / 2
    third += np.abs(order[..., pairs[:, 0], :] + order[..., pairs[:, 1], :] / 2).sum(-2)
    third += np.abs(order[..., triples, :].sum(-2)).sum(-2)
    fourth = np.einsum("...kn,...kn->...n", a.bend, b.bend)
    rough = np.einsum("...kn,...kn->...n", a.size, b.size)
    r = third + fourth + np.einsum("...kn,...kn->...n", a.r, b.size + b.r) + np.einsum("...kn,...kn->...n", a.size, b.r)
    r = (r + roundings(max(a.r.shape[-2], b.r.shape[-2]), n) * rough + TINY) * (1 + ROUNDING)
    return Model(variables, total, r, rough)


def roundings(terms, n):
    """More than what a sum of products loses: a term passes through less than 2 terms * n + 200 roundings."""
    return ROUNDING * (1 + terms * n / 200)



def times(a, b):
    return summed(a.as_term(), b.as_term())


def combined(matrix, model):
    """Sums over a model's first axis with the factors of a matrix's rows, which may be off by 4e-16 of themselves."""
    matrix = np.asarray(matrix, float)
    wide = np.abs(matrix)
    total = np.einsum("rk,k...->r...", matrix, model.coefficients)
    rough = np.einsum("rk,k...->r...", wide, model.rough)
    r = np.einsum("rk,k...->r...", wide, model.r) + (4e-16 + roundings(matrix.shape[1], 1)) * rough + TINY
    return Model(model.variables, total, r * (1 + ROUNDING), rough)


class Boxes:
    """Boxes by their centres and half-widths: (variables, N)."""

    def __init__(self, centre, half):
        self.centre, self.half = centre, half

    def coordinate(self, j):
        centre, half = self.centre[j], self.half[j]
        coefficients = np.array([centre, half, np.zeros_like(half)])
        return Model((j,), coefficients, np.zeros_like(half), np.abs(centre) + half)

    def sine_cosine(self, j):
        """Jacobi-Anger: cos(hx) = J0 - 2 J2 T2 + ..., sin(hx) = 2 J1 x - ...; |J_n(h)| <= (h/2)^n / n!."""
        centre, half = self.centre[j], self.half[j]
        wide = half > 2.0
        z = np.where(wide, 0.0, half) / 2
        j0, j1, j2 = (np.where(wide, 0.0, bessel(n, z)) for n in range(3))
        even = np.where(wide, 1.0, z**4 / 12 / (1 - z * z / 30) + 1e-14)
        odd = np.where(wide, 1.0, z**3 / 3 / (1 - z * z / 20) + 1e-14)
        s, c = np.sin(centre), np.cos(centre)

        def wave(first, second):
            coefficients = np.array([first * j0, second * 2 * j1, -2 * first * j2])
            r = np.abs(first) * even + np.abs(second) * odd + 8 * TRIGONOMETRY
            return Model((j,), coefficients, r, np.abs(coefficients).sum(0))

        return wave(s, c), wave(c, -s)


def bessel(n, z):
    term = z**n / math.factorial(n)
    total = term.copy()
    for k in range(1, 14):
        term = term * -(z * z) / (k * (k + n))
        total = total + term
    return total


# --- vectors: models with an axis of three


NOUGHT = constant([0.0, 0.0, 0.0])


def cross(a, b):
    one, other = a[[[1, 2], [2, 0], [0, 1]]], b[[[2, 1], [0, 2], [1, 0]]]
    other.coefficients[:, 1] *= -1
    return summed(one, other)


class Entry:
    """A constant that is known to within an error."""

    def __init__(self, value, error=0.0):
        self.value, self.error = value, error

    def is_nought(self):
        return self.value == 0.0 and self.error == 0.0


def in_frame(frame, vector):
    """A vector of entries in a frame of three columns."""
    total = NOUGHT
    for column, part in zip(frame, vector):
        if not part.is_nought():
            total = total + column.scaled(part.value, part.error)
    return total


def turned_by(frame, rotation):
    """A frame times a constant rotation (columns of entries); where there is none, the frame."""
    return frame if rotation is None else [in_frame(frame, column) for column in rotation]


def transposed(rotation):
    return None if rotation is None else [[rotation[k][row] for k in range(3)] for row in range(3)]


def turned(frame, axis, sine, cosine, back=False):
    one, other = (axis + 1) % 3, (axis + 2) % 3
    if back:
        sine = -sine
    waves = stacked([cosine, sine, -sine, cosine])[[[[0, 1]], [[2, 3]]]]
    columns = summed(stacked([frame[one], frame[other]], 1)[None], waves)
    result = list(frame)
    result[one], result[other] = columns[0], columns[1]
    return result


# --- the arm


class Exact:
    """A rotation as rows of fractions, off by less than `error` in each; its errors grow with every product."""

    def __init__(self, rows, error=0.0):
        self.rows, self.error = rows, error

    def times(self, other):
        rows = [[sum(self.rows[i][k] * other.rows[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
        return Exact(rows, 4 * (self.error + other.error))

    def transposed(self):
        return Exact([list(column) for column in zip(*self.rows)], self.error)

    def turns(self, vector):
        """The vector turned, as entries."""
        size = sum(abs(x) for x in vector)
        return [entry(sum(a * Fraction(x) for a, x in zip(row, vector)), self.error * size) for row in self.rows]

    def columns(self):
        return [[entry(self.rows[row][column], self.error) for row in range(3)] for column in range(3)]

    def is_permutation(self):
        return self.error == 0.0 and all(abs(x) in (0, 1) for row in self.rows for x in row)


def entry(fraction, error):
    value = float(fraction)
    return Entry(value, error * (1 + 1e-9) if Fraction(value) == fraction else error * (1 + 1e-9) + 3e-16 * abs(value) + 1e-300)


def rotation_of(quaternion):
    """The rotation of a quaternion (x, y, z, w) of any length."""
    x, y, z, w = (Fraction(float(part)) for part in quaternion)
    square = x * x + y * y + z * z + w * w
    if square == 0:
        raise Refused("a quaternion is nought")
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return Exact([[value / square for value in row] for row in rows])


STRAIGHT = Exact([[Fraction(int(i == j)) for j in range(3)] for i in range(3)])
# More than rounding leaves of a frame that is built about a direction.
OBLIQUE = 1e-14


def frame_about(direction):
    """A rotation that turns the z axis to a direction."""
    z = np.array(direction) / np.linalg.norm(direction)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    columns = [x, np.cross(z, x), z]
    return Exact([[Fraction(float(column[row])) for column in columns] for row in range(3)], OBLIQUE)


class Arm:
    """Links whose joints turn about coordinate axes, in frames that are parallel at zero angle where that is exact."""

    def __init__(self, arm):
        self.offset, self.rotation, self.axis, self.sign, self.range = [], [], [], [], []
        frame = STRAIGHT
        if "springs" in arm or any("slides" in joint or "held_at" in joint for joint in arm["joints"]):
            raise Unknown("arms with springs beside the joints' own, slides or passive joints")
        self.tool_joints = arm["tool_joints"]
        if not 0 < self.tool_joints <= len(arm["joints"]):
            raise Refused("the tool is moved by joints that there are not")
        for index, joint in enumerate(arm["joints"]):
            before = frame.transposed()
            turn = before.times(rotation_of(joint["rotation"]))
            axis = [float(x) for x in joint["axis"]]
            along = [k for k in range(3) if axis[k] != 0.0]
            if not along:
                raise Refused("a joint has no axis")
            self.offset.append(before.turns([float(x) for x in joint["offset_m"]]))
            if len(along) == 1 and turn.is_permutation():
                frame, rotation = turn.transposed(), None
                axis = [each.value for each in turn.turns(axis)]
                along = [k for k in range(3) if axis[k] != 0.0]
            elif len(along) == 1:
                frame, rotation = STRAIGHT, turn.columns()
            else:
                frame = frame_about(axis)
                rotation, axis, along = turn.times(frame).columns(), [0.0, 0.0, 1.0], [2]
            self.rotation.append(rotation)
            self.axis.append(along[0])
            self.sign.append(1.0 if axis[along[0]] > 0 else -1.0)
            self.range.append([float(x) for x in joint["range_rad"]])
            if index + 1 == self.tool_joints:
                here = frame.transposed()
                self.tool = here.turns([float(x) for x in arm["tool_offset_m"]])
                self.tool_axis = [column[2] for column in transposed(here.times(rotation_of(arm["tool_rotation"])).columns())]

    def set_runs(self, starts):
        """Joints in a run have parallel axes; variables are the sums of their angles."""
        if len(starts) not in (self.tool_joints, len(self.axis)) or not all(isinstance(each, bool) for each in starts):
            raise Refused("the file names runs of other joints")
        for joint, start in enumerate(starts):
            is_new = joint == 0 or self.axis[joint] != self.axis[joint - 1] or self.rotation[joint] is not None
            if not start and is_new:
                raise Refused("joints that are not parallel make up a run")
        self.runs = starts

    def starts_run(self, joint):
        return self.runs[joint]


TWO_PI = 2 * math.pi * (1 + 1e-15)


def check_domain(question, arm, part):
    """The file's ranges hold every angle that matters. Left out may be
    - the first joint's angle, about a vertical axis, if the load is vertical or of any direction;
    - the last joint's angle, if it moves neither the tool nor its z axis where that is limited;
    - full turns;
    - one of the two ways in which a wrist (axes a b a through a line along a) reaches a pose: the middle angle's sign;
    - one of two mirror images, where the arm lies in a plane and the load in it or across it: one reversed angle's sign.
    """
    variables, ranges = part["variables"], part["ranges"]
    region, wrench = question["region"], part["wrench"]
    count = arm.tool_joints
    if len(variables) != count or len(part["starts_run"]) != count:
        raise Refused("the file names variables for other joints")
    upright = region["elevation_sine"] is not None

    def is_still(joint):
        vertical = wrench is None or all(wrench[k] == 0.0 for k in (0, 1, 3, 4))
        if joint == 0 and arm.axis[0] == 2 and arm.rotation[0] is None and vertical:
            return True
        if joint != count - 1:
            return False
        vectors = [arm.tool] + ([arm.tool_axis] if upright else [])
        return all(v[k].is_nought() for v in vectors for k in range(3) if k != arm.axis[joint])

    signed = []
    for joint in range(count):
        low, high = arm.range[joint]
        signed.append((low, high) if arm.sign[joint] > 0 else (-high, -low))
    free = [high - low >= TWO_PI for low, high in signed]
    needed, differences, seen = {}, {}, 0
    for joint in range(count):
        variable = variables[joint]
        before = None if arm.starts_run(joint) else variables[joint - 1]
        if is_still(joint) and variable == before:
            continue
        if variable != seen:
            raise Refused(f"joint {joint + 1} has no variable of its own")
        seen += 1
        low, high = signed[joint]
        if free[joint]:
            needed[variable] = (-TWO_PI / 2, TWO_PI / 2)
        elif before is None:
            needed[variable] = (low, high)
        else:
            first = ranges[before]
            # Limits may only be left out: they help the prover.
            needed[variable] = (min(first[0], needed[before][0]) + low - 1e-12, max(first[1], needed[before][1]) + high + 1e-12)
            differences[(variable, before)] = (low, high)
    if seen != len(ranges):
        raise Refused("there are variables that stand for nothing")
    for later, earlier, limits in part["differences"]:
        if tuple(limits) != differences.get((later, earlier)):
            raise Refused("a limit of two angles' difference is not that of the arm")
    halved = []
    for variable, (low, high) in enumerate(ranges):
        least, most = needed[variable]
        if low == 0.0 and least < 0.0 and high >= most:
            halved.append(variable)
        elif not (low <= least and high >= most):
            raise Refused(f"variable {variable} does not cover its joint's range")
    joint_of = {}
    for joint in range(count):
        if variables[joint] is not None:
            joint_of.setdefault(variables[joint], joint)

    def symmetric(joint):
        return variables[joint] is None or free[joint] or signed[joint][0] == -signed[joint][1]

    def is_wrist(k):
        if k < 0 or k + 2 >= count:
            return False
        a, b, c = arm.axis[k : k + 3]
        along = all(arm.offset[j][i].is_nought() for j in (k + 1, k + 2) for i in range(3) if i != a)
        along = along and arm.rotation[k + 1] is None and arm.rotation[k + 2] is None
        return a == c != b and along and free[k] and free[k + 2] and symmetric(k + 1) and variables[k] is not None and variables[k + 2] is not None

    def is_mirror(across, variable):
        flat = all(v[across].is_nought() for v in arm.offset[:count] + [arm.tool, arm.tool_axis])
        flat = flat and all(rotation is None for rotation in arm.rotation[:count])
        if wrench is None:
            loads = True
        else:
            force, torque = wrench[:3], wrench[3:]
            other = [k for k in range(3) if k != across]
            loads = (all(force[k] == 0.0 for k in other) and torque[across] == 0.0) or (
                force[across] == 0.0 and all(torque[k] == 0.0 for k in other)
            )
        reversed_joints = [j for j in range(count) if arm.axis[j] != across]
        return flat and loads and all(map(symmetric, reversed_joints)) and joint_of[variable] in reversed_joints

    wrists = [v for v in halved if is_wrist(joint_of[v] - 1)]
    if len(halved) > 2:
        raise Refused("more is left out than symmetries repeat")
    for order in ([], halved[:1], halved[1:2]):
        # At most one by the wrist, which the mirror must not reverse, and one by a mirror.
        rest = [v for v in halved if v not in order]
        if any(v not in wrists for v in order) or len(rest) > 1:
            continue
        mirrors = [
            across
            for across in (0, 1)
            if all(is_mirror(across, v) for v in rest) and all(arm.axis[joint_of[v]] == across for v in order)
        ]
        if not rest or mirrors:
            return
    raise Refused("a range is halved that no symmetry repeats")


def enclose(question, arm, part, boxes):
    """What gives d (or the form whose largest eigenvalue it is), when it is called, and such functions of the margins."""
    variables, middle = part["variables"], part["middle"]
    count = len(variables)
    waves = [boxes.sine_cosine(v) for v in range(len(part["ranges"]))]
    angle = [None if v is None else waves[v] for v in variables]
    home = [constant([float(k == row) for row in range(3)]) for k in range(3)]
    axes, anchors = [None] * count, [None] * count
    tool = tool_axis = None
    frame, origin, run = home, NOUGHT, home
    if middle == arm.tool_joints:
        tool, tool_axis = in_frame(frame, arm.tool), in_frame(frame, arm.tool_axis)
    for joint in range(middle, count):
        origin = origin + in_frame(frame, arm.offset[joint])
        frame = turned_by(frame, arm.rotation[joint])
        if arm.starts_run(joint) or joint == middle:
            run = frame
        anchors[joint] = origin
        axes[joint] = run[arm.axis[joint]].scaled(arm.sign[joint])
        if angle[joint] is not None:
            frame = turned(run, arm.axis[joint], *angle[joint])
        if joint + 1 == arm.tool_joints:
            tool, tool_axis = origin + in_frame(frame, arm.tool), in_frame(frame, arm.tool_axis)
    frame, origin, end = home, NOUGHT, middle
    while end > 0:
        first = end - 1
        while not arm.starts_run(first):
            first -= 1
        axis = arm.axis[first]
        run = frame if angle[end - 1] is None else turned(frame, axis, *angle[end - 1], back=True)
        for joint in range(end - 1, first - 1, -1):
            anchors[joint] = origin
            axes[joint] = run[axis].scaled(arm.sign[joint])
            if joint == first:
                here = turned_by(run, transposed(arm.rotation[first]))
            else:
                here = run if angle[joint - 1] is None else turned(run, axis, *angle[joint - 1])
            origin = origin - in_frame(here, arm.offset[joint])
        frame, end = here, first
    up = frame[2]
    levers = [cross(axes[j], tool - anchors[j]) for j in range(arm.tool_joints)]
    margins = []
    region = question["region"]
    low, high = region["height_m"]
    if low is not None or high is not None:
        height = functools.cache(lambda: summed(up, tool - origin))
        margins += [lambda: height().shifted(-low)] if low is not None else []
        margins += [lambda: (-height()).shifted(high)] if high is not None else []
    near, far = region["radius_m"]
    if near is not None or far is not None:
        squared = functools.cache(lambda: summed(levers[0], levers[0]))
        margins += [lambda: squared().shifted(-near * near)] if near is not None else []
        margins += [lambda: (-squared()).shifted(far * far)] if far is not None else []
    if region["elevation_sine"] is not None:
        rise = functools.cache(lambda: summed(up, tool_axis))
        sine = region["elevation_sine"]
        margins += [lambda: rise().shifted(sine), lambda: (-rise()).shifted(sine)]
    force = torque = None
    if part["wrench"] is not None:
        force, torque = (in_frame(frame, [Entry(float(x)) for x in part["wrench"][k : k + 3]]) for k in (0, 3))
    for later, earlier, limits in part["differences"]:
        margins += difference_margins(boxes, later, earlier, limits)
    if part["wrench"] is None:
        return lambda: form(question, levers), margins
    # Nothing turns about the vertical under a vertical force.
    fx, fy, _, _, _, tz = part["wrench"]
    upright = arm.rotation[0] is None and arm.axis[0] == 2
    silent = [0] if upright and fx == fy == tz == 0 else []
    return lambda: derivative(question, axes, levers, (force, torque), silent), margins


def difference_margins(boxes, later, earlier, limits):
    low, high = limits
    difference = functools.cache(lambda: boxes.coordinate(later) - boxes.coordinate(earlier))
    return [lambda: difference().shifted(-low), lambda: (-difference()).shifted(high)]


def derivative(question, axes, levers, load, silent):
    """d: the sum over rows of |sum of b tau J|^2, or of these by their covariance."""
    rows, parameters = question["rows"], question["parameters"]
    rows = np.array(rows, float).reshape(len(rows), len(parameters))
    moved = [index for index, joint in enumerate(parameters) if joint < len(levers) and joint not in silent]
    if not moved:
        return constant(0.0)
    own_levers = stacked([levers[parameters[index]] for index in moved])
    own_axes = stacked([axes[parameters[index]] for index in moved])
    moments = summed(own_levers, load[0])
    if load[1] is not NOUGHT:
        moments = moments + summed(own_axes, load[1])
    shares = times(own_levers, moments[:, None])
    if question.get("spread") is not None:
        columns, returns = noise_columns(question, axes, levers, load)
        return weighted(question, rows[:, moved], [parameters[index] for index in moved], moments, shares, columns, returns)
    return squares_of_rows(rows[:, moved], shares)


def squares_of_rows(rows, shares):
    """The sum over rows of |sum of b v|^2, with v = p + e about polynomials p and y = sum of b p: |y|^2 + 2 e . w + |sum of b e|^2, w the
    sum over rows of b y, in which rows may cancel."""
    polynomials = Model(shares.variables, shares.coefficients, np.zeros_like(shares.r), shares.rough)
    sums = combined(rows, polynomials)
    weights = combined(rows.T, sums)
    off = 2 * (shares.r * (weights.size + weights.r)).sum((0, 1))
    off += (np.einsum("rk,kin->rin", np.abs(rows) * (1 + 4e-16), shares.r) ** 2).sum((0, 1))
    total = sum_of_squares(sums)
    # Roundings of what is not negative, of more terms than there are here.
    total.r = total.r + off * (1 + roundings(rows.size, 3))
    return total


def sum_of_squares(models):
    """The sum of the squares of all components."""
    every = models.flat()
    return summed(every, every)


def reaches_m(arm):
    """How far from each joint's axis the tool can be at most."""
    length = lambda v: math.sqrt(sum(x * x for x in v))
    reach, reaches = length(arm["tool_offset_m"]), [0.0] * len(arm["joints"])
    for joint in reversed(range(arm["tool_joints"])):
        reaches[joint] = reach
        reach += length(arm["joints"][joint]["offset_m"])
    return reaches


def noise_columns(question, axes, levers, load):
    """The columns g of a covariance s I + sum of g g^T, as an axis of three by one of columns: joints' returns; the load's turns
    and shifts, whose effect on a joint's torque is F x J + T x z and F x z, times the compliances. And where those of joints are
    that return notably."""
    spread = question["spread"]
    columns, returns = [], {}
    reaches = reaches_m(question["arm"])
    for joint, (lever, deviation) in enumerate(zip(levers, spread["joint_repeatability"])):
        if deviation:
            if deviation * reaches[joint] > NOTABLE * math.sqrt(spread["everywhere"]):
                returns[joint] = len(columns)
            columns.append(lever.scaled(deviation))
    force, torque = load
    for name in ("turned", "shifted"):
        deviation = spread[name]
        if not deviation:
            continue
        moments = []
        for lever, axis in zip(levers, axes):
            moment = cross(force, lever if name == "turned" else axis)
            moments.append(moment + cross(torque, axis) if name == "turned" and torque is not NOUGHT else moment)
        follows = [lever.scaled(k * deviation) for lever, k in zip(levers, spread["compliance_rad_per_nm"])]
        # Sums over joints: (part, component).
        follows = summed(stacked(follows, 1)[None], stacked(moments, 1)[:, None])
        columns += [follows[part] for part in range(3)]
    return columns, returns


def weighted(question, rows, joints, moments, shares, columns, returns):
    """A bound of the sum of v^T R^-1 v with R = s I + G G^T, each v = v0 + G a: |v0 + G e|^2 / s + |a - e|^2 for any e, here a
    linear function of the coordinates. It is the best one at the centre with its slopes there, for a larger unit the more G changes
    over the box. A joint's share of v is b times its torque times its lever, of which a column of G is a multiple where it returns,
    or else it is in v0."""
    everywhere, deviations = question["spread"]["everywhere"], question["spread"]["joint_repeatability"]
    if not (math.isfinite(everywhere) and everywhere > 0):
        raise Refused("the covariance is no covariance")
    back = [index for index, joint in enumerate(joints) if joint in returns]
    still = [index for index in range(len(joints)) if index not in back]
    rest = combined(rows[:, still], shares[still])
    returned = [returns[joints[index]] for index in back]
    factors = rows[:, back] / np.array([deviations[joints[index]] for index in back])
    factors = times(constant(factors, 4e-16 * np.abs(factors)), moments[back])
    columns = stacked(columns, 1)
    variables = union(rest, factors, columns)
    rest, factors, columns = (each.of(variables) for each in (rest, factors, columns))
    chosen = best_linear(everywhere, rest, factors, columns, returned)
    # Whatever the numbers in `chosen` are, they are exactly what e is.
    total = sum_of_squares(rest + summed(chosen[:, None], columns[None])).scaled(1 / everywhere, 1e-15 / everywhere)
    others = [q for q in range(columns.r.shape[1]) if q not in returned]
    return total + sum_of_squares(factors - chosen[:, returned]) + sum_of_squares(chosen[:, others])


def best_linear(everywhere, rest, factors, columns, returned):
    """For each row and column of G what is best at the boxes' centres, with its slopes there."""

    def expanded(models):
        n = len(models.variables)
        return models.c - models.coefficients[..., 1 + n : 1 + 2 * n, :].sum(-2), models.g

    (values, slopes), offs = expanded(columns), columns.bend + columns.r
    ridge = 1 + RIDGE * ((slopes**2).sum((0, 2)) / 3 + (offs**2).sum(0)) / everywhere
    covariance = everywhere * np.eye(3) + np.einsum("iqn,kqn->nik", values / ridge, values)
    inverse = np.linalg.inv(np.where(np.isfinite(covariance), covariance, np.eye(3)))
    inverse = np.ascontiguousarray(np.moveaxis(inverse, 0, 2))

    def solved(y):
        """(ridge + G^T G / s)^-1 of vectors: (rows, columns of G, any number, boxes)."""
        z = y / ridge[:, None]
        pull = np.einsum("ikn,rkmn->rimn", inverse, np.einsum("kqn,rqmn->rkmn", values, z))
        return z - np.einsum("iqn,rimn->rqmn", values, pull) / ridge[:, None]

    value, slope = expanded(rest)
    shape = (len(value), *slopes.shape[1:])
    a, a_slope = np.zeros((*shape[:2], shape[3])), np.zeros(shape)
    a[:, returned], a_slope[:, returned] = expanded(factors)
    e = solved((a - np.einsum("iqn,rin->rqn", values, value) / everywhere)[:, :, None])[:, :, 0]
    left = value + np.einsum("iqn,rqn->rin", values, e)
    moved = slope + np.einsum("iqjn,rqn->rijn", slopes, e)
    turning = np.einsum("iqjn,rin->rqjn", slopes, left) + np.einsum("iqn,rijn->rqjn", values, moved)
    steepness = solved(a_slope - turning / everywhere)
    n = shape[2]
    chosen = np.zeros((*shape[:2], columns.coefficients.shape[-2], shape[3]))
    chosen[:, :, 0], chosen[:, :, 1 : 1 + n] = e, steepness
    return Model(columns.variables, chosen, np.zeros(e.shape), np.abs(chosen).sum(2), is_linear=True)


# The entries of a symmetric matrix that are told, and where each of all nine is among them.
UPPER = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])
SYMMETRIC = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]


def form(question, levers):
    """The entries of Q with d = F^T Q F: the sum over rows of W^T W, W = sum b J J^T, times the force squared."""
    size = question["loads"]["any_force"]
    rows, parameters = question["rows"], question["parameters"]
    rows = np.array(rows, float).reshape(len(rows), len(parameters))
    moved = [index for index, joint in enumerate(parameters) if joint < len(levers)]
    if not size or not moved:
        return constant([0.0] * 6)
    own = stacked([levers[parameters[index]] for index in moved])
    w = combined(rows[:, moved] * size, times(own[:, UPPER[0]], own[:, UPPER[1]]))[:, SYMMETRIC]
    columns = stacked([w[:, :, k].flat() for k in range(3)])
    return summed(columns[UPPER[0]], columns[UPPER[1]])


def largest_eigenvalue(q, threshold):
    """A scalar model whose largest value bounds the largest eigenvalue of Q, if that is above the threshold."""
    n = len(q.variables)
    centre = np.moveaxis((q.c - q.coefficients[:, 1 + n : 1 + 2 * n].sum(1))[SYMMETRIC], 2, 0)
    good = np.isfinite(centre).all((1, 2))
    _, vectors = np.linalg.eigh(np.where(good[:, None, None], centre, 0.0))
    u = vectors[:, :, ::-1]
    off = np.abs(np.einsum("nki,nkj->nij", u, u) - np.eye(3)).max((1, 2)) + 1e-15
    good &= off < 1e-13
    u = np.ascontiguousarray(np.moveaxis(u, 0, 2))
    factor, wide = np.zeros((2, 6, 6, len(good)))
    for out, (i, j) in enumerate(zip(*UPPER)):
        for k in range(3):
            for l in range(3):
                factor[out, SYMMETRIC[k][l]] += u[k, i] * u[l, j]
                wide[out, SYMMETRIC[k][l]] += np.abs(u[k, i] * u[l, j])
    sizes = q.size + q.r
    # What the columns of u lack to be orthonormal, and what their products are rounded by.
    r = np.einsum("oin,in->on", wide, q.r) + 1e-12 * (sizes.sum(0) + sizes[3:].sum(0))
    turned_q = Model(q.variables, np.einsum("oin,iqn->oqn", factor, q.coefficients), r, np.einsum("oin,in->on", wide, q.rough))
    size = turned_q.size + turned_q.r
    least = threshold * (1 - 1e-12) - (np.maximum(size[1], size[2]) + size[5]) * (1 + ROUNDING)
    good &= least > 0
    inverse = np.where(good, (1 + ROUNDING) / np.where(least > 0, least, 1.0), 0.0)
    model = turned_q[0] + sum_of_squares(turned_q[3:5]).scaled(inverse)
    model.r = np.where(good, model.r, np.inf)
    return model


# --- the tree

# What stands in place of a margin's number.
DERIVATIVE = -1


def leaves(part):
    """The boxes that are done with: centre, half-widths, margin that is negative (or -1), multipliers."""
    ranges = part["ranges"]
    n = len(ranges)
    text = part["tree"]
    digits = "0123456789abcdef"
    centre = [low + (high - low) / 2 for low, high in ranges]
    half = [(high - low) / 2 for low, high in ranges]
    for (low, high), c, h in zip(ranges, centre, half):
        # All on the grid of the prover: halving rounds nothing.
        for value in (low, high):
            if not abs(value) < 64 or value * 2**20 != math.floor(value * 2**20):
                raise Refused("a range is not on the grid")
    stack = [(tuple(centre), tuple(half))]
    place = 0

    def digit(base=16):
        nonlocal place
        if place >= len(text) or text[place] not in digits[:base]:
            raise Refused("the tree is cut off or spoilt")
        place += 1
        return digits.index(text[place - 1])

    while stack:
        c, h = stack.pop()
        if place >= len(text):
            raise Refused("the tree is cut off")
        kind = text[place]
        if kind == ".":
            place += 1
            yield c, h, -1, []
        elif kind == "x":
            place += 1
            yield c, h, 16 * digit() + digit(), []
        elif kind == "m":
            place += 1
            multipliers = []
            for _ in range(digit()):
                margin = 16 * digit() + digit()
                bits = 0
                for _ in range(6):
                    bits = 16 * bits + digit()
                value = np.array([bits << 40], np.uint64).view(np.float64)[0]
                if not (value >= 0 and np.isfinite(value)):
                    raise Refused("a multiplier is negative")
                multipliers.append((margin, float(value)))
            yield c, h, -1, multipliers
        else:
            j = digit()
            if j >= n:
                raise Refused("a variable is halved that there is not")
            width = list(h)
            width[j] /= 2
            for side in (1, -1):
                where = list(c)
                where[j] += side * width[j]
                if width[j] < 2**-31 or abs(where[j] - c[j]) != width[j]:
                    raise Refused("a box is too small")
                stack.append((tuple(where), tuple(width)))
    if place != len(text):
        raise Refused("the tree goes on behind its end")


def check_batch(question, arm, part, threshold, kind, batch):
    """Which boxes of a batch do not hold as they are, with the variable to halve: by d and multipliers, or by the margin that they
    name; if the batch is of a margin's kind, by that alone."""
    boxes = Boxes(*(np.array([box[k] for box in batch]).T.copy() for k in (0, 1)))
    derivative, margins = enclose(question, arm, part, boxes)
    if any(box[2] >= len(margins) or any(k >= len(margins) for k, _ in box[3]) for box in batch):
        raise Refused("a margin is named that there is not")
    holds, share = np.zeros(len(batch), bool), np.zeros(boxes.half.shape)
    if kind == DERIVATIVE:
        total = derivative() if part["wrench"] is not None else largest_eigenvalue(derivative(), threshold)
        weights = np.zeros((len(margins), len(batch)))
        for index, box in enumerate(batch):
            for k, value in box[3]:
                weights[k, index] += value
        for k in np.flatnonzero(weights.any(1)):
            total = total + margins[k]().scaled(weights[k])
        holds |= total.largest() <= threshold
        left = np.flatnonzero(~holds)
        if total.variables and len(left):
            holds[left] = total.of_boxes(left).largest_of_concave() <= threshold
        share[list(total.variables)] = total.shares()
        share += boxes.half * (np.abs(total.r) / boxes.half.sum(0))
        share = np.where(np.isfinite(share), share, 0.0)
    excluded = np.array([box[2] for box in batch])
    for k in sorted({*excluded.tolist()} - {DERIVATIVE}):
        margin, named = margins[k](), excluded == k
        holds |= named & (margin.largest() < 0)
        moved = 1e-9 * boxes.half
        moved[list(margin.variables)] += margin.shares()
        share = np.where(named, moved, share)
    return np.flatnonzero(~holds), np.argmax(share, 0)


def next_batch(source, queues):
    """A kind, some boxes of it, and how many of them were read. Those that name a margin stand apart, and are judged by that alone: it
    costs a fraction of d."""
    given = 0
    while all(len(queue) < BATCH for queue in queues.values()):
        box = next(source, None)
        if box is None:
            break
        given += 1
        queues.setdefault(box[2], []).append(box)
    kind = max(queues, key=lambda each: len(queues[each]), default=DERIVATIVE)
    queue = queues.pop(kind, [])
    if len(queue) > BATCH:
        queues[kind] = queue[:-BATCH]
    return kind, queue[-BATCH:], given


def halves_of(box, j):
    centre, half, margin, multipliers = box
    width = list(half)
    width[j] /= 2
    if width[j] < 1e-7:
        raise Refused(f"a box about {list(centre)} does not hold")
    for side in (1, -1):
        where = list(centre)
        where[j] += side * width[j]
        yield tuple(where), tuple(width), margin, multipliers


def check_part(question, arm, part, threshold):
    arm.set_runs(part["starts_run"])
    check_domain(question, arm, part)
    if not 0 <= part["middle"] <= arm.tool_joints:
        raise Refused("there is no such middle")
    if part["middle"] < len(part["variables"]) and not arm.starts_run(part["middle"]):
        raise Unknown("the middle stands inside a run")
    looks, given, source, queues, running = 0, 0, leaves(part), {}, collections.deque()
    # NumPy lets other threads work while it does. Batches are made and taken in an order that does not depend on them.
    pool = concurrent.futures.ThreadPoolExecutor(WORKERS)
    try:
        while True:
            while len(running) < WINDOW:
                kind, batch, read = next_batch(source, queues)
                given += read
                looks += len(batch)
                if looks > PATIENCE * given + 100:
                    raise Refused("a box does not hold, however small it is cut")
                if not batch:
                    break
                running.append((batch, pool.submit(check_batch, question, arm, part, threshold, kind, batch)))
            if not running:
                return given, looks
            batch, found = running.popleft()
            open_boxes, variables = found.result()
            for index in open_boxes:
                queues.setdefault(DERIVATIVE, []).extend(halves_of(batch[index], variables[index]))
    finally:
        pool.shutdown(cancel_futures=True)


# --- the bound of rho_0


def target_columns(target, parameters):
    axes, levers = pose(target)
    force, torque = np.array(target["wrench"][:3]), np.array(target["wrench"][3:])
    return [levers[joint] * (levers[joint] @ force + axes[joint] @ torque) for joint in parameters]


def pose(target):
    """The axis of each joint, and how it moves the tool: nought for those that do not."""
    arm = Arm(target["arm"])
    frame = np.eye(3)
    number = lambda vector: np.array([each.value for each in vector])
    origin = np.zeros(3)
    axes, anchors = [], []
    tool = None
    for joint in range(len(arm.axis)):
        origin = origin + frame @ number(arm.offset[joint])
        if arm.rotation[joint] is not None:
            frame = frame @ np.column_stack([number(column) for column in arm.rotation[joint]])
        a = np.zeros(3)
        a[arm.axis[joint]] = arm.sign[joint]
        axes.append(frame @ a)
        anchors.append(origin)
        angle = arm.sign[joint] * target["configuration_rad"][joint]
        s, c = math.sin(angle), math.cos(angle)
        one, other = (arm.axis[joint] + 1) % 3, (arm.axis[joint] + 2) % 3
        turn = np.eye(3)
        turn[one, one] = turn[other, other] = c
        turn[other, one], turn[one, other] = s, -s
        frame = frame @ turn
        if joint + 1 == arm.tool_joints:
            tool = origin + frame @ number(arm.tool)
    moved = range(len(axes))
    return axes, [np.cross(axes[j], tool - anchors[j]) if j < arm.tool_joints else np.zeros(3) for j in moved]


def prior_share(file):
    """trace(B P B^T) for the precision P of what is known before."""
    precision = file["prior_precision"]
    if precision is None:
        return 0.0
    rows = np.array(file["proof"]["question"]["rows"], float) * file["sigma_m"]
    precision = np.array(precision, float)
    if precision.shape != (rows.shape[1],) * 2 or not np.isfinite(precision).all():
        raise Refused("what is known before is about other compliances")
    values = np.linalg.eigvalsh(precision)
    if np.abs(precision - precision.T).max() > 1e-9 * np.abs(precision).max() or values[0] < -1e-9 * abs(values[-1]):
        raise Refused("what is known before is no precision")
    return float(np.einsum("ri,ij,rj->", rows, precision, rows)) * (1 - 1e-9)


def check_bounds(file):
    question = file["proof"]["question"]
    rows, parameters = question["rows"], question["parameters"]
    weights = [target["weight"] for target in file["targets"]]
    if not (all(weight > 0 for weight in weights) and abs(sum(weights) - 1) <= 1e-12):
        raise Refused("the weights of the test poses do not sum to one")
    trace, size, index = 0.0, 0.0, 0
    links = lambda arm: [{key: value for key, value in joint.items() if key != "range_rad"} for joint in arm["joints"]]
    for target in file["targets"]:
        if links(target["arm"]) != links(question["arm"]):
            raise Refused("the arm of a test pose is another than that of the loads")
        columns = target_columns(target, parameters)
        # Along a direction n, which has one row b: the sum of n_k b . C_k, times no more than a unit vector.
        direction = target.get("direction")
        if direction is not None and abs(math.hypot(*direction) - 1) > 1e-14:
            raise Refused("a direction is no unit vector")
        for k in range(3):
            share = math.sqrt(target["weight"]) * (1 if direction is None else direction[k])
            for factor, column in zip(rows[index], columns):
                trace += factor * column[k] * share
                size += abs(factor) * float(np.abs(column).sum()) * math.sqrt(target["weight"])
            index += direction is None or k == 2
    # Fewer than 1000 roundings of terms within `size`.
    trace = abs(trace) - 2e-13 * size
    length = lambda v: math.sqrt(sum(x * x for x in v))
    reaches = reaches_m(question["arm"])
    unit = sum(sum(abs(b) * (reaches[n] + 1) * reaches[n] for b, n in zip(row, parameters)) ** 2 for row in rows)
    spread = question.get("spread")
    unit = math.sqrt(unit / (1.0 if spread is None else spread["everywhere"]))
    loads = question["loads"]
    if "one_of" in loads:
        strongest = max(length(w[:3]) + length(w[3:]) for w in loads["one_of"])
    else:
        strongest = loads["any_force"]
    printed = min(0.05 * math.sqrt(3), 1e-3 * strongest)
    if file["printed"] < printed * (1 - 1e-9):
        raise Refused("loads that are printed alike are left out")
    most = (math.sqrt(file["proof"]["largest"]) + file["printed"] * unit) ** 2
    prior, told = file["prior"], prior_share(file)
    if not prior >= told >= 0:
        raise Refused("what is known before tells more than the file has it")
    for m, rho0 in file["bounds"]:
        total = prior + m * most
        bound = file["sigma_m"] * max(trace, 0.0) / math.sqrt(total)
        if m < 0 or not rho0 <= bound * (1 + 1e-9):
            raise Refused(f"the bound for {m} measurements does not follow")


def no_number(text):
    raise Refused(f"{text} is no number")


def finite(text):
    return float(text) if math.isfinite(float(text)) else no_number(text)


def read(text):
    # What is no number is neither above nor below anything, and would pass any comparison.
    return json.loads(text, parse_constant=no_number, parse_float=finite)


def listed(values, digits=1, unit=1.0):
    return ", ".join("any" if value is None else f"{value * unit:.{digits}f}" for value in values)


def asked(file):
    """The question that is answered, in lines."""
    question, sigma = file["proof"]["question"], file["sigma_m"]
    lines = []
    if "provenance" in file:
        about = file["provenance"]
        lines.append(f"scenario {about['scenario']}, SHA-256 {about['scenario_sha256']}, as the file says")
    for number, target in enumerate(file["targets"], 1):
        angles = listed(target["configuration_rad"], 3, 180 / math.pi)
        line = f"test pose {number}: [{angles}] deg under [{listed(target['wrench'])}] N, N m, weight {target['weight']:.4f}"
        along = target.get("direction")
        lines.append(line if along is None else f"{line}, along [{listed(along, 4)}]")
    kinds = {"one_of": "one of {} N, N m", "any_force": "any force up to {} N"}
    for kind, loads in question["loads"].items():
        wrenches = loads if kind == "one_of" else []
        words = " ".join(f"[{listed(each)}]" for each in wrenches) or f"{loads:.1f}"
        lines.append("loads: " + kinds[kind].format(words))
    ranges = " ".join(f"[{listed(joint['range_rad'], 2, 180 / math.pi)}]" for joint in question["arm"]["joints"])
    lengths = [1e3 * math.hypot(*joint["offset_m"]) for joint in question["arm"]["joints"]]
    lines.append(f"arm: links of {listed(lengths, 3)} mm, each from the joint before")
    region = question["region"]
    lines.append(f"region: joints {ranges} deg")
    lines.append(
        f"  height [{listed(region['height_m'], 4)}] m, radius [{listed(region['radius_m'], 4)}] m, "
        f"sine of the elevation [{listed([region['elevation_sine']], 6)}]"
    )
    more = ", and more in each reading" if question.get("spread") is not None else ""
    lines.append(f"sigma of each coordinate of a deflection {sigma * 1e6:.3f} um{more}")
    lines.append(f"compliances of joints {', '.join(str(joint + 1) for joint in question['parameters'])}")
    if file["prior_precision"] is not None:
        lines.append("what is known of the compliances before has a part in it")
    if file["left_out"]:
        lines.append(f"assumed exact: {', '.join(file['left_out'])}")
    return lines


def check(file):
    """What is asked and what is proved, in lines."""
    if "prior_precision" not in file:
        raise Unknown("the file lacks prior_precision: a program of today writes it")
    proof = file["proof"]
    question, threshold = proof["question"], proof["largest"]
    if question.get("rotation_scale_m"):
        raise Unknown("measured rotations")
    arm = Arm(question["arm"])
    if not (math.isfinite(threshold) and threshold > 0):
        raise Refused("the threshold is no number")
    loads = question["loads"]
    parts = proof["parts"]
    if "one_of" in loads:
        proved = [part["wrench"] for part in parts]
        for wrench in loads["one_of"]:
            if wrench not in proved and [-x for x in wrench] not in proved:
                raise Refused(f"there is no proof for the load {wrench}")
    elif "any_force" in loads:
        if [part["wrench"] for part in parts] != [None]:
            raise Refused("there is no proof for forces of any direction")
    else:
        raise Unknown("loads of this kind")
    lines = asked(file)
    for part in parts:
        given, looks = check_part(question, arm, part, threshold)
        lines.append(f"{given} boxes hold ({looks} looks)")
    check_bounds(file)
    for m, best in file["bounds"]:
        lines.append(f"no plan of {m} measurements has rho0 below {best * 1e6:.4f} um")
    return lines


def verdict(content):
    """The exit code, and what is said of a file with this content (bytes)."""
    try:
        return 0, [*check(read(content.decode("utf-8"))), "the proof holds"]
    except Refused as error:
        return 1, [f"refused: {error}"]
    except Unknown as error:
        return 2, [f"cannot be checked here: {error}"]
    # Numbers beyond any, and nesting without an end, are found by the reading of them.
    except (KeyError, TypeError, IndexError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        return 1, [f"refused: the file is no proof ({type(error).__name__}: {error})"]


def main():
    if len(sys.argv) != 2:
        print(__doc__.split("\n\n")[1], file=sys.stderr)
        return 2
    try:
        with open(sys.argv[1], "rb") as source:
            content = source.read()
    except OSError as error:
        print(f"refused: the file cannot be read ({error})")
        return 1
    code, lines = verdict(content)
    print("\n".join(lines))
    return code


if __name__ == "__main__":
    sys.exit(main())
