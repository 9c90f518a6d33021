//! Finds what the form of a profile cannot exclude: values and combinations that no
//! control could have.

use super::{ArcLead, Dialect, OutputPoint, Profile, RadiusKind, SelectTarget, ZeroOffset};
use crate::geometry::Plane;

/// A profile that no control could have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}: {reason}", path.join("."))]
pub struct ProfileFault {
    /// The keys that lead to the value, the outermost first.
    pub path: &'static [&'static str],
    pub reason: String,
}

impl Profile {
    /// Checks values and combinations, the first fault first.
    pub fn check(&self) -> Result<(), ProfileFault> {
        let refuse = |path, reason: String| Err(ProfileFault { path, reason });
        if self.name.is_empty() {
            return refuse(&["name"], "it is empty".into());
        }
        let tolerance = self.accept_tolerance_mm;
        if !(tolerance > 0.0 && tolerance <= 1.0) {
            return refuse(
                &["accept_tolerance_mm"],
                format!("{tolerance} mm; more than 0 and at most 1 mm is needed"),
            );
        }
        let stock_top = self.interference.stock_top_mm;
        if !stock_top.is_finite() {
            return refuse(
                &["interference", "stock_top_mm"],
                format!("{stock_top} is not a height"),
            );
        }
        let planes = &self.language.planes.rule;
        if planes.is_empty() {
            return refuse(&["language", "planes"], "at least one plane is needed".into());
        }
        if (1..planes.len()).any(|index| planes[..index].contains(&planes[index])) {
            return refuse(&["language", "planes"], "a plane is listed twice".into());
        }
        if self.language.dominant_axes.rule.is_empty() {
            return refuse(
                &["language", "dominant_axes"],
                "without an axis nothing can be compensated".into(),
            );
        }
        if self.language.x_is_diameter && !planes.contains(&Plane::Zx) {
            return refuse(
                &["language", "x_is_diameter"],
                "diameters are for turning, and language.planes does not name zx".into(),
            );
        }
        let short = self.corner.short_block_mm;
        if !(0.0..=10.0).contains(&short) {
            return refuse(
                &["corner", "short_block_mm"],
                format!("{short} mm; 0 to 10 mm is needed"),
            );
        }
        if self.select.arc_lead == ArcLead::Arc && self.select.target != SelectTarget::NormalEntry {
            return refuse(
                &["select", "arc_lead"],
                "an arc ends beside its own end: set select.target to normal_entry".into(),
            );
        }
        let latency = self.radius.value_latency_blocks;
        if latency > 100 {
            return refuse(
                &["radius", "value_latency_blocks"],
                format!("{latency} blocks; at most 100 are possible"),
            );
        }
        let source = self.radius.source.rule;
        if self.d0 != ZeroOffset::None && source != RadiusKind::DRegister {
            return refuse(
                &["d0"],
                "D0 has a meaning only where radius.source is d_register; set it to none".into(),
            );
        }
        let dialect = self.language.dialect;
        let is_possible = match source {
            RadiusKind::ToolNumber | RadiusKind::DRegister => {
                !matches!(dialect, Dialect::Masso | Dialect::Automation1 | Dialect::OspLathe)
            }
            RadiusKind::SpindleToolPlusP => {
                matches!(dialect, Dialect::Masso | Dialect::Rs274 | Dialect::Nct)
            }
            RadiusKind::ProgramValue => dialect == Dialect::Automation1,
            RadiusKind::NoseRegister => dialect == Dialect::OspLathe,
        };
        if !is_possible {
            return refuse(
                &["radius", "source"],
                "the language of this profile has no word for it: see docs/profiles.md".into(),
            );
        }
        let number = |word: &String| word.trim_start_matches('G').parse::<f64>().ok();
        let select = self.select.words.keys().filter_map(number);
        let mut numbers: Vec<f64> =
            self.corner.words.keys().filter_map(number).chain(select).collect();
        numbers.sort_by(f64::total_cmp);
        if numbers.windows(2).any(|pair| pair[0] == pair[1]) {
            return refuse(
                &["corner", "words"],
                "one G number is used twice in corner.words and select.words".into(),
            );
        }
        if self.output == OutputPoint::Tip
            && !matches!(source, RadiusKind::NoseRegister | RadiusKind::DRegister)
        {
            return refuse(
                &["output"],
                "the tip direction comes with a nose or D register, and radius.source is neither"
                    .into(),
            );
        }
        Ok(())
    }
}
