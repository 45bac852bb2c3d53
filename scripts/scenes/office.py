"""Inside a building: a corridor and eight rooms, dense and empty, lit and dark, behind open, ajar and shut doors.

A room's own frame: x to both sides of its middle, z from the corridor's wall (0) to the outer wall; south rooms as in
the world, north rooms turned by 180 degrees. Rooms are numbered from west to east.
"""

from .furniture import Furniture
from .geometry import box, cylinder, pierced_wall, rounded_box
from .glb import Scene
from .portable import Y, add, rotate, turn
from .rooms import panel

WALL = 0.12
SINK = WALL / 2  # how far walls and slabs run into each other
HEIGHT = 2.8
ROOM = 4.0  # m square
PITCH = ROOM + WALL
CORRIDOR = 1.0  # half width
DEPTH = CORRIDOR + WALL + ROOM  # from the corridor's middle to the outer wall
LENGTH = 2 * PITCH  # half, from the building's middle to the end walls' middle
DOOR_X, DOOR_WIDTH, DOOR_HEIGHT = -1.2, 0.9, 2.1
PANEL = (9.0, 9.0, 8.4)  # W/m²/sr
DESK_LAMP = (2.4, 2.0, 1.4)  # W/sr
SPOT = (26.0, 23.0, 18.0)  # W/sr
SPOT_CONE = (0.35, 0.6)  # rad
SHUT, AJAR, HALF, OPEN = 0, 20, 55, 85  # degrees


