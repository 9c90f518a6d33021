//! The command line of the virtual controller.

use intake::yaml::Limits;
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;

use super::listen::{Listen, Protocol};
use super::serve::{ServeOptions, eprint, serve};
use super::stop::{StopHandle, stop_pair};
use crate::scenario::{COORDINATE_MM_MAX, RECEIVE_BUFFER_BYTES, TIME_FACTORS};
use crate::{AxisLetters, Fault, Firmware, Machine, Scenario, Settings, Vector};

/// A grbl 1.1, grblHAL or FluidNC controller with axes that move in time, on a pseudo-terminal or a network port.
///
/// Prints the path of its port as the first line, and another path whenever a fault moves the
/// port there. Runs until SIGTERM or SIGINT. It is not hardware, and no part of it is a safety
/// function.
#[derive(Debug, Parser)]
// The brackets belong to the grammar of faults; they are not links.
#[allow(rustdoc::broken_intra_doc_links)]
#[command(name = "virtual_controller", version)]
struct Arguments {
    /// A YAML file with any of these options; an option given here overrides it, faults are added.
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// The firmware to imitate: grbl (1.1h; the default), grblhal or fluidnc.
    #[arg(long, value_name = "NAME")]
    firmware: Option<Firmware>,
    /// Bytes of the receive buffer as $I reports them [default: the firmware's].
    #[arg(long, value_name = "BYTES", value_parser = buffer_bytes)]
    receive_buffer: Option<usize>,
    /// Initial settings: router (600 x 400 x 100 mm, 5 m/min, 24 000 rpm; the default) or generic
    /// (freshly flashed firmware).
    #[arg(long, value_name = "NAME")]
    machine: Option<Machine>,
    /// The axes of the board: XYZ and up to three of A, B, C, U, V and W [default: XYZ]
    #[arg(long, value_name = "LETTERS")]
    axes: Option<AxisLetters>,
    /// A file of lines `$n=v`; `#` and `;` begin comments.
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,
    /// Switches homing on ($22=1): locked at power-up until $H or $X, except grblHAL.
    #[arg(long)]
    homing: bool,
    /// Machine position at power-up in mm; without it the axes are mid-travel and read 0,0,0.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    start: Option<Vector>,
    /// Height in mm at which the probe touches; without it no probe is wired.
    #[arg(long, value_name = "Z", value_parser = number, allow_hyphen_values = true)]
    probe_z: Option<f64>,
    /// Includes line numbers: `Ln` in reports.
    #[arg(long)]
    line_numbers: bool,
    /// Includes mist coolant: M7.
    #[arg(long)]
    mist: bool,
    /// Repeats each line that it has read: `[echo: ]`.
    #[arg(long)]
    echo: bool,
    /// Bits per second, ten to a byte, in both directions; 0: no delay [default: 115200; 0 with
    /// --listen tcp:// and ws://]
    #[arg(long)]
    baud: Option<u32>,
    /// Runs the machine this many times faster than real time [default: 1]
    #[arg(long, value_name = "N", value_parser = time_factor)]
    time_factor: Option<f64>,
    /// Speeds the bytes up by the time factor, too.
    #[arg(long)]
    fast_bytes: bool,
    /// A symbolic link to the port, removed at the end.
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Listens on a network in place of a pseudo-terminal: tcp://127.0.0.1:7023, ws://127.0.0.1:7081
    /// or rfc2217://127.0.0.1:7217. One client at a time; another is refused.
    #[arg(long, value_name = "URL", conflicts_with_all = ["link", "resets_on_open"])]
    listen: Option<Listen>,
    /// With --listen: a session goes on for so long after its client has left, as on boards that do
    /// not notice a lost one.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, requires = "listen")]
    keep_session: Option<Duration>,
    /// A fault: ACTION[:ARGUMENT]@TRIGGER=VALUE; may be repeated.
    ///
    /// Actions: rx-drop, rx-duplicate, rx-corrupt, rx-digit (bytes to the controller), tx-drop,
    /// tx-duplicate, tx-corrupt (bytes from it), rx-delay:SECONDS, tx-delay:SECONDS, lose-ok,
    /// extra-ok, lose-line, extra-line, mute:TEXT, garble:TEXT (the next line from it that contains
    /// the text), silent[:SECONDS], push:TEXT, alarm:N, reset, limit:AXIS, release:AXIS, cut:AXIS,
    /// door, close-door, close, vanish:SECONDS, unplug:SECONDS. Triggers: line=N (the Nth answer;
    /// for lose-line and extra-line the Nth line), byte=N, time=SECONDS (machine time), rate=P
    /// (probability for each byte, answer or line).
    #[arg(long = "fault", value_name = "FAULT", verbatim_doc_comment)]
    faults: Vec<Fault>,
    /// Seed of the random faults [default: 1]
    #[arg(long)]
    seed: Option<u64>,
    /// Resets the board when its port is opened, as Arduino boards do, unless HUPCL is off and the
    /// port was open before.
    #[arg(long)]
    resets_on_open: bool,
    /// Reads fault actions from standard input, one a line, and ends when it is closed.
    #[arg(long)]
    stdin: bool,
    /// Writes a JSON file at the end: what was received, answered and moved.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Ends when this process ends.
    #[arg(long, value_name = "PID")]
    parent_pid: Option<i32>,
}

