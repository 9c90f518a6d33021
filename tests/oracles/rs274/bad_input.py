"""Wrong programs: both interpreters must refuse them."""

from features import feature, move
from expressions import number

BAD = {
    "unbalanced brackets": ["G0 X[1 + 2", "G0 X1]", "G0 X[[1] * 2", "#1=[1", "G0 X[1 + [2]"],
    "no value": ["G0 X", "G0 X[]", "#1=", "G0 X[1 +]", "G0 X[* 2]", "G1 X1 F", "S"],
    "division by zero": ["G0 X[1 / 0]", "#1=0\nG0 X[5 / #1]", "G0 X[1 / [2 - 2]]"],
    "out of the domain": ["G0 X[SQRT[-1]]", "G0 X[ASIN[1.5]]", "G0 X[ACOS[-2]]", "G0 X[LN[0]]",
                          "G0 X[LN[-1]]", "G0 X[-2 ** 0.5]"],
    "wrong function": ["G0 X[SINE[1]]", "G0 X[ATAN[1]]", "G0 X[ATAN[1]/2]", "G0 X[FOO[1]]",
                       "G0 X[SIN 30]", "G0 X[1 PLUS 2]"],
    "undefined name": ["G0 X#<nothing>", "G0 X[#<_nothing> + 1]", "#1=#<unset>"],
    "wrong parameter": ["G0 X#6000", "#0=1", "#-1=2", "#1.5=3", "G0 X#1.5", "#=1", "G0 X#",
                        "#<open=1", "#99999=1", "G0 X#[-1]"],
    "read-only parameter": ["#<_x>=1", "#5400=3", "#<_line>=1", "#5420=1", "#<_metric>=0"],
    "call of nothing": ["o<nothing> call", "o777 call [1]", "M98 P777", "#1=778\no#1 call"],
    "end without begin": ["o100 endwhile", "o100 endif", "o100 endsub", "o100 else",
                          "o100 endrepeat", "o100 break", "o100 continue", "o100 elseif [1]"],
    "begin without end": ["o100 while [1 LT 0]\nG0 X1", "o100 if [1]\nG0 X1",
                          "o100 sub\nG0 X1", "o100 do\nG0 X1", "o100 repeat [2]\nG0 X1"],
    "crossed blocks": ["o1 if [1]\no2 while [0]\no1 endif\no2 endwhile",
                       "o1 sub\no2 sub\no2 endsub\no1 endsub", "o1 if [1]\no1 endwhile",
                       "o1 while [0]\no1 endif", "o1 repeat [1]\no1 endwhile"],
    "wrong O word": ["o100", "o100 jump", "o call", "o<> call", "o<x call", "o100 if 1",
                     "o100 sub [1]", "o100 if [1] G0 X1", "o-1 call", "o1.5 call"],
    "too many arguments": ["o1 sub\no1 endsub\no1 call " + "[1] " * 31],
    "file out of the folder": ["o<../outside> call", "o</etc/passwd> call"],
    "cycle without words": ["G81 X1 Y1 R1 Z-", "G81 X1 R1", "G81 X1 Z-1", "G83 X1 Z-1 R1",
                            "G73 X1 Z-1 R1", "G82 X1 R1", "G83 X1 Z-1 R1 Q0",
                            "G83 X1 Z-1 R1 Q-1", "G81 Z-1 R1 L0", "G81 X1 Z5 R1", "G81 Z-1"],
    "cycle in a wrong state": ["G41.1 D1 G81 X1 Z-1 R1", "G93 G81 X1 Z-1 R1 F1", "M5\nG84 X1 Z-1 R1",
                               "G17 G81 X1 Z-1 R1 A5"],
    "arcs": ["G2 X1", "G2 X1 Y1", "G2 I1 R1 X1", "G2 X10 R1", "G2 X0 Y0 R1", "G2 X1 Y1 K1",
             "G2 X1 Y1 I5 J5", "G2 X1 Y0 R0", "G18 G2 X1 Y1 J1", "G2 X1 Y0 I0.5 P0",
             "G2 X1 Y0 I0.5 P1.5", "G90.1 G2 X1 Y1 I1"],
    "radius of no number": ["G2 X1 Y1 R[SQRT[-1]]", "G2 X1 R[0 / 0]", "G2 X1 Y0 R[LN[0]]"],
    "no feed": ["F0 G1 X1", "G93 G1 X1", "G93 F0 G1 X5", "F-1"],
    "two of a group": ["G0 G1 X1", "G90 G91", "G17 G18", "M3 M4", "X1 X2", "G20 G21", "F1 F2",
                       "M0 M30", "S1 S2", "G54 G55", "G4 P1 G10 L2 P1"],
    "unknown words": ["G11", "G999", "M29", "M201", "G0 E1", "G1.5 X1", "M3.5", "G-1", "M-1", "!",
                      "G0 X1 $", "G0 X1..2", "G0 X1-2", "G0 X--1", "hello", "G0 X1e3"],
    "unused words": ["G0 X1 P1", "I1", "G1 X1 J1", "L2", "G0 X1 Q1", "R5", "G0 D1", "G0 H1"],
    "curves": ["G5 X1 Y1", "G5 X1 Y1 I1 P1 Q1", "G5 I0 J3 X1 Y1", "G18 G5 I0 J3 P0 Q-3 X1 Y1",
               "G5 I0 J3 P0 Q-3 X1 Y1 Z1", "G5.1 X1 Y1", "G5.1 X1 Y1 I1", "G5.3",
               "G5.2 X1 Y1 P1 L3\nG5.3", "G5.2 P1 L2.5 X1 Y1\nX2 Y2\nG5.3", "G5.2 X1\nX2 Y2\nG5.3",
               "G5.2 X1 Y1\nX2 Y2\nG1 X1", "G5.2 X1 Y1\nX2 Y2"],
    "comments": ["(open", "G0 X1 (open", "(a (nested))", "G0 X1 )"],
    "wrong numbers of words": ["T-1", "T1.5", "S-1", "G4", "G4 P-1", "G4 X1", "G43 H99", "T99 M6",
                               "G41 D99", "M61 Q99", "M61", "G10", "G10 L9 P1", "G10 L2 P99 X1",
                               "G10 L2 X1", "G43 H1.5", "M66", "M62", "G33 Z1", "G38.2",
                               "G92", "G53 X1", "G53 G2 X1 I1"],
    "jumps out of repeat": ["o1 repeat [3]\no1 break\no1 endrepeat",
                            "o1 repeat [3]\no1 continue\no1 endrepeat"],
    "two of a group again": ["M7 M8", "M72"],
    "tip direction": ["G41.1 D2 L2 G1 X9", "G18 G42.1 D2 L-1 G1 X9", "G18 G42.1 D2 L2.5 G1 X9",
                      "G19 G41.1 D2 L0 G1 Y9", "G18 G42.1 L2 G1 X9",
                      "G18 G42.1 D2 L10 G1 X9\nZ9\nG40 X20", "G18 G42 D1 L2 G1 X9\nZ9\nG40 X20"],
    "L with G74": ["M4 S100\nG74 X1 Z-1 R1 L2"],
    "F forgotten at G94": ["G94\nG1 X5", "G95\nG1 X5"],
    "jumps out of a sub": ["o1 sub\no2 while [1]\no1 return\no2 endwhile\no1 endsub\no9 call",
                           "o1 sub\no1 break\no1 endsub\no1 call", "o5 return", "M99 P1 X1"],
}


