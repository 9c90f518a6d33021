"""Programs under cutter radius compensation: every kind of entry, corner, exit, loop and overlap.

Each knows what it has programmed: the contours, where each block belongs, and how to write itself
in another size.
"""

import math
import random
from dataclasses import dataclass, field

from geometry import Arc, Line, minus, plus, polar

LEFT, RIGHT = 1.0, -1.0
MARK = "block "
# LinuxCNC joins elements that turn by less with a straight, which cuts R (1 - cos turn).
SHALLOW_RAD = 0.05


@dataclass
class Span:
    side: float
    elements: list = field(default_factory=list)
    # The lead-on, if it is an arc.
    lead: object = None
    # Of each element: its greatest height.
    heights: list = field(default_factory=list)


@dataclass
class Block:
    """A line of the program: words with lengths in them, and what it does."""
    words: list
    # "free", "on", "contour", "off_plane" or "off", of a span; of a contour, which element.
    role: str = "free"
    span: int = -1
    element: int = -1


class Program:
    def __init__(self, name, radius=5.0, digits=9, tool="diameter"):
        self.name = name
        self.radius = radius
        self.digits = digits
        # "diameter": G41.1 D, "number": G41 D of a table, "spindle": G41 with the tool loaded.
        self.tool = tool
        self.blocks = []
        self.spans = []
        self.at = (0.0, 0.0)
        self.height = 5.0
        self.is_on = self.is_armed = self.is_leaving = False
        self.add(["G21 G17 G90 G40"])
        if tool == "spindle":
            self.add(["T1 M6"])

    def add(self, words, **role):
        self.blocks.append(Block(words, **role))
        return self

    def round(self, point):
        return tuple(round(value, self.digits) for value in point)

    def text(self, size=1):
        """One block a line; all lengths `size` times as large, so that more digits of the path
        can be read. A comment before each block says in the output which block did what."""
        lines = []
        for number, block in enumerate(self.blocks):
            lines.append(f"({MARK}{number})")
            parts = [
                f"{letter}{value * size:.{self.digits}f}" if letter else value
                for letter, value in (("", it) if isinstance(it, str) else it for it in block.words)
            ]
            lines.append(" ".join(parts))
        return "\n".join(lines) + "\n"

    @property
    def rounding_mm(self):
        """What coordinates with so few decimals leave open of where the contour is."""
        return 4.0 * 10.0 ** -self.digits if self.digits < 9 else 0.0

    def is_shallow(self):
        """Whether somewhere it turns by less than LinuxCNC rounds, and is not tangent."""
        for span in self.spans:
            elements = [span.lead] * (span.lead is not None) + span.elements
            for one, other in zip(elements, elements[1:]):
                turn = heading(other, False) - heading(one, True)
                turn = abs(math.remainder(turn, 2.0 * math.pi))
                if 1e-7 < turn < SHALLOW_RAD:
                    return True
        return False

    def block_of_line(self, line):
        return line // 2 - 1

    def select(self, side):
        left = side == LEFT
        if self.tool == "diameter":
            return ["G41.1" if left else "G42.1", ("D", 2.0 * self.radius)]
        return ["G41" if left else "G42"] + (["D1"] if self.tool == "number" else [])

    def xy(self, end, z=None):
        words = [("X", end[0]), ("Y", end[1])]
        return words if z is None else words + [("Z", z)]

    def rapid(self, end):
        end = self.round(end)
        self._moved("G0", end, None)
        return self

    def plunge(self, z, motion="G1 F600"):
        role = "off_plane" if self.is_on else "free"
        self.add([motion, ("Z", z)], role=role, span=len(self.spans) - 1)
        self.height = z
        return self

    def arm(self, side):
        """G41 on a line of its own."""
        self.spans.append(Span(side))
        self.is_armed = True
        return self.add(self.select(side))

    def on(self, side, end, motion="G1 F600", z=None):
        end = self.round(end)
        self.spans.append(Span(side))
        words = self.select(side) + [motion] + self.xy(end, z)
        self.add(words, role="on", span=len(self.spans) - 1)
        self.is_on = True
        self.at = end
        self.height = self.height if z is None else z
        return self

    def _moved(self, word, end, element, words=(), z=None):
        span = len(self.spans) - 1
        low = self.height if z is None else z
        role, number = "free", -1
        if self.is_leaving:
            role, self.is_leaving = "off", False
        elif self.is_armed:
            role, self.is_armed, self.is_on = "on", False, True
            self.spans[span].lead = element
        elif self.is_on:
            role, number = "contour", len(self.spans[span].elements)
            self.spans[span].elements.append(element or Line(self.at, end))
            self.spans[span].heights.append(max(low, self.height))
        words = [word] + self.xy(end, z) + list(words)
        self.add(words, role=role, span=span, element=number)
        self.at, self.height = end, low

    def line(self, end, motion="G1", z=None):
        self._moved(motion, self.round(end), None, z=z)
        return self

    def arc(self, end, center, clockwise, z=None):
        end, center = self.round(end), self.round(center)
        offset = minus(center, self.at)
        element = Arc.between(self.at, end, center, clockwise)
        self._moved("G2" if clockwise else "G3", end, element,
                    [("I", offset[0]), ("J", offset[1])], z)
        return self

    def follow(self, element):
        if isinstance(element, Arc):
            return self.arc(element.end, element.center, element.sweep < 0.0)
        return self.line(element.end)

    def off(self, end, motion="G1", z=None):
        self.add(["G40", motion] + self.xy(self.round(end), z), role="off",
                 span=len(self.spans) - 1)
        self.is_on, self.at = False, self.round(end)
        return self

    def cancel(self):
        """G40 on a line of its own."""
        self.is_on, self.is_leaving = False, True
        return self.add(["G40"])

    def end(self):
        return self.add(["M2"])


