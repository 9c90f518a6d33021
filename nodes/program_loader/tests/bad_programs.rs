//! Wrong programs; the first comment of each lists the expected findings.
//!
//! `(error unknown_word 3:4; warning missing_word 9:1)` is the whole list, in order.

mod common;

use cnc_msgs::finding::Severity;
use common::profile;
use program_loader::limits::FlowLimits;
use program_loader::{LoadOptions, load, render};
use settings::Control;
use std::path::Path;

#[test]
fn bad_programs_get_the_errors_of_their_first_comment() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad");
    let mut count = 0;
    let mut wrong = String::new();
    for control in Control::ALL {
        let profile = profile(control.name());
        let folder = folder.join(control.name());
        let entries = std::fs::read_dir(&folder)
            .unwrap_or_else(|error| panic!("programs of a control, {}: {error}", folder.display()));
        let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
        paths.sort();
        for path in paths {
            let bytes = std::fs::read(&path).expect("a program");
            let text = String::from_utf8_lossy(&bytes);
            let comment = text.split(['(', ')']).nth(1).expect("a first comment");
            // A loop without an end is found sooner.
            let flow = FlowLimits { blocks_max: 100_000, ..FlowLimits::default() };
            let options = LoadOptions { flow, ..LoadOptions::default() };
            let loaded = load(&bytes, &profile, &options);
            let found: Vec<String> = loaded
                .findings
                .iter()
                .map(|found| {
                    let severity = match found.severity {
                        Severity::Error => "error",
                        Severity::Warning => "warning",
                    };
                    let source = found.source;
                    format!("{severity} {} {}:{}", found.code.name(), source.line, source.column)
                })
                .collect();
            if found.join("; ") != comment {
                wrong += &format!(
                    "{}: expected ({comment})\n  found ({})\n{}\n",
                    path.display(),
                    found.join("; "),
                    render::render("bad", &text, &loaded.findings, false)
                );
            }
            assert!(loaded.is_accepted() || loaded.contour.events.is_empty());
            count += 1;
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert!(count >= 40, "{count} programs");
}
