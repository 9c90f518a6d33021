//! The row of a bag in the index: what the recording says of itself.

use crate::core::key::{hex, key_of};
use crate::core::schema::{INDEX, Row, Value, place};
use cnc_msgs::cdr;
use cnc_msgs::units::mm_from_m;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use replay::recording::Recording;
use run_recorder::bag_reader::{Bag, RUN_RECORD};
use std::io::{Read, Seek};

/// What a bag does not say itself.
#[derive(Debug, Clone, Default)]
pub struct Outside {
    /// The key.
    pub bag: String,
    /// Bytes of the file.
    pub bytes: u64,
    /// `--machine`, if it was given.
    pub machine: Option<String>,
    /// The machine if nothing else names one.
    pub host: String,
    /// Why the bag is marked, if it is.
    pub kept: Option<String>,
}

/// The row of a bag; a bag that cannot be read as a run has a row that says why.
pub fn row_of<R: Read + Seek>(bag: &mut Bag<R>, outside: &Outside) -> Row {
    let recording = Recording::read(bag);
    let mut row = vec![Value::Null; INDEX.len()];
    let mut set = |name: &str, value: Value| row[place(INDEX, name)] = value;
    let run = bag.metadata_named(RUN_RECORD).cloned().unwrap_or_default();
    let of_run = |key: &str| Value::text(run.get(key).map_or("", String::as_str));
    set("bag", Value::text(&outside.bag));
    set("bytes", Value::count(outside.bytes));
    set("machine", Value::text(&machine(bag, outside)));
    set("run", of_run("run_id"));
    set("program", of_run("program"));
    set("program_sha256", of_run("program_sha256"));
    set(
        "control",
        if run.contains_key("control") { of_run("control") } else { of_run("controller") },
    );
    set("build", of_run("build"));
    let summary = bag.summary();
    if let Some((start_ns, _)) = summary.time_range_ns {
        set("start", Value::count(start_ns / 1_000));
        set("duration_s", Value::real(summary.duration_ns() as f64 / 1e9));
    }
    set("messages", Value::count(summary.message_count));
    set("complete", Value::Integer(i64::from(bag.is_complete())));
    let kept = outside.kept.as_deref().map(|why| if why.is_empty() { "marked" } else { why });
    set("kept", Value::text(kept.unwrap_or("")));
    match recording {
        Ok(recording) => of_recording(&recording, &mut set),
        Err(error) => set("problem", Value::text(&error.to_string())),
    }
    row
}

/// `--machine`, else the namespace of the driver's topics, else the host.
fn machine<R: Read + Seek>(bag: &Bag<R>, outside: &Outside) -> String {
    if let Some(machine) = &outside.machine {
        return machine.clone();
    }
    let namespaces = bag.channels().iter().filter_map(|it| it.topic.strip_suffix("/machine_state"));
    let namespace = namespaces.map(|it| it.trim_start_matches('/')).find(|it| !it.is_empty());
    namespace.unwrap_or(&outside.host).to_owned()
}

fn of_recording(recording: &Recording, set: &mut impl FnMut(&str, Value)) {
    // The metadata of bags of others do not name the program; its messages do.
    if let Some(program) = recording.programs.values().next_back() {
        set("program_sha256", Value::text(&key_of(&program.text)));
        set("control", Value::text(&program.manifest.control));
        if !program.manifest.name.is_empty() {
            set("program", Value::text(&program.manifest.name));
        }
    }
    if let Some(settings) = &recording.settings {
        set("firmware", Value::text(&settings.firmware));
        set("firmware_version", Value::text(&settings.version));
        let rows = settings.settings.iter().map(|it| format!("{}={}\n", it.number, it.value));
        set("settings_sha256", Value::text(&key_of(rows.collect::<String>().as_bytes())));
    }
    if let Some(end) = recording.end() {
        set("outcome", Value::text(&end.outcome));
        // Older bags do not say the code of a run that failed.
        let is_known = end.error_code > 0 || end.outcome == "succeeded";
        set("error_code", if is_known { Value::count(end.error_code) } else { Value::Null });
        set("last_line", Value::count(end.last_line));
    }
    of_states(recording, set);
    of_certificates(recording, set);
    if let Some(tools) = recording.tool_tables.values().next_back() {
        let table = wire::ToolTable { stamp: Time::default(), revision: 0, ..tools.into() };
        set("tools_sha256", Value::text(&key_of(&cdr::encapsulated(&table))));
        let of_tools = table.tools.iter().map(|tool| tool.wear_diameter / 2.0);
        let wears = of_tools.chain(table.offsets.iter().map(|offset| offset.wear));
        let largest = wears.max_by(|one, other| one.abs().total_cmp(&other.abs()));
        set("wear_mm", largest.map_or(Value::Null, |wear| Value::real(mm_from_m(wear))));
    }
    let mut goals = recording.commands.iter().rev();
    if let Some(goal) = goals.find(|it| it.endpoint.ends_with("run_program")) {
        // The rest of the 16 bytes numbers the writers of one participant.
        set("commander", Value::text(&hex(&goal.sender[..12])));
    }
}

