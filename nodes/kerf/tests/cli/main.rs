//! The command line: exit status and what is said, for good input and bad.

mod bags;
mod fleet;
mod machine;
mod outside;
mod plan_json;
#[path = "../support/mod.rs"]
mod support;
mod trim;

use serde_json::Value;
use support::{CONTOUR, Folder, Ran, TOOLS, kerf, run};

/// Runs `kerf` in a folder.
#[track_caller]
fn said(folder: &Folder, args: &[&str]) -> Ran {
    run(kerf().current_dir(folder.path()).args(args))
}

/// A program, and how `kerf plan` ends on it and what it says.
struct BadProgram {
    name: &'static str,
    content: Vec<u8>,
    status: i32,
    says: &'static [&'static str],
}

fn bad_programs() -> Vec<BadProgram> {
    let row = |name, content: &[u8], status, says| BadProgram {
        name,
        content: content.to_vec(),
        status,
        says,
    };
    let binary: Vec<u8> = (0..3000_u32).map(|n| (n * n % 251) as u8).collect();
    let long = format!("G1 X{}\n", "1".repeat(10_000_000)).into_bytes();
    vec![
        row(
            "binary.ngc",
            &binary,
            1,
            &["error[syntax]: byte 0x00: this is not the text of a part program", "binary.ngc:1:1"],
        ),
        row("empty.ngc", b"", 0, &["warning[missing_word]", "no blocks", "--> empty.ngc"]),
        row("blank.ngc", b"\n\n(nothing)\n", 0, &["warning[missing_word]", "no blocks"]),
        row(
            "long.ngc",
            &long,
            1,
            &[
                "error[limit]: the line has 10000004 bytes; at most 4096 are accepted",
                "long.ngc:1:1",
            ],
        ),
        row(
            "nan.ngc",
            b"G21\nG1 XNaN F100\n",
            1,
            &["error[bad_number]", "nan.ngc:2:4", "no number"],
        ),
        row(
            "1e400.ngc",
            b"G21\nG1 X1e400 F100\n",
            1,
            &["error[bad_number]", "1e400.ngc:2:4", "has an exponent", "write the number out"],
        ),
        row(
            "1e5.ngc",
            b"G21\nG1 X1e5 F100\n",
            1,
            &["error[bad_number]", "1e5.ngc:2:4", "has an exponent", "100000 instead of 1e5"],
        ),
        row(
            "word.ngc",
            b"G21\nG99.7 X1\nM30\n",
            1,
            &["error[unknown_word]: rs274 has no word G99.7", "word.ngc:2:1"],
        ),
        row(
            "arc.ngc",
            b"G21 G17\nG0 X0 Y0\nG2 X10 Y10 I3 J0 F100\nM30\n",
            1,
            &["error[arc_radius]", "arc.ngc:3:1", "3.000 mm at its start", "12.207 mm at its end"],
        ),
    ]
}

#[test]
fn a_bad_program_is_refused_with_its_place_and_what_to_do() {
    let folder = Folder::new();
    for BadProgram { name, content, status, says } in bad_programs() {
        folder.file(name, content);
        let ran = said(&folder, &["plan", name]).expect(status).says(says);
        assert_eq!(ran.out.contains("refused"), status == 1, "{name}: {}", ran.out);
        assert!(ran.err.len() < 100_000, "{name} makes {} bytes of findings", ran.err.len());
        // Scripts get the same verdict.
        let ran = said(&folder, &["plan", name, "--json"]).expect(status);
        let report: Value = serde_json::from_str(&ran.out).expect("one JSON object");
        assert_eq!(report["accepted"], status == 0, "{name}");
        assert_eq!(report["elements"], serde_json::json!([]), "{name}");
    }
}

