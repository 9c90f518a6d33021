//! Axes move as on a real machine: in time, within their limits, exactly to their targets.

mod common;
use common::{Bench, settings, settings_of};
use proptest::prelude::*;
use std::time::Duration;
use virtual_controller::{Build, Controller, Firmware, Switched, Vector};

fn distance(a: Vector, b: Vector) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// Half a step in every axis.
const STEP_MM: f64 = 0.004;

#[test]
fn a_move_takes_the_time_of_its_trapezoid() {
    let mut bench = Bench::new(&[]);
    // 20 mm/s at 100 mm/s²: 0.2 s and 2 mm at each end, 96 mm between.
    bench.send_line("G1X100F1200");
    bench.send_line("G4P0");
    bench.settle();
    let expected = 0.4 + 96.0 / 20.0;
    assert!((bench.now.as_secs_f64() - expected).abs() < 1e-6, "{:?}", bench.now);
}

#[test]
fn a_short_move_takes_the_time_of_its_triangle() {
    let mut bench = Bench::new(&[]);
    bench.send_line("G1X1F6000");
    bench.send_line("G4P0");
    bench.settle();
    assert!((bench.now.as_secs_f64() - 0.2).abs() < 1e-6, "{:?}", bench.now);
}

#[test]
fn a_straight_line_cut_in_pieces_takes_no_longer() {
    let mut bench = Bench::new(&[]);
    for x in 1..=10 {
        bench.send_line(&format!("G1X{}F1200", x * 10));
    }
    bench.send_line("G4P0");
    bench.settle();
    let expected = 0.4 + 96.0 / 20.0;
    assert!((bench.now.as_secs_f64() - expected).abs() < 1e-6, "{:?}", bench.now);
}

#[test]
fn a_full_circle_stays_on_its_circle_and_comes_back() {
    let mut bench = Bench::new(&[]);
    bench.send_line("G2X0I10F3000");
    bench.send_line("G4P0");
    let mut farthest: f64 = 0.0;
    while let Some(event) = bench.controller.next_event(bench.now) {
        bench.now = event.min(bench.now + Duration::from_millis(3)).max(bench.now);
        bench.controller.advance(bench.now);
        bench.received();
        let at = bench.controller.position();
        let miss = (distance(at, [10.0, 0.0, 0.0]) - 10.0).abs();
        assert!(miss < 0.002 + STEP_MM, "{miss} mm off the circle at {at:?}");
        farthest = farthest.max(at[0]);
    }
    assert!(farthest > 19.99, "went round: {farthest}");
    assert_eq!(bench.controller.position(), [0.0; 3]);
}

#[test]
fn a_feed_hold_stops_within_the_braking_distance_and_a_resume_reaches_the_same_end() {
    let mut bench = Bench::new(&[]);
    bench.send_line("G1X100F3000");
    bench.send_line("G1X100Y50");
    bench.wait(1.0);
    let before = bench.controller.position();
    assert!((bench.controller.speed_mm_per_min() - 3000.0).abs() < 1e-6);
    bench.send(b"!");
    assert!(bench.status().starts_with("Hold:1|"));
    bench.wait(0.6);
    // v²/2a = 50² / 200 = 12.5 mm.
    let distance = bench.controller.position()[0] - before[0];
    assert!((distance - 12.5).abs() < STEP_MM, "{distance} mm");
    assert!(bench.status().starts_with("Hold:0|"));
    assert_eq!(bench.controller.speed_mm_per_min(), 0.0);
    bench.wait(60.0);
    assert!(bench.status().starts_with("Hold:0|"), "nothing resumes by itself");
    bench.send(b"~");
    bench.wait(10.0);
    assert_eq!(bench.status(), "Idle|MPos:100.000,50.000,0.000|FS:0,0");
}

#[test]
fn a_resume_while_still_braking_is_ignored() {
    let mut bench = Bench::new(&[]);
    bench.send_line("G1X100F3000");
    bench.wait(1.0);
    bench.send(b"!~");
    bench.wait(5.0);
    assert!(bench.status().starts_with("Hold:0|"));
}

