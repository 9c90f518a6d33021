//! Findings.

use super::{
    WireError, block_to_wire, chain_to_wire, constant, key_of, number, position, source, value_of,
};
use crate::finding::{Code, Finding, Severity};
use crate::units::{m_from_mm, mm_from_m, point_from_position};
use crate::wire::cnc_msgs::msg as wire;

const SEVERITIES: [(u8, Severity); 2] = [
    (wire::Finding::SEVERITY_WARNING, Severity::Warning),
    (wire::Finding::SEVERITY_ERROR, Severity::Error),
];

impl From<&Finding> for wire::Finding {
    fn from(finding: &Finding) -> Self {
        let metres = |mm: Option<f64>| mm.map(m_from_mm).into_iter().collect();
        Self {
            severity: key_of(&SEVERITIES, finding.severity),
            code: finding.code.name().into(),
            alarm: finding.alarm.clone().unwrap_or_default(),
            line: finding.source.line,
            column: finding.source.column.into(),
            length: finding.source.length.into(),
            block: block_to_wire(finding.source.block),
            other_line: finding.other.map_or(0, |other| other.line),
            other_block: block_to_wire(finding.other.and_then(|other| other.block)),
            position: finding.position.map(point_from_position).into_iter().collect(),
            depth: metres(finding.depth_mm),
            needed: metres(finding.needed_mm),
            available: metres(finding.available_mm),
            message: finding.message.clone(),
            help: finding.help.clone(),
            calls: chain_to_wire(&finding.calls),
            other_calls: chain_to_wire(&finding.other_calls),
        }
    }
}

impl TryFrom<&wire::Finding> for Finding {
    type Error = WireError;

    fn try_from(finding: &wire::Finding) -> Result<Self, WireError> {
        let millimetres = |field, metres: &[f64]| {
            metres.first().map(|&value| number(field, mm_from_m(value))).transpose()
        };
        let code = Code::ALL.into_iter().find(|code| code.name() == finding.code);
        Ok(Self {
            severity: constant(
                "severity",
                finding.severity,
                value_of(&SEVERITIES, finding.severity),
            )?,
            code: code
                .ok_or_else(|| WireError::Text { field: "code", value: finding.code.clone() })?,
            alarm: (!finding.alarm.is_empty()).then(|| finding.alarm.clone()),
            source: source(
                finding.line,
                &finding.block,
                u16::try_from(finding.column).unwrap_or(u16::MAX),
                u16::try_from(finding.length).unwrap_or(u16::MAX),
            ),
            other: (finding.other_line > 0)
                .then(|| source(finding.other_line, &finding.other_block, 0, 0)),
            position: finding
                .position
                .first()
                .map(|point| position("position", point))
                .transpose()?,
            depth_mm: millimetres("depth", &finding.depth)?,
            needed_mm: millimetres("needed", &finding.needed)?,
            available_mm: millimetres("available", &finding.available)?,
            message: finding.message.clone(),
            help: finding.help.clone(),
            calls: finding.calls.iter().map(Into::into).collect(),
            other_calls: finding.other_calls.iter().map(Into::into).collect(),
        })
    }
}
