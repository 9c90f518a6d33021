//! RS-274/NGC as in LinuxCNC, or as in grbl where LinuxCNC leaves a choice.

use super::{
    ApproachWords, Cycle, Dialect, Distance, FeedMode, GWord, Group, LatheCycle, LengthWord,
    Letters, MWord, Mode, OffsetWord, Spline, StateWord, Units,
};
use crate::block::LexerRules;
use crate::no_effect;
use crate::turning::{Along, Pockets};
use cnc_msgs::contour::{CoolantMode, CutterSide, Probe, SpindleMode};
use cnc_msgs::geometry::Plane;

pub(super) static DIALECT: Dialect = Dialect {
    lexer: LexerRules {
        blanks_in_numbers: true,
        written_line_feed: false,
        at_words: false,
        delete_levels: false,
        calls: false,
        axis_names_after: None,
        parameters: true,
        r_parameters: false,
        names: false,
        programs: None,
    },
    g,
    m,
    plane: Plane::Xy,
    letters: Letters::of(b"XYZABCUVWIJKRFSTDHLPQE"),
    further_axes: Letters::of(b"ABCUVW"),
    foreign_axes: Letters::NONE,
    auxiliary: Letters::NONE,
    approach: ApproachWords::None,
    dwell: Letters::of(b"P"),
    arc_radius_and_turns: true,
    arc_radius: b'R',
    percent_delimits: true,
};

pub(super) const CYCLE: &str = "post the program with canned cycles expanded to G0 and G1";
pub(super) const PROBE: &str = "probe with the probe action, outside part programs";
pub(super) const THREAD: &str =
    "the spindle and the axes are not synchronised; thread on a lathe control";
const RIGID_TAP: &str = "no controller that Kerf drives turns its spindle back at the pace of the axes: tap with G84 \
                         in a floating chuck";
pub(super) const OFFSETS: &str = "set offsets on the machine and select them with G54 to G59";
pub(super) const FEED_MODE: &str = "post feeds in mm/min or inch/min (G94)";
pub(super) const CONSTANT_SPEED: &str = "post spindle speeds in 1/min (G97)";

