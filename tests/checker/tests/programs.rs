//! Programs of all profiles, and what loader and planner say of them.
//!
//! `KERF_CHECKER_PROGRAMS=1000000` draws so many programs, `KERF_CHECKER_SEED=7` begins at
//! another seed. Build with `--release` for many.

use kerf_checker::judge::{Judgement, WrongKind};
use kerf_checker::program::CONTROLS;
use kerf_checker::tally;

/// Seeds below [`PROGRAMS`] whose refusal is known to be a false alarm; `docs/proof.md` has the
/// causes. Nothing else may be wrong.
const KNOWN: &[u64] = &[];

const PROGRAMS: u64 = 6000;

fn setting(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|value| value.parse().expect("a number"))
}

#[test]
fn no_program_is_cut_silently_and_no_fitting_tool_is_refused() {
    let first = setting("KERF_CHECKER_SEED").unwrap_or(0);
    let count = setting("KERF_CHECKER_PROGRAMS").unwrap_or(PROGRAMS);
    let tally = tally::run(first..first + count);
    let lines = tally.lines();
    // One in the first million is known.
    let silent: Vec<u64> = [WrongKind::SilentCut, WrongKind::NotFollowed]
        .iter()
        .flat_map(|kind| tally.wrong_of(*kind))
        .collect();
    assert!(silent.len() as u64 * 100_000 <= count, "{silent:?}:\n{}", lines.join("\n"));
    let is_new = |(seed, _): &&(u64, _)| !KNOWN.contains(seed);
    let new = tally.wrong.iter().filter(is_new).count() as u64;
    if count <= PROGRAMS && first == 0 {
        assert_eq!(new, 0, "{}", lines.join("\n"));
    } else {
        // The known causes: one program in five hundred at most.
        assert!(new * 500 <= count, "{}\n{}", tally.table(), lines.join("\n"));
    }
    // Otherwise nothing was asked.
    for control in CONTROLS {
        let of = |outcome| tally.of(control, outcome);
        let drawn = count / CONTROLS.len() as u64;
        assert!(of(Judgement::Accepted) * 8 > drawn, "{control}:\n{}", tally.table());
        assert!(of(Judgement::Refused) * 12 > drawn, "{control}:\n{}", tally.table());
    }
    for feature in [
        "D words",
        "arc leads",
        "change of side",
        "legs that cross",
        "negative radius",
        "overlap",
        "rapid leads",
        "roll in",
        "roll out",
        "several depths",
        "several spans",
    ] {
        let drawn = tally.features.get(feature).copied().unwrap_or(0);
        assert!(drawn * 100 > count, "{feature} in {drawn} of {count} programs");
    }
}

#[test]
fn a_seed_gives_the_same_program_every_time() {
    for seed in 0..60 {
        let (one, other) = (kerf_checker::draw::program(seed), kerf_checker::draw::program(seed));
        assert_eq!(one.text, other.text);
        assert!(seed == 0 || one.text != kerf_checker::draw::program(seed - 1).text);
    }
}
