//! What a bag holds for the cores: their inputs, and what they made of them then.
//!
//! Reads a bag once, by topic name whatever the namespace, and puts chunks
//! together. Leaves running the cores to its neighbours.

use super::ReplayError;
use cnc_msgs::cdr;
use cnc_msgs::chunk::Collector;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::interface::Message;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::schema::TypeInfo;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use run_recorder::bag_reader::{Bag, BagMessage};
use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::sync::Arc;

/// A program as it was loaded.
#[derive(Debug, Clone)]
pub(crate) struct RecordedProgram {
    pub(crate) text: Vec<u8>,
    pub(crate) manifest: wire::ProgrammedContour,
    pub(crate) contour: Arc<ProgrammedContour>,
    /// When the manifest was recorded.
    pub(crate) log_time_ns: u64,
}

/// A plan, refused ones too.
#[derive(Debug, Clone)]
pub(crate) struct RecordedPlan {
    pub(crate) report: wire::CompensationReport,
    /// `None` when it was refused.
    pub(crate) manifest: Option<wire::CompensatedPath>,
    pub(crate) path: Option<Arc<CompensatedPath>>,
    /// When the report was recorded.
    pub(crate) log_time_ns: u64,
}

/// Everything that replay needs of a bag.
#[derive(Debug, Default)]
pub(crate) struct Recording {
    /// By program id.
    pub(crate) programs: BTreeMap<String, RecordedProgram>,
    /// By revision.
    pub(crate) tool_tables: BTreeMap<u64, ToolTable>,
    /// By revision.
    pub(crate) plans: BTreeMap<u64, RecordedPlan>,
    /// By sequence.
    pub(crate) traffic: BTreeMap<u64, (u64, wire::TrafficEntry)>,
    /// In order.
    pub(crate) states: Vec<wire::MachineState>,
    /// The newest of each node, by its name without namespace.
    pub(crate) parameters: BTreeMap<String, wire::NodeParameters>,
}

/// Messages as they come, before chunks are put together.
#[derive(Default)]
struct Gathered {
    programs: BTreeMap<String, wire::Program>,
    program_chunks: Vec<wire::ProgramChunk>,
    contours: BTreeMap<String, (u64, wire::ProgrammedContour)>,
    contour_chunks: Vec<wire::ContourChunk>,
    paths: BTreeMap<u64, wire::CompensatedPath>,
    path_chunks: Vec<wire::PathChunk>,
    reports: BTreeMap<u64, (u64, wire::CompensationReport)>,
}

impl Recording {
    /// Reads all of it.
    pub(crate) fn read<R: Read + Seek>(bag: &mut Bag<R>) -> Result<Self, ReplayError> {
        let mut recording = Self::default();
        let mut gathered = Gathered::default();
        for message in bag.messages() {
            recording.sort(&message?, &mut gathered)?;
        }
        recording.put_together(gathered)?;
        Ok(recording)
    }

    fn sort(&mut self, message: &BagMessage, to: &mut Gathered) -> Result<(), ReplayError> {
        let at = message.log_time_ns;
        match message.channel.type_name() {
            wire::Program::TYPE_NAME => {
                let program: wire::Program = decode(message)?;
                to.programs.insert(program.program_id.clone(), program);
            }
            wire::ProgramChunk::TYPE_NAME => to.program_chunks.push(decode(message)?),
            wire::ProgrammedContour::TYPE_NAME => {
                let contour: wire::ProgrammedContour = decode(message)?;
                to.contours.insert(contour.program_id.clone(), (at, contour));
            }
            wire::ContourChunk::TYPE_NAME => to.contour_chunks.push(decode(message)?),
            wire::CompensatedPath::TYPE_NAME => {
                let path: wire::CompensatedPath = decode(message)?;
                to.paths.insert(path.revision, path);
            }
            wire::PathChunk::TYPE_NAME => to.path_chunks.push(decode(message)?),
            wire::CompensationReport::TYPE_NAME => {
                let report: wire::CompensationReport = decode(message)?;
                to.reports.insert(report.revision, (at, report));
            }
            wire::ToolTable::TYPE_NAME => {
                let table: wire::ToolTable = decode(message)?;
                let checked = ToolTable::try_from(&table)
                    .map_err(|error| ReplayError::content(message, error))?;
                self.tool_tables.insert(table.revision, checked);
            }
            wire::ControllerTraffic::TYPE_NAME => {
                let traffic: wire::ControllerTraffic = decode(message)?;
                for entry in traffic.entries {
                    self.traffic.entry(entry.sequence).or_insert((at, entry));
                }
            }
            wire::MachineState::TYPE_NAME => self.states.push(decode(message)?),
            wire::NodeParameters::TYPE_NAME => {
                let parameters: wire::NodeParameters = decode(message)?;
                let name = parameters.node.rsplit('/').next().unwrap_or_default().to_owned();
                self.parameters.insert(name, parameters);
            }
            _ => {}
        }
        Ok(())
    }

    fn put_together(&mut self, mut gathered: Gathered) -> Result<(), ReplayError> {
        for (id, (log_time_ns, manifest)) in gathered.contours {
            let incomplete = |what| ReplayError::Incomplete { what, of: id.clone() };
            let Some(program) = gathered.programs.remove(&id) else {
                return Err(incomplete("the program's manifest"));
            };
            let mut text = Collector::for_program(&program)?;
            collect(&mut text, &mut gathered.program_chunks)?;
            let mut contour = Collector::for_contour(&manifest)?;
            collect(&mut contour, &mut gathered.contour_chunks)?;
            if text.missing().is_some() {
                return Err(incomplete("a chunk of its text"));
            }
            if contour.missing().is_some() {
                return Err(incomplete("a chunk of its contour"));
            }
            let program = RecordedProgram {
                text: text.finish(&program)?,
                contour: Arc::new(contour.finish(&manifest)?),
                manifest,
                log_time_ns,
            };
            self.programs.insert(id, program);
        }
        for (revision, (log_time_ns, report)) in gathered.reports {
            let manifest = gathered.paths.remove(&revision);
            let path = match &manifest {
                None => None,
                Some(manifest) => {
                    let mut path = Collector::for_path(manifest)?;
                    collect(&mut path, &mut gathered.path_chunks)?;
                    if path.missing().is_some() {
                        return Err(ReplayError::Incomplete {
                            what: "a chunk of its path",
                            of: format!("revision {revision} of {}", report.program_id),
                        });
                    }
                    Some(Arc::new(path.finish(manifest)?))
                }
            };
            self.plans.insert(revision, RecordedPlan { report, manifest, path, log_time_ns });
        }
        Ok(())
    }
}

/// Moves the chunks that the collector wants out of the heap.
fn collect<C: cnc_msgs::chunk::Chunk>(
    collector: &mut Collector<C>,
    heap: &mut Vec<C>,
) -> Result<(), ReplayError> {
    let mut rest = Vec::new();
    for chunk in heap.drain(..) {
        if collector.wants(&chunk) {
            collector.add(chunk)?;
        } else {
            rest.push(chunk);
        }
    }
    *heap = rest;
    Ok(())
}

/// Decodes a message whose definition is the one of today.
fn decode<M: Message>(message: &BagMessage) -> Result<M, ReplayError> {
    let today = TypeInfo::of::<M>();
    let recorded = &message.channel.type_hash;
    if !recorded.is_empty() && recorded != today.rihs01 {
        return Err(ReplayError::Definition {
            type_name: M::TYPE_NAME,
            recorded: recorded.clone(),
            today: today.rihs01,
        });
    }
    cdr::decode(&message.data).map_err(|error| ReplayError::content(message, error))
}
