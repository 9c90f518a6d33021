//! Where the radius of compensation comes from.
//!
//! Turns a word of the program, the tool in the spindle and the tool table into one signed
//! number. This is a definition, so the planner and the audit of its path share it; each decides
//! by itself what the sign does to the side.

use crate::contour::{RadiusSource, Source};
use crate::finding::{Code, Finding};
use crate::profile::{NegativeRadius, OutputPoint, Profile, RadiusKind, RadiusValue};
use crate::tool_table::{Offset, Tool, ToolTable, wear_turns_side};

/// The radius in force, mm, signed, and what is to be said of it: an error when
/// there is none, which goes with a radius of 0.
///
/// Without a word the profile decides: the tool in the spindle (rs274, MASSO), or
/// nothing (where a register must be named, or the program sets the value).
/// Source: MASSO M03 to M10; SINUMERIK 840C S17, S22, S49; Automation1 A03, A13.
pub fn resolve(
    word: Option<RadiusSource>,
    spindle_tool: Option<u32>,
    profile: &Profile,
    tools: &ToolTable,
    at: Source,
) -> (f64, Option<Finding>) {
    let radius_mm = match value(word, spindle_tool, profile, tools, at) {
        Ok(radius_mm) => radius_mm,
        Err(finding) => return (0.0, Some(*finding)),
    };
    if !radius_mm.is_finite() {
        let message = format!("the compensation radius is {radius_mm}, not a finite number");
        return (0.0, Some(Finding::error(Code::RadiusSource, at, message)));
    }
    if radius_mm < 0.0 && profile.radius.negative.rule == NegativeRadius::Forbidden {
        let mut finding = Finding::error(
            Code::RadiusSource,
            at,
            format!(
                "the compensation radius is {radius_mm:.3} mm, and {} does not accept a negative \
                 radius",
                profile.name
            ),
        )
        .help("select the other side and make the radius positive");
        finding.severity = profile.radius.negative.severity();
        return (radius_mm, Some(finding));
    }
    (radius_mm, double_radius(word, spindle_tool, tools, at))
}

fn value(
    word: Option<RadiusSource>,
    spindle_tool: Option<u32>,
    profile: &Profile,
    tools: &ToolTable,
    at: Source,
) -> Result<f64, Box<Finding>> {
    let default = match profile.radius.source.rule {
        RadiusKind::ToolNumber => Some(RadiusSource::SpindleTool),
        RadiusKind::SpindleToolPlusP => Some(RadiusSource::SpindleToolPlus(0.0)),
        RadiusKind::DRegister | RadiusKind::NoseRegister | RadiusKind::ProgramValue => None,
    };
    Ok(match word.or(default) {
        // T000101 names a tool and no nose radius.
        None | Some(RadiusSource::Nose(0)) => return Err(Box::new(no_word(profile, at))),
        Some(RadiusSource::SpindleTool) => of_spindle(spindle_tool, tools, at)?,
        Some(RadiusSource::SpindleToolPlus(more_mm)) => {
            // Nothing is known of any tool: all of the radius is in the program (M03).
            let alone = spindle_tool.is_none() && tools.tools.is_empty() && more_mm != 0.0;
            more_mm + if alone { 0.0 } else { of_spindle(spindle_tool, tools, at)? }
        }
        Some(RadiusSource::Tool(number)) => of_number(number, tools, at, "T")?,
        Some(RadiusSource::Offset(number)) => match tools.offsets.get(&number) {
            Some(offset) => of_offset(number, offset, at)?,
            None => of_number(number, tools, at, "D")?,
        },
        Some(RadiusSource::Nose(number)) => match tools.offsets.get(&number) {
            Some(offset) => of_offset(number, offset, at)?,
            None => of_nose(number, tools, at)?,
        },
        Some(RadiusSource::Diameter { mm, .. }) => mm / 2.0,
        Some(RadiusSource::Radius(value_mm)) => match profile.radius.value_is {
            RadiusValue::Radius => value_mm,
            RadiusValue::Width => value_mm / 2.0,
        },
    })
}

fn no_word(profile: &Profile, at: Source) -> Finding {
    let rule = profile.radius.source.rule;
    let message = match rule {
        RadiusKind::ProgramValue => format!(
            "compensation is selected and no radius has been set; {} takes none from the tool table",
            profile.name
        ),
        _ => "compensation is selected without a word for its radius, so it has none".into(),
    };
    let mut finding = Finding::error(Code::RadiusSource, at, message).help(match rule {
        RadiusKind::NoseRegister => "name the nose radius in a T word before: T010101",
        RadiusKind::ProgramValue => {
            "set the radius before the selection, in mm: G43 P5 or CutterCompensationSetRadius(5)"
        }
        _ => "write the offset register in the same block: D1",
    });
    finding.severity = profile.radius.source.severity();
    finding
}

