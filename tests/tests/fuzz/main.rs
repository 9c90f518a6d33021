//! Fuzz targets: mutated programs through loader and planner, random contours through
//! the planner; what a controller says, damaged, through the parser; lines, answers and
//! commands in any order through the link, and through the driver as a whole; bags that
//! were hurt or lie, through the reader.
//!
//! A test run tries a fixed number of cases from a fixed seed. For longer:
//!
//! ```text
//! KERF_FUZZ_SECONDS=600 KERF_FUZZ_SEED=7 cargo test --release -p kerf_tests --test fuzz -- --nocapture
//! ```
//!
//! runs each target for so many seconds; another seed gives other cases. What fails is
//! printed with the number that repeats it (`KERF_FUZZ_SEED` is then that number, and the
//! first case is the one that failed).

mod bag_mutate;
mod bags;
mod contours;
mod controller;
mod driver;
mod link;
mod mutate;
mod orders;
mod programs;
mod responses;
mod verdict;
mod verdict_known;

use mutate::Random;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

/// No case is allowed to take longer, on a busy machine and without optimisation.
const CASE_SECONDS_MAX: u64 = 20;

fn setting(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name}={text} is not a number")))
}

/// Runs cases until their number or the time asked for is reached; gives their number.
fn fuzz(name: &str, cases: u64, mut case: impl FnMut(&mut Random)) -> u64 {
    let first = setting("KERF_FUZZ_SEED").unwrap_or(1);
    let seconds = setting("KERF_FUZZ_SECONDS").map(Duration::from_secs);
    let begin = Instant::now();
    for count in 0.. {
        let is_over = seconds.map_or(count >= cases, |seconds| begin.elapsed() >= seconds);
        if is_over {
            return count;
        }
        let seed = first.wrapping_add(count);
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| case(&mut Random::new(seed))));
        if let Err(panic) = outcome {
            #[allow(clippy::print_stderr)]
            {
                eprintln!("{name} fails with KERF_FUZZ_SEED={seed}");
            }
            resume_unwind(panic);
        }
        let took = start.elapsed();
        assert!(took.as_secs() < CASE_SECONDS_MAX, "{name}: {took:?} with KERF_FUZZ_SEED={seed}");
    }
    0
}

#[test]
fn mutated_programs_are_loaded_and_planned_or_refused_at_a_place() {
    let corpus = programs::corpus();
    let mut accepted = 0_u64;
    let cases = fuzz("programs", 2000, |random| {
        accepted += u64::from(programs::check(&corpus, random));
    });
    assert!(accepted * 20 > cases, "{accepted} of {cases} were accepted: too few for a statement");
}

/// Runs cases whose verdicts must not differ, and shows the first that do: as many as
/// `KERF_FUZZ_SHOWN` says.
fn agree(name: &str, cases: u64, mut case: impl FnMut(&mut Random) -> verdict::ProgramOutcome) {
    let (mut accepted, mut disagreed) = (0_u64, Vec::new());
    let first = setting("KERF_FUZZ_SEED").unwrap_or(1);
    let mut count = 0;
    let cases = fuzz(name, cases, |random| {
        match case(random) {
            verdict::ProgramOutcome::Refused => {}
            verdict::ProgramOutcome::Accepted => accepted += 1,
            verdict::ProgramOutcome::Disagreed(what) => {
                disagreed.push(format!("KERF_FUZZ_SEED={}: {what}", first.wrapping_add(count)));
            }
        }
        count += 1;
    });
    let shown = setting("KERF_FUZZ_SHOWN").unwrap_or(10) as usize;
    assert!(
        disagreed.is_empty(),
        "{} of {cases} programs ({accepted} accepted) have no one verdict:\n{}",
        disagreed.len(),
        disagreed.iter().take(shown).cloned().collect::<Vec<_>>().join("\n")
    );
    assert!(accepted * 20 > cases, "{accepted} of {cases} were accepted: too few for a statement");
}

#[test]
fn mutated_programs_get_one_verdict() {
    let corpus = verdict::corpus();
    agree("verdict", 3000, |random| verdict::check(&corpus, random));
}

#[test]
fn contours_that_just_fit_get_one_verdict() {
    agree("fitting", 3000, verdict::check_grid);
}

