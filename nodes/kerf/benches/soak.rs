//! An hour of machine time, a million lines, every message accounted for.
//!
//! ```text
//! cargo bench -p kerf --bench soak                         1 M lines, ten times as fast
//! cargo bench -p kerf --bench soak -- --lines 100000       fewer
//! cargo bench -p kerf --bench soak -- --time-factor 5      slower
//! cargo bench -p kerf --bench soak -- --test               2000 lines
//! ```
//!
//! A whole machine of real processes runs one program. Then the accounts are compared: what the
//! program has; what the driver sent and received, by the journal in the bag; what the controller
//! read, answered and moved, by its own counts; the goal's result; and a replay of the bag. The
//! memory of each process is sampled while the program runs. Ends with status 1 when anything
//! disagrees or memory grows.

#![allow(clippy::print_stdout)]

mod rig;

use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::TrafficEntry;
use cnc_msgs::wire::cnc_msgs::srv::{GetTraffic, GetTrafficRequest};
use rig::Arguments;
use rig::accounts::Books;
use rig::controller::{InProcess, read_counts};
use rig::memory::{Held, Sampler};
use rig::support::{TIMEOUT, kerf};
use rig::whole::{Whole, spiral_program};
use run_recorder::files::open_bag;
use run_recorder::info::BagInfo;
use serde_json::Value;
use std::fmt::Display;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A segment and its time: a million of them are an hour.
const LENGTH_MM: f64 = 0.4;
const LINE_S: f64 = 3.6e-3;
/// How much memory may grow in the last quarter of a run, MB or share of all: bounded buffers are
/// full by then.
const GROWTH_MB_MAX: f64 = 1.0;
const GROWTH_MAX: f64 = 0.01;
/// The driver keeps about this much of its traffic, for recorders that missed some.
const TRAFFIC_KEPT_BYTES: usize = 24 << 20;