fn g(tenths: u16) -> GWord {
    match tenths {
        430 => GWord::Length(LengthWord::Tool),
        411 => GWord::CompensationOn { side: CutterSide::Left, is_dynamic: true },
        421 => GWord::CompensationOn { side: CutterSide::Right, is_dynamic: true },
        50 => GWord::Motion(Mode::Spline(Spline::Cubic)),
        51 => GWord::Motion(Mode::Spline(Spline::Quadratic)),
        52 => GWord::Motion(Mode::Spline(Spline::Open)),
        53 => GWord::Motion(Mode::Spline(Spline::Close)),
        70 => GWord::Diameter(true),
        80 => GWord::Diameter(false),
        100 => GWord::Offset(OffsetWord::Set),
        281 => GWord::Offset(OffsetWord::StoreReference { second: false }),
        301 => GWord::Offset(OffsetWord::StoreReference { second: true }),
        520 => GWord::Offset(OffsetWord::Local),
        591..=593 => GWord::WorkOffset((tenths - 584) as u8),
        920 => GWord::Offset(OffsetWord::Axis),
        921 => GWord::Offset(OffsetWord::AxisOff { keeps: false }),
        922 => GWord::Offset(OffsetWord::AxisOff { keeps: true }),
        923 => GWord::Offset(OffsetWord::AxisRestore),
        730 => GWord::Motion(Mode::Cycle(Cycle::ChipBreak)),
        740 => GWord::Motion(Mode::Cycle(Cycle::Tap { left_hand: true })),
        810 => GWord::Motion(Mode::Cycle(Cycle::Drill)),
        820 => GWord::Motion(Mode::Cycle(Cycle::DrillAndDwell)),
        830 => GWord::Motion(Mode::Cycle(Cycle::Peck)),
        840 => GWord::Motion(Mode::Cycle(Cycle::Tap { left_hand: false })),
        850 => GWord::Motion(Mode::Cycle(Cycle::Bore)),
        860 => GWord::Motion(Mode::Cycle(Cycle::BoreAndStop)),
        890 => GWord::Motion(Mode::Cycle(Cycle::BoreAndDwell)),
        811..=899 if !tenths.is_multiple_of(10) => GWord::Unknown,
        870 => GWord::RefusedMotion("write the hole as moves; LinuxCNC does not document it"),
        880 => GWord::Motion(Mode::Cycle(Cycle::BoreAndWait)),
        382 => GWord::Motion(Mode::Probe(Probe { away: false, may_miss: false })),
        383 => GWord::Motion(Mode::Probe(Probe { away: false, may_miss: true })),
        384 => GWord::Motion(Mode::Probe(Probe { away: true, may_miss: false })),
        385 => GWord::Motion(Mode::Probe(Probe { away: true, may_miss: true })),
        760 => GWord::Motion(Mode::ThreadCycle),
        171 | 181 | 191 => {
            GWord::Refused("write the arc in X, Y and Z: there are no arcs of U, V and W")
        }
        700 => GWord::LatheCycle(LatheCycle::Finish),
        710..=712 | 720..=722 => GWord::LatheCycle(LatheCycle::Rough {
            along: if tenths < 720 { Along::Z } else { Along::X },
            pockets: match tenths % 10 {
                1 => Pockets::None,
                2 => Pockets::Only,
                _ => Pockets::All,
            },
        }),
        960 => GWord::SurfaceSpeed(true),
        970 => GWord::SurfaceSpeed(false),
        930 => GWord::FeedMode(FeedMode::InverseTime),
        940 => GWord::FeedMode(FeedMode::PerMinute),
        950 => GWord::FeedMode(FeedMode::PerRevolution),
        980 => GWord::Retract { to_r: false },
        990 => GWord::Retract { to_r: true },
        330 => GWord::Motion(Mode::Thread),
        331 => GWord::RefusedMotion(RIGID_TAP),
        431 => GWord::Length(LengthWord::Given),
        432 => GWord::Length(LengthWord::Added),
        _ => common(tenths),
    }
}

/// The G words that rs274 shares with related dialects.
pub(super) fn common(tenths: u16) -> GWord {
    match tenths {
        0 => GWord::Motion(Mode::Rapid),
        10 => GWord::Motion(Mode::Feed),
        20 => GWord::Motion(Mode::Arc { clockwise: true }),
        30 => GWord::Motion(Mode::Arc { clockwise: false }),
        40 => GWord::Dwell,
        70 => GWord::Refused("program X as a diameter on a lathe control only"),
        80 => GWord::Accepted(Group::NonModal),
        100 | 520 | 920..=923 => GWord::Refused(OFFSETS),
        170 => GWord::Plane(Plane::Xy),
        180 => GWord::Plane(Plane::Zx),
        190 => GWord::Plane(Plane::Yz),
        200 => GWord::Units(Units::Inch),
        210 => GWord::Units(Units::Millimetre),
        280 => GWord::Reference { second: false },
        300 => GWord::Reference { second: true },
        281 | 301 => GWord::Refused("store reference positions on the machine"),
        380..=385 => GWord::RefusedMotion(PROBE),
        400 => GWord::CompensationOff,
        410 => GWord::CompensationOn { side: CutterSide::Left, is_dynamic: false },
        420 => GWord::CompensationOn { side: CutterSide::Right, is_dynamic: false },
        430 => GWord::Length(LengthWord::Offset),
        490 => GWord::LengthOff,
        530 => GWord::MachineCoordinates,
        540 | 550 | 560 | 570 | 580 | 590 => GWord::WorkOffset((tenths / 10 - 53) as u8),
        610 | 611 => GWord::of_path(Letters::NONE),
        640 => GWord::of_path(Letters::of(b"PQ")),
        800 => GWord::NoMotion,
        730 | 740 | 760 | 810..=899 => GWord::RefusedMotion(CYCLE),
        900 => GWord::Distance(Distance::Absolute),
        910 => GWord::Distance(Distance::Incremental),
        901 => GWord::Centers(Distance::Absolute),
        911 => GWord::Centers(Distance::Incremental),
        930 | 950 => GWord::Refused(FEED_MODE),
        940 => GWord::Accepted(Group::Feed),
        960 => GWord::Refused(CONSTANT_SPEED),
        970 => GWord::Accepted(Group::SpindleMode),
        980 | 990 => GWord::NoEffect(Group::Retract, Letters::NONE, no_effect::RETRACT),
        _ => GWord::Unknown,
    }
}

