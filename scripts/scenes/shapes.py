"""Shapes of the office's furniture; lengths in metres.

A piece stands on y = 0 and faces +z; those for walls have their back at z = 0. What touches is sunk by `SUNK`.
"""

from .geometry import box, cylinder, join, lathe, rounded_box, sheet, sphere, tube
from .portable import NO_TURN, X, Y, Z, Chance, after, sin_cos, turn

SUNK = 0.005
NO_SCALE = (1.0, 1.0, 1.0)
SHELF_WIDTH, SHELF_HEIGHT, SHELF_DEPTH, SHELF_BOARD, SHELF_TIERS = 1.0, 2.1, 0.3, 0.02, 6
COVERS = 4  # kinds of book
GOLDEN_ANGLE = 137.507764  # degrees from leaf to leaf
LAMP_BULB = (0.0, 0.36, 0.17)


def shelf():
    w, d, b = SHELF_WIDTH / 2, SHELF_DEPTH, SHELF_BOARD
    boards = [
        box((-w, -SUNK, 0.002), (-w + b, SHELF_HEIGHT, d)),
        box((w - b, -SUNK, 0.002), (w, SHELF_HEIGHT, d)),
        box((-w + b / 2, 0.02, 0.004), (w - b / 2, SHELF_HEIGHT - 0.005, 0.02)),
    ]
    step = (SHELF_HEIGHT - 0.1) / SHELF_TIERS
    boards += [
        box((-w + b / 2, y, 0.01), (w - b / 2, y + b, d - 0.005))
        for y in (0.06 + step * tier for tier in range(SHELF_TIERS + 1))
    ]
    return join(boards)


def book():
    """Unit cube (thickness x, height y, depth z, spine to +z) as case and pages; instances give it its size."""
    cover, pages_from = 0.07, 0.04
    case = join(
        [
            box((-0.5, 0, 0), (-0.5 + cover, 1, 1)),
            box((0.5 - cover, 0, 0), (0.5, 1, 1)),
            box((-0.5 + cover / 2, 0.005, 0.975), (0.5 - cover / 2, 0.995, 0.995)),
        ]
    )
    pages = box((-0.5 + cover / 2, 0.02, pages_from), (0.5 - cover / 2, 0.98, 0.98))
    return case, pages


def filling(seed):
    """Poses of the books of one shelf, a list a cover; the last book of a tier leans on the others."""
    chance = Chance(seed)
    covers = [[] for _ in range(COVERS)]
    step = (SHELF_HEIGHT - 0.1) / SHELF_TIERS
    for tier in range(SHELF_TIERS):
        floor = 0.06 + step * tier + SHELF_BOARD - 0.001
        x, end = -SHELF_WIDTH / 2 + SHELF_BOARD + 0.002, SHELF_WIDTH / 2 - SHELF_BOARD - chance.between(0.14, 0.3)
        while x < end:
            size = (chance.between(0.014, 0.045), chance.between(0.19, 0.29), chance.between(0.14, 0.21))
            back = SHELF_DEPTH - 0.03 - size[2]
            covers[chance.below(len(covers))].append(((x + size[0] / 2, floor, back), NO_TURN, size))
            x += size[0] + 0.001
        size = (0.025, 0.24, 0.17)
        sine, cosine = sin_cos(12)
        # Turned about its lower edge, it touches the row at the top: its foot stands a leaning height's sine away.
        foot = (x + size[1] * sine + size[0] * cosine / 2, floor + 0.001 + size[0] * sine / 2, 0.1)
        covers[chance.below(len(covers))].append((foot, turn(Z, 12), size))
    return covers


