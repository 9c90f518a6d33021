//! The ROS shell of the loader: services in, latched topics out.
//!
//! Reads files, keeps the newest program and serves it. [`load`](crate::load) decides what a
//! program means; nothing here decides anything worth a test.

mod chunks;
mod health;
mod lifecycle;
mod parameter_file;
mod parameters;
mod stretches;
mod tools;

use crate::answer::{corners, first_findings, refusal};
use crate::limits::PROGRAM_BYTES_MAX;
use crate::subroutines::with_subroutines;
use crate::upload::Uploads;
use crate::{LoadOptions, Loaded, load};
use cnc_msgs::chunk::{ContourChunks, ProgramChunks, program_id, sha256_hex};
use cnc_msgs::interface::Service;
use cnc_msgs::profile::{Profile, UnknownReaction};
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::units::position_from_point;
use cnc_msgs::wire::cnc_msgs::msg::{ContourChunk, Program, ProgramChunk, ProgrammedContour};
use cnc_msgs::wire::cnc_msgs::srv::{
    GetContourChunks, GetProgramChunks, LoadProgram, LoadProgramRequest, LoadProgramResponse,
    PutProgramChunk, ReadBlock, ReadBlockRequest, ReadBlockResponse,
};
use cnc_msgs::wire::geometry_msgs::msg::Point;
use cnc_msgs::wire::std_msgs::msg::Header;
use intake::file::ReadError;
use intake::folders::{Folders, LookupError};
use intake::text::one_line;
use parameter_file::ParameterFile;
pub use parameters::parameters;
use runtime::chunks::{ChunkTopic, Cut};
use runtime::commands::{Answer, CommandLog};
use runtime::{Handle, Publisher, Qos, RequestInfo};
use settings::ProfileError;
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use tools::ReadAgain;

/// Runs the node until it is shut down.
pub fn main(args: Vec<String>) -> ExitCode {
    runtime::run_managed("program_loader", parameters(), &args, start)
}

async fn start(node: Handle) -> Result<Arc<Loader>, runtime::Error> {
    let loader = Arc::new(Loader::new(&node)?);
    let commands = CommandLog::new(&node)?;

    let (shared, log) = (Arc::clone(&loader), commands.clone());
    node.service::<LoadProgram, _, _>("load_program", move |request, info| {
        let (loader, log) = (Arc::clone(&shared), log.clone());
        async move {
            let asked = request.clone();
            let worker = Arc::clone(&loader);
            let _work = loader.work.lock().await;
            let response = tokio::task::spawn_blocking(move || worker.load_program(request)).await;
            let response = response.unwrap_or_else(|error| LoadProgramResponse {
                message: format!("the loader failed: {error}"),
                ..LoadProgramResponse::default()
            });
            let answer = Answer {
                success: response.success,
                error_code: response.error_code,
                message: &response.message,
            };
            log.record("load_program", LoadProgram::TYPE_NAME, &info, &asked, answer);
            response
        }
    })?;
    let shared = Arc::clone(&loader);
    node.service::<ReadBlock, _, _>("read_block", move |request: ReadBlockRequest, _| {
        let loader = Arc::clone(&shared);
        async move {
            // Reading the profile may open a file.
            let read = tokio::task::spawn_blocking(move || loader.read_block(&request)).await;
            read.unwrap_or_else(|error| ReadBlockResponse {
                message: format!("the loader failed: {error}"),
                ..ReadBlockResponse::default()
            })
        }
    })?;
    let (shared, log) = (Arc::clone(&loader), commands.clone());
    node.service::<PutProgramChunk, _, _>(
        "put_program_chunk",
        move |request, info: RequestInfo| {
            let response = shared.put_chunk(request.clone());
            let answer = Answer {
                success: response.success,
                error_code: response.error_code,
                message: &response.message,
            };
            log.record("put_program_chunk", PutProgramChunk::TYPE_NAME, &info, &request, answer);
            std::future::ready(response)
        },
    )?;
    let shared = Arc::clone(&loader);
    node.service::<GetProgramChunks, _, _>("program/get_chunks", move |request, _| {
        std::future::ready(shared.program_chunks(&request))
    })?;
    let shared = Arc::clone(&loader);
    node.service::<GetContourChunks, _, _>("programmed_contour/get_chunks", move |request, _| {
        std::future::ready(shared.contour_chunks(&request))
    })?;
    stretches::offer(&node, &loader, &commands)?;
    tools::follow(&node, &loader)?;
    Ok(loader)
}

