//! One core's new output feeds the next.

use crate::bag::{Form, TestBag, golden};
use crate::replay;
use crate::support::{Folder, Ran};
use cnc_msgs::chunk::{crc32, sha256_hex};
use cnc_msgs::wire::cnc_msgs::msg as wire;

const BAG: &str = "sinumerik_840c_contour";

/// Replays the bag with another text than was loaded.
#[track_caller]
fn with_text(from: &str, to: &str, more: &[&str]) -> Ran {
    let folder = Folder::new();
    let path = folder.path().join("bag");
    let mut bag = TestBag::golden(BAG);
    let mut text = Vec::new();
    bag.change(|chunk: &mut wire::ProgramChunk| {
        let old = String::from_utf8(chunk.data.clone()).expect("a text");
        assert!(old.contains(from), "{old}");
        chunk.data = old.replace(from, to).into_bytes();
        chunk.crc32 = crc32(&chunk.data);
        text.clone_from(&chunk.data);
        true
    });
    bag.change(|program: &mut wire::Program| {
        program.sha256 = sha256_hex(&text);
        program.size = text.len() as u64;
        true
    });
    bag.write(&path, Form::OURS);
    replay(&path, more)
}

/// The row of counts of a level.
fn row<'a>(ran: &'a Ran, level: &str) -> &'a str {
    let is_of = |line: &&str| line.trim_start().starts_with(level);
    ran.out.lines().find(is_of).unwrap_or_else(|| panic!("no {level} in {}", ran.out))
}

#[test]
fn what_is_reproduced_alone_is_reproduced_in_a_chain() {
    let bags = std::fs::read_dir(golden("")).expect("bags/");
    let bags = bags.map(|entry| entry.expect("an entry").path()).filter(|path| path.is_dir());
    let mut count = 0;
    for bag in bags {
        let alone = replay(&bag, &[]);
        let chain = replay(&bag, &["--chain"]).expect(alone.status);
        assert_eq!(chain.out, alone.out);
        count += usize::from(alone.status == 0);
    }
    assert!(count > 5, "{count}");
}

#[test]
fn a_change_in_one_core_reaches_the_others_in_a_chain_only() {
    let alone = with_text("F400", "F500", &[]).expect(1);
    assert!(!row(&alone, "loader").contains(" 0 differences"), "{}", alone.out);
    for level in ["planner", "driver"] {
        assert!(row(&alone, level).contains(" 0 differences"), "{}", alone.out);
    }
    let chain = with_text("F400", "F500", &["--chain"]).expect(1);
    for level in ["loader", "planner", "driver"] {
        assert!(!row(&chain, level).contains(" 0 differences"), "{}", chain.out);
    }
    // The answers are to other lines: the lines are compared, and bytes in time are not.
    let chain = chain.says(&["F400", "is \"", "F500", "the controller answered other lines"]);
    assert!(!row(&chain, "driver").contains("transmissions"), "{}", chain.out);
    // As far as it is asked for.
    let planner = with_text("F400", "F500", &["--chain", "--level", "planner"]).expect(1);
    assert!(!planner.out.contains("driver:"), "{}", planner.out);
    row(&planner, "loader");
}

#[test]
fn what_is_not_sent_otherwise_is_played_all_the_same() {
    // One more comment: another text, the same contour at other columns.
    let ran = with_text("N20 ", "N20  ", &["--chain"]);
    assert!(row(&ran, "driver").contains("transmissions"), "{}", ran.out);
    assert!(row(&ran, "driver").contains(" 0 differences"), "{}", ran.out);
}

#[test]
fn a_program_that_is_refused_now_leaves_nothing_to_plan_or_to_run() {
    let ran = with_text("G41", "G99", &["--chain"]).expect(1).says(&[
        "was accepted and is refused now",
        "the loader refuses its program now",
        "it was run, and is no longer made",
    ]);
    assert!(!ran.out.contains("reproduced"), "{}", ran.out);
}
