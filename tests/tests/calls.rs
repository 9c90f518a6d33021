//! The calls and loop passes that led to a line, from the program to the machine.

use axis_driver::codes::error_code;
use axis_driver::driver::{CheckTravel, Command, DriverConfig, RunOutcome, RunRequest};
use axis_driver::encoder::EncoderConfig;
use cnc_msgs::calls::chain_after;
use cnc_msgs::chunk::{Collector, ContourChunks, PathChunks};
use cnc_msgs::contour::{Action, ContourEventKind, ProgrammedContour};
use cnc_msgs::convert::WireError;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::{Profile, RestartMode, Strictness};
use cnc_msgs::tool_table::{Tool, ToolTable};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use compensation_planner::{Planning, Verdict, judge, start};
use kerf_tests::line::Line;
use program_loader::LoadOptions;
use std::sync::Arc;
use virtual_controller::{Build, Settings};

fn rs274() -> Profile {
    settings::load_profile("rs274").expect("a shipped profile")
}

fn contour(text: &str) -> ProgrammedContour {
    let loaded = program_loader::load(text.as_bytes(), &rs274(), &LoadOptions::default());
    assert!(loaded.is_accepted(), "{:#?}", loaded.findings);
    loaded.contour
}

fn verdict(contour: &ProgrammedContour) -> Verdict {
    let mut tools = ToolTable::default();
    tools.tools.insert(1, Tool { diameter_mm: 10.0, ..Tool::default() });
    judge(contour, &rs274(), &tools, Planning { certifies: true, ..Planning::default() })
}

fn path(contour: &ProgrammedContour) -> CompensatedPath {
    let plan = verdict(contour).plan;
    assert!(plan.accepted(), "{:#?}", plan.findings);
    plan.path
}

/// A subroutine that cuts a contour with a slot of this width, and two calls of it.
fn twice(width: f64) -> String {
    format!(
        "T1 M6\nF600 S1000 M3\n\
         o<slot> sub\nG0 X#1 Y-20\nG41 D1 G1 X[#1+10] Y0\nX[#1+40]\nY30\nX[#1+{}]\nY0\n\
         X[#1+90]\nG40 G1 X[#1+100] Y-20\no<slot> endsub\n\
         o<slot> call [0]\no<slot> call [200]\nM2\n",
        40.0 + width
    )
}

#[test]
fn an_exact_stop_after_a_call_is_in_the_path() {
    // The subprogram stands after the program.
    let text = "%O1\nG90 G17 G94\nG1 X0 Y0 F100\nG9 G1 X1\nM98 P20\nG9 G1 X5\nM30\n%O20\nG9 G1 X2\nM99\n%\n";
    let profile = settings::load_profile("nct").expect("a shipped profile");
    let loaded = program_loader::load(text.as_bytes(), &profile, &LoadOptions::default());
    assert!(loaded.is_accepted(), "{:#?}", loaded.findings);
    let plan = judge(&loaded.contour, &profile, &ToolTable::default(), Planning::default()).plan;
    assert!(plan.accepted(), "{:#?}", plan.findings);
    let stops = plan.path.events.iter().filter(|it| it.action == Action::ExactStop);
    assert_eq!(stops.map(|it| it.source.line).collect::<Vec<_>>(), [4, 9, 6]);
}

#[test]
fn a_finding_in_a_subroutine_that_is_called_twice_names_the_call() {
    let found = verdict(&contour(&twice(-8.0))).plan.findings;
    let errors: Vec<&Finding> = found.iter().filter(|finding| finding.is_error()).collect();
    let calls: Vec<String> = errors.iter().map(|finding| chain_after(&finding.calls)).collect();
    for line in [13, 14] {
        let wanted = format!(", in o<slot>, called from line {line}");
        assert!(calls.contains(&wanted), "{wanted}: {found:#?}");
    }
    // The other block of a pair is named with its own call.
    for pair in errors.iter().filter(|finding| finding.other.is_some()) {
        assert_eq!(chain_after(&pair.other_calls), chain_after(&pair.calls), "{pair:#?}");
    }
}