/// The newest program, and the publishers that announce it.
struct Loader {
    node: Handle,
    control: String,
    /// The folders of the files that peers may name.
    programs: Folders,
    /// The folders of the subroutines that programs may call.
    subroutines: Folders,
    parameter_file: Option<ParameterFile>,
    controls: Folders,
    frame_id: String,
    options: LoadOptions,
    program: Publisher<Program>,
    program_topic: ChunkTopic<ProgramChunk>,
    contour: Publisher<ProgrammedContour>,
    contour_topic: ChunkTopic<ContourChunk>,
    state: Mutex<LoaderState>,
    /// Held while a program is being loaded, or the parameter file written.
    work: tokio::sync::Mutex<()>,
}

#[derive(Default)]
struct LoaderState {
    uploads: Uploads,
    current: Option<Current>,
    /// The planner's, once it has come.
    tools: Option<ToolTable>,
    /// Why the newest request was rejected.
    refused: Option<String>,
}

/// The loaded program.
#[derive(Clone)]
struct Current {
    program_id: String,
    manifest: Program,
    contour_manifest: ProgrammedContour,
    program: Cut<ProgramChunk>,
    contour: Cut<ContourChunk>,
    /// What it is read from again, where it computes with the results of probes or with the tool table.
    again: Option<Arc<ReadAgain>>,
    /// The same program without results, where it has some.
    first: Option<Box<Current>>,
}

impl Current {
    /// Without results of probes.
    fn first(&self) -> &Self {
        self.first.as_deref().unwrap_or(self)
    }

    /// This program, or the same without results of probes.
    fn named(&self, program_id: &str) -> Option<&Self> {
        [self, self.first()].into_iter().find(|it| it.program_id == program_id)
    }
}

/// A rejection with its code.
struct Refusal {
    code: u16,
    message: String,
}

fn refuse<T>(code: u16, message: impl std::fmt::Display) -> Result<T, Refusal> {
    Err(Refusal { code, message: message.to_string() })
}

impl Loader {
    fn new(node: &Handle) -> Result<Self, runtime::Error> {
        let control: String = node.parameter("control");
        Ok(Self {
            node: node.clone(),
            control,
            programs: Folders::new(
                node.parameter::<Vec<String>>("program_directories"),
                "program_directories",
            ),
            subroutines: Folders::new(
                node.parameter::<Vec<String>>("subroutine_directories"),
                "subroutine_directories",
            ),
            parameter_file: ParameterFile::of(node),
            controls: Folders::new(
                node.parameter::<Vec<String>>("control_directories"),
                "control_directories",
            ),
            frame_id: match node.parameter::<String>("frame_id").as_str() {
                // As the driver names it without a frame_prefix.
                "work" => format!("{}work", node.names().frame_prefix("")),
                given => given.trim_start_matches('/').to_owned(),
            },
            options: parameters::options(node),
            program: node.publisher("program", Qos::LATCHED)?,
            program_topic: ChunkTopic::new(node, "program/chunks")?,
            contour: node.publisher("programmed_contour", Qos::LATCHED)?,
            contour_topic: ChunkTopic::new(node, "programmed_contour/chunks")?,
            state: Mutex::default(),
            work: tokio::sync::Mutex::default(),
        })
    }