#[test]
fn unreadable_files_and_wrong_arguments_end_with_2() {
    let folder = Folder::new();
    folder.file("ok.ngc", "G0 X1\nM30\n");
    folder.file("unknown_key.yaml", "tools:\n  1: {diameter_mm: 10.0, colour: 3}\n");
    folder.file("wrong_type.yaml", "tools:\n  1:\n    diameter_mm: wide\n");
    folder.file("negative.yaml", "tools:\n  1: {diameter_mm: 5.0}\n  2:\n    diameter_mm: -5.0\n");
    folder.file("nan.yaml", "offsets:\n  1: {radius_mm: 1.0}\n  3: {radius_mm: .nan}\n");
    folder.file("list.yaml", "- 1\n");
    folder.file("rows.yaml", "tools: [10, 12]\n");
    folder.file("scenario.yaml", "firmware: foo\n");
    folder.file("broken.yaml", "name: mine\nlanguage: 5\n");
    std::fs::create_dir(folder.path().join("there")).expect("a folder");
    let table: &[(&[&str], &[&str])] = &[
        (&["plan", "none.ngc"], &["cannot read none.ngc: No such file"]),
        (&["plan", "there"], &["cannot read there: it is a folder"]),
        (&["plan"], &["<FILE>", "Usage"]),
        (&["plan", "ok.ngc", "--json", "--quiet"], &["--quiet"]),
        (
            &["plan", "ok.ngc", "--control", "fanuc"],
            &["no control \"fanuc\"", "rs274, sinumerik_840c", "YAML file"],
        ),
        (&["plan", "ok.ngc", "--controller", "masso"], &["--controller is called --control now"]),
        (&["plan", "--controller=masso", "ok.ngc"], &["--controller is called --control now"]),
        (&["check", "ok.ngc", "--all-controllers"], &["is called --all-controls now"]),
        (&["plan", "ok.ngc", "--control", "./broken.yaml"], &["./broken.yaml:2:11: language"]),
        (&["plan", "ok.ngc", "--control", "./no.yaml"], &["cannot read ./no.yaml: No such file"]),
        (
            &["plan", "ok.ngc", "--tools", "unknown_key.yaml"],
            &["unknown_key.yaml:2:26: tools.1: unknown field `colour`", "diameter_mm"],
        ),
        (
            &["plan", "ok.ngc", "--tools", "wrong_type.yaml"],
            &["wrong_type.yaml:3:18: tools.1.diameter_mm", "\"wide\""],
        ),
        (
            &["plan", "ok.ngc", "--tools", "negative.yaml"],
            &["negative.yaml:4: diameter of T2 is -5 mm", "wear_diameter_mm"],
        ),
        (&["plan", "ok.ngc", "--tools", "nan.yaml"], &["nan.yaml:3: radius_mm of D3 is NaN"]),
        (&["plan", "ok.ngc", "--tools", "list.yaml"], &["list.yaml:1:1: not a tool table"]),
        (
            &["plan", "ok.ngc", "--tools", "ok.ngc"],
            &["ok.ngc:1:1: not a tool table; it begins with `tools:` or `offsets:`"],
        ),
        (
            &["plan", "ok.ngc", "--tools", "rows.yaml"],
            &["rows.yaml:1:8: `tools` needs rows such as `1: {diameter_mm: 10.0}`"],
        ),
        (&["plan", "ok.ngc", "--tools", "no.yaml"], &["cannot read no.yaml: No such file"]),
        (&["plan", "ok.ngc", "--machine", "no.yaml"], &["cannot read no.yaml: No such file"]),
        (&["plan", "ok.ngc", "--tools", "there"], &["cannot read there: it is a folder"]),
        (
            &["plan", "ok.ngc", "--subroutines", "nofolder"],
            &["--subroutines: nofolder is not a folder"],
        ),
        (&["check", "ok.ngc", "--subroutines", "ok.ngc"], &["ok.ngc is not a folder"]),
        (&["plan", "ok.ngc", "--probes-touch-at", "200"], &["write a percentage from 0 to 100"]),
        (&["plan", "ok.ngc", "--start-line", "0"], &["write a whole number from 1"]),
        (&["run", "--start-line", "3", "--occurrence", "0"], &["write a whole number from 1"]),
        (&["override", "--feed", "500"], &["write a percentage from 10 to 200"]),
        (&["zero", "X0", "--system", "G60"], &["write G54 to G59.3, or G92"]),
        (
            &["tool", "T1"],
            &["name what changes: --diameter, --wear, --length, --nose-radius or --tip-direction"],
        ),
        (&["plan", "ok.ngc", "--start", "1,2"], &["\"1,2\" is not three numbers X,Y,Z"]),
        (&["plan", "ok.ngc", "--start", "a,b,c"], &["\"a,b,c\" is not three numbers"]),
        (&["plan", "ok.ngc", "--start", "nan,0,0"], &["\"nan,0,0\" is not three numbers"]),
        (&["plan", "ok.ngc", "--start", "1e300,0,0"], &["1e300", "1000000 mm"]),
        (
            &["plan", "ok.ngc", "--svg", "no/such/x.svg"],
            &["cannot write no/such/x.svg: No such file"],
        ),
        (&["bogus"], &["unrecognized subcommand 'bogus'"]),
        (&["up", "--config", "no.yaml"], &["cannot read no.yaml: No such file"]),
        (&["up", "--time-factor", "2"], &["--virtual-controller"]),
        (&["up", "--virtual-controller", "--time-factor", "0"], &["from 0.001 to 10000"]),
        (&["up", "--virtual-controller", "--firmware", "foo"], &["grbl, grblhal or fluidnc"]),
        (&["up", "--virtual-controller", "--axes", "XYQ"], &["write XYZ, then up to three of"]),
        (
            &["up", "--virtual-controller", "--scenario", "no.yaml"],
            &["--scenario: cannot read no.yaml: No such file"],
        ),
        (
            &["up", "--virtual-controller", "--scenario", "scenario.yaml"],
            &["--scenario: scenario.yaml:1:11: ", "unknown firmware `foo`"],
        ),
        (
            &["up", "--ros-args", "-p", "compensation_planner:tool_table:=no.yaml"],
            &["tool_table: cannot read no.yaml: No such file"],
        ),
        (&["up", "--listen", "tcp://127.0.0.1:7023"], &["--virtual-controller"]),
        (&["up", "--virtual-controller", "--listen", "tcp://127.0.0.1:0"], &["names no port"]),
        (&["up", "--virtual-controller", "--listen", "wss://127.0.0.1:1"], &["is not served"]),
        (&["node", "virtual_controller", "--keep-session", "3"], &["--listen"]),
        (&["load", "none.ngc"], &["cannot read none.ngc: No such file"]),
        (&["run", "--control", "masso"], &["<FILE>"]),
    ];
    for (args, says) in table {
        said(&folder, args).expect(2).says(says);
    }
    let kept: Vec<_> = std::fs::read_dir(folder.path())
        .expect("the folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name.contains("partial") || name.contains("svg"))
        .collect();
    assert!(kept.is_empty(), "left behind: {kept:?}");
}

#[test]
fn help_is_there_where_somebody_asks_for_it() {
    let folder = Folder::new();
    for args in [&["--help"][..], &["help"], &["help", "--help"], &["help", "-h"]] {
        said(&folder, args).expect(0).says(&["Usage: kerf", "Compensate a program"]);
    }
    said(&folder, &["help", "plan"]).expect(0).says(&["Usage: kerf plan", "--start-line <LINE>"]);
    for command in ["plan", "run"] {
        let ran = said(&folder, &[command, "--help"]).expect(0);
        assert!(!ran.out.contains("[default: 0]"), "lines count from 1: {}", ran.out);
    }
}

#[test]
fn a_tool_that_does_not_fit_is_refused_with_place_and_numbers() {
    let folder = Folder::new();
    folder.file("big.yaml", "offsets:\n  1: {radius_mm: 25.0}\n");
    let args =
        ["plan", CONTOUR, "--control", "sinumerik_840c", "--tools", "big.yaml", "--svg", "x.svg"];
    let ran = said(&folder, &args).expect(1).says(&[
        "error[unreachable]: the tool (radius 25.000 mm, on the left) does not reach block N40",
        "contour.mpf:5:1",
        "at most 20.851 mm fits",
        "closest at X65.000 Y55.000",
        "25.000 mm needed, 20.851 mm there",
        "contour.mpf: refused by sinumerik_840c",
    ]);
    assert!(ran.err.contains("= help: "), "{}", ran.err);
    // What was refused is drawn all the same.
    let picture = std::fs::read_to_string(folder.path().join("x.svg")).expect("a picture");
    assert!(picture.starts_with("<svg") || picture.starts_with("<?xml"), "{picture:.80}");
}

#[test]
fn what_does_not_fit_is_trimmed_on_demand() {
    let folder = Folder::new();
    let slot = "G21 G90\nT1 M6\nG0 X0 Y20\nG41 G1 X0 Y0 F400\nX40\nY-10\nX44\nY0\nX100\n\
                G40 X100 Y20\nM30\n";
    folder.file("slot.ngc", slot);
    folder.file("tools.yaml", "tools:\n  1: {diameter_mm: 6.0}\n");
    let plan = |more: &[&str], status| {
        let args = ["plan", "slot.ngc", "--tools", "tools.yaml"];
        said(&folder, &[&args[..], more].concat()).expect(status)
    };
    plan(&[], 1);
    plan(&["--interference", "ignore"], 0);
    let trimmed = plan(&["--interference", "trim"], 0);
    assert!(trimmed.out.contains("stay uncut in 1 place"), "{}", trimmed.out);
    let report = plan(&["--interference", "trim", "--json", "--svg", "slot.svg"], 0);
    let report: Value = serde_json::from_str(&report.out).unwrap();
    let region = &report["uncut"][0];
    assert_eq!((region["first_line"].as_u64(), region["last_line"].as_u64()), (Some(6), Some(8)));
    // The slot, without what the tool dips into it.
    let dip = 9.0 * (2.0_f64 / 3.0).asin() - 2.0 * 5.0_f64.sqrt();
    assert!((region["area_mm2"].as_f64().unwrap() - (40.0 - dip)).abs() < 1e-6, "{region}");
    let outline = region["outline"].as_array().unwrap();
    assert_eq!(outline.last().unwrap()["kind"], "arc");
    assert_eq!(outline[0]["start"], outline.last().unwrap()["end"]);
    let picture = std::fs::read_to_string(folder.path().join("slot.svg")).unwrap();
    assert!(picture.contains("class=\"uncut\""), "{picture}");
    // The last word of the legend is within the picture.
    let after = |what: &str| picture.split_once(what).expect(what).1;
    let number = |text: &str| text.split(['"', ' ']).next().and_then(|word| word.parse().ok());
    let view: Vec<f64> =
        after("viewBox=\"").split(['"', ' ']).take(4).map(|n| n.parse().unwrap()).collect();
    let word = picture.rsplit_once(">uncut</text>").expect("the legend").0;
    let at: f64 = number(word.rsplit_once("<text x=\"").expect("its place").1).expect("a number");
    let line: f64 = number(after("font:").split("px").next().unwrap()).expect("a number");
    assert!(at + 5.0 * 0.55 * line < view[0] + view[2], "{at} {line} {view:?}");
    plan(&["--interference", "maybe"], 2);
}

#[test]
fn carets_are_under_the_word_of_the_finding() {
    let folder = Folder::new();
    folder.file("a.ngc", "G21 G90\n(µm) G1 X5 Q12 F100\nM30\n");
    let ran = said(&folder, &["plan", "a.ngc"]).expect(1);
    let lines: Vec<&str> = ran.err.lines().collect();
    let at = lines.iter().position(|line| line.contains("G1 X5 Q12")).expect("the line is shown");
    let column = |line: &str, what| line.chars().take_while(|c| *c != what).count();
    assert_eq!(column(lines[at + 1], '^'), column(lines[at], 'Q'), "{}", ran.err);
    assert_eq!(lines[at + 1].matches('^').count(), "Q12".len(), "{}", ran.err);
    assert!(ran.err.contains("--> a.ngc:2:12"), "{}", ran.err);
    assert!(!ran.err.contains('\u{1b}'), "no colours for a pipe");
}

#[test]
fn a_file_that_is_not_a_bag_is_refused_with_its_name_and_the_reason() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("empty")).expect("a folder");
    folder.file("text.txt", "G0 X1 and some more text that is no bag\n");
    folder.file("empty.mcap", "");
    folder.file("cut.mcap", b"\x89MCAP0\r\n");
    for (path, says) in [
        ("none", "none does not exist"),
        ("empty", "empty holds no .mcap file"),
        ("text.txt", "text.txt is not a bag (MCAP file)"),
        ("empty.mcap", "empty.mcap is empty (0 bytes)"),
        ("cut.mcap", "cut.mcap ends at byte 8, before its header"),
    ] {
        for command in [&["replay"][..], &["bag", "info"]] {
            let ran = said(&folder, &[command, &[path]].concat()).expect(2).says(&[says]);
            assert_eq!(ran.err.matches(path).count(), 1, "named once: {}", ran.err);
        }
        said(&folder, &["bag", "recover", path, "out"]).expect(2).says(&[says]);
        assert!(!folder.path().join("out").exists(), "{path}");
    }
}

