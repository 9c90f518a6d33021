//! Where the radius of compensation comes from.
//!
//! Turns a word of the program, the tool in the spindle and the tool table into
//! one signed number; what its sign does to the side is decided in `walk`.

use cnc_msgs::contour::{RadiusSource, Source};
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::profile::{NegativeRadius, Profile, RadiusKind};
use cnc_msgs::tool_table::{Tool, ToolTable};

/// The radius in force, mm, signed; the finding when there is none.
///
/// Without a word the profile decides: the tool in the spindle (rs274, MASSO),
/// or nothing (840C, where a register must be named).
/// Source: MASSO M03 to M10; SINUMERIK 840C S17, S22, S49.
pub(crate) fn resolve(
    word: Option<RadiusSource>,
    spindle_tool: Option<u32>,
    profile: &Profile,
    tools: &ToolTable,
    at: Source,
) -> Result<f64, Box<Diagnostic>> {
    let default = match profile.radius.source.rule {
        RadiusKind::ToolNumber => Some(RadiusSource::SpindleTool),
        RadiusKind::SpindleToolPlusP => Some(RadiusSource::SpindleToolPlus(0.0)),
        RadiusKind::ProgramValue => Some(RadiusSource::SpindleTool),
        RadiusKind::DRegister | RadiusKind::NoseRegister => None,
    };
    let radius_mm = match word.or(default) {
        None => {
            return Err(Box::new(
                Diagnostic::error(
                    Code::RadiusSource,
                    at,
                    "compensation is selected without a D word, so it has no radius",
                )
                .help("write the offset register in the same block: D1"),
            ));
        }
        Some(RadiusSource::SpindleTool) => of_spindle(spindle_tool, tools, at)?,
        Some(RadiusSource::SpindleToolPlus(more_mm)) => {
            // Nothing is known of any tool: all of the radius is in the program (M03).
            let alone = spindle_tool.is_none() && tools.tools.is_empty() && more_mm != 0.0;
            more_mm + if alone { 0.0 } else { of_spindle(spindle_tool, tools, at)? }
        }
        Some(RadiusSource::Tool(number)) => of_number(number, tools, at, "T")?,
        Some(RadiusSource::Offset(number)) => match tools.offsets.get(&number) {
            Some(offset) => offset.radius_mm + offset.wear_mm,
            None => of_number(number, tools, at, "D")?,
        },
        Some(RadiusSource::Nose(number)) => match tools.offsets.get(&number) {
            Some(offset) => offset.radius_mm + offset.wear_mm,
            None => of_nose(number, tools, at)?,
        },
        Some(RadiusSource::Diameter(diameter_mm)) => diameter_mm / 2.0,
        Some(RadiusSource::Radius(radius_mm)) => radius_mm,
    };
    if !radius_mm.is_finite() {
        return Err(Box::new(Diagnostic::error(
            Code::RadiusSource,
            at,
            format!("the compensation radius is {radius_mm}, not a finite number"),
        )));
    }
    if radius_mm < 0.0 && profile.radius.negative.rule == NegativeRadius::Forbidden {
        return Err(Box::new(
            Diagnostic::error(
                Code::RadiusSource,
                at,
                format!(
                    "the compensation radius is {radius_mm:.3} mm, and {} takes none below 0",
                    profile.name
                ),
            )
            .help("select the other side and make the radius positive"),
        ));
    }
    Ok(radius_mm)
}

/// The radius of a tool, mm: half of the worn diameter (M05).
pub(crate) fn of_tool(tool: &Tool) -> f64 {
    (tool.diameter_mm + tool.wear_diameter_mm) / 2.0
}

fn of_spindle(
    spindle_tool: Option<u32>,
    tools: &ToolTable,
    at: Source,
) -> Result<f64, Box<Diagnostic>> {
    match spindle_tool {
        Some(number) => of_number(number, tools, at, "T"),
        None => Err(Box::new(
            Diagnostic::error(
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
) -> Result<f64, Box<Diagnostic>> {
    match tools.tools.get(&number) {
        Some(tool) => Ok(of_tool(tool)),
        // No tool and no offset (S22).
        None if number == 0 => Ok(0.0),
        None => Err(Box::new(unknown(format!("{letter}{number}"), tools, at))),
    }
}

/// The nose radius of a turning tool, mm.
fn of_nose(number: u32, tools: &ToolTable, at: Source) -> Result<f64, Box<Diagnostic>> {
    match tools.tools.get(&number) {
        Some(tool) => Ok(tool.nose_radius_mm + tool.wear_diameter_mm / 2.0),
        None => Err(Box::new(unknown(format!("nose radius {number}"), tools, at))),
    }
}

/// A number that the tool table does not know.
pub(crate) fn unknown(name: String, tools: &ToolTable, at: Source) -> Diagnostic {
    Diagnostic::error(
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