#[test]
fn the_sixteenth_block_waits_for_its_ok() {
    let mut bench = Bench::new(&["$10=3"]);
    let mut answers = 0;
    for x in 1..=17 {
        answers += usize::from(bench.send_line(&format!("G1X{x}F60")) == "ok");
    }
    assert_eq!(answers, 15);
    // The 16th is in work, the 17th is in the receive buffer.
    assert_eq!(bench.status(), "Run|MPos:0.000,0.000,0.000|Bf:0,119|FS:0,0");
    assert_eq!(bench.wait(1.1), "ok");
    assert_eq!(bench.wait(1.0), "ok");
}

#[test]
fn a_feed_override_takes_effect_in_motion() {
    let mut bench = Bench::new(&[]);
    bench.send_line("G1X100F1200");
    bench.wait(1.0);
    bench.send_spaced(&[0x91, 0x91, 0x93]);
    bench.wait(1.0);
    assert!((bench.controller.speed_mm_per_min() - 1452.0).abs() < 1e-6);
    bench.send_spaced(&[0x90]);
    bench.send_spaced(&[0x92; 30]);
    bench.wait(1.0);
    assert!((bench.controller.speed_mm_per_min() - 120.0).abs() < 1e-6, "clamped at 10 %");
    let mut reports = bench.send(b"?") + &bench.send(b"?");
    reports += &bench.send(b"?");
    assert!(reports.contains("|Ov:10,100,100"), "{reports}");
}

#[test]
fn a_rapid_override_slows_rapids_alone() {
    let mut bench = Bench::new(&[]);
    bench.send(&[0x97]);
    bench.send_line("G0X100");
    bench.wait(1.0);
    assert!((bench.controller.speed_mm_per_min() - 1500.0).abs() < 1e-6);
}

#[test]
fn a_cancelled_jog_brakes_and_forgets_the_rest() {
    let mut bench = Bench::new(&[]);
    assert_eq!(bench.send_line("$J=G91X100F3000"), "ok");
    assert_eq!(bench.send_line("$J=G91X100F3000"), "ok");
    bench.wait(1.0);
    let before = bench.controller.position()[0];
    bench.send(&[0x85]);
    bench.wait(2.0);
    let distance = bench.controller.position()[0] - before;
    assert!((distance - 12.5).abs() < STEP_MM, "{distance} mm");
    assert!(bench.status().starts_with("Idle|"));
    // The parser continues from where the axes are.
    bench.send_line("G91G0X1");
    bench.wait(2.0);
    assert!((bench.controller.position()[0] - before - 13.5).abs() < STEP_MM);
}

#[test]
fn inverse_time_moves_take_the_time_they_name() {
    let mut bench = Bench::new(&["$120=100000"]);
    bench.send_line("G93G1X60F1");
    bench.wait(30.0);
    assert!((bench.controller.position()[0] - 30.0).abs() < 0.05);
}

