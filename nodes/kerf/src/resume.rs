//! `kerf run --resume`: how a run that was broken off goes on.
//!
//! [`start_of`] decides the line. The planner says what its control makes of a start there, and the driver
//! which lines come first and whether the rest fits the machine. Nothing moves before the answer is yes.

use crate::exit::{Failure, Status};
use crate::latched::{LATCHED_WITHIN, newest, newest_there};
use crate::operate::{Refused, RunArgs, begin_or_refused, no_answer, no_result};
use crate::output_file::OutputFile;
use crate::page::StartInTheMiddle;
use axis_driver::codes::error_code::{START_LINE, USER_FUNCTION};
use cnc_msgs::chunk::Collector;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::Profile;
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramGoal, RunProgramResult};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::msg::{CompensationReport, MachineState, Program, RunResult};
use cnc_msgs::wire::cnc_msgs::srv::{
    GetContourChunks, GetContourChunksRequest, GetPathChunks, GetPathChunksRequest,
    GetProgramChunks, GetProgramChunksRequest, PlanStart, PlanStartRequest, PlanStartResponse,
};
use intake::text::one_line;
use replay::run_result;
use runtime::chunks::pull;
use runtime::{Client, Handle, Qos};
use std::error::Error;
use std::io::{IsTerminal, Write};
use std::time::Duration;

/// How long the driver may take to encode the rest of a program.
const CHECKED_WITHIN: Duration = Duration::from_secs(300);

/// Lines before the one that was asked for that are tried, where the driver does not begin there.
const LINES_BACK_MAX: u32 = 20;

/// The line and occurrence to go on with, or why there is none. `asked` is the line that was asked
/// for, or 0, with its occurrence.
fn start_of(
    last: Option<&RunResult>,
    loaded: Option<&Program>,
    asked: (u32, u32),
) -> Result<(u32, u32), String> {
    let by_hand = "or say where to begin: kerf run --resume --start-line LINE";
    let Some(loaded) = loaded else {
        return Err("no program is loaded: load the one of the run, with kerf load FILE".into());
    };
    if asked.0 > 0 {
        return Ok(asked);
    }
    let Some(last) = last else {
        return Err(format!(
            "the driver has run nothing since it was started; the bag of the run says where it ended (kerf bag info), \
             {by_hand}"
        ));
    };
    if last.program_id != loaded.program_id {
        let name = one_line(&loaded.name);
        return Err(format!(
            "{name}, which is loaded, is not the program of the last run: load that one, {by_hand}"
        ));
    }
    if last.outcome == RunResult::OUTCOME_SUCCEEDED {
        return Err("the last run was cut to its end: kerf run begins at the start".into());
    }
    if last.error_code == USER_FUNCTION {
        return Err(format!("{}: {by_hand}", last.message));
    }
    let occurrence_or = |of_last| if asked.1 > 0 { asked.1 } else { of_last };
    match (last.last_line, last.start_line) {
        (0, 0) => Err(format!(
            "the last run ended before it cut: kerf run begins at the start, {by_hand}"
        )),
        // It went on with one before it, and never came to it.
        (0, line) => Ok((line, occurrence_or(last.start_occurrence))),
        (line, _) => Ok((line, occurrence_or(last.last_occurrence))),
    }
}

/// `line 12`, or `line 12 (occurrence 3)` where the program runs it several times.
fn place((line, occurrence): (u32, u32)) -> String {
    match occurrence {
        0 => format!("line {line}"),
        occurrence => format!("line {line} (occurrence {occurrence})"),
    }
}

/// What has to be done first, in the order in which it is done.
fn obstacles(state: &MachineState) -> Vec<String> {
    let mut first = Vec::new();
    if state.needs_reset {
        first.push("reset the controller: kerf reset".to_owned());
    }
    match mode_from_wire(state.state) {
        Mode::Idle => {}
        Mode::Alarm => {
            first.push("the machine is in ALARM: kerf unlock, and kerf home where it homes".into());
        }
        Mode::Disconnected => first.push("no controller is connected".into()),
        // The reset is said already.
        _ if state.needs_reset => {}
        mode => first.push(format!("the machine is in {}: kerf abort", mode.name())),
    }
    first
}