def chair():
    """Swivel chair: cushions, and frame with five castors."""
    cushions = rounded_box((0.25, 0.05, 0.25), 0.045, 5).moved((0, 0.47, 0))
    cushions += rounded_box((0.23, 0.3, 0.04), 0.038, 5).moved((0, 0.85, -0.27), turn(X, -8))
    frame = join(
        [
            cylinder(0.03, 0.1, 0.43, 20),
            cylinder(0.05, 0.07, 0.2, 20),
            tube([(0, 0.43, 0), (0, 0.44, -0.2), (0, 0.5, -0.3), (0, 0.62, -0.325), (0, 0.8, -0.3)], 0.018, 12),
        ]
    )
    for side in (-1, 1):
        x = 0.29 * side
        frame += rounded_box((0.03, 0.015, 0.13), 0.014, 3).moved((x, 0.68, 0))
        frame += tube([(x, 0.67, 0), (x, 0.5, 0), (0.26 * side, 0.45, 0), (0.2 * side, 0.44, 0)], 0.014, 10)
    castor = sphere(0.03, 14, 8).moved((0, 0.028, 0.28))
    leg = tube([(0, 0.13, 0), (0, 0.11, 0.15), (0, 0.07, 0.28), (0, 0.045, 0.285)], 0.018, 10) + castor
    for k in range(5):
        frame += leg.turned(72 * k)
    return cushions, frame


def armchair():
    seat = rounded_box((0.3, 0.1, 0.32), 0.06, 5).moved((0, 0.38, 0.03))
    back = rounded_box((0.3, 0.3, 0.09), 0.07, 5).moved((0, 0.68, -0.3), turn(X, -10))
    arm = rounded_box((0.08, 0.28, 0.38), 0.07, 5)
    base = rounded_box((0.34, 0.08, 0.34), 0.03, 3).moved((0, 0.22, 0))
    feet = [cylinder(0.025, -SUNK, 0.2, 16).moved((x, 0, z)) for x in (-0.28, 0.28) for z in (-0.28, 0.28)]
    return join([seat, back, base, arm.moved((-0.36, 0.4, 0)), arm.moved((0.36, 0.4, 0))]), join(feet)


def desk():
    """Sat at from +z."""
    top = rounded_box((0.8, 0.02, 0.4), 0.015, 2).moved((0, 0.73, 0))
    legs = join(
        [
            tube(
                [
                    (x, -SUNK, 0.33),
                    (x, 0.7, 0.33),
                    (x, 0.705, 0.3),
                    (x, 0.705, -0.3),
                    (x, 0.7, -0.33),
                    (x, -SUNK, -0.33),
                ],
                0.02,
                10,
            )
            for x in (-0.72, 0.72)
        ]
    )
    drawers = box((0.3, 0.08, -0.3), (0.66, 0.712, 0.3)) + join(
        [box((0.31, y, 0.29), (0.65, y + 0.18, 0.315)) for y in (0.1, 0.3, 0.5)]
    )
    feet = [cylinder(0.02, -SUNK, 0.1, 12).moved((x, 0, z)) for x in (0.34, 0.62) for z in (-0.26, 0.26)]
    return top + drawers, legs + join(feet)


def screen():
    """On a desk's top; faces +z."""
    stand = join(
        [
            lathe([(0.0, -SUNK), (0.12, -SUNK), (0.12, 0.008), (0.03, 0.02), (0.0, 0.02)], 32),
            tube([(0, 0.01, 0), (0, 0.2, -0.02), (0, 0.3, 0.0)], 0.016, 12),
            rounded_box((0.3, 0.18, 0.02), 0.015, 3).moved((0, 0.32, 0.015)),
        ]
    )
    return stand, box((-0.28, 0.16, 0.03), (0.28, 0.48, 0.037))


def mug():
    wall = lathe(
        [
            (0.0, -0.002),
            (0.035, -0.002),
            (0.04, 0.01),
            (0.042, 0.05),
            (0.042, 0.09),
            (0.04, 0.094),
            (0.038, 0.09),
            (0.037, 0.05),
            (0.035, 0.012),
            (0.0, 0.01),
        ],
        36,
    )
    arc = [sin_cos(-90 + 18 * k) for k in range(11)]
    return wall + tube([(0.04 + 0.025 * cosine, 0.05 + 0.028 * sine, 0) for sine, cosine in arc], 0.005, 8)


