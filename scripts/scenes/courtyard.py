"""Outdoors: a square court behind two storeys of arches. The sky is the user's (`--env`); the scene brings the sun."""

from .geometry import box, cylinder, join, lathe, pierced_wall, rounded_box, sphere, square_frame
from .glb import Scene
from .portable import Y, scale, sin_cos, turn

COURT = 8.0  # half width between the arcades' fronts
WALL = 0.5  # thickness of the arches' wall
OUTER = 11.0  # half width between the outer walls
BAY = 3.2  # from column to column, five bays a side
ARCH_RADIUS = 1.3
ARCH_SEGMENTS = 24
PAVING = 0.15  # top of the arcade's step
LAP = 0.05  # how far parts that meet stand in each other
# A storey: top of its floor, springing of its arches, underside of the slab above.
STOREYS = {"ground": (PAVING, 2.8, 4.6), "upper": (4.85, 7.15, 8.8)}
SUN = (3.0, 2.8, 2.4)  # W/m²
SUN_ELEVATION, SUN_AZIMUTH = 50, 30  # degrees; azimuth from +z towards +x
BASIN_RADIUS = 1.6


def _arches(spring, top):
    """One side's wall: five arches, ends inside the corner piers."""
    arch = [sin_cos(180 - 180 * k / ARCH_SEGMENTS) for k in range(ARCH_SEGMENTS + 1)]
    end = COURT + 0.1
    edge = [(-end, spring)]
    for bay in range(-2, 3):
        edge += [(bay * BAY + ARCH_RADIUS * cosine, spring + ARCH_RADIUS * sine) for sine, cosine in arch]
    return pierced_wall(edge + [(end, spring)], top + LAP, WALL)


def _column(low, spring):
    """Base, swelling shaft and capital, one stone a part."""
    foot, neck = low + 0.2, spring - 0.25
    plinth = box((-0.26, low - LAP, -0.26), (0.26, low + 0.12, 0.26))
    shaft = lathe(
        [
            (0.0, low + 0.1),
            (0.24, low + 0.1),
            (0.245, low + 0.14),
            (0.235, low + 0.18),
            (0.19, foot + 0.04),
            (0.188, foot + 0.6),
            (0.178, (foot + neck) / 2),
            (0.16, neck - 0.08),
            (0.19, neck - 0.06),
            (0.19, neck - 0.02),
            (0.23, neck + 0.08),
            (0.27, neck + 0.12),
            (0.0, neck + 0.12),
        ],
        24,
    )
    capital = box((-0.29, neck + 0.1, -0.29), (0.29, spring + LAP, 0.29))
    return join([plinth, shaft, capital])


def _storey(scene, name, stone, plaster):
    low, spring, top = STOREYS[name]
    middle = COURT + WALL / 2
    arches = scene.mesh(f"arches_{name}", (_arches(spring, top), plaster))
    column = scene.mesh(f"column_{name}", (_column(low, spring), stone))
    for side in range(4):
        around = turn(Y, 90 * side)
        group = scene.node(f"{name}_{side}", rotation=around)
        scene.node(f"arches_{name}_{side}", arches, (0, 0, -middle), parent=group)
        for k in (-1.5, -0.5, 0.5, 1.5):
            scene.node(f"column_{name}_{side}", column, (k * BAY, 0, -middle), parent=group)


def _fountain(scene, stone, water):
    """An eight-sided basin with a bowl on a stem."""
    basin = lathe(
        [
            (0.0, -LAP),
            (BASIN_RADIUS, -LAP),
            (BASIN_RADIUS, 0.5),
            (BASIN_RADIUS - 0.2, 0.5),
            (BASIN_RADIUS - 0.2, 0.1),
            (0.0, 0.1),
        ],
        8,
    )
    bowl = lathe(
        [
            (0.0, 0.05),
            (0.3, 0.05),
            (0.3, 0.2),
            (0.14, 0.35),
            (0.11, 0.6),
            (0.12, 1.1),
            (0.3, 1.2),
            (0.55, 1.3),
            (0.7, 1.42),
            (0.66, 1.44),
            (0.5, 1.34),
            (0.25, 1.26),
            (0.0, 1.24),
        ],
        32,
    )
    scene.object("basin", (basin, stone))
    scene.object("bowl", (bowl, stone))
    scene.object("water", (cylinder(BASIN_RADIUS - 0.15, 0.05, 0.38, 8), water))


