//! `kerf-fleet`, which `kerf fleet` runs: reads arguments, and prints what came of them.

// What the command prints is its result.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use clap::{Args, Parser, Subcommand};
use fleet::core::condition::Condition;
use fleet::core::key::{build_name, check_build, key_of};
use fleet::core::shard::Shard;
use fleet::store::Store;
use fleet::{FleetError, bisect, page, pages, push, report, worker};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Store, replay and query bags of many machines, with any number of workers.
#[derive(Debug, Parser)]
#[command(name = "kerf-fleet", bin_name = "kerf fleet", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Put bags into a store, each once, with a row in its index
    Push(PushArgs),
    /// Replay one shard of a store with this build, and write the verdicts
    Replay(ReplayArgs),
    /// Show the replay results of a build, or compare those of two builds
    Report(ReportArgs),
    /// Find the commit that changed the result of a bag
    Bisect(BisectArgs),
}

/// Where the bags are.
#[derive(Debug, Args)]
struct StoreArgs {
    /// The store: file:///FOLDER, a folder, or s3://BUCKET/PREFIX
    #[arg(long, value_name = "URL")]
    store: String,
}

#[derive(Debug, Args)]
struct PushArgs {
    /// Bag directories or .mcap files
    #[arg(required_unless_present = "spool")]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    store: StoreArgs,
    /// Name of the machine in the index [default: the namespace of its topics, else this host]
    #[arg(long, value_name = "NAME")]
    machine: Option<String>,
    /// Send at most so many kilobytes per second
    #[arg(long, value_name = "KB", value_parser = clap::value_parser!(u32).range(1..))]
    limit_rate: Option<u32>,
    /// Read the bags that the store has, and send again what is damaged there
    #[arg(long)]
    verify: bool,
    /// Make the store if there is none: once, while its share is mounted
    #[arg(long)]
    create: bool,
    /// Keep bags in this folder while the store does not answer; the next push sends them
    #[arg(long, value_name = "DIR")]
    spool: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct ReplayArgs {
    #[command(flatten)]
    store: StoreArgs,
    /// The shard of this worker: 0/4 to 3/4 for four workers
    #[arg(long, value_name = "I/N", default_value = "0/1")]
    shard: Shard,
    /// Only bags whose row fulfils this: "control = 'rs274' and holds > 0"
    #[arg(long = "where", value_name = "EXPR")]
    condition: Option<Condition>,
    /// Name of this build in the verdicts [default: its commit and the sha256 of this program]
    #[arg(long, value_name = "SHA")]
    build: Option<String>,
    /// Folder for what is not yet written to the store [default: kerf-fleet in the temporary folder]
    #[arg(long, value_name = "DIR")]
    journal: Option<PathBuf>,
    /// Bags that unpack to more are not replayed, and have the verdict `error`
    #[arg(long, value_name = "MB", default_value_t = 512)]
    bag_mb_max: u64,
}

#[derive(Debug, Args)]
struct ReportArgs {
    #[command(flatten)]
    store: StoreArgs,
    /// The build [default: the one whose first verdict is the newest]
    #[arg(long, value_name = "SHA")]
    build: Option<String>,
    /// Show which verdicts this other build has otherwise
    #[arg(long, value_name = "SHA")]
    against: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Write a page for a browser
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Draw the first bag of each group too, into FILE.pages (in place of .html), and link to it
    #[arg(long, requires = "html")]
    pages: bool,
}

#[derive(Debug, Args)]
struct BisectArgs {
    /// A bag directory or an .mcap file
    bag: PathBuf,
    /// A commit whose result is the wanted one
    #[arg(long, value_name = "SHA")]
    good: String,
    /// A later commit with another result
    #[arg(long, value_name = "SHA")]
    bad: String,
    /// The checkout whose history is searched
    #[arg(long, value_name = "DIR", default_value = ".")]
    repository: PathBuf,
    /// Folder for one worktree and one build folder [default: kerf-bisect in the temporary folder]
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
    /// What builds a commit, in its worktree
    #[arg(
        long,
        value_name = "COMMAND",
        default_value = "cargo build --release --locked --bin kerf"
    )]
    build_with: String,
    /// The program that this makes, in the build folder or the worktree
    #[arg(long, value_name = "FILE", default_value = "release/kerf")]
    program: PathBuf,
}

