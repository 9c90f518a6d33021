"""Reads what `kerf plan --json` prints."""

import json
import re
import subprocess
from dataclasses import replace

from sequence import Answer, Event, Move, State

PLANES = {"xy": (0, 1), "zx": (2, 0), "yz": (1, 2)}


class Kerf:
    def __init__(self, command, profile="rs274"):
        self.command = command
        self.profile = profile

    def run(self, folder, program, tools, size, subroutines=None, timeout_s=60):
        rows = "".join(f"  {tool}: {{diameter_mm: {diameter}, length_mm: {length}}}\n"
                       for tool, diameter, length in tools)
        (folder / "tools.yaml").write_text(f"tools:\n{rows}")
        options = ["--subroutines", subroutines] if subroutines else []
        ran = subprocess.run(
            [self.command, "plan", program, "--control", self.profile, "--tools", "tools.yaml",
             "--json", *options], cwd=folder, capture_output=True, text=True, errors="replace",
            timeout=timeout_s)
        if ran.returncode not in (0, 1) or "panicked" in ran.stderr:
            return Answer(False, f"BROKEN: status {ran.returncode}: {ran.stderr.strip()[-300:]}")
        said = json.loads(ran.stdout)
        errors = [it for it in said["findings"] if it["severity"] == "error"]
        words = "; ".join(f"{it['code']} in line {it['line']}: {it['message']}" for it in errors)
        reader = Reader(size)
        reader.read(said["elements"], said["events"])
        return Answer(said["accepted"], words, reader.items,
                      frozenset(it["code"] for it in said["findings"]),
                      frozenset(reader.unknown), reader.is_compensated)