#[test]
fn random_bytes_are_no_program_and_no_trouble() {
    let controls = programs::controls();
    fuzz("bytes", 1500, |random| programs::check_bytes(&controls, random));
}

#[test]
fn programs_that_call_others_are_loaded_and_planned_or_refused_at_a_place() {
    let profiles = ["nct", "masso", "sinumerik_840c"].map(programs::profile);
    let mut accepted = 0_u64;
    let cases = fuzz("calls", 3000, |random| {
        accepted += u64::from(programs::check_calls(&profiles, random));
    });
    assert!(accepted * 100 > cases, "{accepted} of {cases} were accepted: too few for a statement");
}

#[test]
fn programs_of_the_rs274_language_are_loaded_and_planned_or_refused_at_a_place() {
    let rs274 = settings::load_profile("rs274").expect("a shipped profile");
    let pieces = programs::language();
    let mut accepted = 0_u64;
    let cases = fuzz("language", 3000, |random| {
        accepted += u64::from(programs::check_language(&rs274, &pieces, random));
    });
    assert!(accepted * 50 > cases, "{accepted} of {cases} were accepted: too few for a statement");
}

#[test]
fn what_is_accepted_of_random_contours_is_not_cut() {
    let profile = programs::profile("sinumerik_840c");
    let mut accepted = 0_u64;
    let cases = fuzz("contours", 300, |random| {
        accepted += u64::from(contours::check_ring(&profile, random));
    });
    assert!(accepted * 10 > cases, "{accepted} of {cases} were accepted: too few for a statement");
}

#[test]
fn events_in_any_order_are_planned_or_refused() {
    let controls = programs::controls();
    fuzz("events", 2000, |random| contours::check_events(&controls, random));
}

#[test]
fn what_a_controller_says_is_known() {
    responses::check_clean();
}

#[test]
fn answers_are_read_from_whole_lines_whatever_happens_to_them() {
    fuzz("responses", 4000, responses::check);
}

#[test]
fn one_wrong_byte_takes_no_answer_away_unnoticed() {
    fuzz("wrong byte", 6000, responses::check_one_byte);
}

#[test]
fn a_link_keeps_count_or_says_that_it_does_not() {
    let (mut possible, mut seen) = (0, 0);
    fuzz("link", 400, |random| {
        let early = link::check(random);
        (possible, seen) = (possible + early.possible, seen + early.seen);
    });
    assert!(seen * 10 >= possible * 9, "{seen} of {possible} lost answers were seen in mid-stream");
}

#[test]
fn a_driver_answers_every_command_and_ends_every_goal() {
    let (mut accepted, mut finished, mut succeeded) = (0, 0, 0);
    let cases = fuzz("driver", 150, |random| {
        let goals = driver::check(random);
        accepted += goals.accepted;
        finished += goals.finished;
        succeeded += goals.succeeded;
    });
    assert_eq!(accepted, finished);
    assert!(
        accepted > cases && succeeded * 4 > cases,
        "{accepted} goals in {cases} cases, {succeeded} reached: too few for a statement"
    );
}

#[test]
fn hurt_bags_are_read_as_far_as_they_go_and_recovered() {
    let corpus = bags::corpus();
    let (mut open, mut problems, mut messages) = (0, 0, 0);
    let cases = fuzz("bags", 3000, |random| {
        let outcome = bags::check(&corpus, random);
        open += u64::from(outcome.is_open);
        problems += u64::from(outcome.has_problem);
        messages += u64::from(outcome.has_message);
    });
    assert!(
        open * 2 > cases && messages * 2 > cases && problems * 3 > cases,
        "of {cases} bags {open} opened, {messages} had messages, {problems} were reported as \
         damaged: too few for a statement"
    );
    bags::check_memory();
}

#[test]
fn random_bytes_are_no_bag_and_no_trouble() {
    fuzz("bag bytes", 4000, bags::check_bytes);
    bags::check_memory();
}

#[test]
fn definitions_that_lie_are_refused_or_do_not_fit() {
    let corpus = bags::corpus();
    let mut parsed = 0;
    let cases = fuzz("definitions", 1500, |random| {
        parsed += u64::from(bags::check_definition(&corpus, random));
    });
    assert!(parsed * 5 > cases, "{parsed} of {cases} were definitions: too few for a statement");
    bags::check_memory();
}
