"""Vectors, rotations and chance with the same bits on every machine and Python.

Only +, −, ×, ÷ and √ are used, which IEEE 754 rounds exactly. Kept out: libm's sine (its last bit differs between
machines) and the builtin `sum` of floats (compensated since Python 3.12). Vectors are tuples, quaternions (x, y, z, w).
"""

import math
import random

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
NO_TURN = (0.0, 0.0, 0.0, 1.0)
_TAYLOR_TERMS = 9  # of sine and cosine each: the next term is below 1e-17 for an eighth of a turn


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a, factor):
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a):
    return math.sqrt(dot(a, a))


def unit(a):
    size = length(a)
    return (a[0] / size, a[1] / size, a[2] / size)


def mix(a, b, t):
    return a + (b - a) * t


def sin_cos(degrees):
    """Sine and cosine, exact at multiples of 90 degrees."""
    quarters = round(degrees / 90)
    angle = (degrees - 90 * quarters) * (math.pi / 180)
    sine, cosine, term = 0.0, 0.0, 1.0
    for k in range(2 * _TAYLOR_TERMS):
        if k % 2:
            sine += -term if k % 4 == 3 else term
        else:
            cosine += -term if k % 4 == 2 else term
        term *= angle / (k + 1)
    return [(sine, cosine), (cosine, -sine), (-sine, -cosine), (-cosine, sine)][quarters % 4]


def turn(axis, degrees):
    """Quaternion of a counter-clockwise turn about a unit axis that points at the viewer."""
    sine, cosine = sin_cos(degrees / 2)
    return (axis[0] * sine, axis[1] * sine, axis[2] * sine, cosine)


def after(second, first):
    """Quaternion of the turn `first` followed by `second`."""
    v, u = second[:3], first[:3]
    xyz = add(add(scale(u, second[3]), scale(v, first[3])), cross(v, u))
    return (*xyz, second[3] * first[3] - dot(v, u))


def rotate(quaternion, v):
    u = quaternion[:3]
    twice = scale(cross(u, v), 2.0)
    return add(v, add(scale(twice, quaternion[3]), cross(u, twice)))


def look(direction):
    """Quaternion that turns −Z to `direction` and keeps X level: how glTF aims cameras and lights."""
    z = scale(unit(direction), -1.0)
    x = unit(cross(Y, z))
    y = cross(z, x)
    # Shepperd's method: the largest component first, so that no division is by a small number.
    squares = (1 + x[0] - y[1] - z[2], 1 - x[0] + y[1] - z[2], 1 - x[0] - y[1] + z[2], 1 + x[0] + y[1] + z[2])
    largest = squares.index(max(squares))
    d = 2 * math.sqrt(squares[largest])
    a, b, c = (y[2] - z[1]) / d, (z[0] - x[2]) / d, (x[1] - y[0]) / d
    e, f, g = (x[1] + y[0]) / d, (z[0] + x[2]) / d, (y[2] + z[1]) / d
    return [(d / 4, e, f, a), (e, d / 4, g, b), (f, g, d / 4, c), (a, b, c, d / 4)][largest]


class Chance:
    """Seeded numbers; of `random`, only `random()` promises the same sequence in every version."""

    def __init__(self, seed):
        self._unit = random.Random(seed).random

    def between(self, low, high):
        return mix(low, high, self._unit())

    def below(self, count):
        return int(self._unit() * count)
