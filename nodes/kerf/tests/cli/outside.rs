//! Files that the command reads and writes: special files, endless texts, and names with control
//! characters.

use super::said;
use crate::support::{Folder, Ran, TOOLS, kerf, run};
use std::ffi::OsString;
use std::fs;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{MetadataExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

fn fifo(folder: &Folder, name: &str) -> PathBuf {
    let path = folder.path().join(name);
    assert!(Command::new("mkfifo").arg(&path).status().expect("mkfifo").success());
    path
}

/// 2 GB without a block on the disk.
fn hole(folder: &Folder, name: &str) {
    let file = fs::File::create(folder.path().join(name)).expect("made");
    file.set_len(2 << 30).expect("a hole");
}

#[test]
fn what_is_no_file_or_too_large_is_refused_before_it_is_read() {
    let folder = Folder::new();
    fifo(&folder, "fifo");
    hole(&folder, "large");
    folder.file("ok.ngc", "G21 G90\nG0 X1\nM30\n");
    fs::create_dir(folder.path().join("bag")).expect("made");
    fifo(&folder, "bag/run_0.mcap");
    fs::create_dir(folder.path().join("other")).expect("made");
    fifo(&folder, "other/metadata.yaml");
    let table: &[(&[&str], &str)] = &[
        (&["plan", "fifo"], "fifo: it is a named pipe (FIFO); a regular file is needed"),
        (&["plan", "/dev/zero"], "/dev/zero: it is a device"),
        (&["plan", "/dev/stdin"], "/dev/stdin: it is a device"),
        (&["plan", "."], "it is a folder"),
        (&["plan", "large"], "large: it has 2147483648 bytes; at most 536870912 are read"),
        (&["check", "fifo"], "named pipe"),
        (&["plan", "ok.ngc", "--tools", "fifo"], "named pipe"),
        (&["plan", "ok.ngc", "--tools", "/dev/zero"], "it is a device"),
        (&["plan", "ok.ngc", "--tools", "large"], "2147483648 bytes; at most 4194304"),
        (&["plan", "ok.ngc", "--control", "./fifo"], "named pipe"),
        (&["plan", "ok.ngc", "--control", "/dev/zero"], "it is a device"),
        (&["load", "fifo"], "named pipe"),
        (&["load", "/dev/zero"], "it is a device"),
        (&["load", "large"], "2147483648 bytes"),
        (&["run", "fifo"], "named pipe"),
        (&["bag", "info", "fifo"], "fifo"),
        (&["bag", "info", "bag"], "named pipe"),
        (&["bag", "info", "other"], "named pipe"),
        (&["replay", "fifo"], "fifo"),
        (&["up", "--config", "fifo"], "named pipe"),
        (&["up", "--config", "/dev/zero"], "it is a device"),
        (&["node", "virtual_controller", "--scenario", "fifo"], "named pipe"),
        (&["node", "program_loader", "--ros-args", "--params-file", "fifo"], "named pipe"),
    ];
    for (args, says) in table {
        let ran = said(&folder, args);
        assert!(ran.status != 0, "{args:?}: {ran:?}");
        ran.says(&[says]);
    }
}

#[test]
fn yaml_beyond_any_real_file_is_refused_before_it_is_parsed() {
    let folder = Folder::new();
    folder.file("ok.ngc", "G21 G90\nG0 X1\nM30\n");
    folder.file("deep.yaml", "[".repeat(80_000));
    folder.file("wide.yaml", "? ".repeat(4_000_000));
    folder.file("tokens.yaml", "? ".repeat(1_000_000));
    for (flag, file, says) in [
        (
            "--control",
            "./deep.yaml",
            "./deep.yaml:1:50: lists and maps are nested more than 48 deep",
        ),
        ("--tools", "deep.yaml", "deep.yaml:1:50: lists and maps are nested more than 48 deep"),
        ("--control", "./wide.yaml", "8000000 bytes; at most 4194304"),
        ("--tools", "wide.yaml", "8000000 bytes; at most 4194304"),
        ("--tools", "tokens.yaml", "lists and maps are nested"),
    ] {
        said(&folder, &["plan", "ok.ngc", flag, file]).expect(2).says(&[says]);
    }
}

/// All that is in a folder, with its bytes; of what is no file, its kind.
fn contents(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found: Vec<_> = fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| {
            let path = entry.expect("an entry").path();
            let kind = fs::symlink_metadata(&path).expect("there");
            let content = match kind.is_file() {
                true => String::from_utf8_lossy(&fs::read(&path).expect("read")).into_owned(),
                false => format!("{:?}", kind.file_type()),
            };
            (path, content)
        })
        .collect();
    found.sort();
    found
}

