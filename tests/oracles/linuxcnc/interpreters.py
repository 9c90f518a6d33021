"""LinuxCNC's interpreter and Kerf's planner, each as a process."""

import json
import re
import subprocess
from dataclasses import dataclass

from clearance import moved
from geometry import apart
from programs import MARK
from rs274_process import Rs274, complaints


@dataclass
class Answer:
    """What an interpreter says: whether it takes the program, why not, and its path."""
    takes: bool
    words: str
    path: list
    codes: frozenset = frozenset()


class LinuxCnc:
    def __init__(self, root, folder):
        self.rs274 = Rs274(root)
        self.folder = folder

    def run(self, program, size):
        folder = self.folder / f"linuxcnc_{size}"
        folder.mkdir()
        (folder / "part.ngc").write_text(program.text(size))
        ran = self.rs274.run(folder, "part.ngc", [(1, 2 * program.radius * size, 0.0)])
        words = complaints(ran)
        takes = "PROGRAM_END()" in ran.stdout
        # Nothing understood is neither.
        assert takes or words, (program.name, ran)
        return Answer(takes, words[0] if words else "", self.path(ran.stdout, size))

    def path(self, text, size):
        at, block, path = (0.0, 0.0, 0.0), -1, []
        for word, arguments in re.findall(r"N\S* +(\w+)\((.*)\)$", text, re.MULTILINE):
            if word == "COMMENT" and arguments.startswith('"' + MARK):
                block = int(arguments[1 + len(MARK):-1])
            if word not in ("STRAIGHT_TRAVERSE", "STRAIGHT_FEED", "ARC_FEED"):
                assert not re.match("ARC|STRAIGHT|NURBS", word), word
                continue
            values = [float(value) for value in arguments.split(",")]
            lengths = [value / size for value in values]
            if word == "ARC_FEED":
                end = (lengths[0], lengths[1], lengths[5])
                path.append(moved(block, False, at, end, tuple(lengths[2:4]), int(values[4])))
            else:
                end = tuple(lengths[:3])
                path.append(moved(block, word == "STRAIGHT_TRAVERSE", at, end))
            at = end
        return path


class Kerf:
    def __init__(self, command, folder):
        self.command = command
        self.folder = folder

    def run(self, program):
        folder = self.folder / "kerf"
        folder.mkdir()
        (folder / "part.ngc").write_text(program.text())
        (folder / "tools.yaml").write_text(f"tools:\n  1: {{diameter_mm: {2 * program.radius}}}\n")
        ran = subprocess.run(
            [self.command, "plan", "part.ngc", "--control", "rs274", "--tools", "tools.yaml",
             "--json"], cwd=folder, capture_output=True, text=True, timeout=60)
        assert ran.returncode in (0, 1), (program.name, ran)
        said = json.loads(ran.stdout)
        assert said["accepted"] == (ran.returncode == 0), program.name
        found = said["findings"]
        errors = [it for it in found if it["severity"] == "error"]
        words = "; ".join(f"{it['code']} in line {it['line']}: {it['message']}" for it in errors)
        path = [self.piece(program, it) for it in said["elements"] or said["refused_elements"]]
        codes = frozenset(it["code"] for it in found)
        return Answer(said["accepted"], words, path, codes)

    @staticmethod
    def piece(program, it):
        block = program.block_of_line(it["line"])
        start, end = tuple(it["start"]), tuple(it["end"])
        if it["kind"] == "line":
            return moved(block, it["rapid"], start, end)
        assert it["plane"] == "xy", it
        turns = it["turns"] + (apart(start, end) > 1e-9)
        turn = -turns if it["clockwise"] else turns
        return moved(block, it["rapid"], start, end, tuple(it["center"][:2]), turn)
