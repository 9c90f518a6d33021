//! `kerf bag` on damaged bags, on files that are not bags, and on marked bags.

use super::said;
use crate::support::Folder;
use std::fs;
use std::path::{Path, PathBuf};

/// A golden bag, and its one file.
fn golden() -> (PathBuf, Vec<u8>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/sinumerik_840c_contour");
    let mut files = fs::read_dir(&folder).expect("golden bags").map(|entry| entry.unwrap().path());
    let file = files.find(|file| file.extension().is_some_and(|it| it == "mcap"));
    (folder, fs::read(file.expect("an .mcap file")).expect("a file"))
}

/// Where the chunk of messages begins, after the records that precede it.
fn first_chunk(bytes: &[u8]) -> usize {
    let mut at = 8;
    while bytes[at] != 0x06 {
        at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    at
}

#[test]
fn a_damaged_bag_ends_with_2_and_names_the_record() {
    let folder = Folder::new();
    let (_, whole) = golden();
    let chunk = first_chunk(&whole);
    let changed = |at: usize, by: &[u8]| {
        let mut bytes = whole.clone();
        bytes[at..at + by.len()].copy_from_slice(by);
        bytes
    };
    let longer = [&whole[..], b"and something behind it"].concat();
    let cut = format!("cut.mcap: the record at byte {chunk} claims");
    let edge = format!("edge.mcap ends at byte {chunk} without a footer");
    let chunk_is = |name: &str| format!("{name}.mcap: the chunk at byte {chunk} is damaged");
    let (flipped, method) = (chunk_is("flipped"), chunk_is("method"));
    // The index shows it before the chunk is read.
    let huge = chunk_is("huge");
    let table: &[(&str, Vec<u8>, &str)] = &[
        ("cut.mcap", whole[..chunk + 50].to_vec(), &cut),
        ("edge.mcap", whole[..chunk].to_vec(), &edge),
        ("flipped.mcap", changed(chunk + 200, &[!whole[chunk + 200]]), &flipped),
        // The name of the compression.
        ("method.mcap", changed(chunk + 9 + 32, b"zzzz"), &method),
        ("huge.mcap", changed(chunk + 1, &[0xff; 8]), &huge),
        ("longer.mcap", longer, "longer.mcap: there is data after the footer at byte"),
    ];
    for (name, bytes, says) in table {
        folder.file(name, bytes);
        let info = said(&folder, &["bag", "info", name]).expect(2).says(&[says]);
        assert!(info.out.contains("complete:    no"), "{name}: {}", info.out);
        // Readable messages are copied, and the damage is reported.
        let saved = format!("saved_{name}");
        said(&folder, &["bag", "recover", name, &saved]).expect(0).says(&[says, "messages"]);
        said(&folder, &["bag", "info", &saved]).expect(1).says(&[says]);
        // The page shows what is readable; the status is an error in any case.
        said(&folder, &["bag", "report", name, "page.html"]).expect(2);
    }
}

#[test]
fn a_file_that_is_not_an_mcap_bag_ends_with_2_and_its_name() {
    let folder = Folder::new();
    let jpeg: Vec<u8> = [0xff, 0xd8, 0xff, 0xe0, 0, 0x10]
        .into_iter()
        .chain(*b"JFIF\0\x01\x01")
        .chain((0..9000_u32).map(|n| (n * n % 253) as u8))
        .collect();
    folder.file("photo.jpg", &jpeg);
    folder.file("photo.mcap", &jpeg);
    folder.file("old.bag", b"#ROSBAG V2.0\nE\0\0\0\x08\0\0\0chunk_pos=");
    folder.file("bag.db3", b"SQLite format 3\0\x10\0\x01\x01\0@  ");
    for (name, file) in [("pictures", "photo.mcap"), ("no_bag", "notes.txt")] {
        fs::create_dir(folder.path().join(name)).expect("a folder");
        fs::write(folder.path().join(name).join(file), &jpeg).expect("a file");
    }
    let listed = "rosbag2_bagfile_information:\n  relative_file_paths: [\"../../etc/passwd\"]\n";
    fs::create_dir(folder.path().join("astray")).expect("a folder");
    fs::write(folder.path().join("astray/metadata.yaml"), listed).expect("a file");
    let no_mcap = "is not a bag (MCAP file)";
    for (path, says) in [
        ("photo.jpg", "photo.jpg is not a bag (MCAP file)"),
        ("photo.mcap", no_mcap),
        ("old.bag", no_mcap),
        ("bag.db3", no_mcap),
        ("pictures", "pictures/photo.mcap is not a bag (MCAP file)"),
        ("no_bag", "no_bag holds no .mcap file"),
        ("astray", "astray/metadata.yaml names passwd, which does not exist"),
    ] {
        said(&folder, &["bag", "info", path]).expect(2).says(&[says]);
        said(&folder, &["bag", "recover", path, "out"]).expect(2).says(&[says]);
        said(&folder, &["bag", "report", path, "out.html"]).expect(2).says(&[says]);
        for made in ["out", "out.html"] {
            assert!(!folder.path().join(made).exists(), "{path} leaves {made}");
        }
    }
}

#[test]
fn a_bag_is_marked_and_info_says_so() {
    let folder = Folder::new();
    let (_, bytes) = golden();
    fs::create_dir(folder.path().join("run")).expect("a folder");
    fs::write(folder.path().join("run/run_0.mcap"), bytes).expect("a file");
    let info = || said(&folder, &["bag", "info", "run"]).out;
    assert!(!info().contains("kept:"));
    said(&folder, &["bag", "mark", "run", "--because", "alarm 3021"]).expect(0).says(&["is kept"]);
    assert!(info().contains("kept:        alarm 3021\n"), "{}", info());
    let json = said(&folder, &["bag", "info", "run", "--json"]).out;
    assert!(json.contains("\"kept\": \"alarm 3021\""), "{json}");
    said(&folder, &["bag", "mark", "run"]).expect(0);
    assert!(info().contains("kept:        yes\n"), "{}", info());
    said(&folder, &["bag", "mark", "run", "--unmark"]).expect(0).says(&["no longer marked"]);
    assert!(!info().contains("kept:"));
    said(&folder, &["bag", "mark", "run", "--unmark"]).expect(0).says(&["was not marked"]);
    for (none, says) in [
        ("gone", "gone: it does not exist"),
        ("run/run_0.mcap", "it is not a bag directory, which holds .mcap files"),
        (".", "it is not a bag directory"),
    ] {
        said(&folder, &["bag", "mark", none]).expect(2).says(&[says]);
    }
    said(&folder, &["bag", "mark", "run", "--unmark", "--because", "x"]).expect(2);
}