#[test]
fn only_files_that_kerf_wrote_are_overwritten() {
    let folder = Folder::new();
    let at = |name: &str| folder.path().join(name);
    folder.file("part.ngc", "G21 G90\nG0 X1\nM30\n");
    folder.file("tools.yaml", fs::read_to_string(TOOLS).expect("tools"));
    folder.file("other.svg", "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\"></svg>");
    folder.file("other.html", "<!DOCTYPE html>\n<html lang=\"en\">\n<p>mine</p>");
    fs::hard_link(at("part.ngc"), at("hard.svg")).expect("a link");
    symlink("part.ngc", at("soft.svg")).expect("a link");
    symlink("nowhere", at("dangling.svg")).expect("a link");
    symlink("/dev/null", at("null.svg")).expect("a link");
    fifo(&folder, "fifo.svg");
    fs::create_dir(at("folder.svg")).expect("made");
    let before = contents(folder.path());
    let table = [
        ("part.ngc", "is an input of this command"),
        ("./part.ngc", "is an input of this command"),
        ("hard.svg", "is an input of this command"),
        ("soft.svg", "is an input of this command"),
        ("tools.yaml", "is an input of this command"),
        ("other.svg", "is not a picture or page of Kerf"),
        ("other.html", "is not a picture or page of Kerf"),
        ("dangling.svg", "is a link that leads nowhere"),
        ("fifo.svg", "named pipe"),
        ("folder.svg", "it is a folder"),
        ("null.svg", "it is a device"),
        ("/dev/null", "it is a device"),
        ("/dev/stdout", "the standard output of this command"),
        ("/dev/fd/2", "the standard output of this command"),
        ("no/such/folder.svg", "cannot write no/such/folder.svg: No such file"),
    ];
    for flag in ["--svg", "--html"] {
        for (file, says) in table {
            let args = ["plan", "part.ngc", "--tools", "tools.yaml", "--json", flag, file];
            said(&folder, &args).expect(2).says(&[says]);
            assert_eq!(contents(folder.path()), before, "{flag} {file}");
        }
    }
    for (svg, html) in [("same", "same"), ("same", "./same"), ("same", "folder.svg/../same")] {
        let args = ["plan", "part.ngc", "--tools", "tools.yaml", "--svg", svg, "--html", html];
        said(&folder, &args).expect(2).says(&["is named twice as an output of this command"]);
        assert_eq!(contents(folder.path()), before, "{svg} {html}");
    }
    assert!(!fs::metadata("/dev/null").expect("there").is_file());
}

#[test]
fn what_kerf_wrote_is_replaced_whole() {
    let folder = Folder::new();
    let at = |name: &str| folder.path().join(name);
    folder.file("a.ngc", "G21 G90\nG0 X1\nM30\n");
    folder.file("b.ngc", "G21 G90\nG0 X2\nM30\n");
    folder.file("empty.svg", "");
    symlink("page.html", at("link.html")).expect("a link");
    let plan = |program: &str, flag: &str, file: &str| {
        said(&folder, &["plan", program, flag, file]).expect(0);
        fs::read_to_string(at(file)).expect("written")
    };
    for (flag, file) in [("--svg", "picture.svg"), ("--svg", "empty.svg"), ("--html", "page.html")]
    {
        let first = plan("a.ngc", flag, file);
        let inode = fs::metadata(at(file)).expect("there").ino();
        let second = plan("b.ngc", flag, file);
        assert_ne!(first, second, "{file}");
        // A reader that had it open still has the first one.
        assert_ne!(fs::metadata(at(file)).expect("there").ino(), inode);
    }
    plan("a.ngc", "--html", "link.html");
    assert!(fs::symlink_metadata(at("link.html")).expect("there").is_symlink());
    assert!(fs::read_to_string(at("page.html")).expect("there").contains("a.ngc"));
    let left = contents(folder.path());
    assert!(left.iter().all(|(path, _)| !path.display().to_string().contains(".partial")));
}