class Pen:
    """Draws a contour by lengths and turns."""

    def __init__(self, at=(0.0, 0.0), heading=0.0):
        self.at, self.heading = at, math.radians(heading)
        self.elements = []

    def go(self, length):
        end = plus(self.at, polar(self.heading), length)
        self.elements.append(Line(self.at, end))
        self.at = end
        return self

    def turn(self, degrees):
        self.heading += math.radians(degrees)
        return self

    def bend(self, radius, degrees):
        """An arc; to the left where the degrees are positive."""
        side = math.copysign(1.0, degrees)
        center = plus(self.at, polar(self.heading + side * math.pi / 2.0), radius)
        start = self.heading - side * math.pi / 2.0
        arc = Arc(center, radius, start, math.radians(degrees))
        self.elements.append(arc)
        self.at = arc.end
        return self.turn(degrees)


def heading(element, at_end):
    """The direction of travel at an end of an element."""
    if isinstance(element, Arc):
        angle = element.angle + (element.sweep if at_end else 0.0)
        return angle + math.copysign(math.pi / 2.0, element.sweep)
    way = minus(element.end, element.start)
    return math.atan2(way[1], way[0])


def beside(element, side, at_end, degrees, length):
    """A point for a lead: so far from the end of an element, in a direction that is turned from
    where the contour comes from (or goes to) towards the tool."""
    along = heading(element, at_end) + (0.0 if at_end else math.pi)
    sense = side if at_end else -side
    point = element.end if at_end else element.start
    return plus(point, polar(along + sense * math.radians(degrees)), length)


def cut(program, elements, side, entry=(90, 20.0), leave=(90, 20.0), z=-2.0):
    """In from `entry`, along the elements, and out to `leave`: an angle and a length each."""
    program.rapid(beside(elements[0], side, False, *entry)).plunge(z)
    program.on(side, elements[0].start)
    for element in elements:
        program.follow(element)
    program.off(beside(elements[-1], side, True, *leave))
    return program.plunge(5.0, "G0").end()


def sides():
    return (("left", LEFT), ("right", RIGHT))


def corners():
    """Two elements that meet at an angle."""
    leads = [((90, 20.0), (90, 20.0)), ((0, 60.0), (90, 12.0)), ((45, 25.0), (45, 25.0)),
             ((90, 8.0), (0, 60.0))]
    number = 0
    for name, side in sides():
        for before in ("line", "left", "right"):
            for after in ("line", "left", "right"):
                for turn in (-175, -150, -120, -90, -60, -30, -5, 0, 5, 30, 60, 90, 120, 150, 175):
                    pen = Pen((10.0, 20.0), 10.0)
                    draw(pen, before)
                    draw(pen.turn(turn), after)
                    number += 1
                    entry, leave = leads[number % len(leads)]
                    yield cut(Program(f"corner {name} {before}/{after} {turn:+d}"), pen.elements,
                              side, entry, leave)