#[test]
fn a_node_rejects_unknown_arguments_and_parameters_before_it_starts() {
    let folder = Folder::new();
    let node = "/**/axis_driver:\n  ros__parameters:\n    ";
    folder.file("unknown.yaml", format!("{node}prot: x\n"));
    folder.file("plain.yaml", "axis_driver:\n  ros__parameters:\n    baud: 9600\n    prot: x\n");
    folder.file("wrong.yaml", format!("{node}port: 5\n"));
    folder.file("range.yaml", format!("{node}baud: 3\n"));
    folder.file("broken.yaml", "axis_driver: [\n");
    let table: &[(&[&str], &[&str])] = &[
        (&["nosuch"], &["no node nosuch", "program_loader", "virtual_controller"]),
        (
            &["axis_driver", "--ros-args", "-p", "port:=5"],
            &["-p port:=5", "\"port\"", "5 is an integer, and a string is needed"],
        ),
        (
            &["axis_driver", "--ros-args", "-p", "prot:=x"],
            &["-p prot:=x", "\"prot\" is not one of this node's", "baud", "port"],
        ),
        (
            &["axis_driver", "--ros-args", "--params-file", "unknown.yaml"],
            &["unknown.yaml:3", "\"prot\" is not one of this node's"],
        ),
        (
            &["axis_driver", "--ros-args", "--params-file", "plain.yaml"],
            &["plain.yaml:4", "\"prot\" is not one of this node's"],
        ),
        (
            &["axis_driver", "--ros-args", "--params-file", "wrong.yaml"],
            &["wrong.yaml:3", "a string is needed"],
        ),
        (
            &["axis_driver", "--ros-args", "--params-file", "range.yaml"],
            &["range.yaml:3", "\"baud\"", "1200"],
        ),
        (&["axis_driver", "--ros-args", "--params-file", "broken.yaml"], &["broken.yaml:"]),
        (&["axis_driver", "--ros-args", "--params-file", "no.yaml"], &["no.yaml: No such file"]),
        (&["axis_driver", "--ros-args", "port:=5"], &["port:=5", "-p (parameter)"]),
        (&["axis_driver", "junk"], &["argument \"junk\" is not known"]),
        (&["virtual_controller", "--time-factor", "0"], &["--time-factor", "0.001 to 10000"]),
    ];
    for (args, says) in table {
        said(&folder, &[&["node"], *args].concat()).expect(2).says(says);
    }
}

