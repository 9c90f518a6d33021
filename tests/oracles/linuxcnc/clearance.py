"""How deep a path cuts into what was programmed."""

import math
from dataclasses import dataclass

from geometry import TAU, Arc, Contour, Line, apart, dot, minus, nearest, to_point
from programs import SHALLOW_RAD

# Less than this nearer to a wall is rounding, as in Kerf's definition of a gouge.
GOUGE_MM = 1e-4
# What a lead may cut off the free end of a contour, or run back, without a word.
UNSEEN_MM = 0.002


@dataclass
class Piece:
    """A move of the tool: in the plane, and its heights. `block`: of the program, from 0."""
    block: int
    is_rapid: bool
    element: object
    heights: tuple

    def is_of(self, programmed):
        """Whether it is what a programmed element has become, and no corner before it."""
        if isinstance(programmed, Line):
            return isinstance(self.element, Line)
        if not isinstance(self.element, Arc):
            return False
        return apart(self.element.center, programmed.center) < 1e-3

    @property
    def length(self):
        return math.hypot(self.element.length, self.heights[1] - self.heights[0])

    def at(self, part):
        low, high = self.heights
        return self.element.at(part) + (low + part * (high - low),)

    def distance(self, point):
        """How far a point in space is from it. On a helix, at the place next to it."""
        flat, heights = self.element, self.heights
        if isinstance(flat, Line):
            way = [b - a for a, b in zip(flat.start + heights[:1], flat.end + heights[1:])]
            gap = [p - a for a, p in zip(flat.start + heights[:1], point)]
            square = sum(w * w for w in way)
            part = sum(w * g for w, g in zip(way, gap)) / square if square else 0.0
            return math.dist(self.at(min(1.0, max(0.0, part))), point)
        return min(math.dist(self.at(part), point) for part in (flat.part_of(point[:2]), 0.0, 1.0))


def moved(block, is_rapid, start, end, center=None, turn=0):
    if center is None:
        element = Line(start[:2], end[:2])
    else:
        element = Arc.between(start[:2], end[:2], center, turn < 0)
        more = TAU * (abs(turn) - 1)
        element = Arc(element.center, element.radius, element.angle,
                      element.sweep + math.copysign(more, element.sweep))
    return Piece(block, is_rapid, element, (start[2], end[2]))


@dataclass
class Cuts:
    """How deep a path cuts the walls of what was programmed, mm."""
    gouge: float = 0.0
    lead: float = 0.0
    # What of an element is gone is run backwards.
    back: float = 0.0
    # Most of a full circle is not run at all.
    missed: float = 0.0
    nick: float = 0.0
    other_pass: float = 0.0
    where: str = ""

    def add(self, kind, depth, where):
        if depth > getattr(self, kind):
            setattr(self, kind, depth)
            if kind in ("gouge", "lead", "back", "missed"):
                self.where = where

    def is_wrong(self, allowed_mm=GOUGE_MM):
        odd = max(self.back, self.missed)
        return max(self.gouge, self.lead) > allowed_mm or odd > max(allowed_mm, UNSEEN_MM)

    def __str__(self):
        kinds = ("gouge", "lead", "back", "missed", "nick", "other_pass")
        depths = [f"{kind} {getattr(self, kind):.5f}" for kind in kinds
                  if getattr(self, kind) > GOUGE_MM]
        return ", ".join(depths) + (f" {self.where}" if self.where else "") or "nothing"


def measure(program, path, more_mm=0.0):
    """What a path cuts of the contours that were programmed, with a radius so much larger."""
    radius = program.radius + more_mm
    cuts = Cuts()
    contours = [Contour(span.elements) if span.elements else None for span in program.spans]
    for piece in path:
        if piece.block < 0:
            continue
        block = program.blocks[piece.block]
        if block.role == "free" or piece.element.length < 1e-6 or contours[block.span] is None:
            continue
        contour = contours[block.span]
        span = program.spans[block.span]
        if block.role in ("on", "off"):
            measure_lead(cuts, radius, contour, span, piece, block.role == "on")
        elif block.role == "contour":
            if piece.is_of(contour.elements[block.element]):
                more = SHALLOW_RAD * program.is_shallow()
                back = runs_back(piece.element, contour.elements[block.element], more)
                cuts.add("back", back, f"in block {piece.block}")
            for place, element in shares(contour, block.element, piece.element):
                own = contour.pass_of(place)
                for number, at, wall in contour.walls(place):
                    distance, where, _ = nearest(element, wall)
                    depth = radius - distance
                    kind = "gouge" if number == own else "other_pass"
                    cuts.add(kind, depth, f"block {piece.block} into element {at:.2f} of the "
                                          f"contour at X{where[0]:.3f} Y{where[1]:.3f}")
    for number, block in enumerate(program.blocks):
        whole = program.spans[block.span].elements[block.element] if block.element >= 0 else None
        if isinstance(whole, Arc) and abs(whole.sweep) > TAU - 1e-6:
            run = [piece.element.sweep for piece in path
                   if piece.block == number and piece.is_of(whole)]
            missed = (abs(whole.sweep) - sum(map(abs, run))) * whole.radius
            if missed > math.pi * whole.radius:
                cuts.add("missed", missed, f"in block {number}")
    return cuts


