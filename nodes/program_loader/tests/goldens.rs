//! Whole programs with their contours in files next to them. `UPDATE_EXPECT=1` rewrites them.

mod common;

use common::profile;
use expect_test::expect_file;
use program_loader::{LoadOptions, canonical, load, render};
use settings::Control;
use std::path::Path;

#[test]
fn programs_give_the_contours_of_their_golden_files() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs");
    let mut count = 0;
    for control in Control::ALL {
        let profile = profile(control.name());
        let folder = folder.join(control.name());
        let entries = std::fs::read_dir(&folder)
            .unwrap_or_else(|error| panic!("programs of a control, {}: {error}", folder.display()));
        let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
        paths.sort();
        for path in paths.iter().filter(|path| path.extension().is_none_or(|end| end != "txt")) {
            let bytes = std::fs::read(path).expect("a program");
            let loaded = load(&bytes, &profile, &LoadOptions::default());
            let text = String::from_utf8_lossy(&bytes);
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let mut seen = canonical::text(&loaded.contour);
            if let Some(bounds) = loaded.bounds {
                seen += &format!(
                    "bounds {:.3?} {:.3?} {}\n",
                    bounds.min,
                    bounds.max,
                    bounds.axes.letters()
                );
            }
            seen += &render::render(&name, &text, &loaded.findings, false);
            expect_file![path.with_extension("txt")].assert_eq(&seen);
            count += 1;
        }
    }
    assert!(count >= 12, "{count} programs");
}