#[test]
fn without_nodes_a_client_says_so_after_five_seconds() {
    let folder = Folder::new();
    folder.file("ok.ngc", "G0 X1\nM30\n");
    // An unused domain and namespace.
    let ns = format!("__ns:=/nobody_{}", std::process::id());
    let commands: [(&[&str], &str); 6] = [
        (&["status"], "/machine_state"),
        (&["hold"], "/feed_hold"),
        (&["resume"], "/resume"),
        (&["abort"], "/run_program/_action/cancel_goal"),
        (&["load", "ok.ngc"], "/load_program"),
        (&["run"], "/run_program/_action/send_goal"),
    ];
    std::thread::scope(|scope| {
        for (args, says) in commands {
            let (folder, ns) = (folder.path(), &ns);
            scope.spawn(move || {
                let begin = std::time::Instant::now();
                let mut command = kerf();
                command.env("ROS_DOMAIN_ID", "39").current_dir(folder).args(args);
                let ran = run(command.args(["--ros-args", "-r", ns]));
                let took = begin.elapsed().as_secs_f64();
                let ran = ran.expect(3).says(&[&format!("{says} within 5 s. Start the nodes")]);
                assert_eq!(ran.err.lines().count(), 1, "{}", ran.err);
                assert!(took >= 4.9, "kerf {args:?} gave up after {took} s");
            });
        }
    });
}

