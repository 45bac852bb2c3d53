"""Shapes as triangles: solids closed and outward, sheets counter-clockwise from the front.

Shapes that are turned stand upright on y, unless stated; lengths in metres, angles in degrees. A solid shares its edges
vertex for vertex (no T-junctions), so that no ray slips through; solids that meet are sunk into each other.
"""

from .portable import NO_TURN, Y, add, cross, dot, length, rotate, scale, sin_cos, subtract, turn, unit

CREASE_COSINE = 0.7  # profiles bend smoothly up to about 45 degrees and have an edge beyond
ORIGIN = (0.0, 0.0, 0.0)


class Geometry:
    """Corners (position, normal, uv), three a triangle."""

    def __init__(self, corners=()):
        self.corners = list(corners)

    def __add__(self, other):
        return Geometry(self.corners + other.corners)

    def moved(self, translation=ORIGIN, rotation=NO_TURN):
        return Geometry((add(rotate(rotation, p), translation), rotate(rotation, n), uv) for p, n, uv in self.corners)

    def turned(self, degrees):
        return self.moved(rotation=turn(Y, degrees))

    def face(self, *corners):
        """Adds a convex face, counter-clockwise, as a fan; triangles that a pole makes empty are left out."""
        for second, third in zip(corners[1:], corners[2:]):
            triangle = (corners[0], second, third)
            if len({corner[0] for corner in triangle}) == 3:
                self.corners.extend(triangle)


def join(parts):
    joined = Geometry()
    for part in parts:
        joined.corners.extend(part.corners)
    return joined


def quad(a, b, c, d):
    """Flat sheet, counter-clockwise from the front; the texture's lower left at `a`, upper left at `d`."""
    normal = unit(cross(subtract(b, a), subtract(d, a)))
    sheet = Geometry()
    sheet.face((a, normal, (0, 1)), (b, normal, (1, 1)), (c, normal, (1, 0)), (d, normal, (0, 0)))
    return sheet


