"""Programs of the whole language, one generator for each feature.

Each row of docs/rs274.md has a program of its own in tests/rs274_samples.txt, too.

A generator writes the middle of a program; seeds are literals, so that a program always is the
same. What is written is valid, but for the features of bad_input.py.
"""

import math
import re
from pathlib import Path

from expressions import LEVELS, FUNCTIONS, apply, cased, expression, flat, function, number, written
from program import Program, length

# Feature: generator, and how many programs of it.
FEATURES = {}
PLANES = {"G17": "XYZ", "G18": "ZXY", "G19": "YZX"}


def feature(name, count):
    def register(generator):
        FEATURES[name] = (generator, count)
        return generator
    return register


def programs():
    for name, (generator, count) in FEATURES.items():
        for seed in range(count):
            yield write(name, generator, seed)


def write(name, generator, seed):
    program = Program(name, seed)
    program.add("G21 G17 G90 G94 G40 G80 G49 G54", "F600")
    end = generator(program, program.rng)
    program.add(*(["M2"] if end is None else end))
    return program


def mm(rng, low=-50.0, high=50.0):
    return length(rng.uniform(low, high))


def axis_words(rng, axes="XYZ", source=mm):
    chosen = [axis for axis in axes if rng.random() < 0.6] or [rng.choice(axes)]
    return " ".join(f"{axis}{source(rng)}" for axis in chosen)


def move(rng, axes="XYZ", source=mm):
    return f"{rng.choice(['G0', 'G1', 'G1', 'G01'])} {axis_words(rng, axes, source)}"


# Expressions and parameters

def value_words(program, rng, values):
    """Moves to values that are no lengths."""
    for n in range(0, len(values), 3):
        words = " ".join(f"{axis}{text}" for axis, text in zip("XYZ", values[n:n + 3]))
        program.add(f"G{rng.randint(0, 1)} {words}")
    program.scales = False


def bracketed(found):
    return found[0] if found[0].startswith("[") else f"[{found[0]}]"


@feature("expression operators", 150)
def operators(program, rng):
    values = []
    while len(values) < 12:
        operator = rng.choice([it for level in LEVELS for it in level])
        a, b = number(rng), number(rng)
        if rng.random() < 0.3:
            b = a
        if apply(operator, a[1], b[1]) is not None:
            blank = " " if operator.isalpha() else rng.choice(["", " "])
            values.append(f"[{a[0]}{blank}{cased(rng, operator)}{blank}{b[0]}]")
    value_words(program, rng, values)


@feature("expression functions", 200)
def functions(program, rng):
    values = []
    while len(values) < 12:
        found = function(rng, rng.choice(FUNCTIONS), number(rng))
        if found:
            values.append(bracketed(found) if rng.random() < 0.5 else found[0])
    value_words(program, rng, values)


@feature("expression precedence", 300)
def precedence(program, rng):
    values = []
    while len(values) < 9:
        found = flat(rng, [number(rng) for _ in range(rng.randint(3, 7))])
        if found:
            values.append(f"[{found[0]}]")
    value_words(program, rng, values)


@feature("expression nesting", 300)
def nesting(program, rng):
    values = [bracketed(expression(rng, rng.randint(2, 4))) for _ in range(6)]
    value_words(program, rng, values)


@feature("expression on exact values", 60)
def exact(program, rng):
    """Functions where their result should be whole, and rounding shows."""
    whole = [-720, -450, -90, -60, -45, -30, 0, 30, 45, 60, 90, 120, 135, 150, 180, 270, 360]
    values = []
    for _ in range(12):
        name, angle = rng.choice(["SIN", "COS", "TAN"]), rng.choice(whole)
        if name == "TAN" and angle % 180 == 90:
            name = "SIN"
        values.append(rng.choice([
            f"[{name}[{angle}] * 10]", f"FIX[{name}[{angle}] * 2]", f"FUP[{name}[{angle}] * 2]",
            f"ROUND[{name}[{angle}] * 2]", f"[{name}[{angle}] EQ {rng.choice([0, 1, 0.5])}]",
            f"[SQRT[{rng.choice([4, 9, 2])}] GE {rng.choice([2, 3])}]",
            f"[[0.1 + 0.2] EQ 0.3]", f"FIX[{rng.randint(1, 9)} * 0.1 * 10]",
            f"ROUND[{rng.choice(['0.5', '-0.5', '1.5', '2.5', '-1.5', '-2.5'])}]",
            f"FIX[{rng.choice(['-0.5', '-2.8', '2.8', '-3'])}]",
            f"FUP[{rng.choice(['-0.5', '-2.8', '2.8', '-3'])}]",
            f"[{rng.choice(['-7', '7', '-7.5', '7.5'])} MOD {rng.choice(['3', '-3', '2.5'])}]",
            f"[{rng.choice(['0', '-0', '2'])} ** {rng.choice(['0', '1', '3'])}]"]))
    value_words(program, rng, values)


@feature("expression in words", 120)
def in_words(program, rng):
    program.add(f"#1={rng.randint(1, 9)} #2={rng.randint(1, 9)}.5 #<a b>=3")
    for _ in range(8):
        program.add(rng.choice([
            f"G[{rng.randint(0, 1)}] X[#1 + 1] Y-#2", "G1 X#1 Y+#2 Z-[#1]",
            f"F[#1 * 100] G1 X-[#1 * {rng.randint(1, 5)}]", f"S[#1 * 1000] M[1 + 2]",
            f"G4 P[#2 / 10]", f"T[{rng.randint(1, 3)} + 1]", f"G0 X-#1 Y-#2 Z#<a b>",
            f"G0 x #1 y [ #2 * 2 ]", f"G0 X##1", f"G1 X[-#1] Y[+#2] Z[- [#1]]",
            f"G1 X-SIN[30] Y ABS[-#1]", f"N{rng.randint(1, 9999)} G0 Z[#1]",
            f"G0 X#[#1] Y[#[#1 + 1]]", f"M{rng.choice(['[3]', '05', '[4 + 1]'])}"]))
    program.scales = False


@feature("numbers", 80)
def numbers(program, rng):
    for _ in range(6):
        values = [written(rng, number(rng)[1]) for _ in range(3)]
        words = [f"{axis}{rng.choice(['', '', ' '])}{value}" for axis, value in zip("XYZ", values)]
        rng.shuffle(words)
        program.add(rng.choice(["", " "]).join([f"G0{rng.randint(0, 1)}", *words]))
        program.add(rng.choice(["g 1 x 1 0 y 2", "G1X10Y20Z.5", "G0 X-.5", "g1 x+3.", "G0 Z1 0.5",
                                "\tG1\tX7", "G1 X-0", "G1X1(a)Y2(b)", "G0 Y3 ; X9", "N10 G0 X4",
                                "N20.1 G0 X5", "n30g0x6", "G01 X8 ", "/ G0 X9", "/N40 G0 X3"]))
    program.scales = False


@feature("parameters numbered", 200)
def numbered(program, rng):
    known = {}

    def leaf(rng):
        if known and rng.random() < 0.6:
            name = rng.choice(list(known))
            ways = [f"#{name}", f"#[{name}]", f"# {name}"]
            pointers = [it for it, value in known.items() if value == name]
            if pointers:
                ways.append(f"##{rng.choice(pointers)}")
            return rng.choice(ways), known[name]
        return number(rng)

    for _ in range(rng.randint(6, 12)):
        name = rng.choice([rng.randint(1, 30), rng.randint(31, 5000)])
        text, value = expression(rng, rng.randint(0, 2), leaf)
        if rng.random() < 0.25 and known:
            # A pointer.
            value = rng.choice(list(known))
            text = str(value)
        program.add(rng.choice([f"#{name}={text}", f"#{name} = {text}", f"#[{name}]={text}"]))
        known[name] = value
        if rng.random() < 0.5:
            value_words(program, rng, [leaf(rng)[0] for _ in range(3)])
    value_words(program, rng, [f"#{name}" for name in known])


@feature("parameters of the same line", 120)
def same_line(program, rng):
    """All values of a line are those from before it."""
    program.add("#1=1 #2=2 #3=3")
    for _ in range(6):
        words = [f"#{rng.randint(1, 3)}=[{rng.choice(['#1', '#2', '#3'])} + {rng.randint(1, 9)}]"
                 for _ in range(rng.randint(1, 3))]
        words += [f"{axis}#{n}" for axis, n in zip("XYZ", (1, 2, 3))]
        rng.shuffle(words)
        program.add(" ".join([f"G{rng.randint(0, 1)}", *words]))
    program.scales = False


@feature("parameters named", 200)
def named(program, rng):
    names = ["a", "depth", "Feed Rate", "_global", "_G2", "x1", "tool dia.", "_a b"]
    known = []
    for _ in range(10):
        name = rng.choice(names)
        written_name = rng.choice([name, name.upper(), name.replace(" ", ""), f" {name} "])
        if known and rng.random() < 0.5:
            text = f"[#<{rng.choice(known)}> * 2 + {number(rng)[0]}]"
        else:
            text = number(rng)[0]
        program.add(f"#<{written_name}>={text}")
        known.append(name)
        program.add(f"G{rng.randint(0, 1)} X#<{rng.choice(known)}> Y#<{rng.choice(known)}> "
                    f"Z[EXISTS[#<{rng.choice(names + ['nothing'])}>]]")
    program.scales = False


