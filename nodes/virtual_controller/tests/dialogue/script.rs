//! Runs a script of steps and compares the transcript with the expected one.
//!
//! A script has one step a line. Plain text is sent as a line; `^` begins raw bytes (`?`, `!`,
//! `~` or hexadecimal); `bytes` sends text with `\r`, `\n` and `\xNN` and without a line end.
//! `wait S` advances the time by seconds; `settle` advances until no event is left. `limit X`,
//! `release X`, `cut X`, `mend X`, `door`, `shut` and `power` act on the machine; `alarm N`
//! raises an alarm. `times N A; B` repeats steps N times, and shows the last output.

use crate::common::{Bench, settings, settings_of};
use expect_test::Expect;
use virtual_controller::{Build, Firmware};

fn axis(letter: &str) -> usize {
    ["X", "Y", "Z"].iter().position(|l| *l == letter).unwrap()
}

fn unescaped(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = text;
    while let Some((plain, escape)) = rest.split_once('\\') {
        bytes.extend(plain.as_bytes());
        let used = match escape.as_bytes()[0] {
            b'r' => (b'\r', 1),
            b'n' => (b'\n', 1),
            _ => (u8::from_str_radix(&escape[1..3], 16).unwrap(), 3),
        };
        bytes.push(used.0);
        rest = &escape[used.1..];
    }
    bytes.extend(rest.as_bytes());
    bytes
}

fn step(bench: &mut Bench, text: &str) -> String {
    let (verb, argument) = text.split_once(' ').unwrap_or((text, ""));
    match verb {
        "wait" => return bench.wait(argument.parse().unwrap()),
        "settle" => return bench.settle(),
        "bytes" => return bench.send(&unescaped(argument)),
        "times" => {
            let (count, steps) = argument.split_once(' ').unwrap();
            let steps: Vec<&str> = steps.split(';').map(str::trim).collect();
            let received =
                steps.repeat(count.parse().unwrap()).into_iter().map(|one| step(bench, one));
            return received.last().unwrap_or_default();
        }
        "limit" => bench.controller.hold_limit(axis(argument), true),
        "release" => bench.controller.hold_limit(axis(argument), false),
        "mend" => bench.controller.cut_limit(axis(argument), false),
        "cut" => bench.controller.cut_limit(axis(argument), true),
        "door" => bench.controller.set_door(true),
        "shut" => bench.controller.set_door(false),
        "alarm" => bench.controller.raise_alarm(argument.parse().unwrap()),
        "power" => bench.controller.power_cycle(),
        _ => {
            return match text.strip_prefix('^') {
                Some(raw) if raw.len() == 2 => bench.send(&[u8::from_str_radix(raw, 16).unwrap()]),
                Some(raw) => bench.send(raw.as_bytes()),
                None => bench.send_line(text),
            };
        }
    }
    bench.received()
}

pub(crate) fn check(build: Build, script: &str, expected: Expect) {
    let mut bench = Bench::with(build);
    let mut transcript = String::new();
    for line in script.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let received = step(&mut bench, line);
        transcript += format!("{line:<24} {received}").trim_end();
        transcript += "\n";
    }
    expected.assert_eq(&transcript);
}

pub(crate) fn plain(lines: &[&str]) -> Build {
    Build::new(settings(lines))
}

pub(crate) fn hal(lines: &[&str]) -> Build {
    Build::new(settings_of(Firmware::GrblHal, lines))
}

pub(crate) fn fluid(lines: &[&str]) -> Build {
    Build::new(settings_of(Firmware::FluidNc, lines))
}
