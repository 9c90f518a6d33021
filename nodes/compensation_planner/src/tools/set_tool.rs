//! Turns one request into a new tool table, or says why it is refused.
//!
//! Knows tables and requests, and asks the planner whether the loaded program can still be cut.
//! `tool_file` writes the file of the table; the shell publishes.

use crate::tools::verdict::{Disagreement, Verdict, judge};
use crate::walk::plan::Planning;
use cnc_msgs::calls::chain_after;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::Finding;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::units::mm_from_m;
use cnc_msgs::wire::cnc_msgs::srv::{SetToolRequest, SetToolResponse};

/// A larger size is a mistake of units, mm: the request is in metres.
const SIZE_MM_MAX: f64 = 1_000.0;

/// Why nothing was changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct Refusal {
    /// As in `SetTool`.
    pub error_code: u16,
    pub message: String,
    /// Planner and audit disagree on the loaded program with the change.
    pub disagreement: Option<Box<Disagreement>>,
}

impl Refusal {
    pub(crate) fn new(error_code: u16, message: impl Into<String>) -> Self {
        Self { error_code, message: message.into(), disagreement: None }
    }

    fn invalid(message: impl Into<String>) -> Self {
        Self::new(SetToolResponse::INVALID_REQUEST, message)
    }
}

/// A row of the tool table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToolTableRow {
    Tool(u32),
    Offset(u32),
}

impl std::fmt::Display for ToolTableRow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tool(number) => write!(f, "T{number}"),
            Self::Offset(number) => write!(f, "D{number}"),
        }
    }
}

/// The changed table.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolTableChange {
    pub tools: ToolTable,
    pub row: ToolTableRow,
    /// Whether the table had no such row.
    pub is_new: bool,
    /// Keys of the row as in the tool file, with their new values.
    pub values: Vec<(&'static str, f64)>,
}

impl ToolTableChange {
    /// `T1: wear_diameter_mm -0.5`
    pub fn describe(&self) -> String {
        let values: Vec<String> =
            self.values.iter().map(|(key, value)| format!("{key} {value}")).collect();
        let added = if self.is_new { " is new" } else { "" };
        format!("{}{added}: {}", self.row, values.join(", "))
    }
}

/// What a request makes of a table.
///
/// # Errors
/// The request names no row or two, a row that is not there, or a value that no
/// tool can have.
pub fn change(tools: &ToolTable, request: &SetToolRequest) -> Result<ToolTableChange, Refusal> {
    type W = SetToolRequest;
    const KNOWN: u8 =
        W::DIAMETER | W::WEAR_DIAMETER | W::LENGTH | W::NOSE_RADIUS | W::TIP_DIRECTION;
    let sets = |bit| request.mask & bit != 0;
    if request.mask == 0 || request.mask & !KNOWN != 0 {
        let text = format!("mask is {}; it must be a sum of 1, 2, 4, 8 and 16", request.mask);
        return Err(Refusal::invalid(text));
    }
    let row = match (request.tool_number, request.offset_number) {
        (tool, 0) if tool > 0 => ToolTableRow::Tool(tool),
        (0, offset) if offset > 0 => ToolTableRow::Offset(offset),
        (0, 0) => return Err(Refusal::invalid("name a tool or an offset, by a number above 0")),
        (tool, offset) => {
            let text = format!("T{tool} and D{offset} are named: change one at a time");
            return Err(Refusal::invalid(text));
        }
    };
    let fields = match row {
        ToolTableRow::Tool(_) => [
            (W::DIAMETER, "diameter_mm", request.diameter),
            (W::WEAR_DIAMETER, "wear_diameter_mm", request.wear_diameter),
            (W::LENGTH, "length_mm", request.length),
            (W::NOSE_RADIUS, "nose_radius_mm", request.nose_radius),
        ],
        // An offset register holds radii.
        ToolTableRow::Offset(_) => [
            (W::DIAMETER, "radius_mm", request.diameter / 2.0),
            (W::WEAR_DIAMETER, "wear_mm", request.wear_diameter / 2.0),
            (W::LENGTH, "length_mm", request.length),
            (W::NOSE_RADIUS, "", 0.0),
        ],
    };
    let mut values = Vec::new();
    for (_, key, value_m) in fields.into_iter().filter(|(bit, ..)| sets(*bit)) {
        if key.is_empty() {
            let text = format!("{row} has a radius, not a nose radius: set diameter");
            return Err(Refusal::invalid(text));
        }
        if !value_m.is_finite() {
            return Err(Refusal::invalid(format!(
                "{key} of {row} is {value_m}, not a finite number"
            )));
        }
        if value_m.abs() * 1e3 > SIZE_MM_MAX {
            let text = format!(
                "{key} of {row} would be {} mm; at most {SIZE_MM_MAX} mm is accepted; the request \
                 is in metres",
                value_m * 1e3
            );
            return Err(Refusal::invalid(text));
        }
        values.push((key, mm_from_m(value_m)));
    }
    if sets(W::TIP_DIRECTION) {
        values.push(("tip_direction", f64::from(request.tip_direction)));
    }
    let is_new = match row {
        ToolTableRow::Tool(number) => !tools.tools.contains_key(&number),
        ToolTableRow::Offset(number) => !tools.offsets.contains_key(&number),
    };
    if is_new && !sets(W::DIAMETER) && !sets(W::NOSE_RADIUS) {
        let mut text = format!("there is no {row}; to add it, set its diameter or nose radius too");
        if let ToolTableRow::Offset(number) = row
            && tools.tools.contains_key(&number)
        {
            text += &format!(" (until then, D{number} in a program means T{number})");
        }
        return Err(Refusal::new(SetToolResponse::UNKNOWN_TOOL, text));
    }
    let mut tools = tools.clone();
    for &(key, value) in &values {
        set(&mut tools, row, key, value);
    }
    tools.check().map_err(|error| Refusal::invalid(error.to_string()))?;
    Ok(ToolTableChange { tools, row, is_new, values })
}