@feature("parameters predefined", 150)
def predefined(program, rng):
    program.add("T1 M6", f"S{rng.randint(1, 9)}00 M3", f"F{rng.randint(1, 9)}00")
    for _ in range(10):
        program.add(rng.choice([
            move(rng, source=lambda rng: str(rng.randint(-30, 30))),
            f"G{rng.choice([17, 18, 19])}", f"G{rng.choice([90, 91])}", f"G{rng.choice([98, 99])}",
            "M8", "M7", "M9", f"T{rng.randint(1, 5)} M6", "G20\nF20", "G21\nF500", "M5", "M4",
            f"G92 X{rng.randint(1, 9)}", "G92.1"]))
        name = rng.choice(["_x", "_y", "_z", "_feed", "_rpm", "_metric", "_imperial", "_plane",
                           "_absolute", "_incremental", "_current_tool", "_selected_tool",
                           "_spindle_on", "_spindle_cw", "_mist", "_flood", "_ccomp",
                           "_coord_system", "_motion_mode", "_inverse_time", "_units_per_minute",
                           "_units_per_rev", "_lathe_diameter_mode", "_lathe_radius_mode",
                           "_tool_offset", "_call_level", "_value", "_value_returned", "_line"])
        program.add(f"#7=#<{name}>", "G90", f"G0 X[#7 / 10]")
        # LinuxCNC's offsets are in inches, as its machine is.
        value = rng.choice(["#5220", "#5420", "#5421", "#5422", "[#5211 GT 0]", "#5210", "#5400"])
        program.add(f"#8={value}", "G0 Y[#8 / 10]")
    program.scales = False


# Flow

def loop_value(rng):
    """A value that is known at no time, but always is in the domain."""
    return rng.choice(["#1", "#2", "[#1 + 1]", "[#2 * 2]", "[#1 - #2]", "SIN[#1 * 29 + 1]",
                       "[#1 MOD 3]", "ABS[#2]", "[#1 / [ABS[#2] + 1]]", "SQRT[ABS[#1]]", "ROUND[#2]"])


def condition(rng):
    return (f"[{loop_value(rng)} {rng.choice(['LT', 'GT', 'LE', 'GE', 'EQ', 'NE'])} "
            f"{rng.randint(-3, 6)}]")


class Flow:
    """Statements in each other; numbers of O words are used once."""

    def __init__(self, program, rng):
        self.program, self.rng = program, rng
        self.labels = 100
        self.budget = 40
        self.does = set()
        # After a break out of a while, LinuxCNC runs the next do only once.
        self.has_break = rng.random() < 0.5

    def label(self):
        self.labels += 1
        if self.rng.random() < 0.25:
            return f"o<label {self.labels}>" if self.rng.random() < 0.3 else f"o<l{self.labels}>"
        return f"{self.rng.choice('oO')}{self.labels}"

    def line(self, depth, text):
        self.program.add("  " * (depth if self.rng.random() < 0.8 else 0) + text)

    def block(self, depth, in_loop=None, in_sub=False):
        for _ in range(self.rng.randint(1, 3)):
            self.statement(depth, in_loop, in_sub)

    def statement(self, depth, in_loop, in_sub):
        rng = self.rng
        self.budget -= 1
        kind = rng.choice(["move", "move", "set", "if", "while", "do", "repeat", "jump"])
        if self.budget < 0 or depth > 4:
            kind = "move"
        if kind == "move":
            self.line(depth, f"G{rng.randint(0, 1)} X{loop_value(rng)} Y{loop_value(rng)}")
        elif kind == "set":
            self.line(depth, f"#2=[{loop_value(rng)} MOD 50]")
        elif kind == "jump":
            if in_loop:
                label = self.label()
                self.line(depth, f"{label} if {condition(rng)}")
                # After a continue of a do, LinuxCNC goes astray in the loops around and behind it.
                words = ["break"] if in_loop in self.does else ["continue"]
                if in_loop not in self.does and self.has_break:
                    words = ["break", "continue"]
                self.line(depth + 1, f"{in_loop} {rng.choice(words)}")
                self.line(depth, f"{label} endif")
            elif in_sub:
                label = self.label()
                self.line(depth, f"{label} if {condition(rng)}")
                self.line(depth + 1, f"{in_sub} return [#2]")
                self.line(depth, f"{label} endif")
        elif kind == "if":
            label = self.label()
            self.line(depth, f"{label} if {condition(rng)}")
            self.block(depth + 1, in_loop, in_sub)
            for _ in range(rng.choice([0, 0, 1, 2])):
                self.line(depth, f"{label} elseif {condition(rng)}")
                self.block(depth + 1, in_loop, in_sub)
            if rng.random() < 0.5:
                self.line(depth, f"{label} else")
                self.block(depth + 1, in_loop, in_sub)
            self.line(depth, f"{label} endif")
        else:
            self.loop(kind, depth, in_sub)

    def loop(self, kind, depth, in_sub):
        """Each has a counter of its own, so that `continue` does not keep it from ending."""
        rng, label = self.rng, self.label()
        if kind == "do" and self.has_break:
            kind = "while"
        counter = f"#{self.labels}"
        if kind == "repeat":
            self.line(depth, f"{label} repeat [{rng.randint(0, 4)}]")
            # It has neither break nor continue, and after a return LinuxCNC runs it less often the next time.
            self.block(depth + 1, None, None)
            self.line(depth, f"{label} endrepeat")
            return
        self.line(depth, f"{counter}=0")
        times = rng.randint(0, 4)
        if kind == "while":
            self.line(depth, f"{label} while [{counter} LT {times}]")
        else:
            self.does.add(label)
            self.line(depth, f"{label} do")
        self.line(depth + 1, f"{counter}=[{counter} + 1] #1=[#1 + 1]")
        self.block(depth + 1, label, in_sub)
        if kind == "while":
            self.line(depth, f"{label} endwhile")
        else:
            self.line(depth, f"{label} while [{counter} LT {times}]")


def flow_of(kinds):
    def generator(program, rng):
        flow = Flow(program, rng)
        program.add("#1=0 #2=1")
        for _ in range(2):
            if kinds[0] == "if":
                flow.budget = 12
                flow.statement(0, None, None)
                label = flow.label()
                flow.line(0, f"{label} if {condition(rng)}")
                flow.block(1)
                flow.line(0, f"{label} elseif {condition(rng)}")
                flow.block(1)
                flow.line(0, f"{label} else")
                flow.block(1)
                flow.line(0, f"{label} endif")
            else:
                flow.budget = 8
                flow.loop(rng.choice(kinds), 0, None)
        program.scales = False
    return generator


feature("flow if", 120)(flow_of(["if"]))
feature("flow while", 120)(flow_of(["while"]))
feature("flow do", 120)(flow_of(["do"]))


@feature("flow break out of while, then do", 2)
def while_then_do(program, rng):
    program.add("o1 while [1]", "  o1 break", "o1 endwhile", "#9=0", "o2 do", "  #9=[#9 + 1]",
                "  G0 X#9", f"o2 while [#9 LT {rng.randint(2, 4)}]")
    program.scales = False



@feature("flow return out of repeat", 3)
def return_out_of_repeat(program, rng):
    program.add("o1 sub", f"  o2 repeat [{rng.randint(3, 5)}]", "    G0 X#1 Y[#5421 + 1]", "    o3 if [#1 GT 3]",
                "      o1 return", "    o3 endif", "  o2 endrepeat", "o1 endsub",
                "o1 call [5]", "o1 call [1]", "o1 call [2]")
    program.scales = False


feature("flow repeat", 120)(flow_of(["repeat"]))


@feature("flow do and continue", 20)
def do_continue(program, rng):
    program.add("#3=0", "o1 do", "  #3=[#3 + 1]", f"  o2 if [#3 LT {rng.randint(1, 6)}]",
                "    o1 continue", "  o2 endif", "  G1 X#3", f"o1 while [#3 LT {rng.randint(1, 8)}]",
                "G0 Y#3")
    program.scales = False


@feature("flow mixed", 250)
def mixed(program, rng):
    program.add("#1=0 #2=1")
    flow = Flow(program, rng)
    for _ in range(rng.randint(3, 6)):
        flow.statement(0, None, None)
    program.scales = False


def sub_name(rng, n):
    return rng.choice([f"o{500 + n}", f"o<sub{n}>", f"O<Sub {n}>" if n % 2 else f"o<s-{n}>"])