class _Building:
    """The shell with its rooms' nodes."""

    def __init__(self, scene):
        self.scene = scene
        self.white = scene.material("white", (0.75, 0.75, 0.73))
        self.dark = scene.material("dark_metal", (0.2, 0.2, 0.22))
        self.light = scene.material("light", (0.75, 0.75, 0.75), emission=PANEL)
        door = scene.material("door", (0.5, 0.33, 0.2))
        w, h = DOOR_WIDTH, DOOR_HEIGHT
        handle = rounded_box((0.06, 0.012, 0.012), 0.01, 2)
        handles = handle.moved((w - 0.13, 1.05, 0.05)) + handle.moved((w - 0.13, 1.05, -0.05))
        handles += box((w - 0.09, 1.04, -0.05), (w - 0.07, 1.06, 0.05))
        # A shut leaf is sunk into the frame all round: no light passes. An open one has its hinge edge in the frame.
        self._shut = scene.mesh(
            "door_shut", (box((-0.01, -0.01, -0.02), (w + 0.01, h + 0.01, 0.02)), door), (handles, self.dark)
        )
        self._leaf = scene.mesh(
            "door_leaf", (box((-0.01, 0.006, -0.02), (w - 0.01, h - 0.006, 0.02)), door), (handles, self.dark)
        )
        self._housing = {}
        self._shell()

    def _shell(self):
        scene, end, low, high = self.scene, DEPTH + SINK, -SINK, HEIGHT + SINK
        carpet = scene.material("carpet", (0.32, 0.33, 0.36))
        colours = [
            scene.material(name, colour)
            for name, colour in (("sage", (0.5, 0.6, 0.45)), ("brick", (0.62, 0.32, 0.24)), ("sky", (0.42, 0.55, 0.68)))
        ]
        scene.object("floor", (box((-LENGTH, -WALL, -end), (LENGTH, 0, end)), carpet))
        scene.object("ceiling", (box((-LENGTH, HEIGHT, -end), (LENGTH, HEIGHT + WALL, end)), self.white))
        edge = [(-LENGTH, low)]
        for k in range(4):
            left = self._middle(k) + DOOR_X - DOOR_WIDTH / 2
            right = left + DOOR_WIDTH
            edge += [(left, low), (left, DOOR_HEIGHT), (right, DOOR_HEIGHT), (right, low)]
        corridor_wall = scene.mesh("corridor_wall", (pierced_wall(edge + [(LENGTH, low)], high, WALL), self.white))
        outer_wall = scene.mesh("outer_wall", (box((-LENGTH, low, DEPTH), (LENGTH, high, DEPTH + WALL)), self.white))
        partitions = [
            scene.mesh(f"partition_{k}", (box((-SINK, low, CORRIDOR + SINK), (SINK, high, end)), colour))
            for k, colour in enumerate(colours)
        ]
        for side, around in (("south", 0), ("north", 180)):
            group = scene.node(side, rotation=turn(Y, around))
            scene.node(f"corridor_wall_{side}", corridor_wall, (0, 0, CORRIDOR + SINK), parent=group)
            scene.node(f"outer_wall_{side}", outer_wall, parent=group)
            for k, partition in enumerate(partitions):
                scene.node(f"partition_{side}_{k}", partition, ((k - 1) * PITCH, 0, 0), parent=group)
        end_wall = scene.mesh("end_wall", (box((-SINK, low, -end), (SINK, high, end)), self.white))
        for x in (-LENGTH, LENGTH):
            scene.node("end_wall", end_wall, (x, 0, 0))

    @staticmethod
    def _middle(k):
        return (k - 1.5) * PITCH

    def frame(self, side, k):
        """Position and rotation of a room's frame."""
        sign = 1 if side == "south" else -1
        return (self._middle(k), 0.0, sign * (CORRIDOR + WALL)), turn(Y, 0 if sign > 0 else 180)

    def room(self, side, k, door):
        """Node of a room, with its door opened by so many degrees."""
        room = self.scene.node(f"{side}_{k}", None, *self.frame(side, k))
        hinge = (DOOR_X - DOOR_WIDTH / 2, 0, -WALL / 2 if door == SHUT else -0.03)
        self.scene.node("door", self._shut if door == SHUT else self._leaf, hinge, turn(Y, -door), parent=room)
        return room

    def ceiling_light(self, parent, x, z, size_x=0.6, size_z=1.2):
        """A housing under the ceiling and, 1 cm below it, the sheet that emits."""
        if (size_x, size_z) not in self._housing:
            a, b = size_x / 2 + 0.03, size_z / 2 + 0.03
            shape = box((-a, HEIGHT - 0.04, -b), (a, HEIGHT + 0.01, b))
            self._housing[size_x, size_z] = self.scene.mesh("housing", (shape, self.dark))
        self.scene.node("housing", self._housing[size_x, size_z], (x, 0, z), parent=parent)
        panel(self.scene, "panel", (x, HEIGHT - 0.05, z), size_x, size_z, self.light, parent=parent)

    def spot(self, parent, x, z):
        """A can under the ceiling with a spot light at its mouth."""
        can = cylinder(0.06, HEIGHT - 0.15, HEIGHT + 0.01, 32)
        self.scene.node("spot_can", self.scene.mesh("spot_can", (can, self.dark)), (x, 0, z), parent=parent)
        # The node is aimed in the room's frame; straight down has no level X, hence a slight tilt.
        self.scene.light("spot", "spot", SPOT, (x, HEIGHT - 0.17, z), (0.05, -1, 0.1), SPOT_CONE, parent=parent)


def _library(building, furniture):
    room = building.room("north", 0, OPEN)
    building.ceiling_light(room, 0.3, 2)
    for x in (-1.45, -0.4, 0.65):
        furniture.shelf(room, (x, 3.99), 180)
    for z in (1.3, 2.35):
        furniture.shelf(room, (1.99, z), -90)
    for z in (2.1, 3.15):
        furniture.shelf(room, (-1.99, z), 90)
    furniture.armchair(room, (0.2, 2.2), 215)
    furniture.table(room, (-0.7, 1.6), mugs=2)
    furniture.plant(room, (1.5, 0.5))
    furniture.radiator(room, (0.4, 0), 0)