#[test]
fn positions_are_whole_steps() {
    let mut bench = Bench::new(&[]);
    bench.send_line("G0X1.2345678");
    bench.wait(5.0);
    assert_eq!(bench.status(), "Idle|MPos:1.236,0.000,0.000|FS:0,0");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Sampled every millisecond: no axis is faster than `$110` or moves farther than the speed
    /// allows, and at the end each is exactly at the target.
    #[test]
    fn no_axis_exceeds_its_rate_and_every_program_arrives(
        points in prop::collection::vec((-50.0..50.0f64, -50.0..50.0f64, -20.0..20.0f64, 100.0..9000.0f64), 1..12),
        hold_at_ms in 0u64..3000,
        percent_steps in prop::collection::vec(0x91u8..0x95, 0..8),
    ) {
        let settings = settings(&["$110=3000", "$111=4000", "$112=500", "$120=200", "$121=100", "$122=50"]);
        let rates = settings.max_rate_mm_per_min();
        let accelerations = settings.acceleration_mm_per_s2();
        let mut controller = Controller::with_build(Build::new(settings));
        let mut now = Duration::ZERO;
        for (x, y, z, f) in &points {
            controller.receive(now, format!("G1X{x:.3}Y{y:.3}Z{z:.3}F{f:.0}\n").as_bytes());
        }
        let mut last = controller.position();
        let mut last_speed = 0.0;
        let slice = Duration::from_millis(1);
        let longest_acceleration = accelerations.iter().map(|a| a * a).sum::<f64>().sqrt();
        for tick in 0..600_000u64 {
            now += slice;
            if tick == hold_at_ms { controller.receive(now, b"!"); }
            if tick == hold_at_ms + 1500 { controller.receive(now, b"~"); }
            if tick == 200 { controller.receive(now, &percent_steps); }
            controller.advance(now);
            let at = controller.position();
            for axis in 0..3 {
                let speed = (at[axis] - last[axis]).abs() / 0.001 * 60.0;
                // A step of 0.004 mm in one sample of a millisecond reads as 240 mm/min.
                prop_assert!(speed <= rates[axis] + 250.0, "axis {axis} at {speed} mm/min");
            }
            let speed = controller.speed_mm_per_min() / 60.0;
            prop_assert!(
                (speed - last_speed).abs() <= longest_acceleration * 0.001 * 1.001 + 1e-6,
                "from {last_speed} to {speed} mm/s in a millisecond"
            );
            if speed == 0.0 && last_speed == 0.0 && tick > hold_at_ms + 1600 { break; }
            last = at;
            last_speed = speed;
        }
        let (x, y, z, _) = points[points.len() - 1];
        for (reached, wanted) in controller.position().iter().zip([x, y, z]) {
            prop_assert!((reached - wanted).abs() <= 0.0026, "{reached} instead of {wanted}");
        }
    }

    /// On one line the acceleration of each axis itself is limited, sampled by speed.
    #[test]
    fn on_a_line_no_axis_exceeds_its_acceleration(x in -80.0..80.0f64, y in -80.0..80.0f64, f in 100.0..9000.0f64) {
        prop_assume!(x.hypot(y) > 0.1);
        let settings = settings(&["$120=200", "$121=30"]);
        let limits = settings.acceleration_mm_per_s2();
        let mut controller = Controller::with_build(Build::new(settings));
        controller.receive(Duration::ZERO, format!("G1X{x:.3}Y{y:.3}F{f:.0}\n").as_bytes());
        let share = [x / x.hypot(y), y / x.hypot(y)];
        let mut last = 0.0;
        for tick in 1..60_000u64 {
            controller.advance(Duration::from_millis(tick));
            let speed = controller.speed_mm_per_min() / 60.0;
            for axis in 0..2 {
                let acceleration = (speed - last).abs() * share[axis].abs() / 0.001;
                // The end points are whole steps, which turns the line a little.
                prop_assert!(acceleration <= limits[axis] * 1.06 + 1e-6, "axis {axis}: {acceleration} mm/s²");
            }
            if speed == 0.0 && last == 0.0 && tick > 5 { break; }
            last = speed;
        }
    }
}

#[test]
fn outputs_are_switched_when_their_motion_begins_or_at_once() {
    let settings = settings_of(Firmware::GrblHal, &[]);
    let mut bench = Bench::with(Build { ports: [0, 2, 0, 1], ..Build::new(settings) });
    for line in ["G1X10F600", "M62P0", "M67E0Q2.9", "G1X20", "M64P1", "G1X30", "G4P0"] {
        bench.send_line(line);
    }
    bench.settle();
    let switched = |bench: &Bench| -> Vec<String> {
        let text = |it: &Switched| format!("{}={} at {}", it.port, it.value, it.at[0]);
        bench.controller.switched().iter().map(text).collect()
    };
    // M64 is read while the first motion begins; the firmware sets whole numbers.
    assert_eq!(switched(&bench), ["1=1 at 0", "0=1 at 10", "0=2 at 10"]);
    // What no motion has begun is forgotten at a reset.
    bench.send_line("M63P0");
    bench.controller.receive(bench.now, &[0x18]);
    for line in ["G1X5F600", "G4P0"] {
        bench.send_line(line);
    }
    bench.settle();
    assert_eq!(switched(&bench).len(), 3);
}