@feature("subs", 250)
def subs(program, rng):
    """Definitions before the calls; arguments, locals, return values."""
    flow = Flow(program, rng)
    flow.labels = 600
    names = [sub_name(rng, n) for n in range(rng.randint(1, 3))]
    for n, name in enumerate(names):
        program.add(f"{name} sub")
        program.add(f"  #<local>=[#1 + #2 + {n}]", f"  G1 X#<local> Y#1 Z#{rng.randint(1, 4)}")
        flow.budget = 6
        flow.block(1, None, name)
        if n and rng.random() < 0.6:
            program.add(f"  {names[n - 1]} call [#1] [2] [#<local>]")
        ending = rng.choice(["", f" [#<local> + {rng.randint(0, 5)}]"])
        program.add(f"{name} endsub{ending}")
    program.add("#1=7 #2=8")
    for _ in range(rng.randint(1, 4)):
        name = rng.choice(names)
        arguments = " ".join(f"[{number(rng)[0]}]" for _ in range(rng.randint(0, 4)))
        program.add(f"{name} call {arguments}")
        program.add("G0 X[#<_value>] Y#1 Z[#<_value_returned>]")
    program.scales = False


@feature("sub arguments", 60)
def arguments(program, rng):
    count = rng.randint(0, 30)
    program.add("o100 sub")
    program.add(*[f"  G1 X#{n} Y#{n + 1} Z#{n + 2}" for n in range(1, 29, 3)])
    program.add("  #3=99", "o100 endsub")
    program.add(*[f"#{n}={n}.5" for n in range(1, 31)])
    program.add("o100 call " + "".join(f"[{rng.randint(-99, 99)}]" for _ in range(count)))
    program.add(*[f"G0 X#{n} Y#{n + 1} Z#{n + 2}" for n in range(1, 29, 3)])
    program.scales = False


@feature("sub recursion", 60)
def recursion(program, rng):
    depth, name = rng.randint(1, 8), sub_name(rng, 1)
    program.add(f"{name} sub", "  o1 if [#1 LE 0]",
                f"    {name} return [1]", "  o1 endif", f"  G1 X#1 Y[#1 * {rng.randint(1, 3)}]",
                f"  {name} call [#1 - 1]", "  #<result>=[#<_value> + #1]", "  G1 Z#<result>",
                f"{name} endsub [#<result>]", f"{name} call [{depth}]", "G0 X#<_value>")
    program.scales = False


@feature("sub indirect", 60)
def indirect(program, rng):
    for n in (200, 201, 202):
        program.add(f"o{n} sub", f"  G1 X[#1 + {n}]", f"o{n} endsub")
    program.add(f"#5={rng.choice([200, 201, 202])}", f"o#5 call [{rng.randint(1, 9)}]")
    program.add(f"o[200 + {rng.randint(0, 2)}] call [{rng.randint(1, 9)}]")
    program.add("#<n>=201", "o#<n> call [1]")
    program.scales = False


@feature("sub in files", 80)
def in_files(program, rng):
    program.files["helper.ngc"] = [
        "o<helper> sub", "  G1 X#1 Y#2", "  o<inner> call [5]", "o<helper> endsub [#1 * 2]",
        "o<inner> sub", "  G1 Z#1", "o<inner> endsub", "M2"] if rng.random() < 0.5 else [
        "(helper)", "o<helper> sub", "  G1 X#1 Y#2", "o<helper> endsub [#1 * 2]"]
    program.files["300.ngc"] = ["o300 sub", "  G0 X#1", "o300 endsub", "M2"]
    program.add(f"o<helper> call [{rng.randint(1, 9)}] [{rng.randint(1, 9)}]", "G0 Z#<_value>")
    if rng.random() < 0.5:
        program.add("o300 call [3]")
    program.scales = False


@feature("M98 and M99", 100)
def m98(program, rng):
    """Fanuc's subprograms, behind the main program."""
    program.add(f"M98 P100 L{rng.randint(1, 3)}", "G0 X1", "M98 P101")
    if rng.random() < 0.5:
        program.add("M98 P100")
    program.add("M30")
    program.add("O100", f"G91 G1 X{rng.randint(1, 9)} Y{rng.randint(1, 9)}", "G90")
    if rng.random() < 0.5:
        program.add("M98 P101 L2")
    program.add("M99", "O101", f"G1 Z{rng.randint(1, 9)}", f"G1 X{rng.randint(1, 9)}", "M99")
    program.scales = False
    return []


# Drilling cycles

def cycle(name, plane):
    code = f"G{name}"
    axes = PLANES[plane]

    def generator(program, rng):
        program.add(plane, f"S1000 {'M4' if name == 74 else 'M3'}")
        if rng.random() < 0.15:
            program.add("G20", "F20")
        top = rng.randint(5, 20)
        program.add("G0 " + " ".join(f"{axis}{length(rng.randint(0, 20))}" for axis in axes[:2])
                    + f" {axes[2]}{length(top)}")
        program.add(rng.choice(["G98", "G99"]))
        incremental = rng.random() < 0.25
        program.add("G91" if incremental else "G90")
        r = -rng.randint(1, 4) if incremental else rng.randint(1, 8)
        bottom = -rng.randint(4, 12) if incremental else -rng.randint(0, 9)
        words = [f"{axes[2]}{length(bottom)}", f"R{length(r)}"]
        if name in (73, 83):
            words.append(f"Q{length(rng.choice([1.0, 2.5, 3.0, 0.7]))}")
        if name in (82, 86, 88, 89) or name in (74, 84) and rng.random() < 0.3:
            words.append(f"P{rng.choice(['0.5', '1', '0.25'])}")
        if rng.random() < 0.7:
            words += [f"{axis}{length(rng.randint(-20, 20))}" for axis in axes[:2]
                      if rng.random() < 0.8]
        # LinuxCNC takes no L with G74.
        if rng.random() < 0.25 and name != 74:
            words.append(f"L{rng.randint(1, 3)}")
        if rng.random() < 0.2:
            words.append("F300")
        rng.shuffle(words)
        program.add(" ".join([code, *words]))
        for _ in range(rng.randint(0, 4)):
            # Sticky words: only what is another one is written.
            words = [f"{axis}{length(rng.randint(-20, 20))}" for axis in axes[:2]
                     if rng.random() < 0.7]
            if rng.random() < 0.3:
                words.append(f"{axes[2]}{length(bottom - rng.randint(0, 3))}")
            if rng.random() < 0.2:
                words.append(f"R{length(r + (0 if incremental else rng.randint(0, 2)))}")
            if rng.random() < 0.15 and name != 74:
                words.append(f"L{rng.randint(1, 3)}")
            if rng.random() < 0.2:
                words.insert(0, rng.choice(["G98", "G99"]))
            if not any(word[0] in axes for word in words):
                words.append(f"{axes[0]}{length(rng.randint(-20, 20))}")
            if rng.random() < 0.3:
                words.insert(0, code)
            program.add(" ".join(words))
        program.add("G80", f"G90 G0 {axes[0]}{length(3)}")
    return generator


for _name in (73, 74, 81, 82, 83, 84, 85, 86, 88, 89):
    for _plane, _count in (("G17", 60), ("G18", 25), ("G19", 25)):
        feature(f"cycle G{_name} {_plane}", _count)(cycle(_name, _plane))


@feature("cycle without G98 and G99", 20)
def cycle_default(program, rng):
    program.add("S900 M3", f"G0 Z{length(rng.randint(5, 20))}",
                f"G81 X{length(5)} Z{length(-3)} R{length(2)}", f"X{length(9)}",
                rng.choice(["G98", "G99"]), f"X{length(12)}", "G80", f"G0 X{length(1)}")


@feature("cycles in a loop", 60)
def cycle_loop(program, rng):
    code = rng.choice(["G81", "G82 P0.5", "G83 Q2", "G73 Q1.5", "G85"])
    program.add("S900 M3", "G0 Z10", rng.choice(["G98", "G99"]), "#1=0",
                f"o100 while [#1 LT {rng.randint(1, 5)}]", f"  {code} X[#1 * 10] Y[#1 * #1] Z-{rng.randint(1, 6)} R2",
                "  #1=[#1 + 1]", "o100 endwhile", "G80")
    program.scales = False


# Coordinates

@feature("units", 150)
def units(program, rng):
    for _ in range(rng.randint(3, 7)):
        if rng.random() < 0.5:
            program.add(rng.choice(["G20", "G21"]), f"F{rng.choice([10, 100, 333.3])}")
        program.add(move(rng, source=lambda rng: length(rng.uniform(-9, 9))))
        if rng.random() < 0.3:
            program.add(f"G91 {move(rng, 'XY')}", "G90")


@feature("units and F in one block", 4)
def units_and_feed(program, rng):
    program.scales = False
    program.add("G20 F20", "G1 X1", "G21 F500 G1 X2")


@feature("incremental", 100)
def distances(program, rng):
    for _ in range(rng.randint(4, 9)):
        if rng.random() < 0.4:
            program.add(rng.choice(["G90", "G91"]))
        program.add(rng.choice(["", "G91 ", "G90 "]) + move(rng))


@feature("G92", 150)
def g92(program, rng):
    for _ in range(rng.randint(4, 8)):
        program.add(rng.choice([
            move(rng), move(rng), f"G92 {axis_words(rng)}", f"G92 {axis_words(rng)}", "G92.1",
            "G92.2", "G92.3", f"G91 {move(rng)}", "G90",
            f"G2 X{length(rng.randint(1, 9))} Y{length(2)} R{length(200)}", "G20\nF20", "G21\nF400"]))
        program.add(move(rng))