fn main() -> ExitCode {
    let words = match intake::arguments::words() {
        Ok(words) => words,
        Err(error) => return failed(&FleetError::Usage(error)),
    };
    let cli = Cli::parse_from(std::iter::once("kerf-fleet".to_owned()).chain(words));
    let done = match cli.command {
        Command::Push(args) => run_push(args),
        Command::Replay(args) => run_replay(&args),
        Command::Report(args) => run_report(&args),
        Command::Bisect(args) => run_bisect(args),
    };
    done.unwrap_or_else(|error| failed(&error))
}

fn failed(error: &FleetError) -> ExitCode {
    say(&error.to_string());
    ExitCode::from(error.status())
}

fn say(sentence: &str) {
    eprintln!("kerf fleet: {sentence}");
}

fn run_push(args: PushArgs) -> Result<ExitCode, FleetError> {
    let url = &args.store.store;
    let store = if args.create { Store::create(url) } else { Store::open(url) };
    let store = store.map(|mut store| {
        store.rate_max = args.limit_rate.map(|kilobytes| f64::from(kilobytes) * 1_000.0);
        store
    });
    let order = push::Order {
        bags: args.bags,
        machine: args.machine,
        spool: args.spool,
        verify: args.verify,
    };
    let push::Done { sent, known, refused, waiting } =
        push::push(store.as_ref().map_err(Clone::clone), &order, &say)?;
    println!("{sent} bags sent, {known} were there, {refused} refused, {waiting} wait");
    Ok(ExitCode::from(u8::from(refused > 0)))
}

fn run_replay(args: &ReplayArgs) -> Result<ExitCode, FleetError> {
    let build = match &args.build {
        Some(build) => build.clone(),
        None => own_name()?,
    };
    let build = build.as_str();
    check_build(build).map_err(FleetError::Usage)?;
    let bag_bytes_max = args.bag_mb_max.checked_mul(1 << 20).ok_or_else(|| {
        FleetError::Usage(format!(
            "--bag-mb-max {} is more than a file can have; the most is {}",
            args.bag_mb_max,
            u64::MAX >> 20
        ))
    })?;
    let store = Store::open(&args.store.store)?;
    let journal = args.journal.clone().unwrap_or_else(|| std::env::temp_dir().join("kerf-fleet"));
    let order = worker::Order {
        shard: args.shard,
        condition: args.condition.clone(),
        build,
        journal: &journal,
        bag_bytes_max,
    };
    let begun = Instant::now();
    let done = worker::run(&store, &order, &say)?;
    let (seconds, memory) = (begun.elapsed().as_secs_f64(), worker::memory_mb().unwrap_or(0.0));
    let worker::Done { replayed, taken_over, known, absent } = done;
    println!(
        "shard {} of build {build}: {replayed} replayed in {seconds:.1} s ({:.0} bags/s, {memory:.0} MB), {taken_over} \
         taken over, {known} known, {absent} absent",
        args.shard,
        replayed as f64 / seconds.max(1e-9)
    );
    Ok(ExitCode::SUCCESS)
}

/// The name of this build when none is given.
fn own_name() -> Result<String, FleetError> {
    let program = std::env::current_exe().map_err(|why| {
        FleetError::NotDone(format!("this program is not found: {why}; use --build NAME"))
    })?;
    let content = std::fs::read(&program).map_err(|why| FleetError::file(&program, why))?;
    build_name(run_recorder::COMMIT, &key_of(&content)).map_err(FleetError::Usage)
}

fn run_report(args: &ReportArgs) -> Result<ExitCode, FleetError> {
    let store = Store::open(&args.store.store)?;
    let mut report = report::report(&store, args.build.as_deref(), args.against.as_deref())?;
    if args.json {
        println!("{:#}", report.json());
    } else {
        print!("{}", report.text());
    }
    if let Some(file) = &args.html {
        if args.pages {
            pages::draw(&store, &mut report, file, &say)?;
        }
        std::fs::write(file, page::html(&report)).map_err(|why| FleetError::file(file, why))?;
    }
    report.problems.iter().for_each(|problem| say(problem));
    Ok(ExitCode::from(u8::from(!report.problems.is_empty())))
}

fn run_bisect(args: BisectArgs) -> Result<ExitCode, FleetError> {
    let order = bisect::Order {
        bag: args.bag,
        good: args.good,
        bad: args.bad,
        repository: args.repository,
        work: args.work.unwrap_or_else(|| std::env::temp_dir().join("kerf-bisect")),
        build: args.build_with,
        program: args.program,
    };
    let bisect::Found { commit, subject, suspects, built } = bisect::run(&order, &say)?;
    println!("{commit} {subject}");
    println!("is the first of {built} builds that differs");
    for suspect in suspects {
        println!("{suspect} does not build or cannot compare the bag, and may be the first");
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }
}