/// The goal that goes on with a run, once its user has confirmed it.
pub(crate) async fn confirmed(node: &Handle, args: &RunArgs) -> Result<RunProgramGoal, Failure> {
    let page = OutputFile::claim_if(args.html.as_deref(), &[])?;
    let mut states = node.subscription::<MachineState>("machine_state", Qos::LATCHED)?;
    let mut results = node.subscription::<RunResult>("run_result", Qos::LATCHED)?;
    let mut programs = node.subscription::<Program>("program", Qos::LATCHED)?;
    let mut reports =
        node.subscription::<CompensationReport>("compensation_report", Qos::LATCHED)?;
    let mut paths = node.subscription::<wire::CompensatedPath>("compensated_path", Qos::LATCHED)?;
    let mut contours =
        node.subscription::<wire::ProgrammedContour>("programmed_contour", Qos::LATCHED)?;
    let refused = |why: String| Failure::new(Status::NodeRefused, why);

    let (state, last, loaded, report) = tokio::join!(
        newest(&mut states, |it| (it.header.stamp.sec, it.header.stamp.nanosec)),
        newest(&mut results, |it| (it.stamp.sec, it.stamp.nanosec)),
        newest(&mut programs, |it| (it.stamp.sec, it.stamp.nanosec)),
        newest(&mut reports, |it| it.revision),
    );
    let state = state.ok_or_else(|| no_answer(states.topic(), LATCHED_WITHIN))?;
    let asked = (args.start_line.unwrap_or_default(), args.occurrence.unwrap_or_default());
    let start = start_of(last.as_ref(), loaded.as_ref(), asked).map_err(refused)?;
    let program = loaded.unwrap_or_default();
    let Program { program_id, name, .. } = program.clone();
    let report = report.filter(|it| it.program_id == program_id && it.accepted);
    let Some(CompensationReport { revision, .. }) = report else {
        return Err(refused(format!("{} has no plan that may be run", one_line(&name))));
    };

    if let Some(last) = last.as_ref().filter(|it| it.program_id == program_id) {
        println!("{}: the last run: {}", one_line(&name), run_result::of_message(last));
    }
    let goal_at = |(start_line, occurrence)| {
        let program_id = program_id.clone();
        RunProgramGoal { program_id, start_line, check_only: false, occurrence, revision }
    };
    let ((line, occurrence), planned, said) = accepted_start(node, &goal_at, start).await?;
    if (line, occurrence) != start {
        println!(
            "it cannot begin with {}, so it begins with {}",
            place(start),
            place((line, occurrence))
        );
    }
    let goal = goal_at((line, occurrence));
    let rows = rows_of(planned, &said);
    rows.iter().for_each(|row| println!("  {row}"));
    if let Some(page) = page {
        let path = newest_there(&mut paths, |it| it.revision).await;
        let path = path.filter(|it| (&it.program_id, it.revision) == (&goal.program_id, revision));
        let contour = newest_there(&mut contours, |_| 0).await;
        let contour = contour.filter(|it| it.program_id == goal.program_id);
        let (Some(path), Some(contour)) = (path, contour) else {
            return Err(Failure::new(Status::NoAnswer, "the planner shows no path to draw"));
        };
        let manifests = Manifests { program, contour, path };
        draw(node, page, &manifests, (line, occurrence), &rows).await?;
    }
    let first = obstacles(&state);
    if !first.is_empty() {
        return Err(refused(format!("before it can begin: {}", first.join("; "))));
    }
    if !state.is_homed {
        println!(
            "  the machine is not homed: be sure that it stands where it says, and that its zero is right"
        );
    }
    if !args.yes && !is_confirmed((line, occurrence))? {
        return Err(refused("nothing was run".into()));
    }
    // The driver refuses it if the program was planned anew while the question stood there.
    Ok(goal)
}

/// Where planner and driver begin for this line, and what both say of it. What the program has lost the
/// place of only the driver knows: where it refuses a line, the nearest one before that it takes counts.
async fn accepted_start(
    node: &Handle,
    goal_at: &impl Fn((u32, u32)) -> RunProgramGoal,
    start: (u32, u32),
) -> Result<((u32, u32), String, String), Failure> {
    let planner = node.client::<PlanStart>("plan_start")?;
    let (at, planned) = planned_start(&planner, &goal_at(start), start).await?;
    let refused = match checked(node, goal_at(at)).await {
        Ok(said) => return Ok((at, planned, said)),
        Err(refused) => refused,
    };
    if refused.error_code == START_LINE {
        for at in lines_before(at.0).map(|line| (line, 0)) {
            let answer = plan_start(&planner, &goal_at(at), at).await?;
            if answer.success
                && let Ok(said) = checked(node, goal_at(at)).await
            {
                println!("{}", refused.failure.message);
                return Ok((at, one_line(&answer.message).into_owned(), said));
            }
        }
    }
    Err(refused.into())
}

/// The lines that are tried instead, the nearest first. Line 1 would be the whole program.
fn lines_before(line: u32) -> impl Iterator<Item = u32> {
    (line.saturating_sub(LINES_BACK_MAX).max(2)..line).rev()
}