def runs_back(element, programmed, more_rad):
    """How far a move goes that runs against what was programmed, or an arc beyond it.

    Where LinuxCNC joins a shallow corner with a straight, the arc after it is longer by that turn.
    """
    if isinstance(element, Line):
        return element.length if dot(minus(element.end, element.start),
                                     minus(programmed.end, programmed.start)) < 0.0 else 0.0
    return max(0.0, abs(element.sweep) - abs(programmed.sweep) - more_rad) * element.radius


def shares(contour, index, element):
    """A piece of the path next to an element, cut where the passes of the contour are cut."""
    parts = [(0.0, float(index))]
    cuts = {place for it in contour.passes for place in (it.begin, it.end, it.stop)}
    for cut in sorted(cuts):
        if index + 1e-9 < cut < index + 1 - 1e-9:
            point = contour.elements[index].at(cut - index)
            parts.append((element.part_of(point), cut))
    ends = [part for part, _ in parts[1:]] + [1.0]
    for (begin, place), end in zip(parts, ends):
        if (end - begin) * element.length > 1e-6:
            yield place, element.piece(begin, end)


def measure_lead(cuts, radius, contour, span, piece, is_on):
    count = float(len(contour.elements))
    way = piece.element
    low = min(piece.heights)
    # Above all cuts of a pass, and above the material, it is in the air.
    walls = []
    for number, at, wall in contour.walls():
        it = contour.passes[number]
        highest = max(span.heights[int(it.start):math.ceil(it.stop)])
        if not (low > highest + 1e-9 and low > 0.0):
            walls.append((at, wall))
    is_free = contour.passes[0].begin == 0.0 if is_on else contour.passes[-1].end == count
    point = contour.elements[0].start if is_on else contour.elements[-1].end
    joint = way.end if is_on else way.start
    to_end = to_point(way, point)[0]
    passed_mm = 0.0
    # A curve in chords bends from the lead at once: there they meet a little farther out.
    farthest = radius / math.cos(0.05) + 2.0 * GOUGE_MM
    if is_free and apart(joint, point) <= farthest and to_end < radius:
        # Nearer than a radius to the contour within 2 R tan(phi/2) of its end, where the lead
        # misses the perpendicular by phi, and as near to the end as R cos(phi).
        passed_mm = 2.0 * radius * math.sqrt((radius - to_end) / (radius + to_end))
    for at, wall in walls:
        if is_on:
            before = sum(it.length for it in contour.elements[:int(at)])
            before += (at % 1.0) * contour.elements[int(at)].length
        else:
            before = sum(it.length for it in contour.elements[int(at):])
            before -= (at % 1.0) * contour.elements[int(at)].length + wall.length
        split = min(1.0, max(0.0, (passed_mm - before) / wall.length))
        near, far = (split, 1.0), (0.0, split)
        if is_on:
            near, far = (0.0, split), (split, 1.0)
        else:
            near, far = (1.0 - split, 1.0), (0.0, 1.0 - split)
        for (a, b), is_end in ((near, True), (far, False)):
            if (b - a) * wall.length < 1e-9:
                continue
            distance, where, _ = nearest(way, wall.piece(a, b))
            is_nick = is_end and distance >= to_end - 1e-6
            where = f"block {piece.block} into element {at:.2f} of the contour at " \
                    f"X{where[0]:.3f} Y{where[1]:.3f}"
            cuts.add("nick" if is_nick else "lead", radius - distance, where)
