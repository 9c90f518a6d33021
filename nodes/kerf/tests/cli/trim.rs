//! `kerf bag trim`: small bags that replay as the large ones do.

use super::said;
use super::support::Folder;
use run_recorder::files::open_bag;
use std::collections::BTreeMap;
use std::path::Path;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bags/sinumerik_840c_contour");

/// Messages by topic.
fn topics(bag: &Path) -> BTreeMap<String, u64> {
    let mut bag = open_bag(bag).expect("a bag");
    bag.verify().expect("it can be read");
    assert!(bag.is_complete(), "{:?}", bag.problems());
    bag.channels().iter().map(|channel| (channel.topic.clone(), channel.message_count)).collect()
}

#[test]
fn a_bag_is_cut_down_to_what_replay_needs() {
    let folder = Folder::new();
    said(&folder, &["bag", "trim", GOLDEN, "small"])
        .expect(0)
        .says(&["small: ", "replay result as before: reproduced"]);
    let (all, small) = (topics(GOLDEN.as_ref()), topics(&folder.path().join("small")));
    for left_out in ["/tf", "/diagnostics", "/rosout", "/markers", "/joint_states"] {
        assert!(all.contains_key(left_out) && !small.contains_key(left_out), "{left_out}");
    }
    for kept in ["/commands", "/compensated_path/chunks", "/node_parameters", "/program"] {
        assert_eq!(small[kept], all[kept], "{kept}");
    }
    said(&folder, &["replay", "small"]).expect(0).says(&["reproduced"]);

    // What is small already stays as it is.
    said(&folder, &["bag", "trim", "small", "smaller"]).expect(0);
    assert_eq!(topics(&folder.path().join("smaller")), small);
    said(&folder, &["bag", "trim", GOLDEN, "with_tf", "--keep", "/tf"]).expect(0);
    let with_tf = topics(&folder.path().join("with_tf"));
    assert_eq!((with_tf.len(), with_tf["/tf"]), (small.len() + 1, all["/tf"]));
}

#[test]
fn what_cannot_be_trimmed_is_named() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("there")).expect("a folder");
    let cases: [(&[&str], &str); 4] = [
        (&[GOLDEN, "there"], "there"),
        (&["nothing", "out"], "nothing"),
        (&[GOLDEN, "out", "--keep", "/no_such_topic"], "/no_such_topic"),
        (&["there", "out"], "there"),
    ];
    for (args, name) in cases {
        said(&folder, &[&["bag", "trim"], args].concat()).expect(2).says(&[name]);
        assert!(!folder.path().join("out").exists(), "{args:?}");
    }
}
