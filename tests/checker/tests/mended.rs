//! Seeds whose verdict was wrong once, by what was mended.

use kerf_checker::judge::{Judgement, judge};
use kerf_checker::{draw, product, profiles};

/// What was wrong, the seeds, and whether their programs are accepted now.
const MENDED: &[(&str, &[u64], bool)] = &[
    (
        "a short block next to a change of side, merged on one side of the tool only",
        &[
            4294, 26728, 142_325, 175_240, 189_496, 260_032, 274_750, 277_396, 282_059, 524_206,
            567_004, 708_490, 722_572, 872_542, 875_777,
        ],
        true,
    ),
    (
        "a short block next to a change of side, counted as a block of its own by the checker",
        &[1_369_955, 1_464_286, 1_821_100],
        true,
    ),
    ("noise next to a change of side, left out on one side of the tool only", &[465_887], false),
    (
        "a ring that is retraced, in blocks that the planner takes as one",
        &[127_937, 171_831, 184_665, 457_743, 549_457, 730_943, 737_331, 741_827, 852_389, 896_309],
        true,
    ),
    ("an arc that is lengthened to the offset of its lead", &[106_239, 741_555], true),
    ("an arc whose ends are both a rounding error off", &[557_763], true),
    (
        "a straight that a sharp inside corner takes, next to one that continues it",
        &[379_417],
        true,
    ),
    (
        "arcs that rounding bends, whose offsets meet far from their joint",
        &[199_956, 477_749, 590_190],
        false,
    ),
    ("a lead that is near the wall that it leads onto, once more", &[119_516, 598_651], false),
    ("an arc that leads away, and ends on a wall", &[72062], false),
    ("a short arc hardly smaller than the tool, at the end of a contour", &[903_241], false),
    ("a ring with one block that is rounded otherwise", &[769_097], true),
    (
        "a circle whose ends are a micrometre apart, taken for a move that goes nowhere",
        &[
            32483, 164_746, 185_969, 205_139, 247_988, 260_675, 308_459, 500_300, 507_524, 556_938,
            705_155, 824_318,
        ],
        true,
    ),
    (
        "a corner of two curves that the audit looked for at the far end of one of them",
        &[
            38192, 81637, 81739, 130_679, 154_470, 200_938, 247_782, 336_193, 348_256, 389_694,
            415_353, 441_341, 484_633, 514_785, 533_186, 553_900, 586_128, 661_487, 664_698,
            748_411, 749_523, 752_703, 817_494, 838_422, 881_855, 909_946, 925_177, 966_320,
        ],
        true,
    ),
    (
        "a first line that a joined lead takes away with a warning, left out for the audit",
        &[84198, 273_726, 423_870, 679_938, 771_780, 894_462, 900_294, 955_818],
        true,
    ),
    (
        "an arc of a small radius at a sharp corner, no curve for the audit",
        &[235_163, 246_106, 372_190, 488_192, 535_550, 579_880, 780_887, 960_249],
        true,
    ),
];

#[test]
fn a_verdict_that_was_wrong_is_right() {
    let profiles = profiles();
    for (what, seeds, is_accepted) in MENDED {
        for &seed in *seeds {
            let program = draw::program(seed);
            let verdict = product(&program, &profiles);
            let (outcome, wrong) = judge(&program, &verdict);
            assert_eq!(wrong, [], "{what}: seed {seed}\n{}", program.text);
            assert_eq!(outcome == Judgement::Accepted, *is_accepted, "{what}: seed {seed}");
        }
    }
}
