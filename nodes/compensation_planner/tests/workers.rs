//! Spans that do not depend on each other are solved by several workers, and the result is
//! the same to the last bit.

mod support;

use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::profile::{Profile, Reaction, Strictness};
use compensation_planner::{Alone, Plan, Planning, Workers, plan_with};
use std::fmt::Write;
use std::sync::atomic::{AtomicUsize, Ordering};
use support::*;

/// Threads that take the work from its end, and how much each of them was given at most.
#[derive(Debug)]
struct Backwards {
    threads: usize,
    most: AtomicUsize,
}

impl Workers for Backwards {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        self.most.fetch_max(count, Ordering::Relaxed);
        let left = AtomicUsize::new(count);
        let take = || {
            while let Ok(left) =
                left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1))
            {
                work(left - 1);
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..self.threads {
                scope.spawn(take);
            }
        });
    }
}

/// The same with the sign of every zero, and with what is not equal to itself.
fn bits(plan: &Plan) -> String {
    format!("{plan:?}")
}

/// So many pockets one below the other, with `sides` straights each; every third is entered
/// where its lead cuts, every fifth has a slot that is too narrow, every seventh is linked
/// to the next, and coolant and height change between them.
fn levels(count: usize, sides: usize) -> String {
    let mut text = String::new();
    for level in 0..count {
        let z = -(level as f64) / 10.0;
        let far = if level % 3 == 0 { 41.0 } else { 60.0 };
        let _ = writeln!(text, "G0 X{far} Y3 M8\nZ{z}\nG42 D1 G456 G1 X40 Y0 F100");
        for side in 1..=sides {
            let (sin, cos) = (std::f64::consts::TAU * side as f64 / sides as f64).sin_cos();
            let _ = writeln!(text, "X{:.3} Y{:.3}", 40.0 * cos, -40.0 * sin);
            if level % 5 == 0 && side == sides / 2 {
                let _ = writeln!(text, "X-35 Y1\nX-35 Y2\nX-40 Y3");
            }
        }
        if level % 7 == 0 {
            let _ = writeln!(text, "G42 G456 X40.5 Y9\nX45 Y9\nX50 Y30");
        }
        let _ = writeln!(text, "G40 G456 X60 Y-3 M9");
    }
    text
}

fn check(contour: &ProgrammedContour, profile: &Profile, certifies: bool) {
    let planned = |workers: &dyn Workers| {
        plan_with(contour, profile, &tool(3.0), Planning { certifies, workers })
    };
    let expected = planned(&Alone);
    assert!(!expected.findings.is_empty());
    assert_eq!(expected.certificates.is_empty(), !certifies);
    for threads in [1, 2, 7] {
        let workers = Backwards { threads, most: AtomicUsize::new(0) };
        let plan = planned(&workers);
        assert!(workers.most.into_inner() >= 3);
        assert!(bits(&plan) == bits(&expected), "{threads} threads");
    }
}

#[test]
fn any_number_of_workers_gives_the_same_bits() {
    for react in [Reaction::Alarm, Reaction::Trim, Reaction::Ignore] {
        let mut profile = sinumerik();
        profile.interference.react = react;
        check(&contour(&levels(16, 40), &profile), &profile, false);
    }
    check(&contour(&levels(4, 8), &sinumerik()), &sinumerik(), true);
}

#[test]
fn what_is_put_out_piece_by_piece_is_the_same_as_each_level_alone() {
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Trim;
    profile.interference.leads = Strictness::Warn;
    // More blocks than may wait together.
    let count = 50;
    let sides = 1500;
    let level = "G0 X60 Y3\nG42 D1 G456 G1 X40 Y0 F100";
    let mut body = String::new();
    for side in 1..=sides {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(side) / f64::from(sides)).sin_cos();
        let _ = writeln!(body, "X{:.3} Y{:.3}", 40.0 * cos, -40.0 * sin);
    }
    let one = format!("{level}\n{body}G40 G456 X60 Y-3\n");
    let alone = plan(&one, &profile, &tool(3.0));
    let all = plan(&one.repeat(count), &profile, &tool(3.0));
    assert!(alone.accepted() && all.accepted(), "{} {}", findings(&alone), findings(&all));
    assert_eq!(all.spans.len(), count);
    let ends = |plan: &Plan| plan.path.elements.iter().map(|e| e.end).collect::<Vec<_>>();
    let (one, all) = (ends(&alone), ends(&all));
    assert_eq!(all.len(), count * one.len());
    assert!(all.chunks(one.len()).all(|level| level == one));
}