def draw(pen, kind):
    if kind == "line":
        pen.go(40.0)
    else:
        pen.bend(30.0, 70.0 if kind == "left" else -70.0)


def shapes():
    """Open and closed contours with the side of the tool."""
    yield "open line", [LEFT], Pen((20.0, 0.0)).go(40.0).elements
    yield "open arc left", [LEFT, RIGHT], Pen((20.0, 0.0)).bend(25.0, 120).elements
    yield "open corner", [LEFT, RIGHT], Pen().go(30.0).turn(90).go(30.0).elements
    square = Pen().go(20.0)
    for _ in range(3):
        square.turn(90).go(40.0)
    yield "square from a side", [LEFT, RIGHT], square.turn(90).go(20.0).elements
    square = Pen().go(40.0)
    for _ in range(3):
        square.turn(90).go(40.0)
    yield "square from a corner", [LEFT, RIGHT], square.elements
    yield "circle", [LEFT, RIGHT], Pen().bend(20.0, 360).elements


def entries():
    for shape, tools, elements in shapes():
        for side in tools:
            name = "left" if side == LEFT else "right"
            for degrees in (0, 15, 45, 90, 135, 165, 180, -15, -45, -90, -135):
                for length in (5.001, 7.0, 30.0):
                    program = Program(f"entry {shape} {name} {degrees:+d} {length:g}")
                    yield cut(program, elements, side, (degrees, length))


def led(program, lead, elements, side, leave=(90, 20.0), z=-2.0):
    """In by an arc that the compensation begins with, along the elements, and out."""
    program.rapid(lead.start).plunge(z).arm(side).follow(lead)
    for element in elements:
        program.follow(element)
    program.off(beside(elements[-1], side, True, *leave))
    return program.plunge(5.0, "G0").end()


def arc_leads():
    """An arc as the first move: every sweep and size, on both sides, before every kind of joint."""
    joints = [("line", 0), ("left", 0), ("right", 0), ("line", -90), ("line", 60), ("left", -40),
              ("right", 35), ("line", 130), ("line", -150), ("right", -100), ("left", 80)]
    number = 0
    for name, side in sides():
        for turn in (1, -1):
            for degrees in (10, 30, 45, 60, 90, 135, 180, 225, 270, 315, 350):
                for radius in (3.1, 5.3, 7.7, 12.0, 40.0, 400.0):
                    for _ in range(2):
                        after, bend = joints[number % len(joints)]
                        number += 1
                        pen = Pen((10.0, 20.0), 33.0).bend(radius, degrees * turn)
                        draw(pen.turn(bend), after)
                        sweep = degrees * turn
                        yield led(Program(f"arc lead {name} {radius:g} {sweep:+d} {after} {bend:+d}"),
                                  pen.elements[0], pen.elements[1:], side)


def arc_leads_by_chance(count=300):
    """Random contours after random arcs; the seed is a literal."""
    chance = random.Random(41)
    for number in range(count):
        radius = chance.choice((5.0, 3.0, 1.0))
        pen = Pen((0.0, 0.0), chance.uniform(0.0, 360.0))
        degrees = chance.uniform(20.0, 330.0)
        pen.bend(chance.uniform(0.8, 12.0) * radius, chance.choice((-1, 1)) * degrees)
        for _ in range(chance.randint(1, 5)):
            pen.turn(chance.choice((0, 0, chance.uniform(-100.0, 100.0))))
            if chance.random() < 0.5:
                pen.go(chance.uniform(4.0, 40.0))
            else:
                pen.bend(chance.uniform(4.0, 30.0), chance.choice((-1, 1)) * chance.uniform(20, 160))
        side = chance.choice((LEFT, RIGHT))
        leave = (chance.choice((0, 45, 90)), chance.uniform(1.2, 6.0) * radius)
        # On the far side of its circle, rounded coordinates move the arc of the tool by many times as much.
        digits = chance.choice((9, 9, 4)) if degrees < 150.0 else 9
        yield led(Program(f"arc lead chance {number}", radius, digits), pen.elements[0],
                  pen.elements[1:], side, leave)


