"""What a program does, in order: moves and events, and the state of the machine at each."""

import math
from dataclasses import dataclass, field

# Positions are printed in other places than they are calculated; the last bits differ.
SAME_MM = 1.1e-6


@dataclass
class State:
    """What lasts. `None`: not said yet."""
    spindle: str = "M5"
    speed: float = 0.0
    # Under G96, whose speed is that of the surface, 1/min.
    speed_max: float = None
    mist: bool = False
    flood: bool = False
    selected: int = None
    system: int = 1

    def differs(self, other):
        for name in ("spindle", "mist", "flood", "selected", "system"):
            one, two = getattr(self, name), getattr(other, name)
            if one != two and None not in (one, two):
                return f"{name} {one} and {two}"
        if self.speed_max != other.speed_max:
            return f"S at most {self.speed_max} and {other.speed_max}"
        # Kerf writes that of G96 with three decimals.
        allowed = 1e-4 if self.speed_max is None else 6e-4
        if abs(self.speed - other.speed) > allowed + 1e-9 * abs(self.speed):
            return f"S{self.speed:.4f} and S{other.speed:.4f}"
        return None


@dataclass
class Move:
    """`kind`: rapid, line, arc, curve, probe or tap. Millimetres."""
    kind: str
    start: tuple
    end: tuple
    state: State
    # Where the source says it: a line of the program or of the output.
    where: str
    feed: float = None
    plane: str = None
    center: tuple = None
    # Turns with their direction: 1 for an arc and a full circle counterclockwise.
    rotation: int = 0
    # By how much printed numbers may be off.
    allowed_mm: float = SAME_MM
    # The same of the numbers of its start, which may be in another unit.
    start_allowed_mm: float = SAME_MM
    allowed_feed: float = 0.0
    # Millimetres in a revolution of the spindle, of a move that keeps pace with it.
    pitch: float = None
    # For moves in machine coordinates: the axes that are named, and the end in the machine.
    axes: str = ""
    machine_end: tuple = None
    # A, B and C, in degrees.
    rotary: tuple = (0.0, 0.0, 0.0)
    turned: bool = False
    # Axes whose place Kerf does not know, since a move in machine coordinates.
    unknown: str = ""
    # Of these, the axes that it moves by so much from there.
    relative: str = ""

    @property
    def is_empty(self):
        return (self.kind in ("rapid", "line") and not self.turned
                and all(abs(a - b) <= self.allowed_mm + self.start_allowed_mm
                        for a, b in zip(self.start, self.end)))

    def __str__(self):
        words = [self.kind, " ".join(f"{axis}{it:.5f}" for axis, it in zip("XYZ", self.end))]
        if self.center:
            words.append(f"{self.plane} about {self.center[0]:.5f} {self.center[1]:.5f} "
                         f"turns {self.rotation}")
        if self.machine_end:
            words.append(f"in the machine, {self.axes}")
        if self.feed is not None:
            words.append(f"F{self.feed:.4f}")
        return " ".join(words) + f" ({self.where})"


@dataclass
class Event:
    """`kind`: dwell, stop, optional stop, tool, end, message or output."""
    kind: str
    state: State
    where: str
    value: object = None

    @property
    def is_empty(self):
        return self.kind == "dwell" and self.value == 0.0 or \
            self.kind == "message" and not self.value.strip()

    def __str__(self):
        return f"{self.kind} {self.value if self.value is not None else ''} ({self.where})"


@dataclass
class Answer:
    """What an interpreter says of a program."""
    takes: bool
    words: str = ""
    items: list = field(default_factory=list)
    codes: frozenset = frozenset()
    # Words of Kerf's events that are not compared.
    unknown: frozenset = frozenset()
    # Whether a tool radius is compensated: the paths are then compared in space.
    is_compensated: bool = False


def difference(linuxcnc, kerf):
    """None, or what the first difference is. Empty moves may be left out by either."""
    one, other, i, j = linuxcnc.items, kerf.items, 0, 0
    while i < len(one) or j < len(other):
        a = one[i] if i < len(one) else None
        b = other[j] if j < len(other) else None
        words = "only Kerf has it" if a is None else "only LinuxCNC has it"
        if a is not None and b is not None:
            words = apart(a, b)
            if words is None:
                i, j = i + 1, j + 1
                continue
            # A curve is lines and arcs in Kerf, up to where the next element agrees again.
            if isinstance(a, Move) and a.kind == "curve":
                after = after_curve(one, i, other[:j], b)
                if after is not None:
                    i = after
                else:
                    j += 1
                continue
        if a is not None and (a.is_empty or stays_after_curve(one, i, other[:j])):
            i += 1
        elif b is not None and (b.is_empty or is_reached(one, i, b)):
            j += 1
        else:
            return f"{words}: LinuxCNC {a}; Kerf {b}"
    return None


