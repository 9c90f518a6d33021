"""Lines and arcs in a plane, how near they come to each other, and the walls of a contour.

Written from the definitions alone, with none of the code or the methods of Kerf: distances in
closed form between the elements as they are, without offsets.
"""

import math
from dataclasses import dataclass

TAU = 2.0 * math.pi
# Programs are written with three to six decimals: a contour that meets itself this nearly does.
MEETS_MM = 1e-4


def minus(a, b):
    return (a[0] - b[0], a[1] - b[1])


def plus(a, b, factor=1.0):
    return (a[0] + factor * b[0], a[1] + factor * b[1])


def apart(a, b):
    return math.hypot(a[0] - b[0], a[1] - b[1])


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1]


def polar(angle, length=1.0):
    return (length * math.cos(angle), length * math.sin(angle))


@dataclass(frozen=True)
class Line:
    start: tuple
    end: tuple

    @property
    def length(self):
        return apart(self.start, self.end)

    def at(self, part):
        return plus(self.start, minus(self.end, self.start), part)

    def part_of(self, point):
        """Where on it is nearest to a point: 0 at the start, 1 at the end."""
        way = minus(self.end, self.start)
        square = dot(way, way)
        return min(1.0, max(0.0, dot(minus(point, self.start), way) / square)) if square else 0.0

    def feet(self, point):
        """Where its normal may point to the point."""
        return [self.at(self.part_of(point))]

    def piece(self, begin, end):
        return Line(self.at(begin), self.at(end))


@dataclass(frozen=True)
class Arc:
    """Counterclockwise where `sweep` is positive; a full circle sweeps ± 2 pi."""
    center: tuple
    radius: float
    angle: float
    sweep: float

    @staticmethod
    def between(start, end, center, clockwise):
        """Equal ends are a full circle. The radius is that of the start."""
        begin = minus(start, center)
        finish = minus(end, center)
        angle = math.atan2(begin[1], begin[0])
        turn = math.atan2(cross(begin, finish), dot(begin, finish))
        if apart(start, end) < 1e-9:
            turn = 0.0
        if clockwise:
            sweep = turn - TAU if turn >= -0.0 else turn
        else:
            sweep = turn + TAU if turn <= 0.0 else turn
        return Arc(center, math.hypot(*begin), angle, sweep)

    @property
    def length(self):
        return abs(self.sweep) * self.radius

    @property
    def start(self):
        return self.at(0.0)

    @property
    def end(self):
        return self.at(1.0)

    def at(self, part):
        return plus(self.center, polar(self.angle + part * self.sweep, self.radius))

    def part_at(self, angle):
        """The part of the sweep at a direction from the centre; None where it is not swept."""
        turned = (angle - self.angle) % TAU
        if self.sweep < 0.0:
            turned = (self.angle - angle) % TAU
        # Rounding just before the start is the start.
        if turned > abs(self.sweep) and TAU - turned < 1e-9:
            turned = 0.0
        return turned / abs(self.sweep) if turned <= abs(self.sweep) + 1e-9 else None

    def part_of(self, point):
        toward = minus(point, self.center)
        part = self.part_at(math.atan2(toward[1], toward[0]))
        if part is not None:
            return min(part, 1.0)
        return 0.0 if apart(point, self.start) <= apart(point, self.end) else 1.0

    def feet(self, point):
        toward = minus(point, self.center)
        if math.hypot(*toward) < 1e-12:
            return [self.start]
        angle = math.atan2(toward[1], toward[0])
        parts = [self.part_at(angle), self.part_at(angle + math.pi)]
        return [self.at(part) for part in parts if part is not None]

    def piece(self, begin, end):
        return Arc(self.center, self.radius, self.angle + begin * self.sweep,
                   (end - begin) * self.sweep)


def to_point(element, point):
    """The distance of an element from a point, and where on it."""
    places = element.feet(point) + [element.start, element.end]
    return min((apart(place, point), place) for place in places)


def crossings(one, other):
    """The points that both are on."""
    if isinstance(one, Line) and isinstance(other, Line):
        a, b = minus(one.end, one.start), minus(other.end, other.start)
        area = cross(a, b)
        if abs(area) <= 1e-12 * one.length * other.length or not area:
            return []
        gap = minus(other.start, one.start)
        s, t = cross(gap, b) / area, cross(gap, a) / area
        return [one.at(s)] if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0 else []
    if isinstance(one, Arc) and isinstance(other, Line):
        return crossings(other, one)
    if isinstance(one, Line):
        length = one.length
        if not length:
            return []
        way = plus((0.0, 0.0), minus(one.end, one.start), 1.0 / length)
        along = dot(minus(other.center, one.start), way)
        high = cross(way, minus(other.center, one.start))
        half = other.radius ** 2 - high ** 2
        if half < 0.0:
            return []
        found = []
        for s in (along - math.sqrt(half), along + math.sqrt(half)):
            point = plus(one.start, way, s)
            toward = minus(point, other.center)
            if 0.0 <= s <= length and other.part_at(math.atan2(toward[1], toward[0])) is not None:
                found.append(point)
        return found
    gap = minus(other.center, one.center)
    d = math.hypot(*gap)
    if d < 1e-12 or d > one.radius + other.radius or d < abs(one.radius - other.radius):
        return []
    along = (d * d + one.radius ** 2 - other.radius ** 2) / (2.0 * d)
    high = math.sqrt(max(0.0, one.radius ** 2 - along ** 2))
    found = []
    for sign in (1.0, -1.0):
        offset = (along * gap[0] - sign * high * gap[1], along * gap[1] + sign * high * gap[0])
        point = plus(one.center, offset, 1.0 / d)
        angles = [math.atan2(*reversed(minus(point, arc.center))) for arc in (one, other)]
        if one.part_at(angles[0]) is not None and other.part_at(angles[1]) is not None:
            found.append(point)
    return found