/// A program for everybody who has D words and G40.
const PORTABLE: &str = "N10 G0 X-50 Y-25\nN20 G1 Z-5 F250\nN40 G41 D1\nN50 X-25\nN60 X100\n\
                        N65 M8\nN70 Y-100\nN80 X25\nN90 Y25\nN100 G40\nN110 X25 Y50\nN120 M30\n";

#[test]
fn controls_are_put_side_by_side() {
    let folder = Folder::new();
    folder.file("part.nc", PORTABLE);
    folder.file("tools.yaml", "tools:\n  1: {diameter_mm: 10.0}\n");
    let args = ["check", "part.nc", "--all-controls", "--tools", "tools.yaml"];
    let ran = said(&folder, &args).expect(0);
    for line in [
        "masso           cannot read  1 error",
        "line 3 N40, unknown_word: masso has no word D1",
        "osp_lathe       cannot read  5 errors",
        "nct             accepts      0 errors, 0 warnings",
        // Corners cut short at both tangents are (sqrt(2) - 1) 5 mm away from arcs.
        "nct and rs274: 2.0712 mm apart at X105.000 Y-20.000 Z-5.000 in line 5 N60",
    ] {
        assert!(ran.out.contains(line), "{line}\n{}", ran.out);
    }

    let ran = said(&folder, &[&args[..], &["--json"]].concat()).expect(0);
    let report: Value = serde_json::from_str(&ran.out).expect("one JSON object");
    let controls = report["controls"].as_array().expect("a list");
    let verdict = |name: &str| {
        let row = controls.iter().find(|row| row["control"] == name).expect("the control");
        (row["read"].clone(), row["accepted"].clone(), row["error_count"].clone())
    };
    assert_eq!(controls.len(), 6);
    assert_eq!(verdict("masso"), (false.into(), false.into(), 1.into()));
    assert_eq!(verdict("sinumerik_840c"), (true.into(), true.into(), 0.into()));
    let differences = report["differences"].as_array().expect("a list");
    let pair = differences.iter().find(|pair| pair["to"] == "rs274").expect("the pair with nct");
    let apart = pair["distance_mm"].as_f64().expect("a number");
    assert!((apart - 5.0 * (2.0_f64.sqrt() - 1.0)).abs() < 1e-3, "{pair}");
    assert_eq!((&pair["line"], &pair["block"]), (&5.into(), &60.into()));
}

