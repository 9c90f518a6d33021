#!/usr/bin/env python3
"""Holds the language of the profile `rs274` against LinuxCNC's interpreter.

Run:
    .ci/linuxcnc target/oracle/linuxcnc
    python3 -B tests/oracles/rs274 target/debug/kerf target/oracle/linuxcnc [NAME]

The sample programs of LinuxCNC's package and those that features.py and bad_input.py write go
through LinuxCNC's `rs274` and through `kerf plan`, both as processes. What both take, moves the
same way: same kinds, ends, centres and feeds, with the same events and the same spindle, coolant
and tool at the same places. NAME: only the programs with this in their names, in detail.

Exit status 0 if all agree but for differences.py, each row of which is still there, and
if the comparison notices every change that is made to prove that it can fail.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent / "linuxcnc"))

import bad_input  # noqa: E402,F401  registers its features
import features  # noqa: E402
import linuxcnc_output  # noqa: E402
from clearance import moved  # noqa: E402
from differences import DIFFERENCES  # noqa: E402
from kerf_plan import Kerf  # noqa: E402
from rs274_process import NO_END, Rs274, complaints  # noqa: E402
from same_path import same  # noqa: E402
from samples import samples  # noqa: E402
from sequence import Answer, Event, Move, difference  # noqa: E402

# LinuxCNC prints four decimals: of a program that is as many times as large it shows two more.
LARGER = 100
TIMEOUT_S = 60
# LinuxCNC joins shallow corners with a straight, and prints four decimals of inches.
COMPENSATED_MM = 0.004
# Kerf gives up after two seconds; a debug build on a busy computer takes longer.
ENDLESS_S = 300
OUTCOMES = ["agree", "both refuse", "Kerf refuses", "Kerf takes", "differ", "on purpose"]
# Every sort of change that the comparison must notice, so that it can fail.
CHANGES = ["a move aside", "a move left out", "a move twice", "another kind", "another feed",
           "another centre", "another turn", "an event left out", "another state"]


@dataclass
class Result:
    name: str
    feature: str
    outcome: str
    # What differs, or why it is refused.
    words: str = ""
    changes: tuple = ()
    unknown: frozenset = frozenset()
    text: str = ""
    linuxcnc: Answer = None
    kerf: Answer = None


def run_linuxcnc(root, folder, program, size):
    if program.is_endless:
        return Answer(False, "runs for ever")
    place = folder / "linuxcnc"
    place.mkdir()
    source = program.write(place, size)
    options = []
    if program.folder:
        (place / "machine.ini").write_text(
            f"[RS274NGC]\nSUBROUTINE_PATH={program.folder}\n[DISPLAY]\n"
            f"PROGRAM_PREFIX={program.folder}\n")
        options = ["-i", "machine.ini"]
    tools = program.sized_tools(size)
    try:
        ran = Rs274(root).run(place, source, tools, options, TIMEOUT_S)
    except subprocess.TimeoutExpired:
        return Answer(False, "does not end")
    if ran.returncode < 0:
        return Answer(False, f"crashes with signal {-ran.returncode}")
    return linuxcnc_output.answer(ran, complaints(ran), NO_END, size, [it[0] for it in tools])


def run_kerf(command, folder, program, size):
    place = folder / "kerf"
    place.mkdir()
    source = program.write(place, size)
    timeout_s = ENDLESS_S if program.is_endless else TIMEOUT_S
    try:
        return Kerf(command).run(place, source, program.sized_tools(size), size,
                                 program.folder, timeout_s)
    except subprocess.TimeoutExpired:
        return Answer(False, f"BROKEN: no answer within {timeout_s} s")


def examine(work):
    """One program through both."""
    program, command, root, shows = work
    size = LARGER if program.scales else 1
    with tempfile.TemporaryDirectory() as folder:
        linuxcnc = run_linuxcnc(root, Path(folder), program, size)
        kerf = run_kerf(command, Path(folder), program, size)
    result = Result(program.name, program.feature, *judge(linuxcnc, kerf), unknown=kerf.unknown)
    if result.outcome == "agree":
        result.changes = tuple(proof(linuxcnc, kerf, program.name))
    if shows:
        result.text, result.linuxcnc, result.kerf = program.text(size), linuxcnc, kerf
    return result


def judge(linuxcnc, kerf):
    """The outcome and the words."""
    if kerf.words.startswith("BROKEN"):
        return "differ", kerf.words
    if not linuxcnc.takes:
        if kerf.takes:
            return "Kerf takes", f"LinuxCNC: {linuxcnc.words}"
        return "both refuse", f"LinuxCNC: {linuxcnc.words} | Kerf: {kerf.words}"
    if not kerf.takes:
        return "Kerf refuses", kerf.words
    words = compensated_difference(linuxcnc, kerf) if kerf.is_compensated else \
        difference(linuxcnc, kerf)
    return ("differ", words) if words else ("agree", "")


def compensated_difference(linuxcnc, kerf):
    """None, or where the paths are not the same in space. Each has its own corners; whether they
    are right is proved by tests/oracles/linuxcnc."""
    paths = []
    for answer in (linuxcnc, kerf):
        moves = [it for it in answer.items if isinstance(it, Move) and not it.axes]
        planes = {it.plane for it in moves} - {None}
        if len(planes) > 1:
            return None
        # The axes of the plane first.
        axes = {"zx": (2, 0, 1), "yz": (1, 2, 0)}.get(*planes, (0, 1, 2)) if planes else (0, 1, 2)
        ends = [[tuple(place[axis] for axis in axes) for place in (it.start, it.end)]
                for it in moves]
        paths.append([moved(n, it.kind == "rapid", *ends[n], it.center, it.rotation)
                      for n, it in enumerate(moves)])
    return same(*paths, COMPENSATED_MM)


def proof(linuxcnc, kerf, name):
    """Changes of what Kerf answers, and whether the comparison notices each."""
    if kerf.is_compensated:
        return
    moves = [n for n, it in enumerate(kerf.items)
             if isinstance(it, Move) and not it.is_empty and not it.axes and not it.unknown]
    events = [n for n, it in enumerate(kerf.items) if isinstance(it, Event) and not it.is_empty]

    def noticed(items):
        return difference(linuxcnc, replace(kerf, items=items)) is not None

    def changed(n, **change):
        return noticed([*kerf.items[:n], replace(kerf.items[n], **change), *kerf.items[n + 1:]])

    if any(isinstance(it, Move) and it.kind == "curve" for it in linuxcnc.items):
        # LinuxCNC prints nothing of a curve but that it is one: many moves of one line in Kerf. What
        # is next to it may be a part of it.
        count = Counter(kerf.items[n].where for n in moves)
        moves = [n for n in moves
                 if all(count[it.where] <= 1 for it in kerf.items[max(n - 1, 0):n + 2])]
    pick = sum(map(ord, name))
    if moves:
        n = moves[pick % len(moves)]
        it = kerf.items[n]
        x, y, z = it.end
        # By more than the print hides.
        aside_mm = 4.0 * max(a.allowed_mm for a in linuxcnc.items if isinstance(a, Move))
        yield "a move aside", changed(n, end=(x, y + aside_mm, z))
        yield "another state", changed(n, state=replace(it.state, flood=not it.state.flood))
        if it.kind == "arc":
            center = (it.center[0] + aside_mm, it.center[1])
            yield "another centre", changed(n, center=center)
            yield "another turn", changed(n, rotation=it.rotation + 1)
        else:
            kind = "rapid" if it.kind == "line" else "line"
            yield "another kind", changed(n, kind=kind)
        if it.feed is not None and linuxcnc_feed(linuxcnc, it):
            yield "another feed", changed(n, feed=it.feed * 1.01 + 0.1)
        # The end of the last move shows that one is missing, where it is another one.
        neighbours = [other.end for other in kerf.items[max(n - 1, 0):n + 2]
                      if isinstance(other, Move) and other is not it]
        if it.kind != "arc" and it.end not in neighbours:
            if len(it.end) == 3 and any(abs(a - b) > aside_mm for a, b in zip(it.end, it.start)):
                yield "a move left out", noticed(kerf.items[:n] + kerf.items[n + 1:])
        back = replace(it, start=it.end, end=it.start, kind="line")
        # Where the next move goes there anyway, it changes nothing.
        if it.start not in neighbours and \
                any(abs(a - b) > aside_mm for a, b in zip(it.end, it.start)):
            yield "a move twice", noticed([*kerf.items[:n + 1], back, *kerf.items[n + 1:]])
    if events:
        n = events[pick % len(events)]
        yield "an event left out", noticed(kerf.items[:n] + kerf.items[n + 1:])


def linuxcnc_feed(linuxcnc, move):
    """Whether LinuxCNC says a feed for such a move."""
    return all(it.feed is not None for it in linuxcnc.items
               if isinstance(it, Move) and it.kind == move.kind)


def decision(result):
    """The row of differences.py that a result belongs to; None where it is a fault."""
    for row in DIFFERENCES:
        names, outcome, said, _ = row
        if result.outcome == outcome and re.search(names, result.name) and \
                re.search(said, result.words):
            return row
    return None


def show(result):
    print(f"== {result.name}: {result.outcome} {result.words}")
    print(result.text)
    for name, answer in (("LinuxCNC", result.linuxcnc), ("Kerf", result.kerf)):
        print(f"{name}: {'takes it' if answer.takes else answer.words}")
        for item in answer.items:
            print(f"  {item}")


def general(words):
    """What Kerf complains about, without the values."""
    words = re.sub(r" in line \d+", "", words.split("; ")[0])
    return re.sub(r"-?\d+\.\d+", "N", words)


def report(results):
    faults, rows, decided = [], defaultdict(Counter), Counter()
    reasons, only, unknown = Counter(), defaultdict(list), Counter()
    for result in results:
        outcome = result.outcome
        unknown.update(result.unknown)
        if outcome == "Kerf refuses":
            reasons[general(result.words)] += 1
            only[general(result.words)].append(result.name)
        if outcome in ("Kerf refuses", "Kerf takes", "differ"):
            row = decision(result)
            if row:
                decided[row] += 1
                outcome = "on purpose"
            else:
                faults.append(f"{outcome.upper()}: {result.name}: {result.words[:300]}")
        rows[result.feature][outcome] += 1
        faults.extend(f"NOT NOTICED: {what}: {result.name}" for what, found in result.changes
                      if not found)
    print(f"{'feature':32}" + "".join(f"{it:>13}" for it in OUTCOMES))
    total = Counter()
    for name, row in rows.items():
        total.update(row)
        print(f"{name:32}" + "".join(f"{row[it] or '':>13}" for it in OUTCOMES))
    print(f"{'all':32}" + "".join(f"{total[it]:>13}" for it in OUTCOMES))
    if reasons:
        print("\nWhat only Kerf refuses, by its first message:")
        for words, count in reasons.most_common(60):
            print(f"{count:6} {words[:150]}  ({only[words][0]})")
    if unknown:
        print("\nEvents of Kerf that are not compared:")
        for words, count in unknown.most_common(30):
            print(f"{count:6} {words}")
    if decided:
        print("\nOn purpose:")
        for row, count in decided.items():
            print(f"{count:6} {row[0]}: {row[3]}")
    return faults, decided


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("kerf", type=Path)
    arguments.add_argument("linuxcnc", type=Path)
    arguments.add_argument("name", nargs="?", default="")
    arguments.add_argument("--folder", type=Path, help="the programs of this folder instead")
    arguments.add_argument("--samples", action="store_true", help="only the sample programs")
    arguments.add_argument("--generated", action="store_true", help="only the written programs")
    arguments.add_argument("--part", type=int, default=1, help="every so many of each feature")
    arguments.add_argument("--faults", type=int, default=200, help="how many faults are shown")
    arguments = arguments.parse_intermixed_args()
    command, root = arguments.kerf.resolve(), arguments.linuxcnc.resolve()
    wanted = arguments.name
    chosen = []
    if arguments.folder:
        chosen = samples(arguments.folder.resolve(), "folder")
    else:
        if not arguments.generated:
            chosen += samples(root / "usr/share", "samples")
        if not arguments.samples:
            chosen += [it for it in features.programs() if it.seed % arguments.part == 0]
    chosen = [it for it in chosen if wanted in it.name]
    assert chosen and len({it.name for it in chosen}) == len(chosen), "which programs?"
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        work = [(it, command, root, bool(wanted) and len(chosen) <= 40) for it in chosen]
        results = list(pool.map(examine, work, chunksize=8))
    for result in results:
        if result.kerf:
            show(result)
    faults, decided = report(results)
    whole = not (wanted or arguments.folder or arguments.samples or arguments.generated
                 or arguments.part > 1)
    if whole:
        faults.extend(f"NO DIFFERENCE ANY MORE: {row[0]}: {row[3]}" for row in DIFFERENCES
                      if not decided[row])
        tried = Counter(what for result in results for what, _ in result.changes)
        faults.extend(f"NEVER CHANGED: {what}" for what in CHANGES if not tried[what])
    print()
    print(*faults[:arguments.faults], sep="\n")
    if len(faults) > arguments.faults:
        print(f"and {len(faults) - arguments.faults} more")
    print(f"{len(chosen)} programs, {len(faults)} faults")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
