//! Measures the loader: `cargo run --release -p program_loader --example lines_per_second [-- LINES]`.

#![allow(clippy::print_stdout)]

use cnc_msgs::profile::Profile;
use program_loader::{LoadOptions, load};
use std::fmt::Write;
use std::time::Instant;

const LINES_DEFAULT: u32 = 1_000_000;

fn main() {
    let lines = std::env::args().nth(1).and_then(|lines| lines.parse().ok());
    let lines = lines.unwrap_or(LINES_DEFAULT);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/controllers/rs274.yaml");
    let yaml = std::fs::read_to_string(path).expect("the shipped profile");
    let profile: Profile = serde_yaml::from_str(&yaml).expect("a valid profile");
    measure("feed lines", &profile, lines, |text, index| {
        let turn = f64::from(index) * 0.01;
        let _ = writeln!(
            text,
            "X{:.3} Y{:.3} Z{:.3}",
            50.0 * turn.cos(),
            50.0 * turn.sin(),
            -turn / 100.0
        );
    });
    measure("numbered feed lines", &profile, lines, |text, index| {
        let turn = f64::from(index) * 0.01;
        let _ = writeln!(
            text,
            "N{} G1 X{:.4} Y{:.4} F800",
            index * 5,
            50.0 * turn.cos(),
            50.0 * turn.sin()
        );
    });
    measure("arcs", &profile, lines, |text, index| {
        let (x, i) = if index % 2 == 0 { (10.0, 5.0) } else { (0.0, -5.0) };
        let _ = writeln!(text, "G2 X{x:.4} Y0.0000 I{i:.4} J0.0000");
    });
}

fn measure(name: &str, profile: &Profile, lines: u32, line: impl Fn(&mut String, u32)) {
    let mut text = String::from("G21 G17 G90 G0 X0 Y0 Z0\nG1 F500 X0\n");
    for index in 0..lines {
        line(&mut text, index);
    }
    text.push_str("M2\n");
    let mut best = f64::INFINITY;
    for _ in 0..7 {
        let start = Instant::now();
        let loaded = load(text.as_bytes(), profile, &LoadOptions::default());
        best = best.min(start.elapsed().as_secs_f64());
        assert!(loaded.is_accepted(), "{:?}", loaded.diagnostics);
    }
    println!(
        "{name}: {:.2} M lines/s, {:.0} MB/s",
        f64::from(lines) / best / 1e6,
        text.len() as f64 / best / 1e6
    );
}