def after_curve(items, index, before, item):
    """The index of what agrees with an item of Kerf after a curve; None if that may still be a part of it."""
    for n in range(index, len(items)):
        if is_curve(items[n]):
            continue
        if apart(items[n], item) is None:
            return n
        if not stays_after_curve(items, n, before):
            return None
    return None


def stays_after_curve(items, index, before):
    """Whether the first move after a curve goes to where Kerf is already: LinuxCNC does not print where a curve ends."""
    move = items[index]
    end = next((it.end for it in reversed(before) if isinstance(it, Move)), None)
    last = next((it for it in reversed(items[:index]) if isinstance(it, Move)), None)
    return (isinstance(move, Move) and move.kind in ("rapid", "line") and last is not None and is_curve(last)
            and end is not None and math.dist(move.end, end) <= 2.0 * move.allowed_mm)


def is_curve(item):
    return isinstance(item, Move) and item.kind == "curve"


def is_reached(items, index, move):
    """Whether LinuxCNC is already where Kerf goes in machine coordinates."""
    before = next((it for it in reversed(items[:index]) if isinstance(it, Move)), None)
    at = before.machine_end if before else (0.0, 0.0, 0.0)
    return (isinstance(move, Move) and move.axes and move.machine_end is not None
            and all(abs(at["XYZ".index(axis)] - move.machine_end["XYZ".index(axis)]) < 1e-3
                    for axis in move.axes))


def apart(a, b):
    """None, or in what an item of LinuxCNC and one of Kerf differ."""
    if type(a) is not type(b) or a.kind != b.kind:
        return "not of one kind"
    if not (isinstance(a, Event) and a.kind == "end"):
        words = a.state.differs(b.state)
        if words:
            return words
    if isinstance(a, Event):
        if a.kind == "dwell":
            return None if abs(a.value - b.value) <= 0.6e-4 else "another time"
        if a.kind == "message":
            return None if a.value.strip() == b.value.strip() else "another text"
        return None if a.value == b.value else "another one"
    if b.axes:
        if b.machine_end is None and a.is_empty:
            return "the way to a stored position"
        for axis in b.axes if b.machine_end else "":
            n = "XYZ".index(axis)
            if abs(a.machine_end[n] - b.machine_end[n]) > 2.0 * a.allowed_mm:
                return f"{axis} is another one"
    else:
        for axis, x, y in zip("XYZ", a.end, b.end):
            if axis not in b.unknown and not abs(x - y) <= a.allowed_mm + 1e-12 * abs(x):
                return f"{axis} is {y - x:.6f} mm aside"
            n = "XYZ".index(axis)
            if axis in b.relative and abs(x - a.start[n] - y + b.start[n]) > a.allowed_mm + a.start_allowed_mm:
                return f"{axis} goes by {y - b.start[n]:.6f} mm, not {x - a.start[n]:.6f} mm"
    if a.kind == "arc":
        if a.plane != b.plane:
            return "in another plane"
        if a.rotation != b.rotation:
            return "other turns"
        for x, y in zip(a.center, b.center):
            # That of a rotated system is made of two numbers.
            if not abs(x - y) <= 1.5 * a.allowed_mm + 1e-12 * abs(x):
                return f"the centre is {y - x:.6f} mm aside"
    if a.feed is not None and b.feed is not None:
        if not abs(a.feed - b.feed) <= a.allowed_feed + 1e-9 * abs(a.feed) + 1e-6:
            return "another feed"
    if (a.pitch is None) != (b.pitch is None) or \
            a.pitch is not None and abs(a.pitch - b.pitch) > 0.6e-6 * 25.4:
        return f"the pitch is {b.pitch}, not {a.pitch}"
    if b.rotary is not None and a.rotary is not None:
        pairs = zip(a.rotary, b.rotary)
        if any(y is not None and abs(x - y) > 1.1e-4 for x, y in pairs):
            return f"turned to {b.rotary}, not {a.rotary}"
    return None
