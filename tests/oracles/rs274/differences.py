"""What is decided to be otherwise than in LinuxCNC."""

# The programs, the outcome, what is said of them, and why.
DIFFERENCES = [
    (r"^bad: ", "Kerf refuses", r".",
     "a wrong program that LinuxCNC takes, such as a while without an end"),
    (r"^cycle G(74|84) G1[89]", "differ", r"aside|not of one kind",
     "LinuxCNC exchanges the axes of G74 and G84 twice where the plane is not XY"),
    (r"^expression on exact values", "differ", r"is -?1.000000 mm aside",
     "COS[90] is 0, and not a hair below, where FIX and FUP would show it"),
    (r"^flow break out of while, then do", "differ", r"only Kerf has it|aside|not of one kind",
     "after a break out of a while, LinuxCNC runs the next do only once"),
    (r"^units and F in one block", "differ", r"another feed",
     "F counts in the unit of its own block; in LinuxCNC, in that of the block before"),
    (r"^(program ends|percent signs)", "Kerf takes", r"Bad character '%'",
     "a percent sign at the end alone, as it is posted"),
    (r"^bad: two of a group again", "Kerf takes", r"Two m codes",
     "M7 M8 in one block is mist and flood"),
    (r"^bad: L with G74", "Kerf takes", r"L word with no",
     "G74 takes L as G84 does"),
    (r"^bad: F forgotten at G94", "Kerf takes", r"zero feed rate",
     "F is not forgotten where G94 was in force before"),
    (r"^bad: jumps out of repeat", "Kerf takes", r"no matching while/do label",
     "break and continue in a repeat, as in the other loops"),
    (r"^bad: wrong numbers of words", "Kerf takes", r"tool 99 not found",
     "a tool whose diameter and length the path does not need may be missing in the table"),
    (r"^bad: long line", "Kerf takes", r"too long",
     "lines are longer than 255 characters"),
]