/// Runs the virtual controller with these arguments, the program's name first.
///
/// Exit status: 0 stopped by request; 2 wrong arguments, a file that cannot be read or written,
/// or no pseudo-terminal.
pub fn cli(arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> ExitCode {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprint(&message);
            ExitCode::from(2)
        }
    }
}

fn run(arguments: Arguments) -> Result<(), String> {
    let options = options(arguments)?;
    let failed = |error: io::Error| format!("cannot wait for signals: {error}");
    let (handle, stop) = stop_pair().map_err(failed)?;
    stop_on_signals(&handle).map_err(failed)?;
    let mut is_first = true;
    let announce = |path: &Path| {
        let mut out = io::stdout().lock();
        let printed = writeln!(out, "{}", path.display()).and_then(|()| out.flush());
        // The reader of standard output may be gone by now.
        if std::mem::take(&mut is_first) { printed } else { Ok(()) }
    };
    serve(options, &stop, announce).map_err(|error| error.to_string())
}

fn stop_on_signals(handle: &StopHandle) -> io::Result<()> {
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::low_level::pipe::register(signal, handle.duplicate()?)?;
    }
    Ok(())
}

fn options(arguments: Arguments) -> Result<ServeOptions, String> {
    let replace = |scenario: &mut Scenario| override_with(scenario, &arguments);
    let scenario = match &arguments.scenario {
        None => {
            let mut scenario = Scenario::default();
            replace(&mut scenario);
            scenario
        }
        Some(path) => read_scenario(path, replace)?,
    };
    let mut settings = scenario.settings().map_err(|error| error.to_string())?;
    if let Some(path) = &arguments.settings {
        apply(&mut settings, &read(path)?).map_err(|error| format!("{}{error}", path.display()))?;
    }
    if arguments.homing {
        settings.set(22, 1.0).expect("homing may always be switched on");
    }
    let build = scenario.build(settings);
    Ok(ServeOptions {
        timing: scenario.timing(),
        faults: scenario.faults,
        seed: scenario.seed.unwrap_or(1),
        link: arguments.link,
        watches_stdin: arguments.stdin,
        parent_pid: arguments.parent_pid,
        report: arguments.report,
        resets_on_open: scenario.resets_on_open,
        listen: arguments.listen,
        keeps_session: arguments.keep_session.unwrap_or_default(),
        ..ServeOptions::new(build)
    })
}