@feature("G52", 150)
def g52(program, rng):
    for _ in range(rng.randint(4, 8)):
        program.add(rng.choice([
            move(rng), f"G52 {axis_words(rng)}", f"G52 {axis_words(rng)}", "G52 X0 Y0 Z0",
            f"G92 {axis_words(rng)}", "G92.1", "G55", "G54", f"G91 {move(rng)}", "G90"]))
        if program.lines[-1] in ("G54", "G55"):
            program.add("G90 G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"))
        program.add(move(rng))


@feature("work offsets", 150)
def offsets(program, rng):
    for _ in range(rng.randint(3, 6)):
        system = rng.randint(1, 9)
        program.add(rng.choice([
            f"G10 L2 P{system} {axis_words(rng)}", f"G10 L20 P{system} {axis_words(rng)}",
            f"G10 L2 P0 {axis_words(rng)}", f"G10 L20 P0 {axis_words(rng)}"]))
        program.add(rng.choice(["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2",
                                "G59.3"]))
        program.add("G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"))
        program.add(rng.choice([f"G92 {axis_words(rng)}", "G92.1", "(no G92)"]))
        program.add(move(rng), move(rng))


@feature("work offsets are read", 40)
def offsets_read(program, rng):
    program.scales = False
    for _ in range(3):
        program.add(f"G10 L2 P1 X{rng.randint(1, 9)} Y{rng.randint(1, 9)} Z1")
        program.add("G0 X0 Y0 Z0", "G0 X[#5221 / #5222] Y[#5220 + #5222 / #5223]")


ROTATIONS = [0, 30, 45, 90, -90, 180, 270, 12.5, -0.75, 400]


@feature("rotated offsets", 80)
def rotated(program, rng):
    for _ in range(rng.randint(2, 4)):
        program.add(f"G10 L2 P1 {axis_words(rng)} R{rng.choice(ROTATIONS)}")
        program.add("G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"))
        program.add(move(rng), f"G91 {move(rng)}", "G90")
        x, y = rng.randint(5, 20), rng.randint(5, 20)
        program.add(f"G0 X{length(x)} Y{length(y)}",
                    f"G2 X{length(x + 10)} Y{length(y)} I{length(5)} J{length(0)}")


@feature("rotated offsets of several systems", 120)
def rotated_systems(program, rng):
    for _ in range(rng.randint(4, 7)):
        system = rng.randint(1, 3)
        program.add(f"G10 L2 P{rng.choice([system, 0])} R{rng.choice(ROTATIONS)}")
        program.add(f"G{53 + system}", "G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"))
        program.add(rng.choice([
            f"G52 {axis_words(rng)}", f"G92 {axis_words(rng)}", "G92.1", f"G53 G0 {axis_words(rng)}", "G28",
            f"G10 L20 P0 X{mm(rng)} Y{mm(rng)}", f"G10 L20 P{system} X{mm(rng)}", "M70\nG54\nM72"]))
        program.add("G90 G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"), move(rng))
        program.scales = False


@feature("cycles, curves and planes under rotated offsets", 120)
def rotated_cycles(program, rng):
    program.add(f"G10 L2 P1 R{rng.choice(ROTATIONS[1:])}", f"G98 F{length(300)}")
    program.add("G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"))
    for _ in range(rng.randint(2, 4)):
        x, y = rng.randint(5, 20), rng.randint(5, 20)
        program.add(rng.choice([
            f"G0 Z{length(20)}\nG81 X{length(x)} Y{length(y)} Z{length(-3)} R{length(2)}\nX{length(y)}\nG80",
            f"G0 Z{length(20)}\nG91 G83 X{length(x)} Z{length(-3)} R{length(-2)} Q{length(1)} L2\nG90 G80",
            f"G5.1 X{length(x)} Y{length(y)} I{length(9)} J{length(2)}",
            f"G18 G81 X{length(x)} Y{length(-3)} Z{length(y)} R{length(99)}\nG80 G17",
            f"G3 X{length(x)} Y{length(y)} R{length(300)} Z{length(4)} P2",
            f"G90.1 G0 X{length(x)} Y{length(y)}\nG2 X{length(x)} Y{length(y)} I{length(x + 5)} J{length(y)}\nG91.1",
            f"G0 @{length(x)} ^{y}", f"G7 G0 X{length(x)}\nG8",
            f"G0 X[#5420 + {length(1)}] Y[#5421 - {length(2)}]"]))
        program.add(f"G90 G0 X{mm(rng)} Y{mm(rng)}", move(rng))


@feature("machine coordinates", 100)
def machine(program, rng):
    for _ in range(rng.randint(3, 6)):
        program.add(rng.choice([
            f"G53 {move(rng)}", f"G28 {axis_words(rng)}", "G28", f"G30 {axis_words(rng)}", "G30",
            "G91 G28 Z0", f"G92 {axis_words(rng)}", f"G10 L2 P1 {axis_words(rng)}"]))
        program.add("G90 G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"))


@feature("stored positions", 60)
def stored(program, rng):
    for _ in range(3):
        program.add("G0 " + " ".join(f"{axis}{mm(rng)}" for axis in "XYZ"))
        program.add(rng.choice(["G28.1", "G30.1"]))
        program.add(move(rng), rng.choice(["G28", "G30", f"G28 {axis_words(rng)}"]))


@feature("tool lengths", 120)
def tool_lengths(program, rng):
    program.tools = [(tool, 3.0, 10.0 * tool) for tool in range(1, 10)]
    program.scales = False
    for _ in range(rng.randint(3, 6)):
        tool = rng.randint(1, 9)
        program.add(rng.choice([
            f"T{tool} M6 G43", f"T{tool} M6", f"G43 H{tool}", "G43", "G43 H0", "G43.2 H0", "G49", f"G43.1 Z{tool}",
            f"G43.1 X{tool} Z{tool}.5", f"G43.2 H{tool}"]))
        program.add("G0 " + " ".join(f"{axis}{rng.randint(-30, 30)}" for axis in "XYZ"))
        program.add(f"G0 X[{rng.choice(['#5400', '#<_current_tool>', '#<_tool_offset>'])}]")


@feature("tool length in another unit", 3)
def length_in_another_unit(program, rng):
    """LinuxCNC keeps the number of the length in force."""
    program.tools = [(1, 3.0, 20.0)]
    program.scales = False
    program.add("G43 H1", "G0 X1 Y1 Z5", "G20\nF20", rng.choice(["G28", "G53 G0 Z1", "G53 G0 X1 Z0"]), "G0 X1 Y1 Z1")


@feature("tool table", 60)
def tool_table(program, rng):
    program.scales = False
    for _ in range(3):
        tool = rng.randint(1, 9)
        program.add(f"T{tool} M6", "G0 X1 Y2 Z3", rng.choice([
            f"G10 L1 P{tool} Z{rng.randint(1, 30)}", f"G10 L10 P{tool} Z{rng.randint(1, 30)}",
            f"G10 L11 P{tool} Z{rng.randint(1, 30)}",
            f"G10 L2 P1 Z4\nG10 L2 P9 Z{rng.randint(1, 30)}\nG0 Z3\nG10 L11 P{tool} Z{rng.randint(1, 30)}",
            f"G10 L1 P{tool} R{rng.randint(1, 5)}"]))
        program.add("G43", "G0 X5 Y5 Z5")


@feature("tool in the spindle", 60)
def tool_in_spindle(program, rng):
    """Ratios: lengths are in inches in LinuxCNC."""
    program.tools = [(tool, 2.0 + tool, 10.0 * tool) for tool in range(1, 10)]
    program.scales = False
    tool = 0
    for n in range(rng.randint(3, 6)):
        if n == 0 or rng.random() < 0.5:
            tool = rng.randint(1, 9)
            program.add(f"T{tool} M6")
        program.add(rng.choice([
            "", "G43", "G49", f"G43.1 Z{tool}", f"T{rng.randint(1, 9)}",
            f"G10 L1 P{rng.randint(1, 9)} Z{rng.randint(1, 30)} R{rng.randint(1, 9)}",
            f"G10 L1 P{tool} Z{rng.randint(1, 30)}", f"G10 L1 P{tool} R{rng.randint(1, 9)}",
            "G20\nF20", "G21\nF500", "T4 M6"]))
        program.add("G0 X-1 Y-1 Z-1", f"G0 X[#5403 / #5410] Y[#5401 + #{rng.randint(5404, 5409)} + #5402] "
                    f"Z[#5411 + #5412 + #5413 + #[5400 + 10] / #5410]")


# Motion and feeds

@feature("G93", 120)
def g93(program, rng):
    for _ in range(rng.randint(2, 4)):
        program.add("G93")
        for _ in range(rng.randint(1, 4)):
            program.add(f"G1 {axis_words(rng)} F{rng.choice([2, 5, 0.5, 12.5])}")
        if rng.random() < 0.4:
            program.add(f"G3 X{mm(rng)} Y{mm(rng)} R{length(300)} F3")
        if rng.random() < 0.3:
            program.add(move(rng).replace("G1", "G0").replace("G01", "G0"))
        program.add("G94", f"F{rng.randint(1, 9)}00", move(rng))


