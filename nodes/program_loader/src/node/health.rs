//! The loader's status on `/diagnostics`.

use cnc_msgs::wire::cnc_msgs::msg::Program;
use runtime::{Health, HealthLevel};

/// The loaded program, and a rejection since then.
///
/// A rejection is a warning until another program is loaded: its sender may believe that the
/// rejected program would run.
pub(super) fn health(loaded: Option<&Program>, refused: Option<&str>) -> Health {
    let name = loaded.map(|program| program.name.as_str());
    let (level, message) = match (refused, name) {
        (None, None) => (HealthLevel::Ok, "no program is loaded".to_owned()),
        (None, Some(name)) => (HealthLevel::Ok, format!("{name} is loaded")),
        (Some(why), None) => (HealthLevel::Warn, format!("{why}; no program is loaded")),
        (Some(why), Some(name)) => (HealthLevel::Warn, format!("{why}; {name} is still loaded")),
    };
    let values = loaded.map_or_else(Vec::new, |program| {
        [
            ("program id", program.program_id.clone()),
            ("control", program.control.clone()),
            ("lines", program.line_count.to_string()),
            ("bytes", program.size.to_string()),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .to_vec()
    });
    Health { component: "program".into(), level, message, values, ..Health::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_warns_until_something_is_loaded() {
        let program = Program { name: "part.ngc".into(), line_count: 7, ..Program::default() };
        let why = Some("bad.ngc is refused: 2 errors");
        let table = [
            (None, None, HealthLevel::Ok, "no program is loaded"),
            (Some(&program), None, HealthLevel::Ok, "part.ngc is loaded"),
            (None, why, HealthLevel::Warn, "bad.ngc is refused: 2 errors; no program is loaded"),
            (
                Some(&program),
                why,
                HealthLevel::Warn,
                "bad.ngc is refused: 2 errors; part.ngc is still loaded",
            ),
        ];
        for (loaded, refused, level, message) in table {
            let health = health(loaded, refused);
            assert_eq!((health.level, health.message.as_str()), (level, message));
            assert_eq!(health.values.is_empty(), loaded.is_none());
        }
    }
}
