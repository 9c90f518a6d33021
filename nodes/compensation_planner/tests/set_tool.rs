//! One change of the tool table: what is taken, what is refused, and what
//! becomes of the file.

mod support;

use cnc_msgs::tool_table::{Offset, Tool, ToolTable};
use cnc_msgs::wire::cnc_msgs::srv::{SetToolRequest as W, SetToolResponse as Code};
use compensation_planner::set_tool::{LoadedProgram, Refusal, change, still_cuts};
use compensation_planner::tool_file::{edited, whole};
use support::{A6, contour, sinumerik};

/// T1 of 10 mm, T7 a turning tool, D1 of 5 mm.
fn table() -> ToolTable {
    let mut table = ToolTable::default();
    table.tools.insert(1, Tool { diameter_mm: 10.0, ..Tool::default() });
    table.tools.insert(7, Tool { nose_radius_mm: 0.8, tip_direction: 3, ..Tool::default() });
    table.offsets.insert(1, Offset { radius_mm: 5.0, ..Offset::default() });
    table
}

fn tool(tool_number: u32, mask: u8) -> W {
    W { tool_number, mask, ..W::default() }
}

fn offset(offset_number: u32, mask: u8) -> W {
    W { offset_number, mask, ..W::default() }
}

#[test]
fn what_a_request_says_becomes_millimetres_of_one_row() {
    let all = W::DIAMETER | W::WEAR_DIAMETER | W::LENGTH;
    let sizes = W { diameter: 0.012, wear_diameter: -0.0005, length: 0.06, ..W::default() };
    let cases = [
        (
            W { tool_number: 1, mask: all, ..sizes.clone() },
            "T1: diameter_mm 12, wear_diameter_mm -0.5, length_mm 60",
        ),
        // A register holds radii.
        (
            W { offset_number: 1, mask: all, ..sizes.clone() },
            "D1: radius_mm 6, wear_mm -0.25, length_mm 60",
        ),
        // What the mask does not name is not looked at.
        (
            W { wear_diameter: -0.0005, length: f64::NAN, ..tool(1, W::WEAR_DIAMETER) },
            "T1: wear_diameter_mm -0.5",
        ),
        (
            W {
                nose_radius: 0.0004,
                tip_direction: 9,
                ..tool(7, W::NOSE_RADIUS | W::TIP_DIRECTION)
            },
            "T7: nose_radius_mm 0.4, tip_direction 9",
        ),
        (W { diameter: 0.006, ..tool(4, W::DIAMETER) }, "T4 is new: diameter_mm 6"),
        (W { diameter: -0.006, ..offset(4, W::DIAMETER) }, "D4 is new: radius_mm -3"),
    ];
    for (request, expected) in cases {
        let change = change(&table(), &request).expect(expected);
        assert_eq!(change.describe(), expected);
        let others = |tables: &ToolTable| {
            let mut tables = tables.clone();
            tables.tools.remove(&request.tool_number);
            tables.offsets.remove(&request.offset_number);
            tables
        };
        assert_eq!(others(&change.tools), others(&table()), "{expected}");
        assert_ne!(change.tools, table());
    }
}

