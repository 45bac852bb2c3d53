"""Furniture of the office, each mesh stored once: shown by nodes (chairs, desks) or instanced (books, leaves, keys)."""

from . import shapes
from .geometry import box, cylinder, rounded_box
from .portable import Y, sin_cos, turn

BOOK_COVERS = ((0.5, 0.12, 0.1), (0.12, 0.22, 0.42), (0.14, 0.3, 0.18), (0.62, 0.52, 0.32))
FILLINGS = 3  # different rows of books


class Furniture:
    """Places pieces in rooms: `room` is the parent node, `at` the room's (x, z) or (x, y, z), `facing` in degrees."""

    def __init__(self, scene):
        self._scene = scene
        wood = scene.material("wood", (0.55, 0.38, 0.22))
        steel = scene.material("steel", (0.35, 0.36, 0.38))
        black = scene.material("black", (0.06, 0.06, 0.065))
        paper = scene.material("paper", (0.8, 0.77, 0.7))
        fabric = scene.material("fabric", (0.16, 0.26, 0.36))
        leather = scene.material("leather", (0.48, 0.2, 0.1))
        enamel = scene.material("enamel", (0.78, 0.78, 0.76))
        clay = scene.material("clay", (0.55, 0.3, 0.2))
        leaf = scene.material("leaf", (0.14, 0.36, 0.1), double_sided=True)
        mesh = scene.mesh
        self._shelf = mesh("shelf", (shapes.shelf(), wood))
        case, pages = shapes.book()
        self._books = [
            mesh(f"book_{k}", (case, scene.material(f"cover_{k}", cover)), (pages, paper))
            for k, cover in enumerate(BOOK_COVERS)
        ]
        self._fillings = [[scene.poses(poses) for poses in shapes.filling(seed)] for seed in range(FILLINGS)]
        self._filled = 0
        cushions, frame = shapes.chair()
        self._chair = mesh("chair", (cushions, fabric), (frame, black))
        upholstery, feet = shapes.armchair()
        self._armchair = mesh("armchair", (upholstery, leather), (feet, wood))
        top, legs = shapes.desk()
        self._desk = mesh("desk", (top, wood), (legs, steel))
        stand, display = shapes.screen()
        self._screen = mesh("screen", (stand, black), (display, scene.material("display", (0.02, 0.025, 0.03))))
        self._board = mesh("keyboard", (rounded_box((0.22, 0.01, 0.08), 0.008, 2), black))
        self._key = mesh("key", (rounded_box((0.0125, 0.005, 0.0115), 0.004, 1), steel))
        self._keys = scene.poses(shapes.key_poses())
        self._mug = mesh("mug", (shapes.mug(), enamel))
        self._papers = mesh("papers", (box((-0.105, -shapes.SUNK, -0.148), (0.105, 0.03, 0.148)), paper))
        self._bin = mesh("bin", (shapes.bin(), steel))
        self._pot = mesh("pot", (shapes.pot(), clay), (cylinder(0.018, 0.28, 1.2, 12), wood))
        self._leaf = mesh("leaf", (shapes.leaf(), leaf))
        self._foliage = scene.poses(shapes.foliage(seed=11, count=96))
        self._radiator = mesh("radiator", (shapes.radiator(), enamel))
        self._fin = mesh("fin", (rounded_box((0.022, 0.28, 0.05), 0.02, 2), enamel))
        self._fins = scene.poses(shapes.fin_poses())
        foot, shade = shapes.lamp()
        self._lamp = mesh("desk_lamp", (foot, black), (shade, clay))
        top, foot = shapes.table()
        self._table = mesh("table", (top, wood), (foot, steel))
        self._crate = mesh(
            "crate", (box((-0.3, -shapes.SUNK, -0.2), (0.3, 0.36, 0.2)), scene.material("card", (0.6, 0.45, 0.28)))
        )
        self._whiteboard = mesh("whiteboard", (rounded_box((0.9, 0.6, 0.015), 0.012, 2).moved((0, 1.5, 0.01)), enamel))

    def _place(self, name, mesh, room, at, facing):
        x, y, z = at if len(at) == 3 else (at[0], 0.0, at[1])
        return self._scene.node(name, mesh, (x, y, z), turn(Y, facing), parent=room)

    def shelf(self, room, at, facing=0):
        shelf = self._place("shelf", self._shelf, room, at, facing)
        for book, poses in zip(self._books, self._fillings[self._filled % FILLINGS]):
            self._scene.instances("books", book, poses, parent=shelf)
        self._filled += 1

    def workplace(self, room, at, facing=0, seat=True):
        """Desk with screen, keyboard, mug and papers; the chair on its +z side. Returns the desk's node."""
        desk = self._place("desk", self._desk, room, at, facing)
        top = 0.75
        self._place("screen", self._screen, desk, (0.05, top, -0.2), -4)
        keyboard = self._place("keyboard", self._board, desk, (0, top + 0.008, 0.16), 2)
        self._scene.instances("keys", self._key, self._keys, parent=keyboard)
        self._place("mug", self._mug, desk, (0.4, top, 0.12), 40)
        self._place("papers", self._papers, desk, (-0.5, top, 0.1), 12)
        if seat:
            self.chair(desk, (0.05, 0.72), 170)
        return desk

    def lamp(self, desk, power):
        """A desk lamp on a desk, with its point light."""
        lamp = self._place("desk_lamp", self._lamp, desk, (-0.62, 0.75, -0.2), 50)
        self._scene.light("desk_lamp", "point", power, position=shapes.LAMP_BULB, parent=lamp)

    def plant(self, room, at, facing=0):
        pot = self._place("plant", self._pot, room, at, facing)
        self._scene.instances("leaves", self._leaf, self._foliage, parent=pot)

    def radiator(self, room, at, facing=0):
        feeds = self._place("radiator", self._radiator, room, at, facing)
        self._scene.instances("fins", self._fin, self._fins, parent=feeds)

    def crates(self, room, at, facing=0, high=1):
        for k in range(high):
            x, z = at
            self._place("crate", self._crate, room, (x, k * 0.355, z), facing + 7 * k)

    def chair(self, room, at, facing=0):
        self._place("chair", self._chair, room, at, facing)

    def armchair(self, room, at, facing=0):
        self._place("armchair", self._armchair, room, at, facing)

    def table(self, room, at, mugs=0):
        table = self._place("table", self._table, room, at, 0)
        for k in range(mugs):
            sine, cosine = sin_cos(shapes.GOLDEN_ANGLE * k)
            self._place("mug", self._mug, table, (0.33 * cosine, 0.424, 0.33 * sine), 50 * k)

    def bin(self, room, at):
        self._place("bin", self._bin, room, at, 0)

    def whiteboard(self, room, at, facing=0):
        self._place("whiteboard", self._whiteboard, room, at, facing)