def box(low, high):
    """Box between two corners."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return join(
        [
            quad((x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)),
            quad((x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)),
            quad((x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)),
            quad((x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)),
            quad((x0, y1, z1), (x1, y1, z1), (x1, y1, z0), (x0, y1, z0)),
            quad((x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)),
        ]
    )


def inside_out(geometry):
    """The same surface seen from its other side."""
    flipped = Geometry()
    triangles = zip(*[iter(geometry.corners)] * 3)
    for triangle in triangles:
        flipped.corners.extend((p, scale(n, -1.0), uv) for p, n, uv in reversed(triangle))
    return flipped


def square_frame(inner, outer, low, high):
    """Square ring about the y axis between two half widths: slabs, walls and parapets round a court."""
    corners = [(1, 1), (1, -1), (-1, -1), (-1, 1)]  # counter-clockwise from above
    ring = Geometry()

    def at(corner, half, y):
        return (corner[0] * half, y, corner[1] * half)

    for k in range(4):
        a, b = corners[k], corners[(k + 1) % 4]
        ring += quad(at(a, outer, low), at(b, outer, low), at(b, outer, high), at(a, outer, high))
        ring += quad(at(b, inner, low), at(a, inner, low), at(a, inner, high), at(b, inner, high))
        ring += quad(at(a, inner, high), at(a, outer, high), at(b, outer, high), at(b, inner, high))
        ring += quad(at(a, inner, low), at(b, inner, low), at(b, outer, low), at(a, outer, low))
    return ring


def _profile_normals(points):
    """For each segment of a profile with its solid on the left: the normals (to the right) at its two ends."""
    flat = [unit((q[1] - p[1], p[0] - q[0], 0.0)) for p, q in zip(points, points[1:])]
    closed = points[0] == points[-1]

    def smooth(k, neighbour):
        if not closed and not 0 <= neighbour < len(flat):
            return flat[k]
        other = flat[neighbour % len(flat)]
        return unit(add(flat[k], other)) if dot(flat[k], other) > CREASE_COSINE else flat[k]

    return [(smooth(k, k - 1), smooth(k, k + 1)) for k in range(len(flat))]


def pierced_wall(lower_edge, top, depth):
    """Wall along x, centred on z, whose lower edge is the polyline (x, y) from left to right: doors and arches.

    Where the polyline is vertical the wall has a jamb; the foot of every jamb stands at the wall's foot.
    """
    front, back = depth / 2, -depth / 2
    levels = sorted({y for p, q in zip(lower_edge, lower_edge[1:]) if p[0] == q[0] for y in (p[1], q[1])})
    wall = Geometry()

    def between(y):
        return [level for level in levels if y < level < top]

    def panel(x0, y0s, x1, y1s, z, flip):
        for k in range(len(y0s) - 1):
            corners = [(x0, y0s[k], z), (x1, y1s[k], z), (x1, y1s[k + 1], z), (x0, y0s[k + 1], z)]
            wall.corners.extend(quad(*(corners[::-1] if flip else corners)).corners)

    normals = _profile_normals(lower_edge)
    for ((x0, y0), (x1, y1)), (n0, n1) in zip(zip(lower_edge, lower_edge[1:]), normals):
        wall.face(
            ((x0, y0, back), n0, (0, 0)),
            ((x1, y1, back), n1, (0, 0)),
            ((x1, y1, front), n1, (0, 0)),
            ((x0, y0, front), n0, (0, 0)),
        )
        if x0 < x1:
            rows = between(max(y0, y1)) + [top]
            panel(x0, [y0] + rows, x1, [y1] + rows, front, flip=False)
            panel(x0, [y0] + rows, x1, [y1] + rows, back, flip=True)
            wall += quad((x0, top, front), (x1, top, front), (x1, top, back), (x0, top, back))
    for (x, y), z0, z1 in ((lower_edge[0], back, front), (lower_edge[-1], front, back)):
        rows = [y] + between(y) + [top]
        for low, high in zip(rows, rows[1:]):
            wall += quad((x, low, z0), (x, low, z1), (x, high, z1), (x, high, z0))
    return wall


def lathe(profile, segments):
    """Profile (radius, y) turned about y, upwards on the outside; a solid if it ends on the axis or where it began."""
    ring = [sin_cos(360 * k / segments) for k in range(segments)]
    turned = Geometry()

    def corner(point, normal, angle):
        sine, cosine = angle
        return (
            (point[0] * cosine, point[1], -point[0] * sine),
            (normal[0] * cosine, normal[1], -normal[0] * sine),
            (0, 0),
        )

    for p, q, (n_p, n_q) in zip(profile, profile[1:], _profile_normals(profile)):
        for k in range(segments):
            here, there = ring[k], ring[(k + 1) % segments]
            turned.face(corner(p, n_p, here), corner(p, n_p, there), corner(q, n_q, there), corner(q, n_q, here))
    return turned


def cylinder(radius, low, high, segments):
    return lathe([(0.0, low), (radius, low), (radius, high), (0.0, high)], segments)


def sphere(radius, segments, rings):
    """Sphere about the origin with exact normals."""
    angles = [sin_cos(180 * k / rings - 90) for k in range(rings + 1)]
    turned = lathe([(radius * cosine, radius * sine) for sine, cosine in angles], segments)
    return Geometry((p, unit(p), uv) for p, _, uv in turned.corners)


def rounded_box(half, radius, steps):
    """Box of half extents `half` about the origin, edges rounded by `radius` in 2·steps facets."""

    def lines(extent):
        """Positions across a face: the two rounded strips and, between them, one flat strip."""
        offsets = [sin_cos(45 * k / steps) for k in range(steps + 1)]
        strip = [extent - radius + radius * sine / cosine for sine, cosine in offsets[:-1]] + [extent]
        return [-x for x in reversed(strip)] + strip

    core = [h - radius for h in half]
    solid = Geometry()

    def corner(point):
        inner = tuple(min(max(x, -c), c) for x, c in zip(point, core))
        normal = unit(subtract(point, inner))
        return (add(inner, scale(normal, radius)), normal, (0, 0))

    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        us, vs = lines(half[u]), lines(half[v])
        for side in (-1, 1):

            def at(a, b):
                point = [0.0, 0.0, 0.0]
                point[axis], point[u], point[v] = side * half[axis], a, b
                return corner(tuple(point))

            for u0, u1 in zip(us, us[1:]):
                for v0, v1 in zip(vs, vs[1:]):
                    face = [at(u0, v0), at(u1, v0), at(u1, v1), at(u0, v1)]
                    solid.face(*(face if side > 0 else reversed(face)))
    return solid


def tube(path, radius, sides):
    """Round bar along a path of points, with flat ends."""
    directions = [unit(subtract(q, p)) for p, q in zip(path, path[1:])]
    ring = [sin_cos(360 * k / sides) for k in range(sides)]
    side = unit(cross(directions[0], Y if abs(directions[0][1]) < 0.9 else (1.0, 0.0, 0.0)))
    loops = []
    for k, point in enumerate(path):
        before, behind = directions[max(k - 1, 0)], directions[min(k, len(directions) - 1)]
        tangent = unit(add(before, behind))
        side = unit(subtract(side, scale(tangent, dot(side, tangent))))
        other = cross(tangent, side)
        spokes = [add(scale(side, cosine), scale(other, sine)) for sine, cosine in ring]
        loops.append([(add(point, scale(spoke, radius)), spoke, (0, 0)) for spoke in spokes])
    bar = Geometry()
    for here, there in zip(loops, loops[1:]):
        for k in range(sides):
            after = (k + 1) % sides
            bar.face(here[k], here[after], there[after], there[k])
    for loop, normal in ((reversed(loops[0]), scale(directions[0], -1.0)), (loops[-1], directions[-1])):
        bar.face(*[(p, normal, (0, 0)) for p, _, _ in loop])
    return bar


def sheet(rows):
    """Open surface through a grid of points, smooth; the front is where rows go up and columns go right."""
    last_row, last_column = len(rows) - 1, len(rows[0]) - 1

    def corner(r, c):
        along = subtract(rows[r][min(c + 1, last_column)], rows[r][max(c - 1, 0)])
        up = subtract(rows[min(r + 1, last_row)][c], rows[max(r - 1, 0)][c])
        normal = cross(along, up)
        assert length(normal) > 0, "a sheet's rows must not shrink to a point"
        return (rows[r][c], unit(normal), (0, 0))

    surface = Geometry()
    for r in range(last_row):
        for c in range(last_column):
            surface.face(corner(r, c), corner(r, c + 1), corner(r + 1, c + 1), corner(r + 1, c))
    return surface
