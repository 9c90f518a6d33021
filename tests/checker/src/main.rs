//! Draws and checks programs: `kerf_checker [first seed] [count]`; with one number it shows the
//! program of that seed.
#![allow(clippy::print_stdout, reason = "what was counted is what this command is for")]

use kerf_checker::judge::{WrongKind, judge};
use kerf_checker::{draw, product, profiles, tally};
use std::process::ExitCode;

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    match numbers[..] {
        [seed] => show(seed),
        [first, count] => {
            let tally = tally::run(first..first + count);
            println!("{}", tally.table());
            for (feature, count) in &tally.features {
                println!("{feature}: {count}");
            }
            for ((control, code), count) in &tally.rules {
                println!("refused by a rule: {control} {code}: {count}");
            }
            for line in tally.lines().iter().take(200) {
                println!("{line}");
            }
            for kind in [
                WrongKind::SilentCut,
                WrongKind::NotFollowed,
                WrongKind::FalseGouge,
                WrongKind::FalseUnreachable,
                WrongKind::FalseLeadGouge,
                WrongKind::InternalError,
            ] {
                println!("{kind:?}: {}", tally.wrong_of(kind).count());
            }
            println!("{} wrong", tally.wrong.len());
            return ExitCode::from(u8::from(!tally.wrong.is_empty()));
        }
        _ => println!("usage: kerf_checker FIRST_SEED COUNT, or kerf_checker SEED"),
    }
    ExitCode::SUCCESS
}

fn show(seed: u64) {
    let program = draw::program(seed);
    let verdict = product(&program, &profiles());
    println!("{} {:?}\n{}", program.control, program.tools, program.text);
    for finding in &verdict.findings {
        println!(
            "{:?} {} line {}: {}",
            finding.severity,
            finding.code.name(),
            finding.source.line,
            finding.message
        );
    }
    for span in &program.spans {
        println!(
            "side {} {:?} {:?} {:?} {:?}",
            span.side, span.corner, span.begin, span.end, span.lines
        );
        for element in &span.elements {
            println!(
                "  line {} pass {} {:?} {:?} R {:?} copy {}",
                element.line,
                element.pass,
                element.role,
                element.shape,
                element.radius_mm,
                element.is_copy
            );
        }
        println!(
            "  fits: {:?}; less 4 um: {:?}",
            kerf_checker::fit::fits(span, 0.0),
            kerf_checker::fit::fits(span, 0.004)
        );
    }
    for element in verdict.path.elements.iter().chain(&verdict.refused) {
        println!(
            "  {} line {} {:?} {:?}",
            element.role.name(),
            element.source.line,
            element.end,
            element.shape
        );
    }
    println!("{:?}", judge(&program, &verdict));
}
