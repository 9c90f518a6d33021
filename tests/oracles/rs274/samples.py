"""Programs that others wrote: files, run where they are."""

import hashlib
import re
from pathlib import Path

ENDINGS = re.compile(r"\.(nc|ngc|tap|gcode|cnc|eia|ncc|gc|nc1|ncf)$", re.IGNORECASE)


class Sample:
    scales = is_endless = False

    def __init__(self, path, base, feature):
        self.path = path
        self.feature = feature
        self.name = str(path.relative_to(base))
        self.folder = subprograms(path.parent)
        self.seed = 0

    def text(self, _size=1):
        return self.path.read_bytes().decode("latin-1")

    def write(self, _folder, _size):
        return self.path

    def sized_tools(self, _size):
        code = re.sub(r"\([^)]*\)|;.*", "", self.text())
        numbers = {int(it) for it in re.findall(r"(?i)[TDH] *(\d{1,5})(?![\d.])", code)}
        return [(it, 3.0, 0.0) for it in sorted(numbers | set(range(1, 10))) if it]


def subprograms(folder):
    """Where the subprograms of the programs of a folder are: the INI files beside and above it say so."""
    for ini in [*sorted(folder.glob("*.ini")), *sorted(folder.parent.glob("*.ini"))]:
        path = re.search(r"(?m)^SUBROUTINE_PATH *= *([^\s:]+)", ini.read_text(errors="replace"))
        if path and (ini.parent / path[1]).is_dir():
            return (ini.parent / path[1]).resolve()
    return folder


def samples(base, feature):
    """All of a folder, each once."""
    found, seen = [], set()
    for path in sorted(Path(base).rglob("*")):
        if path.is_file() and ENDINGS.search(path.name):
            content = hashlib.sha256(path.read_bytes()).digest()
            if content not in seen:
                seen.add(content)
                found.append(Sample(path, base, feature))
    return found
