#!/usr/bin/env python3
"""Holds cutter radius compensation against LinuxCNC's interpreter.

Run:
    .ci/linuxcnc target/oracle/linuxcnc
    python3 -B tests/oracles/linuxcnc target/debug/kerf target/oracle/linuxcnc [NAME]

Every program of programs.py goes through LinuxCNC's `rs274` and through `kerf plan`, both as
processes. clearance.py measures how near each path comes to what was programmed, with the exact
distances of geometry.py. What LinuxCNC takes and cuts right, Kerf takes too, with the same path;
what LinuxCNC cuts wrong, Kerf refuses; what only Kerf takes, it cuts right. NAME: only the
programs with this in their names, in detail.

Exit status 0 if all agree but for DIFFERENCES, each of which is still there, and if
the comparison notices every path and every verdict that is changed to prove that it can fail.
"""

import math
import os
import re
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from clearance import GOUGE_MM, UNSEEN_MM, Cuts, measure
from geometry import Arc, Line, plus, polar
from interpreters import Answer, Kerf, LinuxCnc
from programs import SHALLOW_RAD, Program, heading, programs
from same_path import SAME_MM, same

# LinuxCNC prints four decimals: of a program that is as many times as large it shows two more.
LARGER = 100

# What is decided to be otherwise than in LinuxCNC: the programs, what is said of them, and why.
DIFFERENCES = [
    (r"^arc lead ", r"^refused: lead_type .* along its inside",
     "an arc as the first move that starts beyond the tangent beside its end: LinuxCNC comes to "
     "that place backwards"),
    (r"(?<!then )no G40$", r"refused: not_cancelled",
     "a program that ends under compensation, at the contour, has forgotten its G40"),
    (r"G40 alone, up, and nothing more$", r"the paths are not the same",
     "a G40 without a move in the plane: LinuxCNC goes to the contour's end aslant, as it rises"),
    (r"G40 alone, up, then away$", r"the paths are not the same",
     "LinuxCNC rises aslant through the free end of the contour; Kerf rises, then goes away"),
    (r"^noise . decimals \w+ pieces of", r"LinuxCNC cuts .*back .*Kerf takes it, and cuts nothing$",
     "a lead into the inside corner with a piece shorter than R: LinuxCNC goes beyond it and back, "
     "or around; Kerf takes pieces of one line or arc for one"),
    (r"^rolled circle .* 3 decimals", r"LinuxCNC cuts .*missed .*Kerf takes it, and cuts nothing$",
     "a full circle whose ends are a hair apart after rounding: LinuxCNC leaves it out"),
]

# Every sort of change that the comparison must notice, so that it can fail.
CHANGES = ["taken though it cuts wrong", "refused though it cuts right", "a larger tool",
           "a move aside", "a move deeper", "a move left out", "a move a rapid"]


@dataclass
class Result:
    program: Program
    linuxcnc: Answer
    # As many times as large, so that it shows more digits; None where it is not taken.
    fine: Answer
    kerf: Answer
    # What LinuxCNC's path cuts.
    cuts: Cuts

    @property
    def allowed_mm(self):
        """How far LinuxCNC may be off at shallow corners, and both in what rounding leaves open."""
        shallow = self.program.radius * (1.0 - math.cos(SHALLOW_RAD))
        return shallow * self.program.is_shallow() + self.rounding_mm

    @property
    def rounding_mm(self):
        return self.program.rounding_mm

    @property
    def is_wrong(self):
        return self.cuts.is_wrong(GOUGE_MM + self.allowed_mm)

    @property
    def kind(self):
        kerf = "Kerf takes" if self.kerf.takes else "Kerf refuses"
        if not self.linuxcnc.takes:
            return f"LinuxCNC refuses, {kerf}"
        if self.is_wrong:
            return f"LinuxCNC takes and cuts wrong, {kerf}"
        shallow = " but for shallow corners and rounding" if self.allowed_mm else ""
        return f"LinuxCNC takes and cuts right{shallow}, {kerf}"


def run(kerf, linuxcnc, program):
    coarse = linuxcnc.run(program, 1)
    fine = linuxcnc.run(program, LARGER) if coarse.takes else None
    path = fine.path if fine and fine.takes else coarse.path
    cuts = measure(program, path) if coarse.takes else Cuts()
    return Result(program, coarse, fine, kerf.run(program), cuts)


