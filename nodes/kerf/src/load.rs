//! `kerf load`: sends a program to the loader and waits for its plan.
//!
//! While it waits, [`Loader`] checks whether the loader still has the program.

use crate::exit::{CommandResult, Failure, Status};
use crate::files;
use crate::operate::with_node;
use crate::terminal::show_findings;
use clap::Args;
use cnc_msgs::count::counted;
use cnc_msgs::finding::Finding;
use cnc_msgs::wire::cnc_msgs::msg::CompensationReport;
use cnc_msgs::wire::cnc_msgs::srv::{
    GetProgramChunks, GetProgramChunksRequest, GetProgramChunksResponse, GetTools, GetToolsRequest,
    LoadProgram, LoadProgramRequest, LoadProgramResponse, PutProgramChunk, PutProgramChunkRequest,
};
use program_loader::upload::CHUNK_BYTES_MAX;
use runtime::{Client, Gid, Handle, Qos, Subscription};
use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// How long planning a new program may take.
const PLAN_WITHIN: Duration = Duration::from_secs(120);
/// How often the loader is asked whether it still has the program.
const ASK_EVERY: Duration = Duration::from_secs(1);
/// A running loader answers sooner, and a dead one is restarted sooner.
const LOADER_SILENCE: Duration = Duration::from_secs(10);

/// What `kerf load` takes.
#[derive(Debug, Args)]
pub(crate) struct LoadArgs {
    /// The part program
    file: PathBuf,
    /// Control profile [default: the loader's parameter]
    #[arg(long, value_name = "NAME|FILE", default_value = "", hide_default_value = true)]
    control: String,
    /// Reaction to a contour that the tool does not fit: alarm, trim or ignore [default: the
    /// profile's]
    #[arg(long, value_name = "REACTION", default_value = "", hide_default_value = true)]
    interference: String,
}

/// `kerf load`
pub(crate) fn load(args: &LoadArgs, ros_args: &[String]) -> CommandResult {
    with_node(ros_args, async |node| {
        load_file(node, &args.file, &args.control, &args.interference).await.map(|_| ())
    })
}

/// Sends the text of a file, waits for the plan, and shows all findings.
///
/// Returns the program's id. The loader may run on another host, so the text is sent, not the
/// name of the file.
pub(crate) async fn load_file(
    node: &Handle,
    path: &Path,
    control: &str,
    interference: &str,
) -> Result<String, Failure> {
    let text = files::read_program(path)?;
    let name = files::file_name(path);
    let mut reports: Subscription<CompensationReport> =
        node.subscription("compensation_report", Qos::LATCHED)?;
    let planner = node.client::<GetTools>("get_tools")?;
    let known = newest_revision(&planner, &mut reports).await;
    let loader = Loader::new(node)?;
    let response = tokio::select! {
        response = send_program(node, (&name, &text), control, interference) => response?,
        loss = loader.lost("") => return Err(loss.failure(&name, "loaded")),
    };
    show(&name, &text, &response.findings);
    if !response.success {
        return Err(Failure::of_node(&response.message));
    }
    let report = tokio::select! {
        biased;
        report = next_report(&mut reports, &response.program_id, known) => report,
        loss = loader.lost(&response.program_id) => {
            return Err(loss.failure(&name, "planned"));
        }
        () = planner_ends_twice(&planner) => {
            return Err(Failure::new(
                Status::NoAnswer,
                format!(
                    "{name} is loaded, but the planner ended twice while it planned it; its log \
                     says why: if its memory was too small, split the program, or start the \
                     planner with a larger memory_mb_max"
                ),
            ));
        }
        () = sleep(PLAN_WITHIN) => {
            let seconds = PLAN_WITHIN.as_secs();
            return Err(Failure::new(
                Status::NoAnswer,
                format!("{name} is loaded, but no planner planned it within {seconds} s"),
            ));
        }
    };
    show(&name, &text, &report.findings);
    if !report.accepted {
        return Err(Failure::new(
            Status::NodeRefused,
            format!(
                "{name} is refused by the planner: {}",
                counted(report.error_count as usize, "error")
            ),
        ));
    }
    println!("{}, and planned", response.message);
    Ok(response.program_id)
}

/// The first report on a program that is newer than the given revision.
async fn next_report(
    reports: &mut Subscription<CompensationReport>,
    program_id: &str,
    known: Option<u64>,
) -> CompensationReport {
    loop {
        let (report, _) = reports.next().await;
        if report.program_id == program_id && Some(report.revision) > known {
            return report;
        }
    }
}

/// Why the loader does not have a program any more.
enum Loss {
    /// It does not answer.
    Silent,
    /// Another process answers, which does not know the program.
    Restarted,
    /// It has another program.
    Replaced,
}

impl Loss {
    /// The failure for a program that was not `done`.
    fn failure(&self, name: &str, done: &str) -> Failure {
        let (status, why) = match self {
            Self::Silent => (
                Status::NoAnswer,
                "the program loader does not answer; check its log, restart it, and",
            ),
            Self::Restarted => {
                (Status::NoAnswer, "the program loader was restarted and no longer has it;")
            }
            Self::Replaced => (Status::NodeRefused, "another program was loaded meanwhile;"),
        };
        Failure::new(status, format!("{name} was not {done}: {why} load the program again"))
    }
}