def exits():
    for shape, tools, elements in shapes():
        for side in tools:
            name = "left" if side == LEFT else "right"
            for degrees in (0, 15, 45, 90, 135, 165, 180, -15, -45, -90, -135):
                for length in (3.0, 30.0):
                    program = Program(f"exit {shape} {name} {degrees:+d} {length:g}")
                    yield cut(program, elements, side, (90, 20.0), (degrees, length))


def ways_of_writing():
    """The same contours, with the selection, the plunge and the cancel written otherwise."""
    for name, side in sides():
        for shape, elements in (("corner", Pen((0.0, 0.0)).go(40.0).turn(-50).go(30.0).elements),
                                ("arc", Pen((0.0, 0.0)).bend(40.0, 80).go(10.0).elements)):
            start = beside(elements[0], side, False, 90, 20.0)
            finish = beside(elements[-1], side, True, 90, 20.0)

            def begin(what, tool="diameter"):
                return Program(f"way {name} {shape} {what}", tool=tool).rapid(start)

            def along(program):
                for element in elements:
                    program.follow(element)
                return program

            def finished(program):
                return along(program).off(finish).plunge(5.0, "G0").end()

            first = elements[0].start
            yield finished(begin("G41 alone, then the plunge").arm(side).plunge(-2.0).line(first))
            yield finished(begin("G41 alone after the plunge").plunge(-2.0).arm(side).line(first))
            yield finished(begin("selected in a rapid").plunge(-2.0).on(side, first, "G0"))
            yield finished(begin("plunge after the lead-on").plunge(1.0).on(side, first)
                           .plunge(-2.0))
            yield finished(begin("a rapid lead above, then the plunge").on(side, first, "G0")
                           .plunge(-2.0))
            yield finished(begin("a lead-on that slopes").on(side, first, z=-2.0))
            yield finished(begin("tool number", "number").plunge(-2.0).on(side, first))
            yield finished(begin("tool in the spindle", "spindle").plunge(-2.0).on(side, first))
            yield along(begin("G40 alone").plunge(-2.0).on(side, first)).cancel().line(finish) \
                .plunge(5.0, "G0").end()
            yield along(begin("left in a rapid").plunge(-2.0).on(side, first)).off(finish, "G0") \
                .plunge(5.0, "G0").end()
            yield along(begin("G40 alone, up, then away").plunge(-2.0).on(side, first)).cancel() \
                .plunge(5.0, "G0").rapid(finish).end()
            yield along(begin("up, then G40").plunge(-2.0).on(side, first)).plunge(5.0, "G0") \
                .off(finish).end()
            yield along(begin("a lead-off that slopes").plunge(-2.0).on(side, first)) \
                .off(finish, z=5.0).end()
            yield along(begin("G40 alone, up, and nothing more").plunge(-2.0).on(side, first)) \
                .cancel().plunge(5.0, "G0").end()
            yield along(begin("no G40").plunge(-2.0).on(side, first)).end()
            yield along(begin("up, then no G40").plunge(-2.0).on(side, first)) \
                .plunge(5.0, "G0").end()
            yield along(begin("a rapid as the last element").plunge(-2.0).on(side, first)) \
                .line(plus(elements[-1].end, polar(heading(elements[-1], True)), 20.0), "G0") \
                .off(plus(finish, polar(heading(elements[-1], True)), 20.0)).end()
            program = begin("an arc as the lead-on").plunge(-2.0).arm(side)
            middle = plus(start, minus(first, start), 0.5)
            yield finished(program.arc(first, middle, side == RIGHT))
            program = along(begin("an arc as the lead-off").plunge(-2.0).on(side, first)).cancel()
            middle = plus(elements[-1].end, minus(finish, elements[-1].end), 0.5)
            yield program.arc(finish, middle, side == RIGHT).end()
            # A corner with a stop, a function or a move of Z.
            for what, words in (("M8", ["M8"]), ("a dwell", ["G4 P0.1"]), ("a feed", ["F200"]),
                                ("a comment", ["(here)"])):
                program = begin(f"{what} in the corner").plunge(-2.0).on(side, first)
                program.follow(elements[0]).add(words).follow(elements[1])
                yield program.off(finish).end()
            program = begin("deeper in the corner").plunge(-2.0).on(side, first)
            yield program.follow(elements[0]).plunge(-4.0).follow(elements[1]).off(finish).end()
            program = begin("a slope along the contour").plunge(0.0).on(side, first)
            program.line(elements[0].end, z=-3.0) if shape == "corner" else \
                program.arc(elements[0].end, elements[0].center, False, z=-3.0)
            yield program.follow(elements[1]).off(finish).end()