/// P is a radius that is added to that of the tool; both at once are uncommon (M09).
fn double_radius(
    word: Option<RadiusSource>,
    spindle_tool: Option<u32>,
    tools: &ToolTable,
    at: Source,
) -> Option<Finding> {
    let Some(RadiusSource::SpindleToolPlus(more_mm)) = word else { return None };
    let tool = spindle_tool.and_then(|number| tools.tools.get(&number))?;
    (more_mm > 0.0 && tool.diameter_mm > 0.0).then(|| {
        let own_mm = of_tool(tool);
        Finding::warning(
            Code::SuspiciousValue,
            at,
            format!(
                "P{more_mm} is added to the {own_mm:.3} mm that the tool table has: \
                 the radius is {:.3} mm. Is it twice there?",
                own_mm + more_mm
            ),
        )
        .help("leave out P, or set the diameter in the tool table to 0")
    })
}

/// The direction of the tip that the path is of, which goes with the radius in force; 0: the path is
/// that of the centre.
pub fn tip(
    word: Option<RadiusSource>,
    spindle_tool: Option<u32>,
    profile: &Profile,
    tools: &ToolTable,
) -> u8 {
    if let Some(RadiusSource::Diameter { tip: tip @ 1.., .. }) = word {
        return tip;
    }
    if profile.output == OutputPoint::Center {
        return 0;
    }
    let of_tool = |number: u32| tools.tools.get(&number).map(|tool| tool.tip_direction);
    let of_offset = |number: u32| tools.offsets.get(&number).map(|offset| offset.tip_direction);
    match word {
        Some(RadiusSource::Offset(number) | RadiusSource::Nose(number)) => {
            of_offset(number).or_else(|| of_tool(number))
        }
        Some(RadiusSource::Tool(number)) => of_tool(number),
        _ => spindle_tool.and_then(of_tool),
    }
    .unwrap_or(0)
}

/// The radius of a tool, mm: half of the worn diameter (M05).
fn of_tool(tool: &Tool) -> f64 {
    (tool.diameter_mm + tool.wear_diameter_mm) / 2.0
}

fn of_spindle(
    spindle_tool: Option<u32>,
    tools: &ToolTable,
    at: Source,
) -> Result<f64, Box<Finding>> {
    match spindle_tool {
        Some(number) => of_number(number, tools, at, "T"),
        None => Err(Box::new(
            Finding::error(
                Code::UnknownTool,
                at,
                format!(
                    "compensation uses the tool in the spindle, and the program has put none in; {}",
                    what_it_holds(tools)
                ),
            )
            .help("change the tool before compensation is selected: T1 M6"),
        )),
    }
}

fn of_number(
    number: u32,
    tools: &ToolTable,
    at: Source,
    letter: &str,
) -> Result<f64, Box<Finding>> {
    match tools.tools.get(&number) {
        Some(tool) => {
            worn(tool.diameter_mm / 2.0, tool.wear_diameter_mm / 2.0, at, format_args!("T{number}"))
        }
        // No tool and no offset (S22).
        None if number == 0 => Ok(0.0),
        None => Err(Box::new(unknown(format!("{letter}{number}"), tools, at))),
    }
}

/// The nose radius of a turning tool, mm.
fn of_nose(number: u32, tools: &ToolTable, at: Source) -> Result<f64, Box<Finding>> {
    match tools.tools.get(&number) {
        Some(tool) => worn(
            tool.nose_radius_mm,
            tool.wear_diameter_mm / 2.0,
            at,
            format_args!("the nose radius of T{number}"),
        ),
        None => Err(Box::new(unknown(format!("nose radius {number}"), tools, at))),
    }
}

fn of_offset(number: u32, offset: &Offset, at: Source) -> Result<f64, Box<Finding>> {
    worn(offset.radius_mm, offset.wear_mm, at, format_args!("D{number}"))
}

/// A radius with its wear, mm. Wear alone never turns the side.
fn worn(
    value_mm: f64,
    wear_mm: f64,
    at: Source,
    name: std::fmt::Arguments<'_>,
) -> Result<f64, Box<Finding>> {
    if !wear_turns_side(value_mm, wear_mm) {
        return Ok(value_mm + wear_mm);
    }
    let message = format!(
        "the wear of {name} is larger than its value: radius {value_mm} mm, wear {wear_mm} mm on the radius"
    );
    Err(Box::new(
        Finding::error(Code::RadiusSource, at, message)
            .help("correct the wear in the tool table; wear alone never changes the side"),
    ))
}

/// A number that the tool table does not know.
pub fn unknown(name: String, tools: &ToolTable, at: Source) -> Finding {
    Finding::error(
        Code::UnknownTool,
        at,
        format!("{name} is not in the tool table; {}", what_it_holds(tools)),
    )
    .help(format!("add {name} to the tool table, or use a number that it holds"))
}

fn what_it_holds(tools: &ToolTable) -> String {
    const SHOWN_MAX: usize = 8;
    let names: Vec<String> = (tools.tools.keys().map(|tool| format!("T{tool}")))
        .chain(tools.offsets.keys().map(|offset| format!("D{offset}")))
        .collect();
    match names.len() {
        0 => "it is empty".into(),
        count if count > SHOWN_MAX => {
            format!("it holds {} and {} more", names[..SHOWN_MAX].join(" "), count - SHOWN_MAX)
        }
        _ => format!("it holds {}", names.join(" ")),
    }
}
