//! How fast contours are planned with the check of the whole program, and how fast
//! `cavalier_contours` offsets the same ones.
//!
//! ```text
//! cargo bench -p compensation_planner            all
//! cargo bench -p compensation_planner -- closed  next to cavalier_contours
//! cargo bench -p compensation_planner -- growth  how time grows with the length, with and without
//!                                                valid radii
//! cargo bench -p compensation_planner -- --test  each once
//! ```
//!
//! At its end it prints the ratios to `cavalier_contours` measured in this run.
//! The planner does more than it: it reads events, checks leads and writes a path
//! with its provenance.

#![allow(clippy::print_stdout)]

mod outline;

use cavalier_contours::polyline::PlineSource;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::{Offset, ToolTable};
use compensation_planner::{plan, plan_certified};
use criterion::{Criterion, SamplingMode, Throughput};
use outline::{Outline, programmed};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// One way to make closed outlines of so many elements, and the tool for them.
struct Rings {
    name: &'static str,
    make: fn(usize) -> Vec<Outline>,
    radius_mm: f64,
}

const RINGS: [Rings; 5] = [
    Rings { name: "lines", make: |count| vec![Outline::wave(count)], radius_mm: 5.0 },
    Rings {
        name: "lines_and_arcs",
        make: |count| vec![Outline::rounded_wave(count)],
        radius_mm: 5.0,
    },
    Rings { name: "corners", make: |count| vec![Outline::zigzag(count)], radius_mm: 0.5 },
    Rings { name: "stars", make: Outline::stars, radius_mm: 1.0 },
    Rings { name: "nested_squares", make: Outline::nested_squares, radius_mm: 1.0 },
];

const COUNTS: [usize; 3] = [10_000, 100_000, 1_000_000];

/// The shortest time of anything that was measured, by name.
#[derive(Debug, Default)]
struct Best(Vec<(String, Duration)>);

impl Best {
    fn note(&mut self, name: &str, time: Duration) {
        match self.0.iter_mut().find(|(known, _)| known == name) {
            Some((_, best)) => *best = time.min(*best),
            None => self.0.push((name.to_owned(), time)),
        }
    }

    fn of(&self, name: &str) -> Option<Duration> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, best)| *best)
    }
}

fn profile() -> Profile {
    settings::load_profile("sinumerik_840c").expect("the shipped profile")
}

fn tool(radius_mm: f64, wear_mm: f64) -> ToolTable {
    let mut tools = ToolTable::default();
    tools.offsets.insert(1, Offset { radius_mm, wear_mm, ..Offset::default() });
    tools
}

/// Measures one thing some times over.
fn measure(
    criterion: &mut Criterion,
    best: &mut Best,
    [group, name]: [&str; 2],
    elements: usize,
    mut run: impl FnMut(),
) {
    let full_name = format!("{group}/{name}");
    let mut group = criterion.benchmark_group(group);
    group.sampling_mode(SamplingMode::Flat).sample_size(10);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    group.throughput(Throughput::Elements(elements as u64));
    group.bench_function(name, |bencher| {
        bencher.iter_custom(|iterations| {
            let mut total = Duration::ZERO;
            for _ in 0..iterations {
                let start = Instant::now();
                run();
                let time = start.elapsed();
                best.note(&full_name, time);
                total += time;
            }
            total
        });
    });
    group.finish();
}

/// Closed contours, the whole program checked, next to `cavalier_contours`.
fn closed(criterion: &mut Criterion, best: &mut Best) {
    let profile = profile();
    for Rings { name, make, radius_mm } in RINGS {
        for count in COUNTS {
            let outlines = make(count);
            let elements = outlines.iter().map(Outline::count).sum();
            let group = format!("closed/{name}/{count}");
            let (contour, tools) = (programmed(&outlines), tool(radius_mm, 0.0));
            measure(criterion, best, [&group, "kerf"], elements, || {
                let plan = plan(black_box(&contour), &profile, &tools);
                assert!(plan.accepted(), "{:?}", plan.findings.first());
            });
            let polylines: Vec<_> = outlines.iter().map(Outline::polyline).collect();
            measure(criterion, best, [&group, "cavalier_contours"], elements, || {
                for polyline in black_box(&polylines) {
                    let offsets = polyline.parallel_offset(-radius_mm);
                    assert_eq!(offsets.len(), 1, "one closed offset");
                }
            });
        }
    }
}

