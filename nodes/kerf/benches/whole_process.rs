//! How fast `kerf plan` is as a process, and how much memory it takes: with `--quiet`, and with
//! each kind of output next to it.
//!
//! ```text
//! cargo bench -p kerf --bench whole_process                      three programs of 1 M feed blocks
//! cargo bench -p kerf --bench whole_process -- --blocks 200000   shorter ones
//! cargo bench -p kerf --bench whole_process -- --keep FOLDER     and keep the programs, to profile with
//! cargo bench -p kerf --bench whole_process -- --test            each once, 2000 blocks
//! ```
//!
//! The process is bound to one processor with `taskset`. Time is from its start to its end, the
//! best of some runs. Its peak of resident memory is read from the kernel in a separate run, until
//! it ends.

#![allow(clippy::print_stdout)]

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const BLOCKS: usize = 1_000_000;
const RUNS: usize = 5;

/// The arguments of this bench; unknown ones are for the harness.
struct Arguments {
    blocks: usize,
    runs: usize,
    keep: Option<PathBuf>,
}

impl Arguments {
    fn read() -> Self {
        let mut arguments = Self { blocks: BLOCKS, runs: RUNS, keep: None };
        let mut words = std::env::args().skip(1);
        while let Some(word) = words.next() {
            match word.as_str() {
                "--test" => (arguments.blocks, arguments.runs) = (2000, 1),
                "--blocks" => {
                    let blocks = words.next().and_then(|word| word.parse().ok());
                    arguments.blocks = blocks.expect("--blocks takes a number");
                }
                "--keep" => arguments.keep = words.next().map(PathBuf::from),
                _ => {}
            }
        }
        arguments
    }
}

fn main() {
    let arguments = Arguments::read();
    let folder = tempfile::tempdir().expect("a folder for programs");
    let folder = arguments.keep.as_deref().unwrap_or(folder.path());
    std::fs::create_dir_all(folder).expect("the folder of the programs");
    quiet(&arguments, folder);
    // Some pages are too long for a browser, but not for this.
    for blocks in [arguments.blocks / 10, arguments.blocks] {
        outputs(blocks, arguments.runs, folder);
    }
}

fn quiet(arguments: &Arguments, folder: &Path) {
    println!("{:<24} {:>10} {:>12} {:>14}", "1 core", "s", "M blocks/s", "bytes a block");
    type Program = fn(usize) -> String;
    let programs: [(&str, Program); 3] =
        [("lines", lines), ("lines_and_arcs", lines_and_arcs), ("corners", corners)];
    for (name, program) in programs {
        let path = folder.join(format!("{name}.ngc"));
        std::fs::write(&path, program(arguments.blocks)).expect("a program can be written");
        let words = &["--quiet"];
        let times = (0..arguments.runs).map(|_| time(&path, words));
        let seconds = times.min().expect("at least one run").as_secs_f64();
        let blocks = arguments.blocks as f64;
        println!(
            "{name:<24} {seconds:>10.3} {:>12.2} {:>14.0}",
            blocks / seconds / 1e6,
            peak_bytes(&path, words) as f64 / blocks
        );
    }
}

/// Standard output goes nowhere, pictures and pages to files.
fn outputs(blocks: usize, runs: usize, folder: &Path) {
    let program = folder.join("outputs.ngc");
    std::fs::write(&program, lines(blocks)).expect("a program can be written");
    let file = |name: &str| folder.join(name).display().to_string();
    let (svg, html) = (file("outputs.svg"), file("outputs.html"));
    let outputs: [(&str, &[&str]); 5] = [
        ("--quiet", &["--quiet"]),
        ("with certificates", &[]),
        ("--json, with them", &["--json"]),
        ("--quiet --svg", &["--quiet", "--svg", &svg]),
        ("--quiet --html", &["--quiet", "--html", &html]),
    ];
    // In turn, so that all see the same load of the host.
    let mut best = [Duration::MAX; 5];
    for _ in 0..runs {
        for (best, (_, words)) in best.iter_mut().zip(outputs) {
            *best = (*best).min(time(&program, words));
        }
    }
    let quiet = best[0].as_secs_f64();
    println!();
    println!(
        "{:<24} {:>10} {:>12} {:>14}",
        format!("{blocks} lines, 1 core"),
        "s",
        "of --quiet",
        "bytes a block"
    );
    for ((name, words), best) in outputs.into_iter().zip(best) {
        let seconds = best.as_secs_f64();
        let bytes = peak_bytes(&program, words) as f64 / blocks as f64;
        println!("{name:<24} {seconds:>10.3} {:>12.2} {bytes:>14.0}", seconds / quiet);
    }
}

