//! Measures how fast programs are read.
//!
//! ```text
//! cargo bench -p program_loader            in lines and bytes a second
//! cargo bench -p program_loader -- --test  each once
//! ```

use criterion::{Criterion, SamplingMode, Throughput};
use program_loader::{LoadOptions, load};
use std::fmt::Write;
use std::hint::black_box;
use std::time::Duration;

const LINES: u32 = 1_000_000;

/// Writes the block of this index.
type WriteBlock = fn(&mut String, u32);

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let profile = settings::load_profile("rs274").expect("the shipped profile");
    let programs: [(&str, WriteBlock); 3] =
        [("lines", feed_line), ("numbered_lines", numbered_line), ("arcs", arc)];
    for (name, block) in programs {
        let text = program(block);
        let per = [
            ("lines", Throughput::Elements(LINES.into())),
            ("bytes", Throughput::Bytes(text.len() as u64)),
        ];
        for (unit, throughput) in per {
            let mut group = criterion.benchmark_group(format!("load/{unit}_per_second"));
            group.sampling_mode(SamplingMode::Flat).sample_size(10).throughput(throughput);
            group.warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
            group.bench_function(name, |bencher| {
                bencher.iter_with_large_drop(|| {
                    let loaded =
                        load(black_box(text.as_bytes()), &profile, &LoadOptions::default());
                    assert!(loaded.is_accepted(), "{:?}", loaded.findings.first());
                    loaded
                });
            });
            group.finish();
        }
    }
    looped(&mut criterion, &profile);
    criterion.final_summary();
}

/// A million blocks from a loop of ten lines.
fn looped(criterion: &mut Criterion, profile: &cnc_msgs::profile::Profile) {
    let mut group = criterion.benchmark_group("load/loop");
    group.sampling_mode(SamplingMode::Flat).sample_size(10);
    group.warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
    group.throughput(Throughput::Elements(LINES.into()));
    group.bench_function("ten_lines", |bencher| {
        bencher.iter_with_large_drop(|| {
            let loaded = load(black_box(LOOP.as_bytes()), profile, &LoadOptions::default());
            assert!(loaded.is_accepted(), "{:?}", loaded.findings.first());
            loaded
        });
    });
    group.finish();
}

const LOOP: &str = "G21 G17 G90 G0 X0 Y0 Z0\nG1 F500\n#1=0\no1 while [#1 LT 100000]\n\
#<turn>=[#1*0.01]\n#<x>=[50*COS[#<turn>]]\n#<y>=[50*SIN[#<turn>]]\n\
G1 X#<x> Y#<y> Z[0-#<turn>/100]\nX[#<x>+0.1] Y#<y>\nX#<x> Y[#<y>+0.1]\n\
Z[0.1-#<turn>/100]\nX#<x> Y#<y>\n#1=[#1+1]\no1 endwhile\nM2\n";

fn program(block: WriteBlock) -> String {
    let mut text = String::from("G21 G17 G90 G0 X0 Y0 Z0\nG1 F500 X0\n");
    for index in 0..LINES {
        block(&mut text, index);
    }
    text.push_str("M2\n");
    text
}

fn feed_line(text: &mut String, index: u32) {
    let turn = f64::from(index) * 0.01;
    let (x, y) = (50.0 * turn.cos(), 50.0 * turn.sin());
    let _ = writeln!(text, "X{x:.3} Y{y:.3} Z{:.3}", -turn / 100.0);
}

fn numbered_line(text: &mut String, index: u32) {
    let turn = f64::from(index) * 0.01;
    let (x, y) = (50.0 * turn.cos(), 50.0 * turn.sin());
    let _ = writeln!(text, "N{} G1 X{x:.4} Y{y:.4} F800", index * 5);
}

fn arc(text: &mut String, index: u32) {
    let (x, i) = if index.is_multiple_of(2) { (10.0, 5.0) } else { (0.0, -5.0) };
    let _ = writeln!(text, "G2 X{x:.4} Y0.0000 I{i:.4} J0.0000");
}