fn m(number: u16) -> MWord {
    match number {
        19 | 48..=53 | 62..=68 | 100..=199 => MWord::Machine,
        61 => MWord::NameTool,
        60 => MWord::Stop { optional: false },
        70 => MWord::State(StateWord::Save { returns: false }),
        71 => MWord::State(StateWord::Forget),
        72 => MWord::State(StateWord::Restore),
        73 => MWord::State(StateWord::Save { returns: true }),
        97 => MWord::Refused(
            "write the block where it is called, or call a subroutine with M98 or o10 call",
        ),
        98 => MWord::CallProgram,
        99 => MWord::EndProgram,
        _ => common_m(number),
    }
}

/// The M words that mean the same on every control here.
pub(super) fn common_m(number: u16) -> MWord {
    match number {
        0 => MWord::Stop { optional: false },
        1 => MWord::Stop { optional: true },
        2 => MWord::ProgramEnd { rewind: false },
        30 => MWord::ProgramEnd { rewind: true },
        3 => MWord::Spindle(SpindleMode::Clockwise),
        4 => MWord::Spindle(SpindleMode::CounterClockwise),
        5 => MWord::Spindle(SpindleMode::Off),
        6 => MWord::ChangeTool,
        7 => MWord::Coolant(CoolantMode::Mist),
        8 => MWord::Coolant(CoolantMode::Flood),
        9 => MWord::Coolant(CoolantMode::Off),
        19 => MWord::Refused("the spindle has no orientation; position it by hand at an M0"),
        50..=53 => MWord::Refused("set overrides while the program runs"),
        60 => MWord::Refused("write M0"),
        61 => MWord::Refused("write T and M6"),
        62..=68 => MWord::Refused("use a user function M100 to M199 for outputs"),
        70..=73 => MWord::Refused("write the modal words out where they are needed"),
        97..=99 => MWord::Refused("write subprograms out where they are called"),
        _ => MWord::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::PREDEFINED;

    const PAGE: &str = include_str!("../../../../docs/rs274.md");

    /// The rows of the page, `G5.1` or `M50 to M53`: the first word, the last one, what becomes of it.
    fn rows(letter: char) -> Vec<(u16, u16, &'static str)> {
        let number = |word: &str| -> u16 {
            let value: f64 = word[1..].parse().expect("a number");
            (value * 10.0).round() as u16
        };
        let rows = PAGE.lines().filter(|line| line.starts_with(&format!("| {letter}")));
        rows.map(|row| {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            let (first, last) = cells[1].split_once(" to ").unwrap_or((cells[1], cells[1]));
            (number(first), number(last), cells[3])
        })
        .collect()
    }

    /// `#5401 to #5409`: the numbers, whether it says that they are read only, and what becomes of them.
    fn parameter_rows() -> Vec<(std::ops::RangeInclusive<u32>, bool, &'static str)> {
        let rows = PAGE.lines().filter(|line| line.starts_with("| #"));
        let number = |word: &str| -> u32 { word[1..].parse().expect("a number") };
        rows.map(|row| {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            let (first, last) = cells[1].split_once(" to ").unwrap_or((cells[1], cells[1]));
            (number(first)..=number(last), cells[2].ends_with("read only"), cells[3])
        })
        .collect()
    }

    fn row(rows: &[(u16, u16, &'static str)], tenths: u16) -> Option<&'static str> {
        rows.iter().find(|row| (row.0..=row.1).contains(&tenths)).map(|row| row.2)
    }

    #[test]
    fn the_page_of_rs274_says_of_each_word_what_becomes_of_it() {
        let page = rows('G');
        for tenths in 0..=9999 {
            let becomes = match g(tenths) {
                GWord::Unknown => None,
                GWord::NoEffect(..) => Some("no effect"),
                GWord::Refused(_) | GWord::RefusedMotion(_) => Some("refused"),
                GWord::SurfaceSpeed(true) => Some("passed on"),
                _ => Some("done"),
            };
            assert_eq!(row(&page, tenths), becomes, "G{}", f64::from(tenths) / 10.0);
        }
        let page = rows('M');
        for number in 0..=999 {
            let becomes = match m(number) {
                MWord::Unknown => None,
                MWord::Machine if !matches!(number, 48..=51 | 100..) => Some("passed on"),
                MWord::Refused(_) => Some("refused"),
                _ => Some("done"),
            };
            assert_eq!(row(&page, number * 10), becomes, "M{number}");
        }
    }

    #[test]
    fn the_page_of_rs274_says_of_each_number_whether_it_can_be_read_and_set() {
        let profile = settings::load_profile("rs274").expect("the shipped profile");
        let error = |text: String| {
            let loaded = crate::load(text.as_bytes(), &profile, &crate::LoadOptions::default());
            loaded.findings.into_iter().find(|it| it.is_error()).map(|it| it.message)
        };
        let rows = parameter_rows();
        for number in 1..=crate::parameters::NUMBER_MAX {
            let shown =
                if (5231..=5390).contains(&number) && number % 20 == 10 { 5230 } else { number };
            let row = rows.iter().find(|row| row.0.contains(&shown));
            let is_read_only = row.is_some_and(|row| row.1);
            if (32..5000).contains(&number) && number % 97 != 0 {
                continue;
            }
            // A tool is in the spindle, and something was probed and read.
            let before = "F100 T0 M6\nG0 X0 Y0 Z0 A0 B0 C0 U0 V0 W0\nG38.3 Z-1\nM66 P0\n";
            let read = error(format!("{before}#31=#{number}\nM2"));
            let is_refused = row.is_some_and(|row| row.2 == "refused");
            assert_eq!(read.is_some(), is_refused, "#{number}: {read:?}");
            let set = error(format!("#{number}=1\nM2"));
            assert_eq!(set.is_some(), is_read_only, "#{number}: {set:?}");
        }
        let beyond = error(format!("#31=#{}\nM2", crate::parameters::NUMBER_MAX + 1));
        assert!(beyond.is_some());
    }

    #[test]
    fn the_page_of_rs274_has_every_predefined_parameter_and_each_has_a_value() {
        let profile = settings::load_profile("rs274").expect("the shipped profile");
        let (rules, _) = crate::rules::Rules::of(&profile);
        let interpreter = crate::interpreter::Interpreter::new(&rules, [0.0; 3], 0);
        let parameters = crate::parameters::Parameters::default();
        let values = crate::values::Values {
            parameters: &parameters,
            interpreter: &interpreter,
            line: 1,
            is_single_block: false,
        };
        for name in PREDEFINED {
            // A value, or an error that says that only the machine knows it.
            assert!(crate::expression::Lookup::named(&values, name).is_some(), "{name}");
            let is_there = PAGE.contains(&format!("`{name}`"))
                || name.starts_with("_abs_") && PAGE.contains("`_abs_x` to `_abs_w`");
            assert!(is_there, "{name}");
        }
    }
}
