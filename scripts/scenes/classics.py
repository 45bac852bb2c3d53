"""Rooms with known answers and pictures: Cornell box, furnace, and a room of glossy, textured and pierced surfaces."""

from .geometry import box, inside_out, quad, sphere
from .glb import Scene
from .png import picture
from .portable import X, Y, after, turn
from .rooms import BLUE, PANEL_DROP, RED, WHITE, block, panel, shell


def cornell():
    """Goral et al.'s box at 2 m for the original's 555 mm units; left, right and colours as seen from the camera."""
    scene = Scene("cornell", "The Cornell box, 2 m wide, open at the front, with its tall and its short box.")
    white = scene.material("white", (0.725, 0.71, 0.68))
    a, b, c, d = (-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)  # floor, counter-clockwise from above
    e, f, g, h = (-1, 2, 1), (1, 2, 1), (1, 2, -1), (-1, 2, -1)  # ceiling above them
    scene.object("floor", (quad(a, b, c, d), white))
    scene.object("ceiling", (quad(h, g, f, e), white))
    scene.object("back", (quad(d, c, g, h), white))
    scene.object("left", (quad(a, d, h, e), scene.material("red", (0.63, 0.065, 0.05))))
    scene.object("right", (quad(c, b, f, g), scene.material("green", (0.14, 0.45, 0.091))))
    light = scene.material("light", (0.78, 0.78, 0.78), emission=(17, 12, 4))
    panel(scene, "panel", (0, 2 - PANEL_DROP, 0), 0.47, 0.38, light)
    sunk = 0.002
    block(scene, "tall", (-0.33, 0, -0.26), (0.595, 1.19, 0.595), 17, white, sunk)
    block(scene, "short", (0.33, 0, 0.39), (0.595, 0.595, 0.595), -17, white, sunk)
    scene.camera("front", (0, 1, 3.9), (0, 1, 0), 39.3)
    return scene


def furnace():
    """Radiance inside is the geometric series Le / (1 − ρ) = 2 in every direction, irradiance 2π."""
    scene = Scene("furnace", "A closed room that emits 1 and reflects 0.5 everywhere: radiance 2 in every direction.")
    glowing = scene.material("glowing", (0.5, 0.5, 0.5), emission=(1, 1, 1))
    scene.object("room", (inside_out(box((-1, 0, -1), (1, 2, 1))), glowing))
    scene.camera("inside", (0.2, 1.1, 0.6), (-0.1, 0.9, -1), 70)
    return scene


def _checkerboard(side, squares, dark, bright):
    step = side // squares
    return picture(
        [[(dark, bright)[(row // step + column // step) % 2] for column in range(side)] for row in range(side)]
    )


def _leaves(side, across):
    """Leaves in a lattice, opaque; each where two discs about opposite corners of its cell overlap."""
    cell = side // across
    width = 2 * cell  # in half pixels, so that all is integer
    reach = width * width * 19 // 20

    def pixel(row, column):
        u, v = row % cell * 2 + 1, column % cell * 2 + 1
        inside = u * u + v * v < reach and (width - u) ** 2 + (width - v) ** 2 < reach
        vein = abs(u + v - width) < 2
        return ((70, 110, 40) if vein else (95, 150, 55)) + (255 if inside else 0,)

    return picture([[pixel(row, column) for column in range(side)] for row in range(side)])


def glossy_room():
    scene = Scene(
        "glossy_room", "Metal spheres of roughness 0 to 1 on a glossy floor, a checkerboard and a screen of leaves."
    )
    white = scene.material("white", WHITE)
    shell(
        scene,
        (-3, 0, -2.5),
        (3, 3, 2.5),
        0.1,
        {
            "floor": scene.material("glossy_floor", (0.25, 0.2, 0.16), roughness=0.2),
            "ceiling": white,
            "back": white,
            "front": white,
            "left": scene.material("red", RED),
            "right": scene.material("blue", BLUE),
        },
    )
    panel(scene, "panel", (0, 3 - PANEL_DROP, 0.3), 1.6, 1, scene.material("light", WHITE, emission=(12, 12, 12)))
    radius, ball = 0.42, sphere(0.42, 64, 32)
    for k in range(5):
        roughness = k / 4
        metal = scene.material(f"metal_{roughness:.2f}", (0.92, 0.83, 0.6), metallic=1, roughness=roughness)
        mesh = scene.mesh(f"sphere_{roughness:.2f}", (ball, metal))
        scene.node(f"sphere_{roughness:.2f}", mesh, (k - 2.0, radius - 0.002, -0.4))
    checks = scene.texture("checks", _checkerboard(64, 8, (40, 40, 48), (225, 215, 190)))
    board = scene.mesh(
        "checkerboard",
        (box((-0.6, -0.6, -0.02), (0.6, 0.6, 0.02)), scene.material("checks", (1, 1, 1), texture=checks)),
    )
    scene.node("checkerboard", board, (-0.7, 1.75, -2.3), turn(X, -8))
    leaves = scene.texture("leaves", _leaves(64, 4))
    screen = scene.mesh(
        "leaf_screen",
        (
            quad((-0.6, -0.7, 0), (0.6, -0.7, 0), (0.6, 0.7, 0), (-0.6, 0.7, 0)),
            scene.material("leaves", (1, 1, 1), texture=leaves, mask=0.5, double_sided=True),
        ),
    )
    scene.node("leaf_screen", screen, (1.5, 1.75, -1.5), after(turn(Y, -25), turn(X, 6)))
    scene.camera("main", (0, 1.55, 2.15), (0, 0.9, -1), 65)
    return scene