def _planters(scene, clay, leaves):
    """A tub with a round tree in each corner of the court."""
    tub = lathe(
        [(0.0, -LAP), (0.35, -LAP), (0.5, 0.6), (0.54, 0.62), (0.54, 0.7), (0.46, 0.7), (0.42, 0.6), (0.0, 0.6)], 24
    )
    tree = join([cylinder(0.05, 0.55, 1.5, 12), sphere(0.6, 24, 12).moved((0, 1.9, 0))])
    mesh = scene.mesh("planter", (tub, clay), (tree, leaves))
    for x in (-5.2, 5.2):
        for z in (-5.2, 5.2):
            scene.node("planter", mesh, (x, 0, z))


def courtyard():
    scene = Scene(
        "courtyard", "A court behind two storeys of arches under a sun of 50 degrees; its sky comes from --env."
    )
    sand = scene.material("paving", (0.6, 0.54, 0.45))
    stone = scene.material("stone", (0.68, 0.64, 0.57))
    plaster = scene.material("plaster", (0.76, 0.69, 0.55))
    ochre = scene.material("ochre", (0.66, 0.36, 0.2))
    timber = scene.material("timber", (0.4, 0.27, 0.16))
    tiles = scene.material("tiles", (0.55, 0.24, 0.14))
    outer_face = OUTER + 0.4

    scene.object("ground", (box((-16, -0.3, -16), (16, 0, 16)), sand))
    scene.object("step", (square_frame(COURT - 0.3, OUTER + 0.1, -0.1, PAVING), stone))
    scene.object("outer_wall", (square_frame(OUTER, outer_face, -0.1, STOREYS["upper"][2] + LAP), ochre))
    slab_low, slab_high = STOREYS["ground"][2], STOREYS["upper"][0]
    scene.object("gallery", (square_frame(COURT - 0.12, OUTER + 0.1, slab_low, slab_high), timber))
    roof_low = STOREYS["upper"][2]
    scene.object("rafters", (square_frame(COURT - 0.35, outer_face - 0.1, roof_low, roof_low + 0.12), timber))
    scene.object("roof", (square_frame(COURT - 0.5, outer_face + 0.3, roof_low + 0.1, roof_low + 0.3), tiles))
    for name in STOREYS:
        _storey(scene, name, stone, plaster)
    scene.object("parapet", (square_frame(COURT + 0.17, COURT + 0.33, slab_high - LAP, slab_high + 0.85), plaster))
    scene.object("coping", (square_frame(COURT + 0.13, COURT + 0.37, slab_high + 0.82, slab_high + 0.92), stone))
    middle, half = COURT + WALL / 2, 0.4
    pier = scene.mesh("pier", (box((-half, -0.1, -half), (half, roof_low + LAP, half)), stone))
    for x in (-middle, middle):
        for z in (-middle, middle):
            scene.node("pier", pier, (x, 0, z))

    _fountain(scene, stone, scene.material("water", (0.1, 0.22, 0.25)))
    _planters(scene, scene.material("clay", (0.55, 0.28, 0.18)), scene.material("leaves", (0.16, 0.34, 0.1)))
    bench = scene.mesh(
        "bench",
        (rounded_box((0.9, 0.06, 0.22), 0.03, 2).moved((0, 0.42, 0)), stone),
        (box((-0.7, -LAP, -0.15), (-0.5, 0.4, 0.15)) + box((0.5, -LAP, -0.15), (0.7, 0.4, 0.15)), stone),
    )
    for side in range(4):
        group = scene.node(f"bench_{side}", rotation=turn(Y, 90 * side))
        scene.node("bench", bench, (0, 0, -5.6), parent=group)
    door = scene.mesh("door", (box((-0.6, PAVING - LAP, -0.1), (0.6, PAVING + 2.3, 0.06)), timber))
    for side in range(4):
        group = scene.node(f"door_{side}", rotation=turn(Y, 90 * side))
        scene.node("door", door, (BAY, 0, -OUTER), parent=group)

    up, level = sin_cos(SUN_ELEVATION)
    east, south = sin_cos(SUN_AZIMUTH)
    scene.light("sun", "directional", SUN, direction=scale((level * east, up, level * south), -1.0))
    scene.camera("court", (2.6, 1.7, 7.3), (-1.6, 3.2, -6), 65)
    scene.camera("arcade", (-7.4, 1.75, -9.9), (4, 1.75, -9.2), 65)
    return scene