@feature("G95", 80)
def g95(program, rng):
    program.add(f"S{rng.randint(1, 30)}00 M3")
    for _ in range(rng.randint(2, 4)):
        program.add("G95", f"F{length(rng.choice([0.1, 0.25, 0.5]))}")
        program.add(move(rng), move(rng))
        if rng.random() < 0.5:
            program.add(f"S{rng.randint(1, 30)}00", move(rng))
        program.add("G94", f"F{length(rng.randint(1, 9) * 100)}", move(rng))


@feature("G96 and G97", 60)
def g96(program, rng):
    program.add(f"G96 D{rng.randint(10, 30)}00 S{rng.randint(50, 200)}", "M3", move(rng), move(rng),
                f"G97 S{rng.randint(5, 20)}00", move(rng), "M5")
    program.scales = False


@feature("G95 under G96", 40)
def surface_feeds(program, rng):
    # Along the axis of the spindle: LinuxCNC prints F alone, and the feed follows from how far X is from 0.
    program.scales = False
    inches = rng.random() < 0.3
    program.add("G18 G95", "G20" if inches else "G21", f"G96 D{rng.randint(5, 20)}00 S{rng.randint(50, 200)} M3",
                f"F{length(rng.choice([0.004, 0.01]) if inches else rng.choice([0.1, 0.25]))}", "G0 X9 Z5")
    for _ in range(rng.randint(2, 5)):
        x, z = rng.randint(1, 40) / 2.0, rng.randint(-20, 5)
        program.add(rng.choice([f"G1 X{x} Z{z}", f"G0 X{x}\nG1 Z{z}", f"G1 Z{z}", f"G91 G1 X{x} Z-1\nG90"]))


@feature("feeds", 80)
def feeds(program, rng):
    for _ in range(rng.randint(5, 9)):
        program.add(rng.choice([
            f"F{rng.randint(1, 3000)}", f"G1 {axis_words(rng)} F{rng.randint(1, 3000)}.5",
            f"F{rng.randint(1, 9)} {axis_words(rng)} G1", "G0 X0 F77", move(rng)]))


def arc_words(rng, plane, start, by_radius, turns=0, helix=False, absolute=False):
    """An arc from `start` whose ends are equally far from its centre, up to 1e-9."""
    axes = PLANES[plane]
    radius, begin = rng.uniform(3.0, 30.0), rng.uniform(0.0, 2.0 * math.pi)
    sweep = rng.uniform(0.2, 6.0)
    center = (start[0] - radius * math.cos(begin), start[1] - radius * math.sin(begin))
    clockwise = rng.random() < 0.5
    angle = begin - sweep if clockwise else begin + sweep
    end = (center[0] + radius * math.cos(angle), center[1] + radius * math.sin(angle))
    full = not by_radius and rng.random() < 0.2
    if full:
        end = start
    words = ["G2" if clockwise else "G3"]
    if not full or rng.random() < 0.5:
        words += [f"{axis}{length(value, 9)}" for axis, value in zip(axes, end)]
    if helix:
        words.append(f"{axes[2]}{mm(rng)}")
    if by_radius:
        words.append(f"R{length(radius if sweep <= math.pi else -radius, 9)}")
    else:
        letters = {"X": "I", "Y": "J", "Z": "K"}
        for axis, value, at in zip(axes, center, start):
            words.append(f"{letters[axis]}{length(value if absolute else value - at, 9)}")
    if turns:
        words.append(f"P{turns}")
    return " ".join(words), tuple(round(value, 9) for value in end)


def arcs(plane, by_radius, turns=False, absolute=False):
    def generator(program, rng):
        program.add(plane, "G90.1" if absolute else "G91.1")
        axes = PLANES[plane]
        at = (round(rng.uniform(-20, 20), 3), round(rng.uniform(-20, 20), 3))
        program.add("G0 " + " ".join(f"{axis}{length(it, 9)}" for axis, it in zip(axes, at)))
        for _ in range(rng.randint(2, 5)):
            text, at = arc_words(rng, plane, at, by_radius,
                                 rng.randint(1, 4) if turns and rng.random() < 0.7 else 0,
                                 rng.random() < 0.3, absolute)
            program.add(text)
    return generator


for _plane in PLANES:
    feature(f"arcs by radius {_plane}", 80)(arcs(_plane, True))
    feature(f"arcs by centre {_plane}", 80)(arcs(_plane, False))
    feature(f"arcs with turns {_plane}", 60)(arcs(_plane, False, turns=True))
    feature(f"arcs G90.1 {_plane}", 40)(arcs(_plane, False, absolute=True))


@feature("arcs with one axis", 80)
def short_arcs(program, rng):
    """Axes and centre words that are left out."""
    program.add("G0 X{L10} Y{L0} Z{L0}")
    program.add(rng.choice(["G2 I{L-10}", "G3 J{L10}", "G2 X{L20} I{L5}", "G3 Y{L20} J{L10}",
                            "G2 X{L0} I{L-5}", "G3 I{L-10} Z{L-2} P2", "G2 Z{L-3} I{L5}",
                            "G91 G2 X{L10} R{L5}", "G91 G3 Y{L6} J{L3}", "G18 G2 X{L20} I{L5}",
                            "G18 G3 K{L4}", "G19 G2 Z{L8} K{L4}", "G19 G3 J{L5} K{L0} P3"]))
    program.add("G90 G17 G1 X{L1} Y{L1}")


@feature("rounded arcs", 80)
def rounded(program, rng):
    """Ends with three decimals, as they are posted."""
    program.scales = False
    for _ in range(3):
        plane = rng.choice(list(PLANES))
        at = (round(rng.uniform(-20, 20), 3), round(rng.uniform(-20, 20), 3))
        axes = PLANES[plane]
        text, _ = arc_words(rng, plane, at, rng.random() < 0.3)
        text = re.sub(r"\{L([-\d.]+)\}", lambda it: f"{{L{round(float(it[1]), 3):g}}}", text)
        program.add(plane, "G0 " + " ".join(f"{axis}{length(it)}" for axis, it in zip(axes, at)))
        program.add(text)


@feature("polar", 60)
def polar(program, rng):
    program.add("G0 X{L1} Y{L2}")
    for _ in range(5):
        program.add(rng.choice([
            f"G1 @{length(rng.randint(1, 30))} ^{rng.randint(-180, 180)}",
            f"G0 ^{rng.randint(0, 360)}", f"G1 @{length(rng.randint(1, 30))}",
            f"G91 G1 @{length(rng.randint(1, 9))} ^{rng.randint(0, 90)}", "G90",
            f"G1 @{length(rng.randint(1, 9))} ^{rng.randint(0, 360)} Z{length(1)}", "G52 X{L1} Y{L2}",
            f"G81 @{length(rng.randint(1, 9))} ^{rng.randint(0, 360)} Z{length(-1)} R{length(1)}\nG80",
            f"G1 @{length(rng.randint(1, 9))} ^[10 * 3]"]))


@feature("polar cycles that L repeats", 60)
def polar_cycles(program, rng):
    program.add(f"G98 F{length(300)}", f"G0 X{length(5)} Y{length(2)} Z{length(9)}")
    for _ in range(3):
        angle, distance = rng.choice([15, 60, 7.5, -90]), length(rng.randint(1, 5))
        words = rng.choice([f"^{angle}", f"@{distance}", f"@{distance} ^{angle}"])
        program.add(rng.choice([
            f"G91 G81 {words} Z{length(-3)} R{length(-5)} L{rng.randint(1, 6)}\nG90 G80",
            f"G81 {words} Z{length(-3)} R{length(4)} L{rng.randint(1, 3)}\nG80",
            "G52 X{L1} Y{L2}", "G10 L2 P1 R30\nG0 X{L3} Y{L4}"]))


@feature("lathe diameters", 60)
def diameters(program, rng):
    program.add("G18", rng.choice(["G7", "G8"]))
    for _ in range(4):
        program.add(move(rng, "XZ"), rng.choice(["G7", "G8", f"G91 G1 X{mm(rng)}", "G90"]))
    program.add("G8")


@feature("tip directions", 40)
def tips(program, rng):
    # Around a step, outside, from a place that is far enough for any tip; every direction in turn.
    program.add("G18", f"G0 X{length(0)} Z{length(0)}",
                f"G42.1 D{length(rng.choice([0.4, 1.6, 2.4]))} L{program.seed % 10} "
                f"G1 X{length(10)} Z{length(rng.randint(15, 20))}", f"Z{length(30)}",
                f"X{length(30)}", f"G{rng.choice([2, 3])} X{length(40)} Z{length(40)} R{length(10)}",
                f"G1 X{length(60)}", f"G40 G0 X{length(rng.randint(70, 80))} Z{length(60)}")


