//! Many programs, and the count of what became of them.

use crate::judge::{Judgement, NotJudged, Wrong, WrongKind, judge};
use crate::program::{CONTROLS, Program};
use crate::{draw, product, profiles};
use settings::Control;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;

/// What became of many programs.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// By control and outcome.
    pub outcomes: BTreeMap<(Control, Judgement), u64>,
    /// Programs in which something was drawn.
    pub features: BTreeMap<&'static str, u64>,
    /// Refusals by a rule, by the code of the finding.
    pub rules: BTreeMap<(Control, &'static str), u64>,
    /// Programs with a verdict that is wrong.
    pub wrong: Vec<(u64, Vec<Wrong>)>,
}

/// Draws the programs of these seeds, and judges what the product says of them, in two threads.
///
/// # Panics
/// A thread did.
pub fn run(seeds: Range<u64>) -> Tally {
    let middle = seeds.start + (seeds.end - seeds.start) / 2;
    std::thread::scope(|scope| {
        let other = scope.spawn(move || run_alone(middle..seeds.end));
        let mut tally = run_alone(seeds.start..middle);
        tally.add(other.join().expect("the other half"));
        tally
    })
}

fn run_alone(seeds: Range<u64>) -> Tally {
    let profiles = profiles();
    let mut tally = Tally::default();
    for seed in seeds {
        let program = draw::program(seed);
        let verdict = product(&program, &profiles);
        let (outcome, wrong) = judge(&program, &verdict);
        if outcome == Judgement::RefusedByRule
            && let Some(finding) = verdict.findings.iter().find(|finding| finding.is_error())
        {
            *tally.rules.entry((program.control, finding.code.name())).or_default() += 1;
        }
        tally.count(&program, outcome, wrong);
    }
    tally
}

impl Tally {
    fn count(&mut self, program: &Program, outcome: Judgement, wrong: Vec<Wrong>) {
        *self.outcomes.entry((program.control, outcome)).or_default() += 1;
        for feature in &program.features {
            *self.features.entry(feature).or_default() += 1;
        }
        if !wrong.is_empty() {
            self.wrong.push((program.seed, wrong));
        }
    }

    fn add(&mut self, other: Self) {
        for (key, count) in other.outcomes {
            *self.outcomes.entry(key).or_default() += count;
        }
        for (key, count) in other.features {
            *self.features.entry(key).or_default() += count;
        }
        for (key, count) in other.rules {
            *self.rules.entry(key).or_default() += count;
        }
        self.wrong.extend(other.wrong);
    }

    /// How many programs of a control had this outcome.
    pub fn of(&self, control: Control, outcome: Judgement) -> u64 {
        self.outcomes.get(&(control, outcome)).copied().unwrap_or(0)
    }

    /// How many programs had this outcome.
    pub fn all(&self, outcome: Judgement) -> u64 {
        CONTROLS.into_iter().map(|control| self.of(control, outcome)).sum()
    }

    /// The programs with something of a kind that is wrong.
    pub fn wrong_of(&self, kind: WrongKind) -> impl Iterator<Item = u64> + '_ {
        let is_of = move |(_, wrong): &&(u64, Vec<Wrong>)| wrong.iter().any(|it| it.kind == kind);
        self.wrong.iter().filter(is_of).map(|(seed, _)| *seed)
    }

    /// What is wrong, in words.
    pub fn lines(&self) -> Vec<String> {
        let words = |wrong: &[Wrong]| {
            wrong.iter().map(|it| format!("{:?}: {}", it.kind, it.what)).collect::<Vec<_>>()
        };
        self.wrong
            .iter()
            .map(|(seed, it)| format!("seed {seed}: {}", words(it).join("; ")))
            .collect()
    }

    /// As a table in Markdown.
    pub fn table(&self) -> String {
        let columns = [
            ("accepted", Judgement::Accepted),
            ("refused, does not fit", Judgement::Refused),
            ("refused by a rule", Judgement::RefusedByRule),
            ("not judged: tolerance", Judgement::NotJudged(NotJudged::Tolerance)),
            ("not judged: unknown", Judgement::NotJudged(NotJudged::Unknown)),
            ("not judged: lead", Judgement::NotJudged(NotJudged::Lead)),
            ("not judged: change", Judgement::NotJudged(NotJudged::Change)),
            ("wrong", Judgement::Wrong),
        ];
        let mut table = String::from("| profile |");
        // Writing to a string cannot fail.
        for (name, _) in columns {
            let _ = write!(table, " {name} |");
        }
        table += "\n|---|";
        table += &"--:|".repeat(columns.len());
        for control in CONTROLS {
            let _ = write!(table, "\n| {control} |");
            for (_, outcome) in columns {
                let _ = write!(table, " {} |", self.of(control, outcome));
            }
        }
        table += "\n| **all** |";
        for (_, outcome) in columns {
            let _ = write!(table, " {} |", self.all(outcome));
        }
        table + "\n"
    }
}