def bin():
    return lathe(
        [
            (0.0, -SUNK),
            (0.11, -SUNK),
            (0.14, 0.3),
            (0.148, 0.303),
            (0.148, 0.31),
            (0.132, 0.31),
            (0.104, 0.012),
            (0.0, 0.012),
        ],
        36,
    )


def pot():
    return lathe(
        [
            (0.0, -SUNK),
            (0.13, -SUNK),
            (0.17, 0.28),
            (0.19, 0.29),
            (0.19, 0.33),
            (0.165, 0.33),
            (0.16, 0.29),
            (0.0, 0.29),
        ],
        36,
    )


def leaf():
    """Blade along +z, front up, folded along its rib and bent down; 12 × 2 facets."""
    facets, blade = 12, []
    for side in (-1, 0, 1):
        row = []
        for k in range(facets + 1):
            t = k / facets
            width = 0.004 + 0.14 * t * (1 - t) * (1.4 - t)
            row.append((side * width, 0.12 * t - 0.16 * t * t + 0.25 * width * abs(side), 0.36 * t))
        blade.append(row)
    return sheet(blade)


def foliage(seed, count):
    """Poses of a plant's leaves, in a spiral up its stem; low ones hang, high ones rise."""
    chance = Chance(seed)
    poses = []
    for k in range(count):
        t = k / (count - 1)
        rise = -15 + 75 * t + chance.between(-8, 8)
        aim = after(turn(Y, GOLDEN_ANGLE * k), turn(X, -rise))
        size = 1.15 - 0.5 * t + chance.between(-0.1, 0.1)
        poses.append(((0.0, 0.42 + 0.75 * t, 0.0), aim, (size, size, size)))
    return poses


def key_poses():
    """Four rows of 15 keys and a space bar."""
    keys = [
        ((-0.196 + 0.028 * k, 0.01, -0.045 + 0.025 * row), NO_TURN, NO_SCALE) for row in range(4) for k in range(15)
    ]
    return keys + [((0.0, 0.01, 0.055), NO_TURN, (7.0, 1.0, 1.0))]


def radiator():
    """Feeds of a radiator whose fins are instanced; back at z = 0."""
    bars = [tube([(-0.5, y, 0.09), (0.5, y, 0.09)], 0.015, 12) for y in (0.15, 0.6)]
    brackets = [box((x - 0.015, 0.36, -SUNK), (x + 0.015, 0.39, 0.09)) for x in (-0.31, 0.31)]
    return join(bars + brackets)


def lamp():
    """Foot and arm, and the shade round `LAMP_BULB`, open below."""
    foot = lathe([(0.0, -SUNK), (0.09, -SUNK), (0.09, 0.012), (0.02, 0.025), (0.0, 0.025)], 36)
    arm = tube([(0, 0.02, 0), (0, 0.22, -0.06), (0, 0.4, 0.02), (0, 0.435, 0.1), (0, 0.44, 0.17)], 0.008, 10)
    shade = lathe(
        [
            (0.0, 0.44),
            (0.03, 0.434),
            (0.068, 0.395),
            (0.095, 0.33),
            (0.1, 0.33),
            (0.072, 0.4),
            (0.032, 0.443),
            (0.0, 0.449),
        ],
        40,
    )
    return foot + arm, shade.moved((0, 0, 0.17))


def table():
    """Round top, and its foot."""
    top = lathe([(0.0, 0.39), (0.5, 0.39), (0.515, 0.4), (0.515, 0.415), (0.5, 0.425), (0.0, 0.425)], 64)
    foot = [(0.0, -SUNK), (0.28, -SUNK), (0.28, 0.015), (0.05, 0.04), (0.04, 0.3), (0.08, 0.395), (0.0, 0.395)]
    return top, lathe(foot, 48)


def fin_poses():
    return [((-0.4 + 0.8 * k / 13, 0.375, 0.09), NO_TURN, NO_SCALE) for k in range(14)]
