//! The lines of the summary: audit, certificates, and what stays uncut.

use cnc_msgs::calls::chain_after;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::count::counted;
use compensation_planner::{Certificate, UncutRegion};
use path_audit::Audit;

/// `the audit confirms the path (19 elements, 1 span, 4 events)`
pub(super) fn audit_text(audit: &Audit) -> String {
    let result = match audit.findings.len() {
        0 => "confirms the path".to_owned(),
        count => format!("has {} about the path", counted(count, "finding")),
    };
    format!(
        "the audit {result} ({}, {}, {})",
        counted(audit.elements, "element"),
        counted(audit.spans, "span"),
        counted(audit.events, "event")
    )
}

/// `lines 3 to 12, tool on the left, radius 5.000 mm: good up to radius 20.851 mm (N40)`
pub(super) fn certificate_text(certificate: &Certificate, fits: bool) -> String {
    let side = match certificate.side {
        CutterSide::Left => "left",
        CutterSide::Right => "right",
    };
    const LIMITS_SHOWN: usize = 3;
    let mut limits: Vec<String> = certificate
        .limited_by
        .iter()
        .take(LIMITS_SHOWN)
        .map(|limit| {
            // The certificate itself names the calls that both share.
            let calls = match limit.calls == certificate.calls {
                true => String::new(),
                false => chain_after(&limit.calls),
            };
            match limit.source.block {
                Some(block) => format!("N{block}{calls}"),
                None => format!("line {}{calls}", limit.source.line),
            }
        })
        .collect();
    let more = certificate.limited_by.len().saturating_sub(LIMITS_SHOWN);
    if more > 0 {
        limits.push(format!("{more} more"));
    }
    if limits.is_empty() {
        limits.push("beyond it not everything could be checked".into());
    }
    // Truncated, not rounded: the printed radius fits.
    let cut = |radius_mm: f64| (radius_mm * 1e3).floor() / 1e3;
    let up_to = |radius_mm: f64| match cut(radius_mm) {
        none if none <= 0.0 => "for no tool".to_owned(),
        radius_mm => format!("up to radius {radius_mm:.3} mm"),
    };
    let good = if fits && certificate.valid_to_mm < certificate.radius_mm {
        // Compared exactly with the posted coordinates, the tool loses some short elements.
        format!(
            "good within the accepted tolerance; to the last digit only {} ({})",
            up_to(certificate.valid_to_mm),
            limits.join(", ")
        )
    } else if certificate.valid_to_mm.is_finite() {
        format!(
            "good {} ({}), with these leads {}",
            up_to(certificate.valid_to_mm),
            limits.join(", "),
            up_to(certificate.leads_valid_to_mm)
        )
    } else if certificate.leads_valid_to_mm.is_finite() {
        format!("good for any tool, with these leads {}", up_to(certificate.leads_valid_to_mm))
    } else {
        "good for any tool".into()
    };
    format!(
        "{}{}, tool on the {side}, radius {:.3} mm: {good}",
        lines(certificate.first_line, certificate.last_line),
        chain_after(&certificate.calls),
        certificate.radius_mm
    )
}

/// The total area, and the largest areas that stay uncut.
pub(super) fn uncut_text(uncut: &[UncutRegion]) -> String {
    const SHOWN: usize = 5;
    let mut largest: Vec<&UncutRegion> = uncut.iter().collect();
    largest.sort_by(|a, b| b.area_mm2.total_cmp(&a.area_mm2));
    let total: f64 = largest.iter().map(|region| region.area_mm2).sum();
    let mut text = format!("\n  {total:.3} mm2 stay uncut in {}", counted(uncut.len(), "place"));
    for region in largest.iter().take(SHOWN) {
        let lines = lines(region.first.line, region.last.line);
        let calls = chain_after(&region.calls);
        text += &format!("\n    {lines}{calls}: {:.3} mm2", region.area_mm2);
    }
    text
}

/// `line 3`, `lines 3 to 12`.
fn lines(first: u32, last: u32) -> String {
    if first == last { format!("line {first}") } else { format!("lines {first} to {last}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_certificate_says_where_it_ends_and_why() {
        let certificate = |radius_mm, valid_to_mm| Certificate {
            first_line: 3,
            last_line: 12,
            call: 0,
            calls: Vec::new(),
            side: CutterSide::Left,
            radius_mm,
            valid_from_mm: 0.0,
            valid_to_mm,
            limited_by: Vec::new(),
            leads_valid_to_mm: valid_to_mm,
        };
        let begin = "lines 3 to 12, tool on the left, radius 5.000 mm: ";
        let unknown = "(beyond it not everything could be checked)";
        for (valid_to_mm, end) in [
            (f64::INFINITY, "good for any tool".to_owned()),
            (
                6.5,
                format!(
                    "good up to radius 6.500 mm {unknown}, with these leads up to radius 6.500 mm"
                ),
            ),
            (0.0, format!("good for no tool {unknown}, with these leads for no tool")),
        ] {
            let text = certificate_text(&certificate(5.0, valid_to_mm), valid_to_mm > 5.0);
            assert_eq!(text, format!("{begin}{end}"));
        }
    }
}