fn set(tools: &mut ToolTable, row: ToolTableRow, key: &str, value: f64) {
    // Only whole numbers from 0 to 255 get here.
    let tip = value as u8;
    match row {
        ToolTableRow::Tool(number) => {
            let tool = tools.tools.entry(number).or_default();
            match key {
                "diameter_mm" => tool.diameter_mm = value,
                "wear_diameter_mm" => tool.wear_diameter_mm = value,
                "length_mm" => tool.length_mm = value,
                "nose_radius_mm" => tool.nose_radius_mm = value,
                _ => tool.tip_direction = tip,
            }
        }
        ToolTableRow::Offset(number) => {
            let offset = tools.offsets.entry(number).or_default();
            match key {
                "radius_mm" => offset.radius_mm = value,
                "wear_mm" => offset.wear_mm = value,
                "length_mm" => offset.length_mm = value,
                _ => offset.tip_direction = tip,
            }
        }
    }
}

/// The program that is loaded.
#[derive(Debug, Clone, Copy)]
pub struct LoadedProgram<'a> {
    pub name: &'a str,
    pub contour: &'a ProgrammedContour,
    pub profile: &'a Profile,
}

/// Checks that a program that could be cut still can.
///
/// A program that is already refused stays refused, or is mended by the change: so its tools can be
/// corrected one by one.
///
/// # Errors
///
/// It could be cut with `before` and cannot with the change.
pub fn still_cuts(
    program: LoadedProgram<'_>,
    before: &ToolTable,
    change: &ToolTableChange,
) -> Result<(), Refusal> {
    let LoadedProgram { contour, profile, .. } = program;
    let judged = |tools| judge(contour, profile, tools, Planning::default());
    let Verdict { plan: after, disagreement, .. } = judged(&change.tools);
    if after.accepted() || !judged(before).plan.accepted() {
        return Ok(());
    }
    let first = after.findings.iter().find(|finding| finding.is_error());
    let text = format!(
        "{} is refused: {} could not be cut any more: {}; nothing was changed",
        change.describe(),
        program.name,
        first.map(message_and_help).unwrap_or_default()
    );
    let refusal = Refusal::new(SetToolResponse::PLAN_REFUSED, text);
    Err(Refusal { disagreement: disagreement.map(Box::new), ..refusal })
}

/// Message and help of a finding in one line, with its place.
pub(crate) fn message_and_help(finding: &Finding) -> String {
    let block = finding.source.block.map(|block| format!(" (N{block})")).unwrap_or_default();
    let calls = chain_after(&finding.calls);
    format!("line {}{block}{calls}: {}", finding.source.line, finding.message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::verdict::tests::{offset, sinumerik, spoil_if, square};

    #[test]
    fn a_change_with_which_the_path_is_wrong_is_handed_out_for_a_report() {
        let (profile, contour, before) = (sinumerik(), square(), offset(5.0));
        let program = LoadedProgram { name: "square", contour: &contour, profile: &profile };
        let request = SetToolRequest {
            offset_number: 1,
            mask: SetToolRequest::DIAMETER,
            diameter: 0.008,
            ..SetToolRequest::default()
        };
        let change = change(&before, &request).expect("a change");
        still_cuts(program, &before, &change).expect("it fits");
        spoil_if(|tools| tools.offsets[&1].radius_mm == 4.0);
        let refusal = still_cuts(program, &before, &change).expect_err("a wrong path");
        assert_eq!(refusal.disagreement.expect("a disagreement").tools, change.tools);
    }
}