#[test]
fn a_certificate_names_the_call_of_its_contour() {
    let verdict = verdict(&contour(&twice(30.0)));
    assert!(verdict.plan.accepted(), "{:#?}", verdict.plan.findings);
    let certificates = &verdict.plan.certificates;
    let calls: Vec<String> = certificates.iter().map(|it| chain_after(&it.calls)).collect();
    let wanted = [13, 14].map(|line| format!(", in o<slot>, called from line {line}"));
    assert_eq!(calls, wanted);
    let limits = certificates.iter().flat_map(|it| it.limited_by.iter().map(move |at| (it, at)));
    let mut count = 0;
    for (certificate, limit) in limits {
        assert_eq!(limit.calls, certificate.calls);
        count += 1;
    }
    assert!(count > 0, "{certificates:#?}");
}

/// Deep calls and many passes: more rows than a chunk has room for.
fn many_rows() -> String {
    "o<down> sub\no1 if [#1 GT 0]\no<down> call [#1-1]\no1 else\nG1 X[#<_x>+1] F100\no1 endif\n\
     o<down> endsub\no2 repeat [100]\no<down> call [40]\no2 endrepeat\nM2\n"
        .to_owned()
}

#[test]
fn the_table_arrives_whole_however_it_is_cut() {
    for text in [twice(30.0), many_rows(), "G0 X1\nM2\n".to_owned()] {
        let contour = contour(&text);
        let path = path(&contour);
        assert_eq!(path.calls, contour.calls);
        let cut = ContourChunks::new("p".into(), contour.clone());
        let manifest = wire::ProgrammedContour { program_id: "p".into(), ..cut.manifest() };
        let mut collector = Collector::for_contour(&manifest).expect("a manifest");
        for index in 0..cut.count() {
            let chunk = cut.chunk(index).expect("a chunk");
            assert!(cnc_msgs::cdr::body(&chunk).len() < cnc_msgs::chunk::MESSAGE_BYTES_MAX);
            collector.add(chunk).expect("it fits");
        }
        assert_eq!(collector.finish(&manifest).expect("a contour"), contour, "{text}");

        let cut = PathChunks::new("p".into(), 1, Arc::new(path.clone()));
        let manifest =
            wire::CompensatedPath { program_id: "p".into(), revision: 1, ..cut.manifest() };
        let mut collector = Collector::for_path(&manifest).expect("a manifest");
        for index in 0..cut.count() {
            let chunk = cut.chunk(index).expect("a chunk");
            assert!(cnc_msgs::cdr::body(&chunk).len() < cnc_msgs::chunk::MESSAGE_BYTES_MAX);
            collector.add(chunk).expect("it fits");
        }
        let received = collector.finish(&manifest).expect("a path");
        assert_eq!(received.calls, path.calls, "{text}");
        let sources = |path: &CompensatedPath| -> Vec<_> {
            path.elements.iter().map(|element| element.source).collect()
        };
        assert_eq!(sources(&received), sources(&path), "{text}");
    }
    let rows = contour(&many_rows()).calls.rows().len();
    assert_eq!(rows, 100 * 42);
}

#[test]
fn a_row_that_the_table_does_not_have_is_refused() {
    let cut = ContourChunks::new("p".into(), contour(&twice(30.0)));
    let manifest = wire::ProgrammedContour { program_id: "p".into(), ..cut.manifest() };
    type Spoil = fn(&mut wire::ContourChunk);
    let spoils: [(&str, Spoil); 3] = [
        ("call", |chunk| chunk.event_calls[0] = 99),
        ("parent", |chunk| chunk.calls[0].parent = 1),
        ("event_calls", |chunk| chunk.event_calls.truncate(1)),
    ];
    for (field, spoil) in spoils {
        let mut chunk = cut.chunk(0).expect("a chunk");
        spoil(&mut chunk);
        let mut collector = Collector::for_contour(&manifest).expect("one").without_checksums();
        collector.add(chunk).expect("it is numbered");
        let error = collector.finish(&manifest).expect_err("it is damaged");
        let cnc_msgs::chunk::ChunkError::Content { error, .. } = error else { panic!("{error}") };
        assert!(matches!(error, WireError::Number { field: of, .. } if of == field), "{error}");
    }
}