/// What defeats boxes, grids and neighbours: refused or accepted, in bounded time.
fn worst(criterion: &mut Criterion, best: &mut Best) {
    let profile = profile();
    let cases = [
        ("comb_of_100000_teeth", Outline::comb(100_000, 12.0), 5.0, true),
        ("comb_too_narrow", Outline::comb(100_000, 8.0), 5.0, false),
        ("spiral_of_1000_turns", Outline::spiral(1000, 12.0), 5.0, true),
        ("spiral_too_narrow", Outline::spiral(1000, 8.0), 5.0, false),
        ("all_in_one_cell", Outline::speck(100_000), 5.0, true),
        ("scribble", Outline::scribble(10_000), 0.01, false),
        ("scribble_consumed", Outline::scribble(100_000), 5.0, false),
    ];
    for (name, outline, radius_mm, is_good) in cases {
        let (contour, tools) = (outline.programmed(), tool(radius_mm, 0.0));
        measure(criterion, best, ["worst", name], outline.count(), || {
            let plan = plan(black_box(&contour), &profile, &tools);
            assert_eq!(plan.accepted(), is_good, "{name}: {:?}", plan.findings.first());
        });
    }
}

/// The name of a kind of program, and how to make one of about so many blocks.
type Family = (&'static str, fn(usize) -> Vec<Outline>);

/// Programs that come back to where they were: time grows as n log n, whatever comes near to what.
const GROWING: [Family; 6] = [
    ("passes", |count| vec![Outline::passes(count, 0.1)]),
    ("retrace", |count| vec![Outline::passes(count, 0.0)]),
    ("spiral", |count| vec![Outline::even_spiral(count, 12.0)]),
    ("comb", |count| vec![Outline::comb(count / 4, 12.0)]),
    ("hilbert", |count| vec![Outline::hilbert(count)]),
    ("bosses", |count| Outline::bosses(count / 2)),
];

const GROWING_COUNTS: [usize; 3] = [10_000, 40_000, 160_000];

fn growth(criterion: &mut Criterion, best: &mut Best) {
    let profile = profile();
    let tools = tool(3.0, 0.0);
    for (name, make) in GROWING {
        for count in GROWING_COUNTS {
            let outlines = make(count);
            let contour = programmed(&outlines);
            let group = format!("growth/{name}/{count}");
            measure(criterion, best, [&group, "plan"], contour.events.len(), || {
                let plan = plan(black_box(&contour), &profile, &tools);
                assert!(plan.accepted(), "{name}: {:?}", plan.findings.first());
            });
            measure(criterion, best, [&group, "certified"], contour.events.len(), || {
                let plan = plan_certified(black_box(&contour), &profile, &tools);
                assert_eq!(plan.certificates.len(), outlines.len(), "{name}");
            });
        }
    }
}

/// What follows a new wear, and the radii that a contour is good for.
fn again(criterion: &mut Criterion, best: &mut Best) {
    let profile = profile();
    for Rings { name, make, radius_mm } in RINGS {
        let contour = programmed(&make(10_000));
        let worn = tool(radius_mm, -0.02);
        let elements = contour.events.len();
        measure(criterion, best, ["replan_after_wear_10000", name], elements, || {
            let plan = plan(black_box(&contour), &profile, &worn);
            assert!(plan.accepted(), "{:?}", plan.findings.first());
        });
        for count in [10_000, 100_000] {
            let outlines = make(count);
            let (contour, tools) = (programmed(&outlines), tool(radius_mm, 0.0));
            let elements = contour.events.len();
            let group = format!("with_certificate/{count}");
            measure(criterion, best, [&group, name], elements, || {
                let plan = plan_certified(black_box(&contour), &profile, &tools);
                assert_eq!(plan.certificates.len(), outlines.len());
            });
        }
    }
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut best = Best::default();
    closed(&mut criterion, &mut best);
    worst(&mut criterion, &mut best);
    growth(&mut criterion, &mut best);
    again(&mut criterion, &mut best);
    criterion.final_summary();
    for (name, _) in GROWING {
        for count in GROWING_COUNTS {
            let time = |what| best.of(&format!("growth/{name}/{count}/{what}"));
            let (Some(plan), Some(certified)) = (time("plan"), time("certified")) else { continue };
            println!(
                "{name}, {count} blocks: {:.2} us a block, {:.1} times that with valid radii",
                plan.as_secs_f64() / count as f64 * 1e6,
                certified.as_secs_f64() / plan.as_secs_f64()
            );
        }
    }
    for Rings { name, .. } in RINGS {
        for count in COUNTS {
            let time = |who| best.of(&format!("closed/{name}/{count}/{who}"));
            let (Some(ours), Some(theirs)) = (time("kerf"), time("cavalier_contours")) else {
                continue;
            };
            println!(
                "{name}, {count} elements: {:.2} M elements/s, {:.2} times cavalier_contours",
                count as f64 / ours.as_secs_f64() / 1e6,
                theirs.as_secs_f64() / ours.as_secs_f64()
            );
        }
    }
}