@feature("arcs that begin compensation", 300)
def arc_leads(program, rng):
    # In both planes with compensation, on both sides, before a straight or an arc; the tool leaves far away.
    side, turn = rng.choice([-1, 1]), rng.choice([-1, 1])
    turning = rng.random() < 0.3
    one, two, center_one, center_two, up = "ZXKIY" if turning else "XYIJZ"
    radius, degrees = rng.uniform(2, 30), rng.uniform(20, 340)
    # In G18 the turn is that about Y, from Z to X.
    word = "G3" if turn > 0 else "G2"
    heading = rng.uniform(0, 2 * math.pi)
    start = (rng.uniform(-20, 20), rng.uniform(-20, 20))

    def beside(point, direction, distance):
        return (point[0] - distance * math.sin(direction), point[1] + distance * math.cos(direction))

    center = beside(start, heading, turn * radius)
    leave = heading + turn * math.radians(degrees)
    end = beside(center, leave, -turn * radius)
    is_relative = rng.random() < 0.3
    at = (0.0, 0.0)

    def words(point):
        origin = at if is_relative else (0.0, 0.0)
        values = [length(p - o, 6) for p, o in zip(point, origin)]
        return f"{one}{values[0]} {two}{values[1]}"

    diameter = rng.choice([1.0, 3.0, 6.0, 9.0])
    select = rng.choice([f"G41.1 D{length(diameter)}", "G41 D1"])
    if side < 0:
        select = select.replace("41", "42")
    if rng.random() < 0.15:
        # A negative diameter is that on the other side.
        select = select.replace("41", "40").replace("42", "41").replace("40", "42")
        select = re.sub(r"D\{L", "D{L-", select) if ".1" in select else select
        side = side if ".1" in select else -side
    is_absolute = not is_relative and rng.random() < 0.3
    if rng.random() < 0.25 and degrees < 330:
        form = f"R{length(radius if degrees < 180 else -radius, 6)}"
    else:
        origin = (0.0, 0.0) if is_absolute else start
        form = f"{center_one}{length(center[0] - origin[0], 6)} {center_two}{length(center[1] - origin[1], 6)}"
    rise = f" {up}{length(rng.uniform(-3, 3))}" if rng.random() < 0.3 else ""
    program.add(*["G18"] * turning, f"G0 {one}{length(start[0], 6)} {two}{length(start[1], 6)}",
                *["G90.1"] * is_absolute, *["G91"] * is_relative)
    at = start
    arc = f"{word} {words(end)} {form}{rise}"
    if rng.random() < 0.2:
        # Called, as posts call each contour.
        program.lines[:0] = ["o100 sub", *([select, arc] if rng.random() < 0.5 else [f"{select} {arc}"]),
                             "o100 endsub"]
        program.add("o100 call")
    elif rng.random() < 0.5:
        program.add(select, arc)
    else:
        program.add(f"{select} {arc}")
    at, direction = end, leave + math.radians(rng.choice([0, 0, rng.uniform(-80, 80)]))
    if rng.random() < 0.4:
        bend, size = rng.choice([-1, 1]), rng.uniform(6, 30)
        center = beside(at, direction, bend * size)
        direction += bend * math.radians(rng.uniform(20, 90))
        then = beside(center, direction, -bend * size)
        origin = (0.0, 0.0) if is_absolute else at
        program.add(f"{'G3' if bend > 0 else 'G2'} {words(then)} "
                    f"{center_one}{length(center[0] - origin[0], 6)} {center_two}{length(center[1] - origin[1], 6)}")
    else:
        then = beside(at, direction - math.pi / 2, rng.uniform(10, 40))
        program.add(f"G1 {words(then)}")
    at = then
    program.add(f"G40 G1 {words(beside(at, direction, side * 40))}")


@feature("splines", 40)
def splines(program, rng):
    program.scales = False
    program.add("G0 X0 Y0", rng.choice([
        "G5 I0 J3 P0 Q-3 X1 Y1", "G5.1 X4 Y4 I2 J1", "G5.2 P1 L3 X0 Y1\nX2 Y2 P1\nX4 Y0 P1\nG5.3",
        "G5 I1 J3 P0 Q-3 X1 Y1\nG5 P2 Q2 X9 Y[2 * 3]", "G91 G5.1 X4 Y4 I2 J0\nG90",
        "G20\nF20\nG5.1 X1 Y1 I0.5 J0.1\nG21\nF500", "G5.2 P0.5\nX1 Y1 P1\nX2 Y0 P3\nG5.3",
        "G92 X1 Y1\nG5.1 X4 Y4 I2 J1", "G91 G5.2 X1 Y1 P1\nX3 Y3 P1\nX5 Y0 P1\nX1 Y9 P2\nG5.3\nG90",
        "G93 G5.1 X4 Y4 I2 J1 F2\nG94 F300"]),
        "G1 X10 Y10")


@feature("threads", 80)
def threads(program, rng):
    program.scales = False
    program.add(f"S{rng.randint(1, 20)}00 {rng.choice(['M3', 'M4'])}", rng.choice([
        "", "", "G7", "G20", "G91", "G18", "G93", "G95", "G92 X3 Z1", "G55", "G10 L2 P1 R30", "G43.1 Z2"]),
        "G0 X10 Y0 Z5")
    for _ in range(rng.randint(1, 3)):
        thread = f"G76 P{rng.choice([0.5, 1, 1.75])} I{rng.choice([-2, -1, 1, 0.5])} J{rng.choice([0.1, 0.3])} K{rng.choice([0.4, 1, 2])}"
        for letter, values in (("R", [1, 1.5, 2]), ("Q", [0, 29.5, 30, 60]), ("H", [0, 1, 3]), ("L", [0]), ("E", [1])):
            if rng.random() < 0.5:
                thread += f" {letter}{rng.choice(values)}"
        program.add(rng.choice([
            f"G33 Z-{rng.randint(1, 9)} K{rng.choice([0.5, 1.5, 1.27])}", f"G33 X{mm(rng)} Z{mm(rng)} K2\nX1 Z2 K1.5",
            f"G33 X{mm(rng)} Y{mm(rng)} K1", f"{thread} Z{mm(rng)}", f"{thread} Z{mm(rng)}", f"{thread} Z{mm(rng)} X{mm(rng)}"]),
            move(rng, "XZ") + f" F{rng.randint(1, 9)}")
    program.add("G90", "G21", "G94", "G8", "G0 Z5")


@feature("threads with angled ends", 20)
def threads_with_angled_ends(program, rng):
    program.scales = False
    program.add("S500 M3", "G0 X10 Z5", rng.choice([
        "G33.1 Z-10 K1", "G76 P1 Z-20 I-1 J0.3 K2 R1.5 Q29.5 H2 E0.5 L2"]), "G0 Z5")


def lathe_profile(rng, goes_down, keeps):
    """Heights over the way along a profile, and what leads to each: the radius of an arc to the left, to the
    right, or None; and what its end is rounded with."""
    points = [(0.0, rng.uniform(2.0, 6.0), None, "")]
    last = ""
    for _ in range(rng.randint(2, 8)):
        kinds = ["level", "rise", "wall", "arc", *(["fall"] if goes_down else []),
                 *(["drop"] if goes_down and not keeps and last else [])]
        kind = rng.choice([it for it in kinds if it != last and not {it, last} <= {"wall", "drop"}])
        way, height = points[-1][:2]
        along, up = rng.uniform(1.5, 6.0), rng.uniform(1.5, 5.0)
        end = {"level": (along, 0.0), "rise": (along, up), "wall": (0.0, up), "drop": (0.0, -up / 2.0),
               "fall": (along, -up / 2.0), "arc": (along, rng.choice([1, 1, -1 if goes_down else 1]) * up / 2.0)}[kind]
        end = round(way + end[0], 3), round(height + end[1], 3)
        radius = None
        if kind == "arc":
            chord, slope = math.dist((way, height), end), abs(math.atan2(end[1] - height, end[0] - way))
            left = slope > 0.15 and rng.random() < 0.5
            # Where an arc has its lowest place between its ends, LinuxCNC leaves out layers after it.
            half = rng.uniform(0.1, min(slope, math.radians(88.0) - slope) if left else math.radians(88.0) - slope)
            radius = (1 if left else -1) * math.ceil(chord / 2.0 / math.sin(half) * 1000.0) / 1000.0
        points.append((*end, radius, rng.choice(["", "", "", "A", "C"])))
        last = kind
    # It ends higher than it begins.
    highest = max(it[1] for it in points)
    end = points[-1][0] + rng.uniform(1.0, 4.0), highest + rng.uniform(0.1, 3.0)
    points.append((*end, None, ""))
    return [(round(way, 3), round(height, 3), *more) for way, height, *more in points]


def lathe_words(rng, number, points, place, mirrored, wide):
    """The subroutine with a profile. `place` says Z and X of a way and a height."""
    lines = [f"o{number} sub"]
    before = None
    for at, (way, height, radius, bevel) in enumerate(points):
        z, x = place(way, height)
        if at == 0:
            lines.append(f"G0 X{length(wide * x)} Z{length(z)}")
        else:
            words = f"X{length(wide * x)} Z{length(z)}"
            if rng.random() < 0.15:
                words = f"U{length(wide * (x - before[1]))} Z{length(z)}"
            elif rng.random() < 0.15:
                words = f"X{length(wide * x)} W{length(z - before[0])}"
            code = rng.choice(["G1", "G1", "G0"])
            if radius is not None:
                code = "G2" if (radius < 0) != mirrored else "G3"
                words += f" R{length(abs(radius))}"
            # Both motions have to be long enough for it.
            following = points[at + 1] if at + 1 < len(points) else None
            if bevel and following and radius is None and following[2] is None:
                words += f" {bevel}{length(rng.choice([0.1, 0.25]))}"
            lines.append(f"{code} {words}" + rng.choice(["", "", " F50"]))
        before = z, x
    return [*lines, f"o{number} endsub"]