def disagreement(result):
    """None, or what Kerf does otherwise than it must."""
    program, kerf, cuts = result.program, result.kerf, result.cuts
    rounding_mm = GOUGE_MM + result.rounding_mm
    own = measure(program, kerf.path) if kerf.takes else Cuts()
    own_words = "nothing" if not own.is_wrong(rounding_mm) else str(own)
    if not result.linuxcnc.takes:
        return f"only Kerf takes it, and cuts {own_words}" if own_words != "nothing" else None
    if not result.fine.takes:
        return f"LinuxCNC takes it in its own size only: {result.fine.words}"
    if differs := same(result.linuxcnc.path, result.fine.path, 2e-4):
        return f"LinuxCNC in another size: {differs}"
    if result.is_wrong:
        return f"LinuxCNC cuts {cuts}, Kerf takes it, and cuts {own_words}" if kerf.takes else None
    if not kerf.takes:
        return f"refused: {kerf.words}"
    if own_words != "nothing":
        return f"Kerf cuts {own_words}"
    if differs := same(result.fine.path, kerf.path, SAME_MM + result.allowed_mm):
        return f"the paths are not the same: {differs}"
    unsure_mm = SAME_MM + result.allowed_mm + rounding_mm
    if cuts.nick > UNSEEN_MM + unsure_mm and "lead_nick" not in kerf.codes:
        return f"a nick of {cuts.nick:.6f} mm is not reported"
    if cuts.nick < UNSEEN_MM - unsure_mm and "lead_nick" in kerf.codes:
        return f"a nick of only {cuts.nick:.6f} mm is reported"
    if cuts.other_pass > unsure_mm and "cuts_other_pass" not in kerf.codes:
        return f"{cuts.other_pass:.6f} mm into another pass are not reported"
    if cuts.other_pass < GOUGE_MM and "cuts_other_pass" in kerf.codes:
        return "a cut of another pass is reported, but there is none"
    return None


def changed(path, by_mm):
    """Paths that are wrong by little: a move aside or deeper, left out, or a rapid."""
    number = max(range(len(path)), key=lambda number: (
        path[number].block > 2, min(path[number].element.length, 1.0), number))
    before, piece, after = path[:number], path[number], path[number + 1:]
    flat = piece.element
    if isinstance(flat, Arc):
        aside = replace(flat, radius=flat.radius + by_mm)
    else:
        way = polar(heading(flat, False) + math.pi / 2.0, by_mm)
        aside = Line(plus(flat.start, way), plus(flat.end, way))
    heights = tuple(height - by_mm for height in piece.heights)
    yield "aside", [*before, replace(piece, element=aside), *after]
    yield "deeper", [*before, replace(piece, heights=heights), *after]
    yield "left out", before + after
    yield "a rapid", [*before, replace(piece, is_rapid=not piece.is_rapid), *after]


def proof(result):
    """Changes of an agreement, and whether the comparison notices each."""
    kerf, allowed_mm = result.kerf, result.allowed_mm

    def fails(**change):
        return disagreement(replace(result, kerf=replace(kerf, **change))) is not None

    if not result.linuxcnc.takes:
        return []
    if result.is_wrong:
        # As if it were taken, and cut as LinuxCNC does.
        return [("taken though it cuts wrong", fails(takes=True, path=result.fine.path))]
    found = [("refused though it cuts right", fails(takes=False))]
    for what, path in changed(kerf.path, 2.0 * SAME_MM + allowed_mm):
        found.append((f"a move {what}", fails(path=path)))
    # A tool that is larger than the path was made for cuts into all that it touches.
    larger = measure(result.program, result.fine.path, 3.0 * GOUGE_MM + allowed_mm)
    found.append(("a larger tool", larger.is_wrong(GOUGE_MM + allowed_mm)))
    return found


def examine(work):
    """One program: its result, what disagrees, and the proof that it would be noticed."""
    program, command, root = work
    with tempfile.TemporaryDirectory() as folder:
        result = run(Kerf(command, Path(folder)), LinuxCnc(root, Path(folder)), program)
    words = disagreement(result)
    return result, words, proof(result) if words is None else []


def show(result):
    print(result.program.text())
    print(f"{result.kind}; LinuxCNC cuts {result.cuts}")
    for name, answer in (("LinuxCNC", result.fine or result.linuxcnc), ("Kerf", result.kerf)):
        print(f"{name}: {answer.words} {sorted(answer.codes)}")
        for piece in answer.path:
            print(f"  {piece}")


def decision(name, words):
    """The reason why a disagreement is decided; None where it is not."""
    for names, said, why in DIFFERENCES:
        if re.search(names, name) and re.search(said, words):
            return why
    return None


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    command, root = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    wanted = sys.argv[3] if len(sys.argv) > 3 else ""
    chosen = [program for program in programs() if wanted in program.name]
    assert chosen and len({program.name for program in chosen}) == len(chosen), "which programs?"
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        examined = list(pool.map(examine, [(it, command, root) for it in chosen], chunksize=8))

    kinds, decided, tried, faults = Counter(), Counter(), Counter(), []
    for result, words, changes in examined:
        name = result.program.name
        kinds[result.kind] += 1
        tried.update(what for what, _ in changes)
        faults.extend(f"NOT NOTICED: {what}: {name}" for what, found in changes if not found)
        if wanted:
            show(result)
        if words is None:
            continue
        if why := decision(name, words):
            decided[why] += 1
        else:
            faults.append(f"DISAGREE: {name}: {words}")
    table("What LinuxCNC and Kerf say:", kinds)
    table("Decided otherwise:", decided)
    table("Changed to prove that it is noticed:", tried)
    if not wanted:
        reasons = [why for _, _, why in DIFFERENCES]
        faults.extend(f"NO DIFFERENCE ANY MORE: {why}" for why in reasons if not decided[why])
        faults.extend(f"NEVER CHANGED: {what}" for what in CHANGES if not tried[what])
    print(*faults, sep="\n")
    print(f"{len(chosen)} programs, {len(faults)} faults")
    sys.exit(1 if faults else 0)


def table(title, counts):
    print(title)
    for what, count in sorted(counts.items()):
        print(f"{count:6} {what}")


if __name__ == "__main__":
    main()