    fn state(&self) -> std::sync::MutexGuard<'_, LoaderState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn health(&self) -> Vec<runtime::Health> {
        let state = self.state();
        let loaded = state.current.as_ref().map(|current| &current.manifest);
        let file = self.parameter_file.as_ref().and_then(ParameterFile::health);
        [health::health(loaded, state.refused.as_deref())].into_iter().chain(file).collect()
    }

    fn load_program(&self, request: LoadProgramRequest) -> LoadProgramResponse {
        let response = self.try_load(request).unwrap_or_else(|Refusal { code, message }| {
            LoadProgramResponse { error_code: code, message, ..LoadProgramResponse::default() }
        });
        self.state().refused = (!response.success).then(|| response.message.clone());
        response
    }

    fn try_load(&self, request: LoadProgramRequest) -> Result<LoadProgramResponse, Refusal> {
        type W = LoadProgramResponse;
        self.node.require_active().or_else(|why| refuse(W::NOT_ACTIVE, why))?;
        let (text, name) = self.text_of(&request)?;
        let mut profile =
            self.profile(&request.control).or_else(|error| refuse(W::UNKNOWN_CONTROL, error))?;
        if !request.interference.is_empty() {
            profile.interference.react = request
                .interference
                .parse()
                .or_else(|error: UnknownReaction| refuse(W::INVALID_REQUEST, error))?;
        }
        let text = with_subroutines(text, &profile, |name| {
            let file = self.subroutines.read(name, PROGRAM_BYTES_MAX as u64);
            file.map_err(|error| error.of_a_file())
        });
        let text = match &self.parameter_file {
            Some(file) => file.append(text, &profile)?,
            None => text,
        };
        let (text, mut loaded) = self.load(&text, &profile);
        loaded.allow_tools(&request.expected_tools);
        let again = ReadAgain::of(&loaded, &name, &text, &profile, &request.expected_tools);
        let (findings, finding_count) = first_findings(&loaded);
        if let Some(message) = refusal(&name, &loaded) {
            return Ok(LoadProgramResponse {
                error_code: W::PROGRAM_REFUSED,
                message,
                line_count: loaded.line_count,
                findings,
                finding_count,
                ..LoadProgramResponse::default()
            });
        }
        let (min, max) = corners(&loaded);
        let response = LoadProgramResponse {
            success: true,
            message: format!("{name} is loaded: {} lines", loaded.line_count),
            program_id: id_of(&profile, &text),
            line_count: loaded.line_count,
            bounds_min: min,
            bounds_max: max,
            findings,
            finding_count,
            ..LoadProgramResponse::default()
        };
        tracing::info!("{}", response.message);
        self.remember_left(&response.program_id, &mut loaded);
        let current = self.current(name, text.into_owned(), &profile, loaded);
        self.publish(Current { again, ..current });
        Ok(response)
    }

    /// Reads a single block; the loaded program stays.
    fn read_block(&self, request: &ReadBlockRequest) -> ReadBlockResponse {
        type W = ReadBlockResponse;
        let refused = |error_code, message| W { error_code, message, ..W::default() };
        if let Err(why) = self.node.require_active() {
            return refused(W::NOT_ACTIVE, why);
        }
        let profile = match self.profile(&request.control) {
            Ok(profile) => profile,
            Err(error) => return refused(W::UNKNOWN_CONTROL, error.to_string()),
        };
        let start = position_from_point(&request.start);
        if !start.iter().all(|value| value.is_finite()) {
            return refused(
                W::PROGRAM_REFUSED,
                "start has a coordinate that is not a finite number".into(),
            );
        }
        let options = LoadOptions { start, is_single_block: true, ..self.options };
        let loaded = load(request.text.as_bytes(), &profile, &options);
        let accepted = loaded.is_accepted();
        let said: Vec<&str> = loaded
            .findings
            .iter()
            .filter(|finding| accepted || finding.is_error())
            .map(|finding| finding.message.as_str())
            .collect();
        let response =
            W { message: said.join("; "), findings: first_findings(&loaded).0, ..W::default() };
        if !accepted {
            return W { error_code: W::PROGRAM_REFUSED, ..response };
        }
        let program_id = id_of(&profile, request.text.as_bytes());
        let chunks = ContourChunks::new(program_id, loaded.contour);
        W {
            success: true,
            contour: self.manifest(
                request.text.clone(),
                &profile,
                &chunks,
                (request.start.clone(), request.start.clone()),
            ),
            chunks: (0..chunks.count()).filter_map(|index| chunks.chunk(index)).collect(),
            ..response
        }
    }

    /// The profile that a request names; by default the configured one.
    fn profile(&self, named: &str) -> Result<Profile, ProfileError> {
        if named.is_empty() || named == self.control {
            settings::load_profile(&self.control)
        } else {
            settings::load_foreign_profile(named, &self.controls)
        }
    }

    /// The text and a name for it, from the one source that the request names.
    fn text_of(&self, request: &LoadProgramRequest) -> Result<(Vec<u8>, String), Refusal> {
        type W = LoadProgramResponse;
        // Any peer may choose the name, and it is shown in logs, terminals and pages.
        let named = |fallback: &str| {
            let name = if request.name.is_empty() { fallback } else { &request.name };
            one_line(name).into_owned()
        };
        let sources = [&request.path, &request.text, &request.upload_id];
        match sources.map(|source| !source.is_empty()) {
            [true, false, false] => {
                let path = Path::new(&request.path);
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                let text = self.programs.read(&request.path, PROGRAM_BYTES_MAX as u64);
                let text = text.map_err(|error| Refusal {
                    code: match error {
                        LookupError::Read {
                            error: ReadError::TooLarge { .. } | ReadError::Grew { .. },
                            ..
                        } => W::TOO_LARGE,
                        _ => W::FILE_UNREADABLE,
                    },
                    message: error.to_string(),
                });
                Ok((text?, named(&name)))
            }
            [false, true, false] => Ok((request.text.clone().into_bytes(), named("program"))),
            [false, false, true] => {
                let text = self.state().uploads.take(&request.upload_id);
                Ok((text.or_else(|error| refuse(W::UPLOAD_INCOMPLETE, error))?, named("program")))
            }
            // An empty text is a program, too.
            [false, false, false] if !request.name.is_empty() => Ok((Vec::new(), named(""))),
            _ => refuse(
                W::INVALID_REQUEST,
                "set exactly one of path, text and upload_id (or only a name, for an empty \
                 program)",
            ),
        }
    }

    /// What the run of a program leaves in the parameter file: known when all of it was read, and kept
    /// under the id that the run begins with.
    fn remember_left(&self, program_id: &str, loaded: &mut Loaded) {
        if let Some(file) = self.parameter_file.as_ref().filter(|_| loaded.awaits.is_none()) {
            file.loaded(program_id, std::mem::take(&mut loaded.left));
        }
    }

    /// What is published of a program that was read.
    fn current(&self, name: String, text: Vec<u8>, profile: &Profile, loaded: Loaded) -> Current {
        let program_id = id_of(profile, &text);
        let (min, max) = corners(&loaded);
        let mut program = Program {
            program_id: program_id.clone(),
            name: name.clone(),
            control: profile.name.clone(),
            sha256: sha256_hex(&text),
            size: text.len() as u64,
            line_count: loaded.line_count,
            ..Program::default()
        };
        let chunks = ProgramChunks { program_id: program_id.clone(), text };
        program.chunk_count = chunks.count();
        let program_cut: Cut<ProgramChunk> = Arc::new(move |index| chunks.chunk(index));

        let chunks = ContourChunks::new(program_id.clone(), loaded.contour);
        let contour = self.manifest(name, profile, &chunks, (min, max));
        let contour_cut: Cut<ContourChunk> = Arc::new(move |index| chunks.chunk(index));
        Current {
            program_id,
            manifest: program,
            contour_manifest: contour,
            program: program_cut,
            contour: contour_cut,
            again: None,
            first: None,
        }
    }

    /// This is the program that is loaded now.
    fn publish(&self, mut current: Current) {
        let stamp = self.node.now();
        current.manifest.stamp = stamp.into();
        current.contour_manifest.header.stamp = stamp.into();
        let Current { manifest, contour_manifest, program, contour, .. } = current.clone();
        self.state().current = Some(current);
        self.program.publish(manifest);
        self.program_topic.send(program);
        self.contour.publish(contour_manifest);
        self.contour_topic.send(contour);
    }

    fn manifest(
        &self,
        name: String,
        profile: &Profile,
        chunks: &ContourChunks,
        (bounds_min, bounds_max): (Point, Point),
    ) -> ProgrammedContour {
        ProgrammedContour {
            header: Header { stamp: self.node.now().into(), frame_id: self.frame_id.clone() },
            program_id: chunks.program_id().to_owned(),
            name,
            control: profile.name.clone(),
            profile: settings::profile_to_yaml(profile),
            bounds_min,
            bounds_max,
            ..chunks.manifest()
        }
    }
}

/// The id of a program under the rules of a profile: other rules may give another path.
fn id_of(profile: &Profile, text: &[u8]) -> String {
    program_id(&settings::profile_to_yaml(profile), text)
}
