//! `kerf plan --machine` and `--keep-out`: what is said, and the exit status.

use super::said;
use super::support::Folder;
use serde_json::Value;

const MACHINE: &str = "\
firmware: grbl
version: \"1.1h\"
options: V
planner_blocks: 15
settings:
  11: 0.010
  12: 0.002
  20: 1
  22: 1
  23: 0
  30: 24000
  31: 0
  32: 0
  100: 250
  101: 250
  102: 250
  110: 5000.000
  111: 5000.000
  112: 2000.000
  120: 500.000
  121: 500.000
  122: 200.000
  130: 600.000
  131: 400.000
  132: 100.000
offsets_mm:
  G54: [-500, -300, -60]
  G55: [-100, -300, -60]
";
const TOOLS: &str = "tools:\n  1: {diameter_mm: 6.0}\n";
const CLAMP: &str =
    "keep_out:\n  left clamp: {frame: G54, min_mm: [50, -5, -20], max_mm: [60, 5, 8]}\n";

fn folder(program: &str) -> Folder {
    let folder = Folder::new();
    for (name, text) in [
        ("part.ngc", program),
        ("router.yaml", MACHINE),
        ("tools.yaml", TOOLS),
        ("clamps.yaml", CLAMP),
    ] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

const PLAN: [&str; 6] = ["plan", "part.ngc", "--tools", "tools.yaml", "--machine", "router.yaml"];

#[test]
fn a_program_that_fits_says_so_with_its_time() {
    let folder = folder("G21 G90\nT1 M6\nG0 Z20\nG0 X0 Y0\nG1 Z-1 F300\nX100 F600\nM2\n");
    said(&folder, &PLAN)
        .expect(0)
        .says(&["fits the machine of router.yaml (grbl); takes 15.", "part.ngc: accepted"]);
    let json: Value =
        serde_json::from_str(&said(&folder, &[&PLAN[..], &["--json"]].concat()).expect(0).out)
            .expect("JSON");
    let machine = &json["machine"];
    let seconds = machine["seconds"].as_f64().expect("a number");
    // 21 mm down at 5 mm/s, 100 mm at 10 mm/s, and the rapid up.
    assert!((14.0..16.0).contains(&seconds), "{machine}");
    assert_eq!(machine["firmware"], "grbl");
    assert_eq!(machine["not_judged"], Value::Array(Vec::new()));
}

#[test]
fn a_time_that_jerk_makes_doubtful_is_named_so() {
    let folder = folder("G21 G90\nT1 M6\nG0 Z20\nG0 X0 Y0\nG1 X100 F600\nM2\n");
    let text = MACHINE.replace("firmware: grbl", "firmware: grblHAL");
    let jerk = "  800: 5000\n  801: 5000\n  802: 2000\noffsets_mm";
    for (text, is_said) in [(text.clone(), false), (text.replace("offsets_mm", jerk), true)] {
        std::fs::write(folder.path().join("router.yaml"), text).expect("written");
        let ran = said(&folder, &PLAN).expect(0);
        let doubt = "not judged: the time: the controller limits jerk ($800 and up)";
        assert_eq!(ran.out.contains(doubt), is_said, "{}", ran.out);
    }
}

#[test]
fn a_program_that_leaves_the_machine_is_refused_with_line_place_and_numbers() {
    let folder = folder("G21 G90\nG0 Z20\nG0 X0 Y0\nG55\nG1 X112.5 Y0 F600\nM2\n");
    said(&folder, &PLAN).expect(1).says(&[
        "error[travel]",
        "X12.500 in the machine frame (X112.500 in G55), 12.500 mm beyond the travel",
        "part.ngc:5:1",
        "move the work zero of G55 by at least 12.500 mm towards X-",
        "does not fit the machine of router.yaml",
    ]);
    let ran = said(&folder, &[&PLAN[..], &["--json"]].concat()).expect(1);
    let json: Value = serde_json::from_str(&ran.out).expect("JSON");
    assert_eq!(json["accepted"], false);
    assert_eq!(json["elements"], Value::Array(Vec::new()));
    assert!(!json["refused_elements"].as_array().expect("a list").is_empty());
    assert_eq!(json["findings"][0]["code"], "travel");
    // Without the machine it is a good program.
    said(&folder, &PLAN[..4]).expect(0);
}

#[test]
fn a_clamp_in_the_way_is_named_and_one_beside_it_is_not() {
    let program = |y: &str| {
        format!("G21 G90\nT1 M6\nG0 Z20\nG0 X0 Y{y}\nG1 Z-1 F300\nX100 F600\nG0 Z20\nM2\n")
    };
    let args = [&PLAN[..], &["--keep-out", "clamps.yaml"]].concat();
    let hit = folder(&program("7"));
    said(&hit, &args).expect(1).says(&[
        "error[keep_out]: T1 (radius 3.000 mm) touches the keep-out \"left clamp\"",
        "part.ngc:6:1",
        "2.000 mm from the side, and 9.000 mm below the top",
        "keep 1.000 mm more distance",
    ]);
    said(&folder(&program("8.1")), &args).expect(0);
}

#[test]
fn a_clamp_that_may_be_in_the_way_is_a_warning_and_the_first_z_decides() {
    let args = [&PLAN[..], &["--keep-out", "clamps.yaml"]].concat();
    let program = |first: &str| format!("G21 G90\nT1 M6\n{first}G0 X0 Y0\nG0 Z20\nM2\n");
    // As many posts begin: the program is accepted.
    said(&folder(&program("")), &args).expect(0).says(&[
        "warning[keep_out]: where X, Y and Z are before this move is not known: on its way T1 (radius \
         3.000 mm) may touch the keep-out \"left clamp\"; it does so where its tip is at Z-52.000 in \
         the machine frame (Z8.000 in G54) or lower",
        "part.ngc:3:1",
        "put a move in Z alone before it, to above Z-52.000 in the machine frame (Z8.000 in G54)",
        "accepted by rs274, 0 errors, 1 warning",
    ]);
    for first in ["G0 Z8.1\n", "G53 G0 Z0\n", "G28 G91 Z0\nG90\n"] {
        let folder = folder(&program(first));
        let file = MACHINE.replace("offsets_mm:\n", "offsets_mm:\n  G28: [0, 0, -1]\n");
        std::fs::write(folder.path().join("router.yaml"), file).expect("written");
        let ran = said(&folder, &[&args[..], &["--json"]].concat()).expect(0);
        let json: Value = serde_json::from_str(&ran.out).expect("JSON");
        assert_eq!(json["findings"], Value::Array(Vec::new()), "{first}");
        assert_eq!(json["machine"]["not_judged"], Value::Array(Vec::new()), "{first}");
    }
    // Of a machine file without offsets the box and the program are in G54 all the same.
    let program = "G21 G90\nT1 M6\nG0 Z20\nG0 X0 Y0\nG1 Z0 F300\nX80 F600\nM2\n";
    let without = folder(program);
    let (file, _) = MACHINE.split_once("offsets_mm:").expect("its offsets");
    std::fs::write(without.path().join("router.yaml"), file).expect("written");
    said(&without, &args).expect(1).says(&[
        "error[keep_out]: T1 (radius 3.000 mm) touches the keep-out \"left clamp\": its tip is at \
         X50.000 Y0.000 Z0.000 in G54",
        "part.ngc:6:1",
    ]);
}

#[test]
fn files_that_are_no_machine_are_refused_with_their_line() {
    let folder = folder("G21\nG1 X1 F100\nM2\n");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("written");
    };
    for (text, says) in [
        (
            MACHINE.replace("130: 600", "130: -600"),
            "m.yaml:23: $130 (X-axis maximum travel, mm) is -600",
        ),
        (
            MACHINE.replace("  132: 100.000\n", ""),
            "m.yaml:5: $132 (Z-axis maximum travel, mm) is missing",
        ),
        (MACHINE.replace("  30: 24000\n", "  376: 1\n"), "is this the file of another board?"),
        (MACHINE.replace("grbl", "marlin"), "m.yaml:1: firmware \"marlin\" is not known"),
        (MACHINE.replace("G55:", "G66:"), "m.yaml:28: G66 is not a stored position"),
        (MACHINE.replace("[-500,", "[.inf,"), "m.yaml:27: X of G54 is inf"),
        ("$0=10\n$1=25\n".into(), "m.yaml:1: this is the output of $$"),
        (TOOLS.into(), "m.yaml:1:1: unknown field `tools`"),
    ] {
        write("m.yaml", &text);
        said(&folder, &["plan", "part.ngc", "--machine", "m.yaml"]).expect(2).says(&[says]);
    }
    write("k.yaml", "keep_out:\n  vice: {frame: G54, min_mm: [0, 0, 9], max_mm: [1, 1, 1]}\n");
    let args = [&PLAN[..], &["--keep-out", "k.yaml"]].concat();
    said(&folder, &args).expect(2).says(&["k.yaml:2: \"vice\" has no size in Z"]);
    said(&folder, &["plan", "part.ngc", "--keep-out", "k.yaml"]).expect(2).says(&["--machine"]);
    said(&folder, &["plan", "part.ngc", "--machine", "none.yaml"]).expect(2).says(&["none.yaml"]);
}