fn main() -> ExitCode {
    let arguments = Arguments::read();
    let lines: usize = arguments.value("--lines", 1_000_000, 2_000);
    let time_factor: f64 = arguments.value("--time-factor", 10.0, 10.0);
    let folder = tempfile::tempdir().expect("a folder");
    let report = folder.path().join("report.json");
    let mut controller = InProcess::start(
        folder.path(),
        &[
            "--fast-bytes",
            "--time-factor",
            &time_factor.to_string(),
            "--report",
            report.to_str().expect("a path of ours is UTF-8"),
        ],
    );
    let whole = Whole::start("soak", &controller.port);
    whole.load(&spiral_program(lines, LENGTH_MM, LENGTH_MM / LINE_S * 60.0));
    let before = Books::of(traffic_so_far(&whole).into_iter(), LENGTH_MM);
    println!("{lines} lines, {time_factor} times as fast; {}", rig::load());

    let sampler = Sampler::start(processes(&whole, &controller));
    let begin = Instant::now();
    let goal = whole.run();
    // A run that takes ten times as long will not end.
    let within = TIMEOUT + Duration::from_secs_f64(10.0 * LINE_S * lines as f64 / time_factor);
    let result = whole.wait(goal.result(within)).expect("a goal ends with a result").1;
    let seconds = begin.elapsed().as_secs_f64();
    let memory = sampler.stop();
    let bag = whole.machine.until_bags(1).remove(0);
    controller.stop();
    let counts = read_counts(&report);

    let mut opened = open_bag(&bag).expect("a bag");
    let is_whole = opened.verify().is_ok() && opened.is_complete();
    if !is_whole {
        println!("{}", BagInfo::new(&bag.display().to_string(), &opened));
    }
    drop(opened);
    let books = Books::of_bag(&bag, LENGTH_MM);
    println!(
        "{seconds:.0} s or {:.0} s of machine time, {:.0} lines/s; the planner ran empty {} \
         times; {}\n",
        seconds * time_factor,
        lines as f64 / seconds,
        counts["underruns"],
        rig::load()
    );
    let mut checks = Checks::default();
    checks.compare(&result, &books, &before, &counts, lines);
    checks.row("the bag is whole", is_whole, true);
    let replay = whole.command(kerf(), &["replay", bag.to_str().expect("UTF-8")]).status();
    checks.row("a replay does the same", replay.expect("kerf can be run").success(), true);
    println!();
    checks.memory(&memory, &books);
    drop(whole);
    if checks.failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The driver's traffic since it was started.
fn traffic_so_far(whole: &Whole) -> Vec<TrafficEntry> {
    whole.wait(async {
        let client = whole.node().client::<GetTraffic>("get_traffic").expect("a client");
        let (mut entries, mut first_sequence) = (Vec::<TrafficEntry>::new(), 1);
        loop {
            let answer = client.call(GetTrafficRequest { first_sequence }).await;
            let answer = answer.expect("the driver answers");
            assert!(answer.success, "{}", answer.message);
            entries.extend(answer.entries);
            let last = entries.last().map_or(0, |entry| entry.sequence);
            if last >= answer.newest_sequence {
                return entries;
            }
            first_sequence = last + 1;
        }
    })
}

fn processes(whole: &Whole, controller: &InProcess) -> Vec<(String, u32)> {
    let nodes = whole.machine.nodes().into_iter().map(|(id, line)| {
        let name = line.split(" node --leave-with-parent ").nth(1).unwrap_or(&line);
        let name = name.split(' ').next().unwrap_or_default().to_owned();
        (name, id.as_raw_nonzero().get().unsigned_abs())
    });
    let mut processes: Vec<(String, u32)> = nodes.collect();
    processes.sort();
    processes.push(("virtual_controller".to_owned(), controller.id()));
    processes
}

/// The tables, and how many of their rows are wrong.
#[derive(Default)]
struct Checks {
    failed: usize,
}

impl Checks {
    fn row<T: PartialEq + Display>(&mut self, what: &str, found: T, wanted: T) {
        let is_so = found == wanted;
        self.failed += usize::from(!is_so);
        let verdict = if is_so { "" } else { "  WRONG" };
        println!("{what:<52} {found:>12} {wanted:>12}{verdict}");
    }

    fn compare(
        &mut self,
        result: &RunProgramResult,
        books: &Books,
        before: &Books,
        counts: &Value,
        lines: usize,
    ) {
        let count = |name: &str| counts[name].as_u64().unwrap_or(u64::MAX);
        let lines = lines as u64;
        println!("{:<52} {:>12} {:>12}", "", "found", "wanted");
        self.row("outcome of the goal", result.outcome, RunProgramResult::OUTCOME_SUCCEEDED);
        self.row("traffic entries missing in the bag", books.missing, 0);
        // One move goes to the start of the program.
        self.row("moves sent, by the bag", books.moves, lines + 1);
        let wrong = books.wrong.as_ref();
        let wrong = wrong.map_or("none".to_owned(), |(at, line)| format!("{at}: {line}"));
        self.row("first move out of the program's order", wrong, "none".to_owned());
        self.row("lines answered ok, by the bag", books.oks, books.lines);
        self.row("lines not answered ok, by the bag", books.errors, 0);
        let all = before.lines + books.lines;
        self.row("lines read by the controller, earlier ones included", count("lines_read"), all);
        self.row("lines it answered ok", count("oks"), all);
        self.row("moves it completed", count("motions_finished"), books.moves);
        self.row("blocks it completed", count("blocks_executed"), count("blocks_planned"));
        self.row("bytes it lost", count("bytes_lost"), 0);
        self.row("alarms it raised", count("alarms"), 0);
    }

    fn memory(&mut self, processes: &[Held], books: &Books) {
        println!(
            "{:<22} {:>12} {:>12} {:>9} {:>29}",
            "memory, MB", "1st quarter", "4th quarter", "most", "slope of 4th quarter, MB/min"
        );
        for held in processes {
            let last_mb = held.mean_mb(6..8);
            let growth_mb = held.mean_mb(7..8) - held.mean_mb(6..7);
            let grows = growth_mb > GROWTH_MB_MAX.max(GROWTH_MAX * last_mb);
            let fills = held.name == "axis_driver" && books.bytes * 3 / 4 < TRAFFIC_KEPT_BYTES;
            self.failed += usize::from(grows && !fills);
            let verdict = match (grows, fills) {
                (false, _) => "",
                (true, false) => "  GROWS",
                (true, true) => "  (fills its buffer of traffic)",
            };
            println!(
                "{:<22} {:>12.1} {last_mb:>12.1} {:>9.1} {:>29.3}{verdict}",
                held.name,
                held.mean_mb(0..2),
                held.most_mb(),
                held.slope_mb_per_min(6..8),
            );
        }
    }
}
