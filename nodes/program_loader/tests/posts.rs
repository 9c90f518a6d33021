//! Programs in the form in which CAM systems and other programs post them (`tests/posts`): each is read as it is, or
//! refused for a reason on which its owner can act.

#[path = "common/mod.rs"]
mod common;

use common::profile;
use program_loader::{LoadOptions, load};
use std::collections::BTreeMap;
use std::path::Path;

/// The first error of those that are refused, and its help.
const REFUSED: &[(&str, &str, &str)] = &[
    ("vectric_mach", "G71 without Q", "meant for inches and millimetres, write G20 and G21"),
    (
        "hsmworks_haas",
        "M97 is not supported",
        "write the block where it is called, or call a subroutine with M98 or o10 call",
    ),
];

#[test]
fn posts_are_read_as_they_are_or_refused_with_what_to_do() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/posts");
    let mut refused: BTreeMap<&str, _> =
        REFUSED.iter().map(|&(name, message, help)| (name, (message, help))).collect();
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("tests/posts") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().and_then(|it| it.to_str()).expect("a name").to_owned();
        let text = std::fs::read(&path).expect("a file");
        let loaded = load(&text, &profile("rs274"), &LoadOptions::default());
        let first = loaded.findings.iter().find(|it| it.is_error());
        match (first, refused.remove(name.as_str())) {
            (None, None) => assert!(!loaded.contour.events.is_empty(), "{name}"),
            (Some(found), Some((message, help))) => {
                assert!(found.message.contains(message), "{name}: {}", found.message);
                assert!(found.help.contains(help), "{name}: {}", found.help);
            }
            (found, wanted) => panic!("{name}: {found:?}, {wanted:?}"),
        }
        count += 1;
    }
    assert!(count >= 25 && refused.is_empty(), "{count} files; {refused:?} are not there");
}