/// Starts a plan of a program on the first processor.
fn start(program: &Path, words: &[&str]) -> Child {
    Command::new("taskset")
        .args(["-c", "0", env!("CARGO_BIN_EXE_kerf"), "plan"])
        .args(words)
        .arg(program)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("taskset (of util-linux) starts kerf")
}

fn time(program: &Path, words: &[&str]) -> Duration {
    let begin = Instant::now();
    let status = start(program, words).wait().expect("its end");
    assert!(status.success(), "{}: {status}", program.display());
    begin.elapsed()
}

/// Reads the peak again and again while the process runs: it only grows, and is reached long before
/// the end.
fn peak_bytes(program: &Path, words: &[&str]) -> u64 {
    let mut child = start(program, words);
    let mut peak = 0;
    while child.try_wait().expect("its state").is_none() {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id()));
        let line = status.as_deref().unwrap_or_default();
        let line = line.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        peak = peak.max(kilobytes.unwrap_or(0_u64) * 1024);
        std::thread::sleep(Duration::from_millis(1));
    }
    peak
}

/// A program with the tool outside of a ring, whose start is its outermost point.
fn program(start: [f64; 2], blocks: impl FnOnce(&mut String)) -> String {
    let mut text = String::from("G21 G17 G90 G40\nT1 M6\n");
    let out = start[0] + 20.0;
    let _ = writeln!(text, "G0 X{out:.3} Y{:.3}", start[1]);
    let _ = writeln!(text, "F1000\nG42.1 D{DIAMETER_MM:.1} G1 X{:.3} Y{:.3}", start[0], start[1]);
    blocks(&mut text);
    let _ = writeln!(text, "G40 G1 X{out:.3} Y{:.3}\nM2", start[1]);
    text
}

const DIAMETER_MM: f64 = 1.0;

/// Points of a ring with seven waves and 2 mm between two points.
fn wave(index: usize, count: usize) -> [f64; 2] {
    let angle = TAU * (index % count) as f64 / count as f64;
    let (sin, cos) = angle.sin_cos();
    let out = count as f64 * 2.0 / TAU * (1.0 + 0.05 * (7.0 * angle).cos());
    [out * cos, out * sin]
}

fn lines(blocks: usize) -> String {
    program(wave(0, blocks), |text| {
        for index in 1..=blocks {
            let [x, y] = wave(index, blocks);
            let _ = writeln!(text, "X{x:.3} Y{y:.3}");
        }
    })
}

/// Lines and arcs of 30 degrees that bend away from the ring, like the edge of a stamp; it begins
/// and ends within a line.
fn lines_and_arcs(blocks: usize) -> String {
    let points = blocks & !1;
    let [first, second] = [wave(0, points), wave(1, points)];
    let start = [(first[0] + second[0]) / 2.0, (first[1] + second[1]) / 2.0];
    program(start, |text| {
        for index in (1..points).step_by(2) {
            let [a, b] = [wave(index, points), wave(index + 1, points)];
            let _ = writeln!(text, "G1 X{:.3} Y{:.3}", a[0], a[1]);
            // The centre is on the left, at the distance for 30 degrees.
            let half = [(b[0] - a[0]) / 2.0, (b[1] - a[1]) / 2.0];
            let far = 1.0 / 15.0_f64.to_radians().tan();
            let (i, j) = (half[0] - half[1] * far, half[1] + half[0] * far);
            let _ = writeln!(text, "G3 X{:.3} Y{:.3} I{i:.4} J{j:.4}", b[0], b[1]);
        }
        let _ = writeln!(text, "G1 X{:.3} Y{:.3}", start[0], start[1]);
    })
}

/// A corner of 30 degrees in each block, inside and outside in turn.
fn corners(blocks: usize) -> String {
    let half_turn = 15.0_f64.to_radians();
    let count = blocks & !1;
    let point = |index: usize| {
        let out = count as f64 * 4.0 * half_turn.cos() / TAU;
        let out = out + if index.is_multiple_of(2) { 4.0 * half_turn.sin() } else { 0.0 };
        let (sin, cos) = (TAU * (index % count) as f64 / count as f64).sin_cos();
        [out * cos, out * sin]
    };
    program(point(0), |text| {
        for index in 1..=count {
            let [x, y] = point(index);
            let _ = writeln!(text, "X{x:.3} Y{y:.3}");
        }
    })
}