@feature("lathe cycles", 300)
def lathe_cycles(program, rng):
    face = rng.random() < 0.4
    cycle = rng.choice(["G70", "G71", "G71", "G71.1", "G71.2"])
    goes_down = rng.random() < 0.6
    # LinuxCNC does not end where a distance is kept and the cycle begins level with a wall.
    # Towards plus Z, LinuxCNC takes the other side for the distances of G70.
    runs = rng.choice([-1, -1, 1]) if cycle != "G70" or face else -1
    rises = rng.choice([1, 1, -1])
    shift = rng.uniform(15.0, 25.0)

    def place(way, height):
        along, across = runs * way, rises * height
        return (round(across, 3), round(along + shift, 3)) if face else (round(along, 3), round(across + shift, 3))

    mirrored = (runs * rises < 0) != face
    wide = 1
    setting = rng.choice(["", "", "", "G7", "G20", "G55", "G92 X1 Z-2"])
    # Of features below a tenth of a unit LinuxCNC leaves out arcs, which shows where a distance is kept.
    program.scales = "G92" not in setting
    keeps = program.scales and rng.random() < 0.6
    points = lathe_profile(rng, goes_down, keeps)
    if setting == "G7":
        wide = 2
    program.add("G18", setting, f"F{rng.randint(1, 9)}0")
    program.add(*lathe_words(rng, 100, points, place, mirrored, wide))
    top = max(it[1] for it in points)
    before = rng.choice([1.0, 2.0] if keeps or cycle == "G70" else [0.0, 3.0])
    above = [top + rng.uniform(0.1, 4.0), max(points[-1][1] - 0.05, points[0][1] + 1.0)]
    start = place(-before, rng.choice(above))
    there = f"X{length(wide * start[1])} Z{length(start[0])}"
    far = place(-6.0, top + 6.0)
    program.add(f"G0 X{length(wide * far[1])} Z{length(far[0])}")
    if rng.random() < 0.5:
        program.add(f"G0 {there}")
        there = ""

    def some(letter, values, chance=0.7):
        if letter in "DE" and not keeps:
            return ""
        if rng.random() < chance or keeps:
            return f"{letter}{length(rng.choice(values))}"
        program.scales = False
        return ""

    if cycle == "G70":
        passes = rng.choice(["", "P1", "P2", "P3"]) if not face else ""
        words = [some("D", [0.0, 0.3, 0.5]), some("E", [0.0, 0.07, 0.2]), passes]
        program.add(" ".join(["G70 Q100", there, *words]))
    else:
        cycle = cycle.replace("G71", "G72") if face else cycle
        words = [some("D", [0.0, 0.1, 0.35]), some("I", [0.7, 1.13, 2.31, 4.0], 0.8), some("R", [0.0, 0.2, 1.0, 3.0])]
        program.add(" ".join([cycle, "Q100", there, *words]))
    program.add(rng.choice(["", f"X{length(wide * far[1])}"]), f"G0 X{length(wide * far[1])}", f"Z{length(far[0])}",
                "G92.1", "G21", "G8", "G54")


@feature("probes", 30)
def probes(program, rng):
    program.scales = False
    program.add("G0 X0 Y0 Z10", f"F{rng.randint(1, 90)}0")
    for _ in range(rng.randint(1, 4)):
        axes = rng.choice([f"Z-{rng.randint(1, 9)}", f"X-{rng.randint(1, 9)} Y-{rng.randint(1, 9)}",
                           f"X-{rng.randint(1, 9)} Z-{rng.randint(1, 9)} F{rng.randint(1, 9)}0"])
        program.add(rng.choice(["", "G20\nF9", "G21\nF500", "G55", "G92.1", "G52 Z1", "G95 S100\nF0.1", "G94 F300"]),
                    "G0 X0 Y0 Z10", f"G38.{rng.randint(2, 5)} {axes}",
                    rng.choice(["", "X-12 Y-12 Z-12", "G91 G0 Z2\nG38.3 Z-3 F50\nG1 Z1\nX1 Y1 Z1\nG90", f"G10 L20 P{rng.randint(1, 3)} X0 Y0 Z0"]),
                    rng.choice(["G0 X0 Y0 Z10", "G1 Z3\nX1 Y1", "G0 Z5\nG0 X2 Y3"]))


@feature("incremental moves from somewhere", 120)
def from_somewhere(program, rng):
    program.scales = False
    program.add("G0 X0 Y0 Z10")
    for _ in range(rng.randint(1, 4)):
        program.add(
            rng.choice([f"G53 G0 {axis_words(rng)}", f"G28 {axis_words(rng)}", "G91 G28 Z0", f"G{rng.randint(54, 59)}",
                        f"G10 L2 P1 {axis_words(rng)}", f"G10 L2 P1 R{rng.randint(1, 80)}",
                        f"G52 {axis_words(rng)}\nG53 G0 Z3", "G43 H1", "G20\nG53 G1 Z1 F20"]),
            "G91", move(rng), move(rng),
            rng.choice(["", "G38.3 Z-5 F50", "G21", f"G93 {move(rng)} F2\nG94 F300"]),
            "G90 G21", "G92.1", "G10 L2 P1 R0", "G0 X0 Y0 Z10")


def degrees(rng):
    return str(rng.choice([rng.randint(-720, 720), round(rng.uniform(-360.0, 360.0), 3)]))


def turned(rng, letters="ABC"):
    return axis_words(rng, letters, degrees)


@feature("rotary axes", 200)
def rotary(program, rng):
    program.scales = False
    program.add("G0 X0 Y0 Z0 A0 B0 C0", f"F{rng.randint(1, 90)}0")
    for _ in range(rng.randint(4, 10)):
        program.add(rng.choice([
            f"G{rng.randint(0, 1)} {axis_words(rng)} {turned(rng)}",
            f"G{rng.randint(0, 1)} {turned(rng)}", turned(rng), axis_words(rng),
            f"G1 {axis_words(rng, 'XYZ')} {turned(rng)} F{rng.randint(1, 90)}0",
            f"G91 {turned(rng)} {axis_words(rng)}\nG90", f"G92 {turned(rng)}", "G92.1",
            f"G52 {turned(rng)}", "G20", "G21",
            f"G93 G1 {turned(rng)} F{rng.randint(1, 9)}\nG94 F{rng.randint(1, 90)}0",
            f"G93 G1 {axis_words(rng)} {turned(rng)} F{rng.randint(1, 9)}\nG94 F{rng.randint(1, 90)}0"]))


@feature("rotary axes and offsets", 100)
def rotary_offsets(program, rng):
    program.scales = False
    program.add("G0 X0 Y0 Z0 A0 B0 C0", f"F{rng.randint(1, 90)}0")
    for _ in range(rng.randint(2, 5)):
        system = rng.randint(1, 3)
        program.add(rng.choice([
            f"G10 L2 P{system} {turned(rng)} {axis_words(rng)}", f"G10 L2 P{system} {turned(rng)}",
            f"G{53 + system}", f"G53 G0 {turned(rng)}"]))
        program.add(f"G90 G0 X1 Y2 Z3 A{degrees(rng)} B{degrees(rng)} C{degrees(rng)}",
                    f"G1 {axis_words(rng)} {turned(rng)}")


# Machine functions

@feature("spindle and coolant", 150)
def functions_of_machine(program, rng):
    for _ in range(rng.randint(5, 12)):
        program.add(rng.choice([
            f"S{rng.randint(1, 240)}00", "M3", "M4", "M5", "M7", "M8", "M9", "M3 S500", "M8 M3",
            f"M3 S{rng.randint(1, 99)}0 {move(rng)}", f"M5 {move(rng)}", f"M9 M5 {move(rng)}",
            move(rng), move(rng)]))


@feature("tools", 120)
def tools(program, rng):
    for _ in range(rng.randint(4, 8)):
        tool = rng.randint(1, 9)
        program.add(rng.choice([
            f"T{tool}", f"T{tool} M6", f"M6 T{tool}", f"T{tool}\nM6", "T0 M6", move(rng), "M3 S100",
            f"G0 {axis_words(rng)} T{tool} M6"]))
        program.add(move(rng))


@feature("dwells and stops", 120)
def stops(program, rng):
    for _ in range(rng.randint(4, 8)):
        program.add(rng.choice([
            f"G4 P{rng.choice(['0', '0.5', '1', '2.25'])}", "M0", "M1", "M60", move(rng),
            f"M0 {move(rng)}", "G4 P[1 / 4]", f"M1 {move(rng)}"]))
        program.add(move(rng))