def rounded(width, height, radius, turn):
    """A rectangle with round corners, from the middle of its lower side; -1: clockwise."""
    pen = Pen((0.0, 0.0), 0.0).go(width / 2.0 - radius)
    for side in (height, width, height, width / 2.0 + radius):
        if radius:
            pen.bend(radius, 90.0 * turn)
        else:
            pen.turn(90.0 * turn)
        pen.go(side - 2.0 * radius)
    return pen.elements


def loops():
    """Closed contours: how they are closed, left, and cut again."""
    outlines = {
        "circle 20": [Pen().bend(20.0, 360.0).elements, Pen().bend(20.0, -360.0).elements],
        "circle in halves": [Pen().bend(20.0, 180.0).bend(20.0, 180.0).elements,
                             Pen().bend(20.0, -180.0).bend(20.0, -180.0).elements],
        "rectangle": [rounded(60.0, 40.0, 0.0, 1), rounded(60.0, 40.0, 0.0, -1)],
        "round rectangle": [rounded(60.0, 40.0, 8.0, 1), rounded(60.0, 40.0, 8.0, -1)],
        "slot with round ends": [rounded(60.0, 16.0, 8.0, 1), rounded(60.0, 16.0, 8.0, -1)],
    }
    for outline, both in outlines.items():
        for turn, elements in zip(("ccw", "cw"), both):
            for name, side in sides():
                title = f"loop {outline} {turn} {name}"
                yield cut(Program(f"{title}, closed"), elements, side)
                more = [part_of(elements[0], length) for length in (0.35, 3.0)]
                yield cut(Program(f"{title}, a degree over"), elements + more[:1], side)
                yield cut(Program(f"{title}, 3 mm over"), elements + more[1:], side)
                if isinstance(elements[-1], Line):
                    longer = Line(elements[-1].start, more[1].end)
                    yield cut(Program(f"{title}, 3 mm over in one block"),
                              elements[:-1] + [longer], side)
                yield cut(Program(f"{title}, twice"), elements * 2, side)
                yield cut(Program(f"{title}, twice and 3 mm"), elements * 2 + more[1:], side)
                # Roll-in and roll-out arcs of a quarter, with a straight before and after.
                for radius in (4.0, 6.0):
                    rolled = rolls(elements, side, radius)
                    for what, body in (("closed", elements), ("a degree over", elements + more[:1]),
                                       ("twice", elements * 2)):
                        lead_in, lead_out = rolled[0], rolls(body, side, radius)[1]
                        yield cut(Program(f"{title}, rolled {radius:g}, {what}"),
                                  [lead_in] + body + [lead_out], side, (0, 6.0), (0, 6.0))
                # Depth after depth, in one span and with one span each.
                start = beside(elements[0], side, False, 90, 20.0)
                program = Program(f"{title}, three depths").rapid(start).plunge(-1.0)
                program.on(side, elements[0].start)
                for depth in (-1.0, -2.0, -3.0):
                    program.plunge(depth)
                    for element in elements:
                        program.follow(element)
                yield program.off(start).plunge(5.0, "G0").end()
                program = Program(f"{title}, three spans").rapid(start)
                for depth in (-1.0, -2.0, -3.0):
                    program.plunge(depth).on(side, elements[0].start)
                    for element in elements:
                        program.follow(element)
                    program.off(start)
                yield program.plunge(5.0, "G0").end()


def part_of(element, length):
    return element.piece(0.0, length / element.length)