def nearest(one, other):
    """The distance between two elements, and the place on each of them."""
    shared = crossings(one, other)
    if shared:
        return 0.0, shared[0], shared[0]
    found = []
    for point in (one.start, one.end):
        distance, place = to_point(other, point)
        found.append((distance, point, place))
    for point in (other.start, other.end):
        distance, place = to_point(one, point)
        found.append((distance, place, point))
    # Within both, the shortest way is a normal of both: it runs through the centres of arcs.
    if isinstance(one, Arc):
        for place in other.feet(one.center):
            found.extend((apart(foot, place), foot, place) for foot in one.feet(place))
    if isinstance(other, Arc):
        for place in one.feet(other.center):
            found.extend((apart(foot, place), place, foot) for foot in other.feet(place))
    return min(found)


@dataclass(frozen=True)
class Pass:
    """From a place of a contour to a place, and between which of them it is a wall."""
    start: float
    stop: float
    begin: float
    end: float


class Contour:
    """Elements one after another, what of them are walls, and in which pass.

    A place is counted along it: 2.25 is a quarter of element 2. A pass ends where the contour
    returns to a point that it has passed since the pass began. What a pass has before the first
    place where it meets itself, and after the last, are tails: they bound nothing but a tool
    that runs along them. So are what leads to the first closed loop and away from the last,
    even where these two cross. A contour that never meets itself is one pass without tails.
    """

    def __init__(self, elements):
        self.elements = elements
        count = float(len(elements))
        meetings = self._meetings()
        closings, start = [], 0.0
        for early, late, is_return in meetings:
            if is_return and early >= start - 1e-9 and late > start:
                closings.append((early, late))
                start = late
        cuts = [0.0] + [late for _, late in closings]
        if cuts[-1] < count - 1e-9:
            cuts.append(count)
        self.passes = []
        for start, stop in zip(cuts, cuts[1:]):
            inside = [(early, late) for early, late, _ in meetings
                      if early >= start - 1e-9 and late <= stop + 1e-9]
            begin = min((early for early, _ in inside), default=start)
            end = max((late for _, late in inside), default=stop)
            if closings and start == 0.0:
                begin = min(early for early, late, _ in meetings if late <= closings[-1][1] + 1e-9)
            if closings and start == closings[-1][1]:
                end = max([late for early, late, _ in meetings if early >= closings[0][0] - 1e-9]
                          + [start])
            self.passes.append(Pass(start, stop, max(begin, start), min(end, stop)))
        self._cache = {}

    def between(self, begin, end):
        """The elements from a place to a place, with the place where each begins."""
        found = []
        for index in range(int(begin), min(math.ceil(end), len(self.elements))):
            a, b = max(0.0, begin - index), min(1.0, end - index)
            element = self.elements[index]
            if (b - a) * element.length > 1e-7:
                found.append((index + a, element.piece(a, b)))
        return found

    def _meetings(self):
        """(early, late, whether it is a return and no mere crossing), in the order of `late`."""
        found = []
        lengths = [0.0]
        for element in self.elements:
            lengths.append(lengths[-1] + element.length)
        for number, late in enumerate(self.elements):
            if isinstance(late, Arc) and abs(late.sweep) > TAU - 1e-9:
                found.append((float(number), number + TAU / abs(late.sweep), True))
            for before, early in enumerate(self.elements[:number]):
                for a, b in touches(early, late):
                    way = lengths[number] + b * late.length - lengths[before] - a * early.length
                    # The joint of neighbours is none; at a cusp they part slowly.
                    if way > (0.1 if before + 1 == number else 10.0 * MEETS_MM):
                        at_joint = min(b, 1.0 - b) * late.length < MEETS_MM
                        at_start = before == 0 and a * early.length < MEETS_MM
                        found.append((before + a, number + b, at_joint or at_start))
        return sorted(found, key=lambda places: (round(places[1], 9), places[0]))

    def pass_of(self, place):
        for number, it in enumerate(self.passes):
            if place < it.stop - 1e-9:
                return number
        return len(self.passes) - 1

    def walls(self, place=None):
        """(pass, place, wall): what bounds a tool; of a tool along the contour, with the tail
        that it runs along."""
        own = None if place is None else self.pass_of(place)
        along = None
        if own is not None:
            it = self.passes[own]
            along = (own, place < it.begin - 1e-9, place >= it.end - 1e-9)
        if along not in self._cache:
            walls = []
            for number, it in enumerate(self.passes):
                begin, end = it.begin, it.end
                if number == own:
                    begin = it.start if along[1] else begin
                    end = it.stop if along[2] else end
                walls.extend((number, at, wall) for at, wall in self.between(begin, end))
            self._cache[along] = walls
        return self._cache[along]


def touches(one, other):
    """Where two elements meet: pairs of parts."""
    points = list(crossings(one, other))
    for point in (other.start, other.end):
        if to_point(one, point)[0] < MEETS_MM:
            points.append(point)
    for point in (one.start, one.end):
        if to_point(other, point)[0] < MEETS_MM:
            points.append(point)
    distance, on_one, _ = nearest(one, other)
    if distance < MEETS_MM:
        points.append(on_one)
    return [(one.part_of(point), other.part_of(point)) for point in points]