@feature("program ends", 40)
def ends(program, rng):
    program.add(move(rng), move(rng))
    return rng.choice([["M2"], ["M30"], ["M2", "G0 X5"], ["M30", "o nonsense"], [], ["%"],
                       ["M30", "%"], ["G0 X1 M30"], ["M5 M9", "G0 Z{L5}", "M30"]])


@feature("percent signs", 30)
def percent(program, rng):
    program.lines.insert(0, "%")
    if rng.random() < 0.3:
        program.lines.insert(0, rng.choice(["", "(before)"]))
    program.add(move(rng))
    return rng.choice([["%"], ["M2", "%"], ["M30", "%", "G0 X9"], ["%", "words"]])


@feature("comments", 80)
def comments(program, rng):
    for _ in range(8):
        program.add(rng.choice([
            "(a comment)", "; another", f"{move(rng)} (beside)", f"(before) {move(rng)}",
            f"{move(rng)} ; (both)", "()", "(MSG, hello #1)", "(msg,hello)", "(PRINT, #1)", "#7=1.23456 (DEBUG, %d#7 %.3f#7)",
            "(DEBUG, #1 and #<_x> ##7 #<nothing>)", "(LOG, l #7)", "(LOGOPEN,log.txt)",
            "(LOGCLOSE)", "( debug,#<_metric>%f#7)", "(MSG,)", "(M SG,no)", "(DEBUG, [#7] 50 %)",
            "(AXIS,hide)", "  ", "(ümläut)", "; (open", "(%.3f#1)", f"G1 (in) X{mm(rng)}"]))
        program.add(move(rng))


@feature("path modes", 60)
def path_modes(program, rng):
    for _ in range(5):
        program.add(rng.choice(["G61", "G61.1", "G64", "G64 P0.05", "G64 P0.1 Q0.05",
                                f"G64 {move(rng)}", f"G61 {move(rng)}"]), move(rng))


@feature("outputs and overrides", 60)
def outputs(program, rng):
    program.tools = [(1, 3.0, 0.0)]
    for _ in range(5):
        program.add(rng.choice([
            "M48", "M49", "M50 P0", "M51 P1", "M52 P1", "M53 P0", "M62 P1", "M63 P1", "M64 P2",
            "M65 P2", "M66 P0 L0", "M66 E0 L0", "M67 E1 Q0.5", "M68 E1 Q2.5", "M19 R45",
            "M19 R270 P1", "M66 P1 L3 Q2", "M62 P[1 + 1]", "M50", "M52 P0", "M61 Q1",
            "(DEBUG, #<_feed_override> #<_speed_override> #<_adaptive_feed> #<_feed_hold>)"]),
            move(rng))


@feature("saved state", 80)
def saved(program, rng):
    def change():
        return rng.choice(["G91", "G20", "G18", "F50", "S700", "G61", "G55", "G99", "M8", "M3 S1000"])
    begin, end = rng.choice([("M73", ""), ("M70", "M72"), ("M70", "M71"), ("", ""), ("M70", "")])
    program.add("o100 sub", f"  {begin}", f"  {change()}", f"  {change()}", f"  {move(rng)}",
                f"  {end}", "o100 endsub", f"{change()}", "o100 call", move(rng), move(rng))
    if rng.random() < 0.4:
        program.add("M70", change(), change(), move(rng), "M72", move(rng))


@feature("modal groups", 120)
def modal(program, rng):
    """Words in any order, several in a block."""
    for _ in range(8):
        words = rng.sample(["G90", "G17", "G94", "G40", "G49", "G80", "G64", "G54", "M9", "M5",
                            "S500", "F200", "G98", "G91.1"], rng.randint(1, 6))
        if "G80" not in words:
            words += ["G0"] + axis_words(rng).split()
        rng.shuffle(words)
        program.add(rng.choice([" ", ""]).join(words))
        # LinuxCNC forgets F at G94.
        program.add(f"F{rng.randint(1, 9)}00", move(rng), axis_words(rng))


def known(rng):
    """Where the tool is, in absolute coordinates."""
    return "G90 G0 " + " ".join(f"{axis}{rng.randint(-20, 20)}" for axis in "XYZ")


def change(rng):
    """Something that stays in force."""
    word = rng.choice(["G49\nG20\nF20", "G49\nG21\nF400", "G92 X1 Y2", "G92 Z3", "G92.1", "G92.2", "G92.3", "G52 X5 Y-2 Z1", "G52 X0 Y0 Z0",
                       "G54", "G55", "G59.3", "G10 L2 P1 X3 Y4 Z5", "G10 L2 P2 X-3 R30", "G10 L2 P1 R0", "G10 L2 P0 R90",
                       "G10 L20 P1 X1 Y1 Z1", "G43.1 Z4", "G43 H3", "G43.2 H2", "G49", "G7", "G8", "G18", "G19", "G17",
                       "G98", "G99", "G95 S500 F0.2", "G94 F300", "T3 M6", "T2", "M3 S800", "M4", "M5", "M8", "M7", "M9",
                       "G90.1", "G91.1", "M70", "M73", "G61", "G64 P0.1", "M49", "M48", "M50 P0", "M51 P0", "G97 S300",
                       "S1200", "F77", "G10 L1 P3 Z7 R2", "G80"])
    return word


def action(rng, kept, label):
    """Something that moves, in any state."""
    x, y, z = (rng.randint(-15, 15) for _ in range(3))
    r, many = rng.randint(60, 90), rng.randint(2, 4)
    return rng.choice([
        f"G0 X{x} Y{y}", f"G1 Z{z}", f"G91 G1 X{x} Z{z}\nG90", f"G1 X[{x} + #5420 / 4] Y#<_y>",
        f"G17 G2 X{x} Y{y} R{r}", f"G17 G3 X{x} Y{y} R{r} Z{z} P{many}", f"G18 G3 X{x} Z{z} R{r}\nG17",
        f"G17 G90 G98 G81 X{x} Y{y} Z-3 R2\nX{y}\nG80", f"G17 G91 G99 G83 X2 Y1 Z-3 R-1 Q1 L{many}\nG80 G90",
        f"G17 G82 X{x} Z-2 R1 P0.5\nG80", f"G17 G73 X{x} Z-2 R1 Q0.7\nG80", f"G18 G85 X{x} Z{z} Y-2 R1\nG80 G17",
        f"G17 G8 G90 G5.1 X{x} Y{y} I2 J3", f"G17 G8 G90 G5 X{x} Y{y} I1 J2 P-1 Q-2", "G4 P0.5",
        f"G53 G0 Z{z}\n{known(rng)}", f"G28\n{known(rng)}", f"G91 G28 Z0\n{known(rng)}",
        f"G17 G8\nG0 @{r} ^{x}", f"G93 G1 X{x} Y{y} F4\nG94 F200", f"G38.3 Z-30 F100\n{known(rng)}",
        f"o<pass> call [{x}] [{many}]", f"#3=0\no{label} while [#3 LT {many}]\n  #3=[#3 + 1]\n  G0 X[#3 * {x}]\no{label} endwhile",
        f"o{label} repeat [{many}]\n  G91 G0 X{x}\no{label} endrepeat\nG90", f"o{label} if [#5420 GT {x}]\n  G0 X{x}\no{label} else\n  G1 Y{y}\no{label} endif",
        "(DEBUG, %d#<_metric>#<_absolute>#5220 #<_plane>)", f"M62 P1\nG0 X{x} Y{y}", "M64 P1", "M65 P1", "M67 E1 Q2\nG1 Z3",
        f"S500 M3\nG33 Z-5 K1\nG0 X{x}", "M0", f"G1 X{x} (MSG, at {x})", f"M72\n{known(rng)}" if kept else "M1"])


# No two words of a program, however far apart, disturb each other: every word of the language in one program, in any order.
@feature("everything mixed", 600)
def everything(program, rng):
    program.scales = False
    program.tools = [(tool, 2.0 + tool, 5.0 * tool) for tool in range(1, 10)]
    program.add("o<pass> sub", "  #<a>=[#1 + 1]", "  G91 G1 X1 Y#<a>", f"  G90 G0 Z[#2 * {rng.randint(1, 3)}]",
                "o<pass> endsub [#<a>]", "T1 M6", "S1000 M3", "G98 " + known(rng))
    kept = False
    for label in range(100, 100 + rng.randint(6, 14)):
        if rng.random() < 0.5:
            word = change(rng)
            if word in ("M70", "M73"):
                kept = word == "M70"
            program.add(word, known(rng))
        else:
            doing = action(rng, kept, label)
            kept = kept and not doing.startswith("M72")
            program.add(doing)
    program.add("G21 F500 " + known(rng))


SAMPLES = (Path(__file__).resolve().parents[2] / "rs274_samples.txt").read_text().split("\n= ")[1:]


@feature("row of the page", len(SAMPLES))
def row_of_the_page(program, rng):
    """The program of a row, named by its seed."""
    program.scales = False
    program.tools = [(tool, 10.0, 20.0) for tool in range(1, 10)]
    _, text = SAMPLES[program.seed].split("\n", 1)
    lines = re.sub("[{}]", "", text).strip().split("\n")
    program.add(*lines)
    return [] if "M2" in lines or "M30" in lines else ["M2"]