#[test]
fn a_start_in_a_line_that_is_run_several_times_says_which() {
    let text = "G0 X0 Y0 Z5\no<row> sub\no1 repeat [3]\nG1 X[#<_x>+10] F600\no1 endrepeat\n\
                o<row> endsub\nG1 Y1 F600\no<row> call\nG0 Y5\no<row> call\nG0 Z9\nM2\n";
    let contour = contour(text);
    let path = path(&contour);
    let begin = |line, occurrence| start(&contour, &rs274(), &path, line, occurrence);
    let refused = begin(4, 0).expect_err("which of six");
    assert_eq!(
        refused.finding.message,
        "line 4 is run 6 times: 1: pass 1 of the loop in line 3, in o<row>, called from line 8; 2: \
         pass 2 of the loop in line 3, in o<row>, called from line 8; 3: pass 3 of the loop in line \
         3, in o<row>, called from line 8; 2 more; 6: pass 3 of the loop in line 3, in o<row>, \
         called from line 10"
    );
    assert_eq!(
        refused.finding.help,
        "say which one, from 1 to 6: --occurrence, or occurrence of the goal"
    );
    for (line, occurrence, x, text) in [
        (4, 1, 0.0, "line 4, pass 1 of the loop in line 3, in o<row>, called from line 8"),
        (4, 5, 40.0, "line 4, pass 2 of the loop in line 3, in o<row>, called from line 10"),
        // The lines of the calls and of the main program are run once.
        (8, 0, 0.0, "line 4, pass 1 of the loop in line 3, in o<row>, called from line 8"),
        (9, 0, 30.0, "line 9"),
        (10, 0, 30.0, "line 4, pass 1 of the loop in line 3, in o<row>, called from line 10"),
        (11, 0, 60.0, "line 11"),
        // The loop begins once in each call, and has three passes each.
        (3, 4, 30.0, "line 4, pass 1 of the loop in line 3, in o<row>, called from line 10"),
    ] {
        let start = begin(line, occurrence).expect("it begins");
        assert_eq!(start.at[0], x, "line {line}, {occurrence}");
        let comma = if text.contains(',') { "," } else { "" };
        let wanted = format!("begins with {text}{comma} at X");
        assert!(start.to_string().starts_with(&wanted), "line {line}: {start}");
    }
    let refused = begin(4, 7).expect_err("there are six");
    assert_eq!(refused.finding.message, "line 4 is run 6 times, and the start asks for number 7");
    assert_eq!(begin(9, 2).expect_err("once").finding.code, Code::Restart);
}

#[test]
fn a_start_that_is_refused_in_a_loop_names_the_pass_of_the_nearest_line() {
    // Of three passes each has its own compensation; the line before it is run as often.
    let text = "G0 X-50 Y-50 Z5\nT1 M6\no1 repeat [3]\nG0 X-40 Y-40\nG41 D1 G1 X0 Y-10 F600\nY30\nX30\nG40 X60\n\
                o1 endrepeat\nM2\n";
    let contour = contour(text);
    let path = path(&contour);
    let mut profile = rs274();
    profile.restart.rule = RestartMode::Forbidden;
    profile.restart.strictness = Strictness::Error;
    let begin = |line, occurrence| start(&contour, &profile, &path, line, occurrence);
    for pass in 1..=3 {
        let refused = begin(7, pass).expect_err("it is under compensation");
        assert_eq!((refused.nearest.line, refused.nearest_occurrence), (4, pass));
        let start = begin(4, refused.nearest_occurrence).expect("what it names is a start");
        let wanted = format!("pass {pass} of the loop in line 3");
        assert!(start.to_string().contains(&wanted), "{start}");
    }
    // Which of them is meant cannot be guessed, and neither can the line of a time.
    for (line, occurrence, text) in
        [(7, 0, "run 3 times"), (7, 4, "number 4"), (0, 3, "names no line")]
    {
        let refused = begin(line, occurrence).expect_err(text);
        assert!(refused.finding.message.contains(text), "{}", refused.finding.message);
        assert_eq!((refused.nearest.line, refused.nearest_occurrence), (0, 0), "{text}");
    }
    let past = begin(9, 0).expect_err("nothing is cut after it");
    assert_eq!((past.nearest.line, past.nearest_occurrence), (8, 3), "the last time");
    assert!(begin(1, 2).expect_err("once").finding.message.contains("run once"));
}

