//! Plans a long program in parts, where only its errors are shown.

use super::Planned;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::node::parts::PartsVerdict;
use compensation_planner::{Planning, Verdict};
use program_loader::{LoadOptions, load_in_parts};

/// The least events of a part: enough spans for all processors, and as few as stay in their caches.
const PART_EVENTS: usize = 16_384;

impl Planned {
    /// For callers that show errors only: what is accepted may come without its contour, its path,
    /// and the warnings of the planner.
    ///
    /// A long program is planned in parts while it is still being read, and no part is kept.
    pub(super) fn without_path(
        text: &[u8],
        profile: &Profile,
        tools: &ToolTable,
        options: &LoadOptions,
        planning: Planning<'_>,
    ) -> Self {
        let (mut loaded, is_accepted) = std::thread::scope(|scope| {
            let mut parts = PartsVerdict::new(scope, profile, tools, planning.workers);
            let mut loaded = load_in_parts(text, profile, options, PART_EVENTS, &mut |contour| {
                parts.take(contour);
            });
            if loaded.reads_tools {
                return (loaded, Some(false));
            }
            if parts.is_untouched() || !loaded.is_accepted() {
                return (loaded, None);
            }
            let rest = std::mem::take(&mut loaded.contour);
            (loaded, Some(parts.accepts(rest)))
        });
        match is_accepted {
            None => Self::of(loaded, profile, tools, planning),
            // It is read again with the tools, or to say why it is refused.
            Some(false) => Self::new(text, profile, tools, options, planning),
            Some(true) => {
                let findings = std::mem::take(&mut loaded.findings);
                Self { loaded, verdict: Verdict::default(), findings, on_machine: None }
            }
        }
    }
}