/// Where the control begins for this line, and what is in force there.
async fn planned_start(
    planner: &Client<PlanStart>,
    goal: &RunProgramGoal,
    (line, occurrence): (u32, u32),
) -> Result<((u32, u32), String), Failure> {
    let answer = plan_start(planner, goal, (line, occurrence)).await?;
    let nearest = (answer.nearest_line, answer.nearest_occurrence);
    let (start, answer) = match answer.error_code {
        PlanStartResponse::START_REFUSED
            if answer.nearest_line > 0 && nearest != (line, occurrence) =>
        {
            println!("{}", one_line(&answer.message));
            (nearest, plan_start(planner, goal, nearest).await?)
        }
        _ => ((line, occurrence), answer),
    };
    let message = one_line(&answer.message).into_owned();
    if answer.success { Ok((start, message)) } else { Err(Failure::of_node(&message)) }
}

/// What the planner says of a start.
async fn plan_start(
    planner: &Client<PlanStart>,
    goal: &RunProgramGoal,
    (line, occurrence): (u32, u32),
) -> Result<PlanStartResponse, Failure> {
    let (program_id, revision) = (goal.program_id.clone(), goal.revision);
    Ok(planner.call(PlanStartRequest { program_id, revision, line, occurrence }).await?)
}

/// What will be done, a row each: what the planner says, and the parts of what the driver says.
fn rows_of(planned: String, checked: &str) -> Vec<String> {
    std::iter::once(planned).chain(checked.split("; ").map(str::to_owned)).collect()
}

/// What the driver would send first, and how long the rest takes.
async fn checked(node: &Handle, goal: RunProgramGoal) -> Result<String, Refused> {
    let goal = RunProgramGoal { check_only: true, ..goal };
    let handle = begin_or_refused::<RunProgram>(node, "run_program", goal).await?;
    let (_, result) = handle.result(CHECKED_WITHIN).await.map_err(no_result)?;
    let message = one_line(&result.message).into_owned();
    if result.outcome == RunProgramResult::OUTCOME_SUCCEEDED {
        return Ok(message);
    }
    let error_code = result.error_code;
    let failure = Failure::of_node(&format!("{message} (error {error_code})"));
    Err(Refused { error_code, failure })
}

/// Asks on the terminal; without one nobody can answer.
fn is_confirmed(start: (u32, u32)) -> Result<bool, Failure> {
    if !std::io::stdin().is_terminal() {
        return Err(Failure::new(
            Status::NodeRefused,
            "nothing was run: there is no terminal to confirm on; --yes begins without asking",
        ));
    }
    print!("Begin with {}? [y/N] ", place(start));
    let mut answer = String::new();
    let read = std::io::stdout().flush().and_then(|()| std::io::stdin().read_line(&mut answer));
    read.map_err(Failure::usage)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}

/// What the page of a start is drawn from, announced by three nodes.
struct Manifests {
    program: Program,
    contour: wire::ProgrammedContour,
    path: wire::CompensatedPath,
}

/// The same, fetched.
struct Fetched {
    text: Vec<u8>,
    contour: ProgrammedContour,
    profile: Profile,
    path: CompensatedPath,
}

/// Draws the path up to the start and from it on.
async fn draw(
    node: &Handle,
    page: OutputFile,
    manifests: &Manifests,
    (line, occurrence): (u32, u32),
    rows: &[String],
) -> Result<(), Failure> {
    let fetched = fetched(node, manifests).await.map_err(|why| {
        Failure::new(Status::NoAnswer, format!("the page cannot be drawn: {why}"))
    })?;
    let start = StartInTheMiddle {
        name: &manifests.program.name,
        text: &String::from_utf8_lossy(&fetched.text),
        contour: &fetched.contour,
        profile: &fetched.profile,
        path: &fetched.path,
        line,
        occurrence,
        rows,
    };
    page.write(|to| start.page().write_html(to))
}