def rolls(elements, side, radius):
    """Quarter arcs, tangent to the contour on the side of the tool."""
    into, away = elements[0], elements[-1]
    start = heading(into, False)
    center = plus(into.start, polar(start + side * math.pi / 2.0), radius)
    lead_in = Arc(center, radius, start - side * math.pi, side * math.pi / 2.0)
    end = heading(away, True)
    center = plus(away.end, polar(end + side * math.pi / 2.0), radius)
    lead_out = Arc(center, radius, end - side * math.pi / 2.0, side * math.pi / 2.0)
    return lead_in, lead_out


def rolled_noise():
    """Loops with arcs to and from them, as posts round them."""
    for digits in (3, 4, 6):
        for turn in (1, -1):
            for name, side in sides():
                outlines = {"circle": Pen((1.0 / 3, 1.0 / 7), 12.3).bend(20.0, 360.0 * turn),
                            "halves": Pen((1.0 / 3, 1.0 / 7), 12.3).bend(20.0, 180.0 * turn)
                            .bend(20.0, 180.0 * turn)}
                for outline, pen in outlines.items():
                    elements = pen.elements
                    for over in (0.0, 0.35, 2.0, 10.0):
                        body = elements + [part_of(elements[0], over)] * (over > 0.0)
                        for radius in (6.0, 11.0):
                            lead_in, lead_out = rolls(body, side, radius)
                            title = f"rolled {outline} {turn:+d} {name} {digits} decimals"
                            yield cut(Program(f"{title} {radius:g} over {over:g}", digits=digits),
                                      [lead_in] + body + [lead_out], side, (0, 16.0), (0, 16.0))


def bores():
    """A circle from its middle, with a straight under compensation and arcs to and from it."""
    for bore in (6.0, 5.5, 5.0, 8.0, 10.001, 12.0, 25.0):
        for radius in (5.0, 3.0, 0.5):
            for side, clockwise in ((LEFT, False), (RIGHT, True)):
                title = f"bore {2 * bore:g} with {2 * radius:g} {'cw' if clockwise else 'ccw'}"
                sense = -1.0 if clockwise else 1.0
                start = (bore, 0.0)
                program = Program(f"{title}, straight in", radius).plunge(-2.0)
                program.on(side, start).arc(start, (0.0, 0.0), clockwise)
                yield program.off((0.0, 0.0)).end()
                # A straight to where the arc begins, half as large as the bore.
                small = bore / 2.0
                beside_it = (small, -sense * small)
                program = Program(f"{title}, arc in", radius).plunge(-2.0)
                program.on(side, beside_it).arc(start, (small, 0.0), clockwise)
                program.arc(start, (0.0, 0.0), clockwise)
                program.arc((small, sense * small), (small, 0.0), clockwise)
                yield program.off((0.0, 0.0)).end()
                # The straights under compensation too.
                program = Program(f"{title}, straights and arcs", radius).plunge(-2.0)
                program.on(side, (0.0, -sense * small)).line(beside_it)
                program.arc(start, (small, 0.0), clockwise).arc(start, (0.0, 0.0), clockwise)
                program.arc((small, sense * small), (small, 0.0), clockwise)
                program.line((0.0, sense * small))
                yield program.off((0.0, 0.0)).end()
                program = Program(f"{title}, down in a helix", radius).plunge(0.0)
                program.on(side, start)
                for depth in (-1.0, -2.0, -2.0):
                    program.arc(start, (0.0, 0.0), clockwise, z=depth)
                yield program.off((0.0, 0.0)).end()


def slots():
    """Open and narrow: what the tool fits, just fits, and does not."""
    for width in (16.0, 10.0002, 9.9, 6.0):
        for name, side, turn in (("left", LEFT, 1), ("right", RIGHT, -1)):
            open_slot = Pen((0.0, 0.0)).go(30.0).turn(90 * turn).go(width).turn(90 * turn).go(30.0)
            yield cut(Program(f"slot {width:g} {name} open"), open_slot.elements, side,
                      (0, 40.0), (0, 40.0))
            round_slot = Pen((0.0, 0.0)).go(30.0).bend(width / 2.0, 180 * turn).go(30.0)
            yield cut(Program(f"slot {width:g} {name} round"), round_slot.elements, side,
                      (0, 40.0), (0, 40.0))
            spread = Pen((0.0, 0.0)).go(30.0).turn(70 * turn).go(width).turn(70 * turn).go(30.0)
            yield cut(Program(f"slot {width:g} {name} spread"), spread.elements, side,
                      (0, 40.0), (0, 40.0))