/// A controller whose X ends at -10 mm, and a program that goes on along X in a loop.
#[test]
fn an_alarm_in_a_loop_names_the_pass() {
    let text = "G21 G90\no<go> sub\no1 repeat [5]\nG1 X[#<_x>+40] F3000\no1 endrepeat\n\
                o<go> endsub\nG1 X0 Y0 Z0 F3000\no<go> call\nM2\n";
    let contour = contour(text);
    let path = path(&contour);
    let mut settings = Settings::small_router();
    for line in ["$22=1", "$20=1"] {
        settings.set_line(line).expect("a setting");
    }
    let build = Build { start_in_machine: Some([-100.0, -200.0, -50.0]), ..Build::new(settings) };
    // The driver would refuse the program.
    let config = DriverConfig { check_travel: CheckTravel::Off, ..DriverConfig::default() };
    let mut line = Line::new(config, build, &[]);
    line.until("locked", |line| line.mode() == Mode::Alarm);
    line.ask(Command::Unlock).expect("unlocked");
    let at = line.state().work_position.expect("a position");
    let mut path = path;
    for element in &mut path.elements {
        element.end = [0, 1, 2].map(|axis| element.end[axis] + at[axis]);
    }
    path.start = at;
    line.start(path, 0);
    let result = line.result();
    assert_eq!(result.error_code, error_code::ALARM, "{}", result.message);
    assert!(
        result
            .message
            .ends_with("at line 4, pass 3 of the loop in line 3, in o<go>, called from line 8"),
        "{}",
        result.message
    );
    // The controller read that block and cut nothing of it.
    assert_eq!((result.last_line, result.last_occurrence), (7, 0), "line 7 is run once");
}

