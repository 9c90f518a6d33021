"""A program that is written by rule, in any size."""

import random
import re


class Program:
    """Lengths are written as `{L12.5}`, so that all of them can be written larger: LinuxCNC prints
    four decimals, and of a program that is 100 times as large they are two more."""

    def __init__(self, feature, seed):
        self.feature = feature
        self.seed = seed
        self.rng = random.Random(f"{feature} {seed}")
        self.lines = []
        # Programs that it calls by name.
        self.files = {}
        # Number, diameter and length.
        self.tools = [(tool, 3.0, 0.0) for tool in range(1, 10)]
        # Whether it can be written in another size: what it does does not depend on lengths.
        self.scales = True
        self.folder = None
        # Whether it runs for ever, so that LinuxCNC is not asked.
        self.is_endless = False

    @property
    def name(self):
        return f"{self.feature} {self.seed}"

    def add(self, *lines):
        self.lines.extend(lines)

    def text(self, size=1):
        return sized(self.lines, size)

    def write(self, folder, size):
        """Writes it and what it calls into a folder; its name."""
        for name, lines in self.files.items():
            (folder / name).write_text(sized(lines, size))
        text = self.text(size)
        # Some editors write no line end after the last line.
        if sum(map(ord, self.name)) % 3 == 0:
            text = text.rstrip("\n")
        (folder / "part.ngc").write_text(text)
        self.folder = folder if self.files else None
        return "part.ngc"

    def sized_tools(self, size):
        return [(tool, size * diameter, size * height) for tool, diameter, height in self.tools]


def sized(lines, size):
    text = "\n".join(lines) + "\n"
    return re.sub(r"\{L([-+.\d]+)\}", lambda match: literal(match[1], size), text)


def literal(text, size):
    """A number as it is written, or its multiple."""
    if size == 1:
        return text
    return f"{float(text) * size:.9f}".rstrip("0").rstrip(".")


def length(value, decimals=3):
    """A length that grows with the program."""
    text = f"{value:.{decimals}f}"
    return "{L" + (text.rstrip("0").rstrip(".") or "0").replace("-0", "-0") + "}"