def features():
    """Steps, fillets, chamfers and notches that are small for the tool."""
    for name, side in sides():
        for size in (0.001, 0.05, 0.5, 3.0, 4.9, 5.1, 8.0):
            for turn in (90, -90):
                title = f"{size:g} {name} {turn:+d}"
                step = Pen().go(40.0).turn(turn).go(size).turn(-turn).go(40.0).elements
                yield cut(Program(f"step {title}"), step, side)
                fillet = Pen().go(40.0).bend(size, turn).go(40.0).elements
                yield cut(Program(f"fillet {title}"), fillet, side)
                chamfer = Pen().go(40.0).turn(turn / 2).go(size).turn(turn / 2).go(40.0).elements
                yield cut(Program(f"chamfer {title}"), chamfer, side)
                notch = Pen().go(40.0).turn(turn / 2).go(size).turn(-turn).go(size).turn(turn / 2)
                yield cut(Program(f"notch {title}"), notch.go(40.0).elements, side)
                ess = Pen().go(40.0).bend(size, turn).bend(size, -turn).go(40.0).elements
                yield cut(Program(f"ess {title}"), ess, side)


def noise():
    """As posts write: rounded coordinates, and curves in chords."""
    for digits in (3, 4, 5):
        for name, side in sides():
            for degrees in (7, 33, 61):
                pen = Pen((1.23456789, 2.3456789), degrees)
                pen.go(31.4159).bend(12.3456, 77.7).go(22.2222).bend(9.8765, -55.5).go(17.1717)
                program = Program(f"noise {digits} decimals {name} {degrees}", digits=digits)
                yield cut(program, pen.elements, side)
            for turn in (1, -1):
                pen = Pen((0.0, 0.0), 3.0).go(20.0)
                for _ in range(30):
                    pen.turn(2.0 * turn).go(1.0)
                program = Program(f"noise {digits} decimals {name} chords {turn:+d}", digits=digits)
                yield cut(program, pen.turn(2.0 * turn).go(20.0).elements, side)
            # A straight in many pieces, and an arc in many.
            pen = Pen((0.3333333, 0.7777777), 17.7)
            for _ in range(8):
                pen.go(3.3333333)
            yield cut(Program(f"noise {digits} decimals {name} pieces of a line", digits=digits),
                      pen.elements, side)
            pen = Pen((0.3333333, 0.7777777), 17.7)
            for _ in range(8):
                pen.bend(23.456789, 11.1)
            yield cut(Program(f"noise {digits} decimals {name} pieces of an arc", digits=digits),
                      pen.elements, side)


def by_chance(count=150):
    """Random contours; the seed is a literal."""
    chance = random.Random(16)
    for number in range(count):
        radius = chance.choice((5.0, 3.0, 1.0))
        pen = Pen((0.0, 0.0), chance.uniform(0.0, 360.0))
        for _ in range(chance.randint(2, 7)):
            turn = chance.choice((0, chance.uniform(-100.0, 100.0), chance.uniform(-40.0, 40.0)))
            pen.turn(turn)
            if chance.random() < 0.5:
                pen.go(chance.uniform(4.0, 40.0))
            else:
                degrees = chance.choice((-1, 1))
                degrees *= chance.uniform(20, 160)
                pen.bend(chance.uniform(4.0, 30.0), degrees)
        side = chance.choice((LEFT, RIGHT))
        leads = [(chance.choice((0, 45, 90)), chance.uniform(1.2, 6.0) * radius) for _ in range(2)]
        yield cut(Program(f"chance {number}", radius), pen.elements, side, *leads)


def programs():
    for family in (corners, entries, arc_leads, arc_leads_by_chance, exits, ways_of_writing, loops, rolled_noise, bores, slots,
                   features, noise, by_chance):
        yield from family()