/// What the machine went through.
fn of_states(recording: &Recording, set: &mut impl FnMut(&str, Value)) {
    use wire::MachineState as State;
    let states = || recording.states.iter().map(|it| &it.state);
    if states().next().is_none() {
        return;
    }
    let entries = |wanted: u8| {
        let before = std::iter::once(State::STATE_UNKNOWN).chain(states().map(|it| it.state));
        states()
            .zip(before)
            .filter(move |(state, before)| state.state == wanted && *before != wanted)
    };
    set("alarms", Value::count(entries(State::STATE_ALARM).count()));
    let alarm = states().map(|it| it.alarm_code).find(|code| *code > 0);
    set("alarm_code", alarm.map_or(Value::Null, Value::count));
    set("holds", Value::count(entries(State::STATE_HOLD).count()));
    set("tool_changes", Value::count(entries(State::STATE_TOOL_CHANGE).count()));
    let tools = entries(State::STATE_TOOL_CHANGE).map(|(state, _)| state.tool_wanted.to_string());
    set("tools", Value::text(&tools.collect::<Vec<_>>().join(",")));
    let running =
        states().filter(|it| it.state == State::STATE_RUN && it.feed_override.is_finite());
    let overrides: Vec<f64> = running.map(|it| it.feed_override).collect();
    if !overrides.is_empty() {
        let least = overrides.iter().copied().fold(f64::INFINITY, f64::min);
        set("feed_override_min", Value::real(least));
        set(
            "feed_override_mean",
            Value::real(overrides.iter().sum::<f64>() / overrides.len() as f64),
        );
    }
}

/// How much room the certificates leave; what nothing limits has no number.
fn of_certificates(recording: &Recording, set: &mut impl FnMut(&str, Value)) {
    let reports = recording.plans.values().map(|plan| &plan.report);
    let spans = || reports.clone().flat_map(|report| &report.certificates);
    let least = |of: fn(&wire::RadiusCertificate) -> Option<f64>| {
        let least = spans().filter_map(of).filter(|it| !it.is_nan()).fold(f64::INFINITY, f64::min);
        Value::real(mm_from_m(least))
    };
    // `valid_to` below the radius is where something is consumed already: no clearance that is left.
    set(
        "least_clearance_mm",
        least(|it| Some(it.valid_to.min(it.leads_valid_to) - it.radius).filter(|it| *it >= 0.0)),
    );
    set(
        "certificate_slack_mm",
        least(|it| Some((it.valid_to - it.radius).min(it.radius - it.valid_from))),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use run_recorder::files::open_bag;
    use std::path::Path;

    /// The row of a golden bag, as `name value` of these columns.
    fn golden(name: &str, columns: &[&str]) -> String {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags").join(name);
        let outside = Outside { host: "cell".into(), ..Outside::default() };
        let row = row_of(&mut open_bag(&path).expect("a bag"), &outside);
        let shown = columns.iter().map(|column| row[place(INDEX, column)].to_string());
        shown.collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_row_says_what_the_recording_says() {
        let end = &["machine", "control", "program", "outcome", "error_code", "problem"];
        for (bag, expected) in [
            ("sinumerik_840c_contour", "cell sinumerik_840c contour.mpf succeeded 0 -"),
            ("osp_lathe_shaft", "cell osp_lathe shaft.min succeeded 0 -"),
            ("alarm_hard_limit", "cell sinumerik_840c arch.mpf aborted - -"),
        ] {
            assert_eq!(golden(bag, end), expected, "{bag}");
        }
        let states =
            &["alarms", "alarm_code", "holds", "tool_changes", "tools", "feed_override_min"];
        for (bag, expected) in
            [("alarm_hard_limit", "1 1 0 0 - 1"), ("rs274_hold_and_tool_change", "0 - 1 1 1 1")]
        {
            assert_eq!(golden(bag, states), expected, "{bag}");
        }
        assert_eq!(golden("sinumerik_840c_wear_correction", &["wear_mm"]), "-0.05");
        for bag in ["sinumerik_840c_contour", "sinumerik_840c_wear_correction", "osp_lathe_shaft"] {
            let clearance = golden(bag, &["least_clearance_mm"]);
            let is_room = clearance.parse::<f64>().is_ok_and(|it| it >= 0.0);
            assert!(is_room || clearance == "-", "{bag}: {clearance}");
        }
        assert_eq!(golden("sinumerik_840c_contour", &["firmware", "complete"]), "grbl 1");
    }
}