/// Reads a scenario from a file; the command line replaces some of its values.
///
/// # Errors
/// The file cannot be read, or is not a scenario. The message names the file and the line.
pub fn read_scenario(path: &Path, replace: impl FnOnce(&mut Scenario)) -> Result<Scenario, String> {
    let text = read(path)?;
    Scenario::from_yaml_with(&text, replace).map_err(|error| format!("{}:{error}", path.display()))
}

fn read(path: &Path) -> Result<String, String> {
    let failed = |why: &dyn std::fmt::Display| format!("cannot read {}: {why}", path.display());
    let bytes = intake::file::read(path, Limits::FILE.bytes as u64).map_err(|why| failed(&why))?;
    String::from_utf8(bytes).map_err(|why| failed(&why))
}

/// Options of the command line override the scenario; faults are added.
fn override_with(scenario: &mut Scenario, arguments: &Arguments) {
    scenario.firmware = arguments.firmware.or(scenario.firmware);
    scenario.machine = arguments.machine.or(scenario.machine);
    scenario.axes = arguments.axes.or(scenario.axes);
    scenario.receive_buffer_bytes = arguments.receive_buffer.or(scenario.receive_buffer_bytes);
    scenario.start_mm = arguments.start.or(scenario.start_mm);
    scenario.probe_z_mm = arguments.probe_z.or(scenario.probe_z_mm);
    scenario.line_numbers |= arguments.line_numbers;
    scenario.mist |= arguments.mist;
    scenario.echo |= arguments.echo;
    scenario.baud = arguments.baud.or(scenario.baud);
    // A network has no baud rate; a gateway has one.
    if arguments.listen.is_some_and(|listen| listen.protocol != Protocol::Rfc2217) {
        scenario.baud = scenario.baud.or(Some(0));
    }
    scenario.time_factor = arguments.time_factor.or(scenario.time_factor);
    scenario.fast_bytes |= arguments.fast_bytes;
    scenario.resets_on_open |= arguments.resets_on_open;
    scenario.seed = arguments.seed.or(scenario.seed);
    scenario.faults.extend(arguments.faults.iter().cloned());
}

/// Applies the lines of a settings file; an error begins with `:LINE: `.
fn apply(settings: &mut Settings, text: &str) -> Result<(), String> {
    for (index, line) in text.lines().enumerate() {
        let line = line.split(['#', ';']).next().unwrap_or("").trim();
        if line.is_empty() {
            continue;
        }
        settings.set_line(line).map_err(|code| {
            let firmware = settings.firmware();
            format!(":{}: {firmware} rejects `{line}` ({code}); write $n=v", index + 1)
        })?;
    }
    Ok(())
}

fn buffer_bytes(text: &str) -> Result<usize, String> {
    let value: Option<usize> = text.parse().ok();
    value
        .filter(|bytes| RECEIVE_BUFFER_BYTES.contains(bytes))
        .ok_or_else(|| format!("`{text}` is not a number of bytes from 16 to 65536"))
}

fn seconds(text: &str) -> Result<Duration, String> {
    let value = text.parse().ok().filter(|seconds| (0.0..=86_400.0).contains(seconds));
    value
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("`{text}` is not a number of seconds from 0 to 86400"))
}

fn number(text: &str) -> Result<f64, String> {
    let is_usable = |value: &f64| value.is_finite() && value.abs() <= COORDINATE_MM_MAX;
    text.trim()
        .parse()
        .ok()
        .filter(is_usable)
        .ok_or_else(|| format!("`{text}` is not a number of millimetres within 100000"))
}

fn point(text: &str) -> Result<Vector, String> {
    let values = text.split(',').map(number).collect::<Result<Vec<_>, _>>()?;
    values.try_into().map_err(|_| format!("`{text}` is not X,Y,Z in millimetres"))
}

fn time_factor(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|factor| TIME_FACTORS.contains(factor))
        .ok_or_else(|| format!("`{text}` is not a factor from 0.001 to 10000"))
}