def _lit_office(building, furniture):
    room = building.room("north", 1, OPEN)
    building.ceiling_light(room, -0.9, 2)
    building.ceiling_light(room, 0.9, 2)
    furniture.workplace(room, (0.95, 1.1), 0)
    furniture.workplace(room, (-0.8, 3.1), 180)
    furniture.workplace(room, (1.1, 3.1), 180)
    furniture.shelf(room, (1.99, 1.9), -90)
    furniture.plant(room, (-1.6, 3.5), 70)
    furniture.bin(room, (0.15, 3.6))
    furniture.radiator(room, (-1.99, 2.1), 90)
    furniture.crates(room, (1.6, 0.3), 4, high=2)


def _meeting_room(building, furniture):
    """Sparse: nothing but a board on the wall."""
    room = building.room("north", 2, SHUT)
    building.ceiling_light(room, 0, 2)
    furniture.whiteboard(room, (0, 4.0), 180)


def _store(building, furniture):
    """Sealed and without light: black, whatever happens outside."""
    room = building.room("north", 3, SHUT)
    for x in (-1.4, -0.3, 0.8):
        furniture.crates(room, (x, 3.5), 5, high=4)
    furniture.shelf(room, (1.99, 1.2), -90)
    furniture.crates(room, (0.9, 1.6), 30, high=2)


def _lounge(building, furniture):
    room = building.room("south", 0, HALF)
    building.spot(room, 0.3, 2.2)
    furniture.table(room, (0.35, 2.3), mugs=5)
    for x, z, facing in ((-0.75, 2.3, 90), (1.4, 2.2, -95), (0.4, 3.4, 178)):
        furniture.armchair(room, (x, z), facing)
    furniture.plant(room, (1.55, 3.5))
    furniture.plant(room, (-1.55, 3.5), 30)
    furniture.radiator(room, (0.8, 0), 0)


def _dark_office(building, furniture):
    room = building.room("south", 1, OPEN)
    furniture.workplace(room, (-0.6, 3.1), 180)
    furniture.workplace(room, (1.3, 2.0), -90)
    furniture.shelf(room, (1.99, 3.4), -90)
    furniture.plant(room, (-1.6, 3.5), 110)
    furniture.radiator(room, (0.6, 0), 0)
    furniture.chair(room, (0.1, 1.0), -60)


def _lamp_office(building, furniture):
    room = building.room("south", 2, HALF)
    desk = furniture.workplace(room, (0.5, 3.0), 180)
    furniture.lamp(desk, DESK_LAMP)
    furniture.shelf(room, (1.99, 1.6), -90)
    furniture.bin(room, (-0.5, 3.5))
    furniture.plant(room, (-1.6, 3.5), 200)
    furniture.radiator(room, (-1.99, 2.2), 90)


def _archive(building, furniture):
    room = building.room("south", 3, AJAR)
    for x in (-0.3, 0.8):
        furniture.shelf(room, (x, 1.75), 0)
        furniture.shelf(room, (x, 1.74), 180)
        furniture.shelf(room, (x, 3.99), 180)
    furniture.shelf(room, (-1.99, 2.6), 90)
    furniture.crates(room, (-1.6, 3.6), 8, high=3)


def office():
    scene = Scene("office", "A corridor and eight rooms, crowded and empty, lit and dark, behind open and shut doors.")
    building, furniture = _Building(scene), Furniture(scene)
    for furnish in (_library, _lit_office, _meeting_room, _store, _lounge, _dark_office, _lamp_office, _archive):
        furnish(building, furniture)
    for x in (-3.2, 4.2):
        building.ceiling_light(None, x, 0, 1.2, 0.3)
    furniture.plant(None, (-7.8, 0.65))
    furniture.chair(None, (3.2, 0.7), 180)

    def camera(name, side, k, eye, target):
        place, around = building.frame(side, k)
        scene.camera(name, *(add(place, rotate(around, point)) for point in (eye, target)), 70)

    scene.camera("corridor", (-7.3, 1.6, 0.0), (8, 1.25, 0), 60)
    camera("room_lit", "north", 1, (-0.5, 1.65, 0.4), (0.3, 0.95, 3.2))
    camera("room_dark", "south", 1, (1.5, 1.65, 0.5), (-0.9, 0.95, 2.6))
    return scene
