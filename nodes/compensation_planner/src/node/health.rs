//! The planner's entry in `/diagnostics`.

use cnc_msgs::count::counted;
use runtime::{Health, HealthLevel};

/// The result of the newest plan.
#[derive(Debug, Clone, Default)]
pub(super) struct PlanSummary {
    pub(super) name: String,
    pub(super) revision: u64,
    pub(super) accepted: bool,
    pub(super) error_count: u32,
    pub(super) warning_count: u32,
}

/// The health of the planner: a refused program cannot be run, which is a warning.
pub(super) fn health(summary: Option<&PlanSummary>, tool_table_revision: u64) -> Health {
    let mut values = vec![("tool table revision", tool_table_revision.to_string())];
    let (level, message) = match summary {
        None => (HealthLevel::Ok, "nothing is planned".to_owned()),
        Some(PlanSummary { name, revision, accepted, error_count, warning_count }) => {
            values.push(("revision", revision.to_string()));
            values.push(("errors", error_count.to_string()));
            values.push(("warnings", warning_count.to_string()));
            if *accepted {
                (HealthLevel::Ok, format!("{name} is planned"))
            } else {
                (HealthLevel::Warn, {
                    let errors = counted(*error_count as usize, "error");
                    format!("{name} is refused: {errors}")
                })
            }
        }
    };
    let values = values.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    Health { component: "plan".into(), level, message, values, ..Health::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_refused_program_warns() {
        let planned = PlanSummary {
            name: "part.ngc".into(),
            revision: 3,
            accepted: true,
            warning_count: 2,
            ..PlanSummary::default()
        };
        let refused = PlanSummary { accepted: false, error_count: 4, ..planned.clone() };
        let table = [
            (None, HealthLevel::Ok, "nothing is planned", 1),
            (Some(&planned), HealthLevel::Ok, "part.ngc is planned", 4),
            (Some(&refused), HealthLevel::Warn, "part.ngc is refused: 4 errors", 4),
        ];
        for (summary, level, message, values) in table {
            let health = health(summary, 1);
            assert_eq!((health.level, health.message.as_str()), (level, message));
            assert_eq!(health.values.len(), values);
        }
    }
}