def writer(blocks):
    def generator(program, rng):
        program.scales = False
        program.add(move(rng), f"#10={number(rng)[0]}")
        # Each of them in turn, so that none is left out.
        program.add(*blocks[program.seed % len(blocks)].split("\n"))
        program.add("G0 X3")
    return generator


for _name, _blocks in BAD.items():
    feature(f"bad: {_name}", len(_blocks))(writer(_blocks))


ENDLESS = [
    "o1 while [1]\no1 endwhile", "o1 while [1]\n  G1 X1\n  G1 X2\no1 endwhile",
    "o1 do\n  #1=[#1 + 1]\no1 while [#1 GT 0]", "o1 repeat [1000000000]\n  #1=[#1 + 1]\no1 endrepeat",
    "o1 repeat [1000000000]\n  G1 X#1\n  #1=[#1 + 1]\no1 endrepeat",
    "o1 do\n  o2 if [1]\n    o1 continue\n  o2 endif\no1 while [1]",
    "o1 while [1]\n  o2 repeat [1000000]\n  o2 endrepeat\no1 endwhile",
    "o1 while [1]\n  G81 X1 Z-1 R1 L1000\no1 endwhile"]


@feature("bad: endless", len(ENDLESS))
def endless(program, rng):
    program.is_endless = True
    program.scales = False
    program.add("#1=1", *ENDLESS[program.seed].split("\n"), "G0 X3")


@feature("bad: probe under compensation", 1)
def compensated_probe(program, rng):
    program.scales = False
    program.add("G41.1 D2", "G1 X10", "G1 Y20", "G38.2 Z-5 F100", "G1 X30", "G40 G1 X40 Y40")


@feature("bad: nested brackets", 3)
def brackets(program, rng):
    program.scales = False
    count = (100, 1000, 10000)[program.seed]
    program.add("G0 X" + "[" * count + "1" + "]" * count)


@feature("bad: endless recursion", 2)
def endless_recursion(program, rng):
    program.scales = False
    program.add("o1 sub", "  G0 X#1", "  o1 call [#1 + 1]", "o1 endsub", "o1 call [1]")


@feature("bad: long line", 2)
def long_line(program, rng):
    program.scales = False
    program.add("G0 X1 (" + "a" * (250, 400)[program.seed] + ")")
