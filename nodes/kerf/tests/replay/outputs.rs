//! The outputs of replay overwrite no other file.

use crate::bag::{files, golden};
use crate::replay;
use crate::support::{Folder, kerf, run};
use std::fs;

const BAG: &str = "nct_offsets";

#[test]
fn out_is_never_written_over_a_file() {
    let folder = Folder::new();
    let bytes = fs::read(files(&golden(BAG)).remove(0)).expect("a golden bag");
    let bag = folder.file("over.mcap", &bytes);
    let here = folder.path().display().to_string();
    // The bag itself.
    replay(&bag, &["--out", &here])
        .expect(2)
        .says(&["over.mcap already exists and is not overwritten"]);
    assert!(fs::read(&bag).expect("it is still there") == bytes);
    // What was written before.
    let out = folder.path().join("out").display().to_string();
    replay(&bag, &["--out", &out]).expect(0);
    let written = fs::read(folder.path().join("out/over.mcap")).expect("it was written");
    replay(&golden(BAG), &["--out", &out]).expect(0);
    replay(&bag, &["--out", &out])
        .expect(2)
        .says(&["out/over.mcap already exists and is not overwritten"]);
    assert!(fs::read(folder.path().join("out/over.mcap")).expect("it stays") == written);
}

#[test]
fn bags_of_one_name_are_not_written_over_each_other() {
    let folder = Folder::new();
    let bytes = fs::read(files(&golden(BAG)).remove(0)).expect("a golden bag");
    for name in ["a", "b", "run.1", "run.2"] {
        fs::create_dir(folder.path().join(name)).expect("a folder");
        fs::write(folder.path().join(name).join("run.mcap"), &bytes).expect("a bag");
    }
    let replayed = |bags: [&str; 2], out: &str| {
        run(kerf()
            .arg("replay")
            .args(bags)
            .args(["--level", "planner", "--out", out])
            .current_dir(folder.path()))
    };
    replayed(["a/run.mcap", "b/run.mcap"], "one").expect(2).says(&["a/run.mcap and b/run.mcap"]);
    assert!(!folder.path().join("one").exists(), "it was refused before anything was done");
    // A dot and what follows it are part of a folder's name.
    replayed(["run.1", "run.2"], "two").expect(0);
    for name in ["run.1.mcap", "run.2.mcap"] {
        assert!(folder.path().join("two").join(name).exists(), "{name}");
    }
}