/// The loader, as far as this command depends on it.
struct Loader {
    chunks: Client<GetProgramChunks>,
    /// The process that answered first.
    process: OnceCell<[u8; 12]>,
}

impl Loader {
    fn new(node: &Handle) -> Result<Self, Failure> {
        let chunks = node.client::<GetProgramChunks>("program/get_chunks")?;
        Ok(Self { chunks, process: OnceCell::new() })
    }

    /// Waits until the loader has ended, or no longer has this program.
    ///
    /// An empty id means a program that is still being sent. Then a loader that has not answered
    /// yet is not reported here, but by the sender.
    async fn lost(&self, program_id: &str) -> Loss {
        // No program has this chunk, so the answer is short.
        let first = u32::MAX;
        let request = GetProgramChunksRequest { program_id: program_id.to_owned(), first };
        loop {
            match self.chunks.call_for_server(&request, LOADER_SILENCE).await {
                Ok((answer, server)) => {
                    let knows_it = answer.error_code != GetProgramChunksResponse::UNKNOWN_PROGRAM;
                    if let Some(loss) = self.loss(program_id, knows_it, server) {
                        return loss;
                    }
                }
                Err(_) if program_id.is_empty() && self.process.get().is_none() => {}
                Err(_) => return Loss::Silent,
            }
            sleep(ASK_EVERY).await;
        }
    }

    /// What an answer means for a program; `knows_it`: the loader has a program of this id.
    fn loss(&self, program_id: &str, knows_it: bool, server: Gid) -> Option<Loss> {
        let process = server.participant();
        let is_same = *self.process.get_or_init(|| process) == process;
        match (is_same, program_id.is_empty()) {
            (false, true) => Some(Loss::Restarted),
            (false, false) if !knows_it => Some(Loss::Restarted),
            (true, false) if !knows_it => Some(Loss::Replaced),
            _ => None,
        }
    }
}

/// The newest revision before this load: the same program may have been planned already, with other
/// tools, and its latched report would arrive first.
async fn newest_revision(
    planner: &Client<GetTools>,
    reports: &mut Subscription<CompensationReport>,
) -> Option<u64> {
    const PLANNER_WITHIN: Duration = Duration::from_secs(2);
    const QUIET: Duration = Duration::from_millis(200);
    // A service that answers has been discovered. A missing planner is reported by the wait for its
    // plan.
    let _ = planner.call_within(GetToolsRequest::default(), PLANNER_WITHIN).await;
    let mut newest = None;
    while let Ok((report, _)) = timeout(QUIET, reports.next()).await {
        newest = newest.max(Some(report.revision));
    }
    newest
}

/// Waits until two processes of the planner have ended. The first may have ended for another reason
/// than the program; the next process plans it again.
async fn planner_ends_twice(planner: &Client<GetTools>) {
    let mut processes = BTreeSet::new();
    while processes.len() < 3 {
        // A planner that is being restarted does not answer.
        let answer = planner.call_for_server(&GetToolsRequest::default(), PLAN_WITHIN).await;
        processes.extend(answer.map(|(_, server)| server.participant()));
        sleep(ASK_EVERY).await;
    }
}

/// Sends a text to the loader, in chunks if it is long.
pub(crate) async fn send_program(
    node: &Handle,
    (name, text): (&str, &[u8]),
    control: &str,
    interference: &str,
) -> Result<LoadProgramResponse, Failure> {
    let load = node.client::<LoadProgram>("load_program")?;
    let mut request = LoadProgramRequest {
        name: name.to_owned(),
        control: files::as_loader_finds_it(control),
        interference: interference.to_owned(),
        ..LoadProgramRequest::default()
    };
    match std::str::from_utf8(text) {
        Ok(text) if text.len() <= CHUNK_BYTES_MAX => request.text = text.to_owned(),
        _ => request.upload_id = upload(node, text).await?,
    }
    Ok(load.call_within(request, PLAN_WITHIN).await?)
}

/// Sends a long text in chunks; returns the id of the upload.
async fn upload(node: &Handle, text: &[u8]) -> Result<String, Failure> {
    let put = node.client::<PutProgramChunk>("put_program_chunk")?;
    let upload_id = cnc_msgs::chunk::sha256_hex(text);
    let pieces: Vec<&[u8]> = text.chunks(CHUNK_BYTES_MAX).collect();
    for (index, data) in pieces.iter().enumerate() {
        let request = PutProgramChunkRequest {
            upload_id: upload_id.clone(),
            index: index as u32,
            chunk_count: pieces.len() as u32,
            data: data.to_vec(),
            crc32: cnc_msgs::chunk::crc32(data),
        };
        let answer = put.call_idempotent(&request, PLAN_WITHIN).await?;
        if !answer.success {
            return Err(Failure::of_node(&answer.message));
        }
    }
    Ok(upload_id)
}

fn show(name: &str, text: &[u8], findings: &[cnc_msgs::wire::cnc_msgs::msg::Finding]) {
    let findings: Vec<Finding> =
        findings.iter().filter_map(|finding| finding.try_into().ok()).collect();
    let text = String::from_utf8_lossy(text);
    let color = std::io::stderr().is_terminal();
    show_findings(&program_loader::render::render(name, &text, &findings, color));
}