class Reader:
    def __init__(self, size):
        self.size = size
        self.state = State()
        self.items = []
        self.unknown = set()
        self.is_compensated = False
        # Axes whose place in the work system is not known, and places that the program stores.
        self.lost, self.stored = set(), set()
        # Of these, those that a probe has moved.
        self.probed = set()
        self.at = (0.0, 0.0, 0.0)
        # A, B and C; `None` where Kerf does not know them. Those that wait for their motion.
        self.rotary = [0.0, 0.0, 0.0]
        self.along = {}
        # The next element is the way of a probe.
        self.is_probe = False
        # Of the next element, if it keeps pace with the spindle.
        self.pitch = None
        # Axes that the next element moves from wherever they are.
        self.relative = set()
        # The line of a G10 L20, whose rapid says where the tool is and moves nothing.
        self.standing = None

    def read(self, elements, events):
        number = 0
        for index, element in enumerate(elements):
            while number < len(events) and events[number]["at_element"] <= index:
                self.event(events[number])
                number += 1
            self.element(element)
        for event in events[number:]:
            self.event(event)
        if not (self.items and isinstance(self.items[-1], Event)
                and self.items[-1].kind == "end"):
            self.items.append(Event("end", State(), "the end of the file"))

    def lengths(self, position):
        return tuple(it / self.size for it in position[:3])

    def element(self, it):
        self.is_compensated |= it["role"] != "none"
        kind = "rapid" if it["rapid"] else "line" if it["kind"] == "line" else "arc"
        start, end = self.lengths(it["start"]), self.lengths(it["end"])
        if it["line"] == self.standing:
            self.at, self.standing = end, None
            return
        feed = it["feed_mm_per_min"]
        self.at = end
        turned = self.turn(self.along)
        self.along = {}
        # Known again where the next move of the axis ends.
        self.lost -= {axis for axis, a, b in zip("XYZ", start, end) if a != b} - self.relative
        self.probed &= self.lost
        # LinuxCNC's interpreter alone lets a probe touch just before its end.
        relative, self.relative = "".join(self.relative - self.probed), set()
        move = Move(kind, start, end, replace(self.state), f"line {it['line']}",
                    feed and feed / self.size, rotary=tuple(self.rotary), turned=turned,
                    unknown="".join(self.lost), relative=relative)
        if it["kind"] == "arc":
            one, two = PLANES[it["plane"]]
            is_full = abs(start[one] - end[one]) < 1e-9 and abs(start[two] - end[two]) < 1e-9
            turns = it["turns"] + (not is_full)
            center = self.lengths(it["center"])
            move.kind, move.plane, move.center = "arc", it["plane"], (center[one], center[two])
            move.rotation = -turns if it["clockwise"] else turns
        if self.pitch is not None:
            move.pitch, move.feed, self.pitch = self.pitch, None, None
        if self.is_probe:
            move.kind, self.is_probe = "probe", False
            self.probed |= {axis for axis, a, b in zip("XYZ", start, end) if a != b}
            self.lost |= self.probed
        self.items.append(move)

    def turn(self, axes):
        """Whether it moves one of them."""
        before = list(self.rotary)
        for n, axis in enumerate("ABC"):
            self.rotary[n] = axes.get(axis, self.rotary[n])
        return before != self.rotary

    def axes(self, event, text):
        """A, B and C, with the next motion or function, or alone."""
        self.along = event["axes"]
        match = re.match(r"G([01]) .*?(?: F([-\d.e]+))?$", text)
        if match:
            turned = self.turn(self.along)
            self.along = {}
            kind, feed = ("line", float(match[2])) if match[1] == "1" else ("rapid", None)
            self.items.append(Move(kind, self.at, self.at, replace(self.state),
                                   f"line {event['line']}", feed, rotary=tuple(self.rotary),
                                   turned=turned, unknown="".join(self.lost)))

    def forget_along(self):
        """The axes of this block are somewhere else, or in another frame."""
        self.turn(dict.fromkeys(self.along))
        self.along = {}

    def add(self, kind, event, value=None):
        self.items.append(Event(kind, replace(self.state), f"line {event['line']}", value))

    def message(self, event, text):
        last = self.items[-1] if self.items else None
        # A long one is in parts, divided at a blank.
        if isinstance(last, Event) and last.kind == "message" and last.where == \
                f"line {event['line']}" and len((last.value + " " + text).encode()) > 62:
            last.value += " " + text
        else:
            self.add("message", event, text)

    def event(self, event):
        text, state, kind = event["text"], self.state, event["kind"]
        where = f"line {event['line']}"
        if kind == "axes":
            self.axes(event, text)
        elif kind == "probe":
            self.is_probe = True
        elif kind == "spindle_sync":
            self.pitch = float(text.removeprefix("G33 K")) / self.size
        elif kind == "relative":
            self.relative = set(text.removeprefix("G91 "))
        elif kind == "stretch":
            # What follows is planned from the result of a probe.
            pass
        elif kind == "message":
            self.message(event, text.removeprefix("(MSG, ").removesuffix(")"))
        elif match := re.fullmatch(r"S([-\d.e]+)", text):
            state.speed = float(match[1])
        elif match := re.fullmatch(r"G96 S([-\d.e]+)(?: D([-\d.e]+))?", text):
            state.speed, state.speed_max = float(match[1]), float(match[2] or 1e30)
        elif text == "G97":
            state.speed_max = None
        elif text in ("M3", "M4", "M5"):
            state.spindle = text
        elif text == "M9":
            state.mist = state.flood = False
        elif text == "M7":
            state.mist = True
        elif text == "M8":
            state.flood = True
        elif match := re.fullmatch(r"T(\d+)", text):
            state.selected = int(match[1])
        elif match := re.fullmatch(r"M6(?: T(\d+))?", text):
            state.spindle = "M5"
            self.add("tool", event, int(match[1]) if match[1] else state.selected)
        elif match := re.fullmatch(r"G5([4-9])(?:\.([123]))?", text):
            system = int(match[1]) - 3 + int(match[2] or 0)
            if system != state.system:
                self.lost = set("XYZ")
                self.rotary = [None] * 3
            state.system = system
        elif match := re.fullmatch(r"G4 P([-\d.e]+)", text):
            self.add("dwell", event, float(match[1]))
        elif text == "M0":
            self.add("stop", event)
        elif text == "M1":
            self.add("optional stop", event)
        elif text in ("M2", "M30"):
            self.add("end", event)
        elif match := re.fullmatch(r"(G28|G30) ([XYZ]+)", text):
            self.lost |= set(match[2])
            # Without a parameter file it is the origin of the machine.
            end = None if match[1] in self.stored else (0.0,) * 3
            self.items.append(Move("rapid", (0.0,) * 3, (0.0,) * 3, replace(state), where,
                                   axes=match[2], machine_end=end, rotary=None))
        elif text in ("G28.1", "G30.1"):
            self.stored.add(text[:3])
        elif re.match(r"G10 L(2|20) ", text):
            # What the offsets are shows in the moves in machine coordinates.
            self.lost = set("XYZ")
            self.forget_along()
            system = re.match(r"G10 L20 P(\d)", text)
            self.standing = event["line"] if system and int(system[1]) == state.system else None
        elif text == "G53 G0":
            # Other axes alone.
            self.forget_along()
            self.items.append(Move("rapid", self.at, self.at, replace(state), where, turned=True,
                                   rotary=tuple(self.rotary), unknown="".join(self.lost)))
        elif match := re.fullmatch(r"G53 G([01])((?: [XYZ][-\d.e]+)+)", text):
            self.forget_along()
            words = {it[0]: float(it[1:]) / self.size for it in match[2].split()}
            self.lost |= set(words)
            self.items.append(Move("line" if match[1] == "1" else "rapid", (0.0,) * 3, (0.0,) * 3,
                                   replace(state), where, axes="".join(words),
                                   machine_end=tuple(words.get(axis, 0.0) for axis in "XYZ"),
                                   rotary=None))
        elif match := re.fullmatch(r"(M(?:19|6[2-8]))((?: [A-Z][-\d.e]+)*)", text):
            words = {it[0]: float(it[1:]) for it in match[2].split()}
            if match[1] == "M19":
                self.add("output", event, ("M19", words.get("R", 0.0), words.get("P", 0.0)))
            elif match[1] != "M66":
                # LinuxCNC prints no M66.
                self.add("output", event, (match[1], *words.values()))
        # LinuxCNC says what M48 to M53 have switched, not which word has done so.
        elif not re.fullmatch(r"M(48|49|5[0-3])(?: P[01])?", text) and not re.fullmatch(r"G43 H\d+|G43\.1 Z[-\d.e]+|G49", text):
            self.unknown.add(re.sub(r"[-\d.]{3,}", "N", text))
