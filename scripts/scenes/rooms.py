"""Rooms of solid walls for leaks: two rooms, sealed and open, and walls of 1 mm and of a single sheet."""

from .geometry import box, quad, sphere
from .glb import Scene
from .portable import Y, turn

WHITE = (0.75, 0.75, 0.75)
RED = (0.75, 0.15, 0.1)
GREEN = (0.3, 0.6, 0.3)
BLUE = (0.2, 0.35, 0.7)
OCHRE = (0.65, 0.5, 0.25)
PANEL_DROP = 0.02  # m below the ceiling
FOOT = 0.01  # m that furniture stands in the floor
BALL_CENTER, BALL_RADIUS = (-2.0, 0.45, 0.0), 0.25  # m


def shell(scene, low, high, wall, paint):
    """Solid walls round the air between two corners; `paint` names those to build and their materials.

    Each runs half a wall's thickness into its neighbours: sealed, and no two faces in one plane.
    """
    (x0, y0, z0), (x1, y1, z1) = low, high
    s = wall / 2
    boxes = {
        "floor": box((x0 - s, y0 - wall, z0 - s), (x1 + s, y0, z1 + s)),
        "ceiling": box((x0 - s, y1, z0 - s), (x1 + s, y1 + wall, z1 + s)),
        "left": box((x0 - wall, y0 - s, z0 - s), (x0, y1 + s, z1 + s)),
        "right": box((x1, y0 - s, z0 - s), (x1 + wall, y1 + s, z1 + s)),
        "back": box((x0 - s, y0 - s, z0 - wall), (x1 + s, y1 + s, z0)),
        "front": box((x0 - s, y0 - s, z1), (x1 + s, y1 + s, z1 + wall)),
    }
    for name, material in paint.items():
        scene.object(name, (boxes[name], material))


def panel(scene, name, center, size_x, size_z, material, parent=None):
    """Single sheet that faces down: the area light of every scene."""
    (x, y, z), a, b = center, size_x / 2, size_z / 2
    facing_down = quad((x - a, y, z - b), (x + a, y, z - b), (x + a, y, z + b), (x - a, y, z + b))
    scene.object(name, (facing_down, material), parent=parent)


def block(scene, name, foot, size, degrees, material, sunk=FOOT):
    """Box on the floor, turned about its axis; `foot` is the middle of its base on the floor."""
    a, height, b = size[0] / 2, size[1], size[2] / 2
    mesh = scene.mesh(name, (box((-a, -sunk, -b), (a, height, b)), material))
    scene.node(name, mesh, foot, turn(Y, degrees))


def _two_rooms(name, description, divider_end):
    """`divider_end`: z at which the dividing wall ends."""
    half_length, half_depth, height, wall = 4.05, 2.0, 3.0, 0.1
    scene = Scene(name, description)
    white = scene.material("white", WHITE)
    ground = scene.material("floor", (0.6, 0.58, 0.55))
    green, blue = scene.material("green", GREEN), scene.material("blue", BLUE)
    shell(
        scene,
        (-half_length, 0, -half_depth),
        (half_length, height, half_depth),
        wall,
        {
            "floor": ground,
            "ceiling": white,
            "front": white,
            "left": scene.material("red", RED),
            "right": blue,
        },
    )
    s, lap = wall / 2, 0.02
    low, high = -s, height + s
    # The back wall changes colour inside the dividing wall; the thinner part keeps the outer faces apart.
    scene.object("back_lit", (box((-half_length - s, low, -half_depth - wall), (lap, high, -half_depth)), green))
    scene.object("back_dark", (box((-lap, low, -half_depth - 0.9 * wall), (half_length + s, high, -half_depth)), white))
    scene.object("divider", (box((-s, low, -half_depth - s), (s, high, divider_end)), white))
    light = scene.material("light", WHITE, emission=(12, 12, 12))
    panel(scene, "panel", (-2.05, height - PANEL_DROP, 0), 1, 1, light)
    plinth, cube = scene.material("plinth", OCHRE), scene.material("cube", (0.5, 0.5, 0.55))
    block(scene, "plinth_lit", (-2.7, 0, -1.1), (0.6, 1, 0.6), 15, plinth)
    block(scene, "cube_lit", (-1.2, 0, -0.4), (0.4, 0.4, 0.4), -20, cube)
    block(scene, "plinth_dark", (1.9, 0, 1.0), (0.6, 1, 0.6), -10, plinth)
    block(scene, "cube_dark", (1.1, 0, -0.7), (0.4, 0.4, 0.4), 25, cube)
    scene.camera("lit", (-3.65, 1.6, 1.2), (-0.4, 1.25, -0.6), 70)
    scene.camera("dark", (3.65, 1.6, -1.2), (0.4, 1.25, 0.6), 70)
    return scene


def two_rooms_sealed():
    return _two_rooms(
        "two_rooms_sealed",
        "Two closed rooms side by side, an area light in the left one: all light in the right one is leaked.",
        divider_end=2.05,
    )


def two_rooms_open():
    return _two_rooms(
        "two_rooms_open",
        "The two rooms with a passage at one end of the dividing wall: true light and leaked light in one picture.",
        divider_end=0.8,
    )


def two_rooms_ball():
    scene = _two_rooms(
        "two_rooms_ball",
        "two_rooms_open and a ball in the air of the lit room: to be rendered with probes that do not know the ball.",
        divider_end=0.8,
    )
    # Fine facets: the reference shades by the normals of the sphere, but its rays leave from the facets.
    ball = scene.mesh("ball", (sphere(BALL_RADIUS, 48, 24), scene.material("ball", WHITE)))
    scene.node("ball", ball, BALL_CENTER)
    # At the ball's height, so that half of what it shows faces the floor.
    scene.camera("ball", (-2.9, 0.45, 1.5), BALL_CENTER, 19)
    return scene


def thin_wall():
    half_length, half_depth, height, wall = 3.0, 2.0, 3.0, 0.1
    scene = Scene(
        "thin_wall", "A lit chamber between two dark ones, behind a solid wall of 1 mm and behind a single sheet."
    )
    white = scene.material("white", WHITE)
    shell(
        scene,
        (-half_length, 0, -half_depth),
        (half_length, height, half_depth),
        wall,
        {
            "floor": scene.material("floor", (0.6, 0.58, 0.55)),
            "ceiling": white,
            "back": white,
            "front": white,
            "left": scene.material("blue", BLUE),
            "right": scene.material("green", GREEN),
        },
    )
    s, thin = wall / 2, 0.001
    low_y, high_y, end = -s, height + s, half_depth + s
    scene.object("solid_1mm", (box((-1 - thin, low_y, -end), (-1, high_y, end)), scene.material("solid", RED)))
    facing_light = quad((1, low_y, -end), (1, low_y, end), (1, high_y, end), (1, high_y, -end))
    scene.object("sheet", (facing_light, scene.material("sheet", OCHRE)))
    light = scene.material("light", WHITE, emission=(12, 12, 12))
    panel(scene, "panel", (0, height - PANEL_DROP, 0), 1, 1, light)
    scene.camera("middle", (0.6, 1.6, 1.6), (-0.25, 1.3, -1.2), 70)
    scene.camera("behind_solid", (-2.6, 1.6, 1.6), (-1.4, 1.3, -0.9), 70)
    scene.camera("behind_sheet", (2.6, 1.6, 1.6), (1.4, 1.3, -0.9), 70)
    return scene