async fn fetched(node: &Handle, manifests: &Manifests) -> Result<Fetched, Box<dyn Error>> {
    let Manifests { program, contour, path } = manifests;
    let program_id = || program.program_id.clone();
    let mut text = Collector::for_program(program)?;
    pull(
        &node.client::<GetProgramChunks>("program/get_chunks")?,
        &mut text,
        |first| GetProgramChunksRequest { program_id: program_id(), first },
        |answer| if answer.success { Ok(answer.chunks) } else { Err(answer.message) },
    )
    .await?;
    let mut programmed = Collector::for_contour(contour)?;
    pull(
        &node.client::<GetContourChunks>("programmed_contour/get_chunks")?,
        &mut programmed,
        |first| GetContourChunksRequest { program_id: program_id(), first },
        |answer| if answer.success { Ok(answer.chunks) } else { Err(answer.message) },
    )
    .await?;
    let mut compensated = Collector::for_path(path)?;
    pull(
        &node.client::<GetPathChunks>("compensated_path/get_chunks")?,
        &mut compensated,
        |first| GetPathChunksRequest { program_id: program_id(), revision: path.revision, first },
        |answer| if answer.success { Ok(answer.chunks) } else { Err(answer.message) },
    )
    .await?;
    Ok(Fetched {
        text: text.finish(program)?,
        contour: programmed.finish(contour)?,
        profile: settings::profile_from_yaml(&contour.profile)?,
        path: compensated.finish(path)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::convert::mode_to_wire;

    #[test]
    fn the_line_is_that_where_the_last_run_of_this_program_broke_off() {
        let result = |outcome, program_id: &str, last_line| RunResult {
            outcome,
            program_id: program_id.into(),
            last_line,
            ..RunResult::default()
        };
        let again = |line| RunResult {
            start_line: 7,
            start_occurrence: 2,
            ..result(RunResult::OUTCOME_ABORTED, "a", line)
        };
        let part =
            Program { program_id: "a".into(), name: "part.ngc".into(), ..Program::default() };
        let (done, aborted) = (RunResult::OUTCOME_SUCCEEDED, RunResult::OUTCOME_ABORTED);
        let canceled = RunResult::OUTCOME_CANCELED;
        for (last, loaded, asked, expected) in [
            (Some(result(aborted, "a", 7)), Some(&part), 0, Ok((7, 0))),
            (Some(again(9)), Some(&part), 0, Ok((9, 0))),
            // It failed before its first move: the place is not lost.
            (Some(again(0)), Some(&part), 0, Ok((7, 2))),
            (Some(result(canceled, "a", 7)), Some(&part), 0, Ok((7, 0))),
            (Some(result(aborted, "a", 7)), Some(&part), 5, Ok((5, 0))),
            (None, Some(&part), 5, Ok((5, 0))),
            (Some(result(done, "a", 7)), Some(&part), 5, Ok((5, 0))),
            (Some(result(done, "a", 7)), Some(&part), 0, Err("cut to its end")),
            (
                Some(result(aborted, "b", 7)),
                Some(&part),
                0,
                Err("part.ngc, which is loaded, is not"),
            ),
            (Some(result(aborted, "a", 0)), Some(&part), 0, Err("ended before it cut")),
            (None, Some(&part), 0, Err("has run nothing since it was started")),
            (Some(result(aborted, "a", 7)), None, 0, Err("no program is loaded")),
            (Some(result(aborted, "a", 7)), None, 5, Err("no program is loaded")),
        ] {
            match (start_of(last.as_ref(), loaded, (asked, 0)), expected) {
                (Ok(line), Ok(expected)) => assert_eq!(line, expected),
                (Err(why), Err(expected)) => assert!(why.contains(expected), "{why}"),
                (line, expected) => panic!("{line:?} and not {expected:?}"),
            }
        }
    }

    #[test]
    fn the_nearest_lines_before_are_tried_and_never_the_whole_program() {
        for (line, first, last, count) in [
            (12, Some(11), Some(2), 10),
            (2, None, None, 0),
            (0, None, None, 0),
            (500, Some(499), Some(480), 20),
        ] {
            let lines: Vec<u32> = lines_before(line).collect();
            let said = (lines.first().copied(), lines.last().copied(), lines.len());
            assert_eq!(said, (first, last, count), "{line}");
        }
    }

    #[test]
    fn what_has_to_be_done_first_is_said() {
        for (mode, needs_reset, expected) in [
            (Mode::Idle, false, &[][..]),
            (Mode::Idle, true, &["kerf reset"]),
            (Mode::Alarm, false, &["kerf unlock"]),
            (Mode::Alarm, true, &["kerf reset", "kerf unlock"]),
            (Mode::Hold, false, &["is in HOLD: kerf abort"]),
            (Mode::Unknown, true, &["kerf reset"]),
            (Mode::Disconnected, false, &["no controller"]),
        ] {
            let state = mode_to_wire(mode);
            let first = obstacles(&MachineState { state, needs_reset, ..MachineState::default() });
            assert_eq!(first.len(), expected.len(), "{first:?}");
            for (sentence, expected) in first.iter().zip(expected) {
                assert!(sentence.contains(expected), "{sentence}");
            }
        }
    }
}
