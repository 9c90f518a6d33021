"""Reads what `rs274 -g` prints: canonical functions, one a line, with four decimals.

Lengths are printed in the units of the program. They become millimetres in the work system
(G54 to G59.3), so that the offset of G92 and G52 is added to each position.
"""

import math
import re
from dataclasses import replace

from sequence import SAME_MM, Answer, Event, Move, State

PLANES = {"XY": ("xy", 0, 1, 2), "YZ": ("yz", 1, 2, 0), "XZ": ("zx", 2, 0, 1)}
CURVES = ("NURBS_FEED", "NURBS_G5_FEED", "NURBS_G6_FEED")

OUTPUTS = {"SET_MOTION_OUTPUT_BIT": "M62", "CLEAR_MOTION_OUTPUT_BIT": "M63",
           "SET_AUX_OUTPUT_BIT": "M64", "CLEAR_AUX_OUTPUT_BIT": "M65",
           "SET_MOTION_OUTPUT_VALUE": "M67", "SET_AUX_OUTPUT_VALUE": "M68"}


class Reader:
    """`size`: how many times as large as meant the program was written. `tools`: in the order of
    their pockets."""

    def __init__(self, size, tools):
        self.size = size
        self.tools = tools
        self.unit = 1.0
        self.state = State()
        self.items = []
        self.g5x = self.g92 = self.tool = (0.0, 0.0, 0.0)
        self.rotation = 0.0
        # In the machine, without what G92 adds.
        self.machine = (0.0, 0.0, 0.0)
        self.plane = "XY"
        self.feed = 0.0
        self.feed_unit = 1.0
        self.is_per_revolution = False
        self.pitch = None
        self.is_changing = False
        self.start_allowed_mm = SAME_MM
        # In the work system, with what G92 adds.
        self.rotary = self.g92_rotary = (0.0, 0.0, 0.0)

    def read(self, text):
        """The items of the whole output."""
        for line in text.splitlines():
            match = re.match(r" *(\d+) N\S* +([\w.]+)\((.*)\)$", line)
            if match:
                number, word, arguments = match.groups()
                self.line = number
                self.function(word, arguments)
                if word == "PROGRAM_END":
                    break
            elif not line.startswith("Oops ("):
                # PRINT writes the bare text. Lathe cycles say Oops of arcs whose ends were rounded.
                self.event("message", line)
        return self.items

    def function(self, word, arguments):
        handler = getattr(self, "on_" + word.lower(), None)
        if word in OUTPUTS:
            handler = self.output(OUTPUTS[word])
        if handler:
            handler(arguments)
        elif word in CURVES:
            self.items.append(Move("curve", self.work(), self.work(), replace(self.state),
                                   self.line))
        else:
            # A new motion would be missed.
            assert not re.match("ARC|STRAIGHT|NURBS", word), word

    @staticmethod
    def numbers(arguments):
        return [float(it) for it in re.split(r"[, ]+", arguments.strip()) if it]

    def lengths(self, numbers):
        return tuple(it * self.unit / self.size for it in numbers)

    @property
    def allowed_mm(self):
        # Half a digit of a position, and of the offset that it is added to.
        digits = 1.0 + any(self.g92)
        if self.rotation:
            # Each place is made of two numbers.
            digits *= math.sqrt(2.0)
        return digits * 0.505e-4 * self.unit / self.size + SAME_MM

    def work(self):
        """Where the tool is in the work system, which a controller does not rotate."""
        return tuple(at - g5x - tool for at, g5x, tool in zip(self.machine, self.g5x, self.tool))

    def turned(self, place):
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        x, y, z = place
        return (c * x - s * y, s * x + c * y, z)

    def to_machine(self, work):
        turned = self.turned(work)
        return tuple(at + g5x + tool for at, g5x, tool in zip(turned, self.g5x, self.tool))

    def add(self, kind, end, rotary, **more):
        end = tuple(at + g92 for at, g92 in zip(end, self.g92))
        start, self.machine = self.work(), self.to_machine(end)
        end = self.work()
        feed, allowed_feed = None, 0.0
        if kind in ("line", "arc") and self.pitch is None:
            # Degrees are no lengths.
            only_turns = kind == "line" and math.dist(start, end) <= 2.0 * self.allowed_mm
            unit = 1.0 if only_turns else self.feed_unit * (self.speed(start, end) if self.is_per_revolution else 1.0)
            feed, allowed_feed = self.feed * unit / self.size, 0.505e-4 * unit / self.size
        rotary = tuple(at + g92 for at, g92 in zip(rotary, self.g92_rotary))
        turned = any(abs(a - b) > 1e-4 for a, b in zip(rotary, self.rotary))
        self.rotary = tuple(rotary)
        self.items.append(Move(
            kind, start, end, replace(self.state), self.line, feed, allowed_mm=self.allowed_mm,
            start_allowed_mm=self.start_allowed_mm,
            allowed_feed=allowed_feed, pitch=self.pitch, machine_end=self.machine, rotary=self.rotary, turned=turned, **more))
        self.start_allowed_mm = self.allowed_mm

    def speed(self, start, end):
        """1/min; under G96 where the line is farthest from X0."""
        if self.state.speed_max is None:
            return self.state.speed
        radius = max(abs(at[0] - self.g92[0]) for at in (start, end)) * self.size
        return min(self.state.speed_max, 1000.0 * self.state.speed / (2.0 * math.pi * radius) if radius else math.inf)

    def event(self, kind, value=None):
        self.items.append(Event(kind, replace(self.state), self.line, value))

    def on_use_length_units(self, arguments):
        self.unit = {"CANON_UNITS_MM": 1.0, "CANON_UNITS_INCHES": 25.4}[arguments]

    def on_set_g5x_offset(self, arguments):
        index, *offset = self.numbers(arguments)
        self.g5x = self.lengths(offset[:3])
        self.state.system = int(index)

    def on_set_g92_offset(self, arguments):
        numbers = self.numbers(arguments)
        self.g92, self.g92_rotary = self.lengths(numbers[:3]), tuple(numbers[3:6])

    def on_set_xy_rotation(self, arguments):
        self.rotation = math.radians(self.numbers(arguments)[0])

    def on_use_tool_length_offset(self, arguments):
        self.tool = self.lengths(self.numbers(arguments)[:3])

    def on_select_plane(self, arguments):
        self.plane = arguments.removeprefix("CANON_PLANE_")

    def on_set_feed_mode(self, arguments):
        self.is_per_revolution = self.numbers(arguments)[1] == 1.0

    def on_set_feed_rate(self, arguments):
        self.feed, self.feed_unit = self.numbers(arguments)[0], self.unit

    def on_start_speed_feed_sync(self, arguments):
        # Newer ones say the spindle before it.
        self.pitch = self.lengths(self.numbers(arguments)[-2:-1])[0]

    on_start_speed_feed_synch = on_start_speed_feed_sync

    def on_stop_speed_feed_synch(self, _):
        self.pitch = None

    def on_straight_traverse(self, arguments):
        self.straight("rapid", arguments)

    def on_straight_feed(self, arguments):
        self.straight("line", arguments)

    def on_straight_probe(self, arguments):
        self.straight("probe", arguments)

    def on_rigid_tap(self, arguments):
        start = self.machine
        self.straight("tap", arguments)
        # It comes back.
        self.machine = start

    def straight(self, kind, arguments):
        numbers = self.numbers(arguments)
        self.add(kind, self.lengths(numbers[:3]), numbers[3:6])

    def on_arc_feed(self, arguments):
        numbers = self.numbers(arguments)
        first, second, first_center, second_center = self.lengths(numbers[:4])
        name, one, two, three = PLANES[self.plane]
        end = [0.0, 0.0, 0.0]
        end[one], end[two], end[three] = first, second, self.lengths(numbers[5:6])[0]
        center = [0.0, 0.0, 0.0]
        center[one], center[two] = first_center + self.g92[one], second_center + self.g92[two]
        if name == "xy":
            center = self.turned(center)
        center = (center[one], center[two])
        self.add("arc", end, numbers[6:9], plane=name, center=center, rotation=int(numbers[4]))

    def output(self, word):
        def handler(arguments):
            self.event("output", (word, *self.numbers(arguments)))
        return handler

    def on_orient_spindle(self, arguments):
        self.event("output", ("M19", *self.numbers(arguments)[1:]))

    def on_message(self, arguments):
        self.event("message", arguments[1:-1])

    on_log = on_message

    def on_dwell(self, arguments):
        self.event("dwell", self.numbers(arguments)[0])

    def on_start_spindle_clockwise(self, _):
        self.state.spindle = "M3"

    def on_start_spindle_counterclockwise(self, _):
        self.state.spindle = "M4"

    def on_stop_spindle_turning(self, _):
        # A tool change stops the spindle; in Kerf that is a part of M6.
        self.state.spindle = "M5"

    def on_set_spindle_mode(self, arguments):
        # The highest speed of G96; 0 for G97.
        self.state.speed_max = self.numbers(arguments)[-1] or None

    def on_set_spindle_speed(self, arguments):
        speed = self.numbers(arguments)[-1]
        # Feet a minute under G96 in inches.
        is_feet = self.state.speed_max and self.unit != 1.0
        self.state.speed = speed * 0.3048 if is_feet else speed

    def on_flood_on(self, _):
        self.state.flood = True

    def on_flood_off(self, _):
        self.state.flood = False

    def on_mist_on(self, _):
        self.state.mist = True

    def on_mist_off(self, _):
        self.state.mist = False

    def on_select_tool(self, arguments):
        self.state.selected = int(self.numbers(arguments)[0])

    def on_change_tool(self, arguments):
        # It says the pocket.
        pocket = int(self.numbers(arguments)[0])
        self.event("tool", self.tools[pocket - 1] if pocket else 0)

    def on_program_stop(self, _):
        self.event("stop")

    def on_optional_program_stop(self, _):
        self.event("optional stop")

    def on_program_end(self, _):
        self.event("end")


def answer(ran, complaints, no_end, size, tools):
    """What LinuxCNC says. A program that only lacks its end was run to there."""
    items = Reader(size, tools).read(ran.stdout)
    ends = bool(items) and isinstance(items[-1], Event) and items[-1].kind == "end"
    lacks_end = bool(complaints) and complaints[0].startswith(no_end)
    takes = not complaints or lacks_end or ends
    if not ends:
        items.append(Event("end", State(), "the end of the file"))
    words = "" if takes else "; ".join(complaints[:2])
    return Answer(takes, words, items)