#[test]
fn a_program_that_no_control_accepts_and_unknown_controls() {
    let folder = Folder::new();
    folder.file("junk.nc", "G1 X1 Q9 F100\n");
    folder.file("mine.yaml", "name: mine\nlanguage: {dialect: fanuc}\n");
    folder.file("odd.yaml", odd_profile());
    let all = said(&folder, &["check", "junk.nc", "--all-controls"]).expect(1);
    let none_named = said(&folder, &["check", "junk.nc"]).expect(1);
    assert_eq!(none_named.out, all.out);
    said(&folder, &["check", "junk.nc", "--control", "fanuc"]).expect(2).says(&["known are"]);
    said(&folder, &["check", "junk.nc", "--control", "./mine.yaml"])
        .expect(2)
        .says(&["mine.yaml:2", "unknown variant `fanuc`"]);
    said(&folder, &["check", "junk.nc", "--control", "./odd.yaml"]).expect(2).says(&[
        "odd.yaml:",
        "radius.source",
        "no word for it",
    ]);
    said(&folder, &["check", "none.nc", "--all-controls"]).expect(2);
}

/// A profile with a combination that no control could have.
fn odd_profile() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/controls/masso.yaml");
    let text = std::fs::read_to_string(path).expect("a profile");
    text.replace("rule: spindle_tool_plus_p", "rule: nose_register")
}

/// `UPDATE_EXPECT=1 cargo test -p kerf --test cli picture` draws it anew.
#[test]
fn the_picture_of_the_readme_is_of_today() {
    let folder = Folder::new();
    let plain = ["plan", CONTOUR, "--control", "sinumerik_840c", "--tools", TOOLS];
    said(&folder, &[&plain[..], &["--quiet", "--svg", "contour.svg"]].concat()).expect(0);
    let drawn = std::fs::read_to_string(folder.path().join("contour.svg")).expect("a picture");
    expect_test::expect_file!["../../../../docs/images/contour.svg"].assert_eq(&drawn);
}

#[test]
fn plan_audits_every_path() {
    let folder = Folder::new();
    let plain = ["plan", CONTOUR, "--control", "sinumerik_840c", "--tools", TOOLS];
    let ran = said(&folder, &plain).expect(0);
    assert!(ran.out.contains("  the audit confirms the path (19 elements, 1 span, 3 events)\n"));
    let ran = said(&folder, &[&plain[..], &["--json"]].concat()).expect(0);
    let report: Value = serde_json::from_str(&ran.out).expect("one JSON object");
    let elements = report["elements"].as_array().expect("a list").len();
    assert_eq!(report["audit"]["accepted"], true);
    assert_eq!(report["audit"]["elements"], elements);
    assert_eq!(report["audit"]["spans"], 1);
    assert_eq!(report["audit"]["nearest_mm"], Value::Null);
}