#[test]
fn what_a_run_waits_for_in_a_subroutine_names_the_call() {
    let text = "o<change> sub\nT#1 M6\nG1 X[#<_x>+10] F600\nM0\no<change> endsub\nG0 X0 Y0 Z0\n\
                o<change> call [1]\no<change> call [2]\nM2\n";
    let path = path(&contour(text));
    let mut line = Line::new(DriverConfig::default(), Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.ask(Command::SetSingleBlock(true)).expect("it stops at each block");
    line.start(path, 0);
    let mut reasons = Vec::new();
    while line.finished.is_none() {
        line.step();
        let state = line.state();
        if matches!(state.mode, Mode::Hold | Mode::ToolChange)
            && reasons.last() != Some(&state.reason)
        {
            reasons.push(state.reason);
            let answer = match state.mode {
                Mode::Hold => Command::Resume,
                _ => Command::ConfirmToolChange { objection: None },
            };
            line.ask(answer).expect("it goes on");
        }
    }
    for call in [7, 8] {
        let tool = call - 6;
        let chain = format!(", in o<change>, called from line {call})");
        for wanted in [
            format!("TOOL_CHANGE: put in T{tool} (line 2{chain}"),
            format!("SINGLE_BLOCK: resume to go on (line 3{chain}"),
            format!("PROGRAM_STOP: resume to go on (line 4{chain}"),
        ] {
            assert!(
                reasons.iter().any(|reason| reason.starts_with(&wanted)),
                "{wanted}: {reasons:#?}"
            );
        }
    }
}

#[test]
fn a_deviation_in_a_loop_names_the_pass() {
    let text =
        "G0 X0 Y0 Z0\no1 repeat [5]\nG1 X[#<_x>+10] F600\nG1 Y[#<_y>+10]\no1 endrepeat\nM2\n";
    let path = path(&contour(text));
    let mut line = Line::new(DriverConfig::default(), Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.spoil_next(|bytes| {
        let text = std::str::from_utf8(bytes).ok()?;
        text.contains("Y30").then(|| text.replace("Y30", "Y90").into_bytes())
    });
    line.start(path, 0);
    line.until("it is held", |line| line.mode() == Mode::Hold && !line.state().reason.is_empty());
    let reason = line.state().reason;
    // Just past the end of the damaged line, the next one could be under way.
    let wanted = "PATH_DEVIATION: at line 3, pass 4 of the loop in line 2, the tool is ";
    assert!(reason.starts_with(wanted), "{reason}");
}

#[test]
fn a_run_that_is_canceled_in_a_loop_says_in_which_pass() {
    let text = "G0 X0 Y0 Z0\no1 repeat [5]\nG1 X[#<_x>+40] F600\no1 endrepeat\nM2\n";
    let path = path(&contour(text));
    let mut line = Line::new(DriverConfig::default(), Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.start(path.clone(), 0);
    line.until("the third pass", |line| line.state().work_position.is_some_and(|at| at[0] > 90.0));
    line.ask(Command::CancelRun { run: None }).expect("it is stopped");
    let result = line.result();
    assert_eq!(result.outcome, RunOutcome::Canceled, "{}", result.message);
    assert_eq!((result.last_line, result.last_occurrence), (3, 3));
    let entry = path.entry(3, result.last_occurrence).expect("it can go on there");
    assert_eq!(path.start_of(entry.element)[0], 80.0);
}

#[test]
fn a_run_begins_at_the_pass_that_was_asked_for() {
    let text = "G0 X0 Y0 Z0\no1 repeat [3]\nG1 X[#<_x>+10] F600\no1 endrepeat\nM2\n";
    let path = path(&contour(text));
    let mut line = Line::new(DriverConfig::default(), Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    let request = |occurrence| {
        Command::RunProgram(RunRequest {
            program_id: "part".into(),
            revision: 1,
            path: Arc::new(path.clone()),
            start_line: 3,
            occurrence,
            in_span: Default::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        })
    };
    let refusal = line.ask(request(0)).expect_err("which of three");
    assert_eq!(refusal.error_code, error_code::START_LINE);
    assert!(refusal.message.contains("line 3 is run 3 times: 1: pass 1"), "{refusal}");
    // The tool stands where the first pass begins.
    line.ask(request(1)).expect("it begins");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    let code = match line.ask(request(2)) {
        Ok(_) => line.result().error_code,
        Err(refusal) => refusal.error_code,
    };
    assert_eq!(code, error_code::START_POSITION);
    // A time without a line is not the whole program.
    for (start_line, occurrence, text) in [(0, 3, "names no line"), (1, 9, "asks for number 9")] {
        let Command::RunProgram(asked) = request(occurrence) else { panic!("it is a run") };
        let refusal = line.ask(Command::RunProgram(RunRequest { start_line, ..asked }));
        let refusal = refusal.expect_err(text);
        assert!(refusal.message.contains(text), "{refusal}");
    }
}

#[test]
fn what_cannot_be_sent_names_its_call() {
    let text = "o<far> sub\nG1 X#1 F600\no<far> endsub\nG0 X0 Y0 Z0\no<far> call [5]\n\
                o<far> call [20000]\nM2\n";
    let path = Arc::new(path(&contour(text)));
    let mut encoder = axis_driver::encoder::Encoder::new(path, EncoderConfig::default());
    let error = std::iter::from_fn(|| encoder.next_step()).find_map(Result::err).expect("too far");
    let text = error.to_string();
    assert!(text.starts_with("line 2, in o<far>, called from line 6: X20000"), "{text}");
}

#[test]
fn each_element_has_the_call_of_its_motion() {
    let contour = contour(&twice(30.0));
    let path = path(&contour);
    let motions = contour.events.iter().filter_map(|event| match event.kind {
        ContourEventKind::Motion(_) => Some(event.source),
        _ => None,
    });
    let motions: Vec<_> = motions.collect();
    assert!(path.elements.iter().all(|element| motions.contains(&element.source)));
    let second = path.elements.iter().filter(|element| element.source.call == 2).count();
    assert_eq!(second * 2, path.elements.len(), "both calls make the same elements");
}