#[test]
fn a_report_never_replaces_a_file_of_the_bag() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/sinumerik_840c_contour");
    let folder = Folder::new();
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).expect("made");
    let mut mcap = None;
    for entry in fs::read_dir(&golden).expect("a golden bag") {
        let from = entry.expect("an entry").path();
        let name = from.file_name().expect("a name");
        fs::copy(&from, bag.join(name)).expect("copied");
        if from.extension().is_some_and(|it| it == "mcap") {
            mcap = Some(format!("bag/{}", name.display()));
        }
    }
    let mcap = mcap.expect("an .mcap file");
    let before = contents(&bag);
    for (target, says) in
        [("bag/metadata.yaml", "not a picture or page"), (&mcap, "is not overwritten")]
    {
        said(&folder, &["bag", "report", "bag", target]).expect(2).says(&[says]);
        said(&folder, &["replay", "bag", "--html", target]).expect(2).says(&[says]);
        assert_eq!(contents(&bag), before, "{target}");
    }
    said(&folder, &["bag", "report", "bag", "page.html"]).expect(0);
    said(&folder, &["bag", "report", "bag", "page.html"]).expect(0);
}

#[test]
fn a_demo_overwrites_no_other_files() {
    let folder = Folder::new();
    let mine = folder.file("contour.mpf", "my own\n");
    said(&folder, &["demo", "--out", "."])
        .expect(2)
        .says(&["contour.mpf: another file exists there"]);
    assert_eq!(fs::read_to_string(mine).expect("there"), "my own\n");
}

#[test]
fn an_argument_that_is_not_utf_8_is_an_error() {
    let folder = Folder::new();
    let word = || OsString::from_vec(b"part\xff.ngc".to_vec());
    fs::write(folder.path().join(word()), "G0 X1\n").expect("written");
    for words in [
        &["plan"][..],
        &["load"],
        &["up", "--config"],
        &["node", "program_loader"],
        &["node", "axis_driver", "--ros-args", "-p"],
        &["node", "virtual_controller", "--scenario"],
        &["bag", "info"],
        &["status", "--ros-args"],
    ] {
        let ran = run(kerf().current_dir(folder.path()).args(words).arg(word()));
        ran.expect(2).says(&["kerf: argument", "(\"part\u{fffd}.ngc\") is not UTF-8"]);
    }
}

/// Nothing in it controls a terminal; color is off without a terminal.
#[track_caller]
fn is_plain(ran: &Ran) {
    for text in [&ran.out, &ran.err] {
        let bad = text.chars().find(|letter| letter.is_control() && *letter != '\n');
        assert_eq!(bad, None, "{text:?}");
    }
}

#[test]
fn a_name_and_a_program_that_steer_terminals_are_shown_as_text() {
    let folder = Folder::new();
    let name = "a\x1b[2J\x07\u{1}\nb\u{9b}.ngc";
    folder.file(name, "G21\nG1 X\x1b]0;pwned\x07 \u{9b}2J F100\n(\x1b[31m)\nM30\n");
    for args in [
        &["plan", name, "--svg", "picture.svg", "--html", "page.html"][..],
        &["plan", name, "--json"],
        &["check", name],
        &["plan", "no\x1b[2J.ngc"],
        &["plan", name, "--control", "no\x1b[2J"],
        &["plan", name, "--tools", "no\x1b[2J.yaml"],
        &["bag", "info", name],
        &["node", "no\x1b[2J"],
        &["node", "axis_driver", "no\x1b[2J"],
    ] {
        is_plain(&said(&folder, args));
    }
    let json = said(&folder, &["plan", name, "--json"]).out;
    serde_json::from_str::<serde_json::Value>(&json).expect("still JSON");
    for file in ["picture.svg", "page.html"] {
        let text = fs::read_to_string(folder.path().join(file)).expect("written");
        let bad = text.chars().find(
            |letter| !matches!(letter, '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'..),
        );
        assert_eq!(bad, None, "{file}");
    }
}

#[test]
fn a_stack_refuses_parameters_that_no_node_has() {
    let folder = Folder::new();
    let file = |name: &str, section: &str, key: &str| {
        folder.file(name, format!("{section}:\n  ros__parameters:\n    {key}: x\n"));
    };
    file("node.yaml", "/**/axis_drvier", "port");
    file("key.yaml", "/**", "frame_idd");
    let table: &[(&[&str], &str)] = &[
        (
            &["up", "--config", "node.yaml"],
            "node.yaml:1: there is no node \"axis_drvier\"; did you mean \"axis_driver\"?",
        ),
        (
            &["up", "--config", "key.yaml"],
            "key.yaml:3: parameter \"frame_idd\" belongs to no node; did you mean \"frame_id\"?",
        ),
        (
            &["node", "axis_driver", "--ros-args", "--params-file", "node.yaml"],
            "node.yaml:1: there is no node \"axis_drvier\"; did you mean \"axis_driver\"?",
        ),
    ];
    for (args, says) in table {
        said(&folder, args).expect(2).says(&[says]);
    }
}