#[test]
fn what_no_tool_can_be_is_refused_with_its_number() {
    let invalid = Code::INVALID_REQUEST;
    let cases = [
        (tool(1, 0), invalid, "mask is 0"),
        (tool(1, 32), invalid, "mask is 32"),
        (offset(0, W::LENGTH), invalid, "name a tool or an offset"),
        (W { offset_number: 1, ..tool(1, W::LENGTH) }, invalid, "T1 and D1 are named"),
        (W { diameter: -0.01, ..tool(1, W::DIAMETER) }, invalid, "T1 is -10 mm"),
        (W { nose_radius: -0.001, ..tool(7, W::NOSE_RADIUS) }, invalid, "T7 is -1 mm"),
        (W { diameter: f64::NAN, ..tool(1, W::DIAMETER) }, invalid, "NaN"),
        (W { wear_diameter: f64::INFINITY, ..offset(1, W::WEAR_DIAMETER) }, invalid, "inf"),
        // Wear that is larger than the tool, entered as wear or as another tool.
        (W { wear_diameter: -0.02, ..tool(1, W::WEAR_DIAMETER) }, invalid, "T1 is -20 mm, more"),
        (W { wear_diameter: -0.02, ..offset(1, W::WEAR_DIAMETER) }, invalid, "D1 is -10 mm, more"),
        (
            W { diameter: 0.001, wear_diameter: -0.002, ..tool(4, W::DIAMETER | W::WEAR_DIAMETER) },
            invalid,
            "T4 is -2 mm, more",
        ),
        // Millimetres where metres are meant.
        (W { diameter: 10.0, ..tool(1, W::DIAMETER) }, invalid, "10000 mm; at most 1000 mm"),
        (
            W { tip_direction: 10, ..tool(7, W::TIP_DIRECTION) },
            invalid,
            "T7 is 10; it must be 0 to 9",
        ),
        (W { nose_radius: 0.001, ..offset(1, W::NOSE_RADIUS) }, invalid, "set diameter"),
        (W { wear_diameter: -0.0005, ..tool(9, W::WEAR_DIAMETER) }, Code::UNKNOWN_TOOL, "no T9"),
        (
            W { length: 0.05, ..offset(7, W::LENGTH) },
            Code::UNKNOWN_TOOL,
            "D7 in a program means T7",
        ),
    ];
    for (request, code, part) in cases {
        let Refusal { error_code, message, .. } = change(&table(), &request).expect_err(part);
        assert_eq!(error_code, code, "{message}");
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_value_that_the_loaded_program_does_not_take_is_refused_with_the_finding() {
    let (profile, before) = (sinumerik(), table());
    let contour = contour(A6, &profile);
    let program = LoadedProgram { name: "a6.mpf", contour: &contour, profile: &profile };
    let to = |radius_mm: f64, before: &ToolTable| {
        let request = W { diameter: radius_mm * 2e-3, ..offset(1, W::DIAMETER) };
        let change = change(before, &request).expect("a size that tools have");
        still_cuts(program, before, &change).map(|()| change.tools)
    };
    // The contour of 11.15 takes tools up to 20.851449 mm.
    to(20.85, &before).expect("it fits");
    let Refusal { error_code, message, .. } = to(20.86, &before).expect_err("it does not fit");
    assert_eq!(error_code, Code::PLAN_REFUSED);
    assert!(message.starts_with("D1: radius_mm 20.86 is refused: a6.mpf"), "{message}");
    assert!(
        message.contains("line 5 (N40): ") && message.ends_with("nothing was changed"),
        "{message}"
    );
    // What does not fit already is no reason to refuse a step towards what does.
    let mut worse = before;
    worse.offsets.insert(1, Offset { radius_mm: 30.0, ..Offset::default() });
    to(25.0, &worse).expect("a step");
    to(5.0, &worse).expect("mended");
}

const IN_ONE_LINE: &str = "\
# Mill 3, shift 2.
tools:   # by T number
  1: {diameter_mm: 10.0, wear_diameter_mm: -0.05 } # HSS, reground
  12: {diameter_mm: 4.0}

offsets:
  1: {radius_mm: 5.0}
";

const BELOW: &str = "\
tools:
  1:
    # new in May
    diameter_mm: 10.0   # measured
    wear_diameter_mm: 0.0
  2:
    diameter_mm: 3.0
# no drills
";

fn wear(tool_number: u32) -> W {
    W { wear_diameter: -0.0005, ..tool(tool_number, W::WEAR_DIAMETER) }
}

fn diameter(tool_number: u32) -> W {
    W { diameter: 0.006, ..tool(tool_number, W::DIAMETER) }
}

fn radius(offset_number: u32) -> W {
    W { diameter: 0.002, ..offset(offset_number, W::DIAMETER) }
}

#[test]
fn a_tool_file_keeps_what_its_owner_wrote() {
    let (crlf, no_end) = (IN_ONE_LINE.replace('\n', "\r\n"), BELOW.trim_end().to_owned());
    let over_lines =
        "tools:\n  1: &first {\n    diameter_mm: 10.0, # measured\n    length_mm: 60}\n";
    let cases = [
        // One row in one line.
        (IN_ONE_LINE, wear(1), ("wear_diameter_mm: -0.05 }", "wear_diameter_mm: -0.5 }")),
        (
            IN_ONE_LINE,
            W { length: 0.06, ..tool(1, W::LENGTH) },
            ("-0.05 }", "-0.05, length_mm: 60.0 }"),
        ),
        (IN_ONE_LINE, diameter(2), ("4.0}\n", "4.0}\n  2: {diameter_mm: 6.0}\n")),
        (
            IN_ONE_LINE,
            W { wear_diameter: 0.0001, ..offset(1, W::WEAR_DIAMETER) },
            ("radius_mm: 5.0}", "radius_mm: 5.0, wear_mm: 0.05}"),
        ),
        (&crlf, wear(12), ("4.0}", "4.0, wear_diameter_mm: -0.5}")),
        (&crlf, diameter(2), ("4.0}\r\n", "4.0}\r\n  2: {diameter_mm: 6.0}\r\n")),
        // One key a line.
        (BELOW, diameter(1), ("diameter_mm: 10.0   # m", "diameter_mm: 6.0   # m")),
        (
            BELOW,
            W { tip_direction: 3, ..tool(2, W::TIP_DIRECTION) },
            ("3.0\n", "3.0\n    tip_direction: 3\n"),
        ),
        (BELOW, radius(3), ("# no drills\n", "# no drills\noffsets:\n  3: {radius_mm: 1.0}\n")),
        (&no_end, diameter(2), ("diameter_mm: 3.0", "diameter_mm: 6.0")),
        // Other styles.
        (over_lines, diameter(1), ("10.0", "6.0")),
        (over_lines, wear(1), ("60}", "60, wear_diameter_mm: -0.5}")),
        (
            "tools: {1: {\"diameter_mm\": 10}} # all\n",
            wear(1),
            ("10}", "10, \"wear_diameter_mm\": -0.5}"),
        ),
        ("{tools: {1: {diameter_mm: 10}}}", diameter(2), ("10}", "10}, 2: {diameter_mm: 6.0}")),
        ("tools: {} # none yet\n", diameter(1), ("{}", "{1: {diameter_mm: 6.0}}")),
        (
            "# Mill 3\n---\ntools:\n  ? 1\n  : {diameter_mm: 1e1} # was {diameter_mm: 9.0}\n...\n",
            diameter(1),
            ("1e1", "6.0"),
        ),
    ];
    for (text, request, (from, to)) in cases {
        let before: ToolTable = serde_yaml::from_str(text).expect("a tool file");
        let change = change(&before, &request).expect(to);
        let text_now = edited(text, &change).expect(to);
        assert_eq!(text_now, text.replacen(from, to, 1));
        let read: ToolTable = serde_yaml::from_str(&text_now).expect("still a tool file");
        assert_eq!(read, change.tools);
    }
}

#[test]
fn a_row_that_cannot_be_changed_alone_is_left_and_a_whole_file_reads_back() {
    for text in [
        // T1 is T2.
        "tools:\n  2: &a {diameter_mm: 10.0}\n  1: *a\n",
        // The comment would go with the old value.
        "tools:\n  1:\n    diameter_mm: 10.0\n    wear_diameter_mm:\n      0.0 # measured\n",
    ] {
        let before: ToolTable = serde_yaml::from_str(text).expect("a tool file");
        let change = change(&before, &wear(1)).expect("it is there");
        let read =
            edited(text, &change).and_then(|text| serde_yaml::from_str::<ToolTable>(&text).ok());
        assert_ne!(read, Some(change.tools), "the reader finds out");
    }
    for table in [table(), ToolTable::default()] {
        assert_eq!(serde_yaml::from_str::<ToolTable>(&whole(&table)).expect("YAML"), table);
    }
}
