//! Fetches messages that were sent before the bag was open or were missed, into the bag.
//!
//! A program may be larger than the write queue: its chunks are written one by one, as
//! there is room.

use super::fetch::FetchedTraffic;
use super::numbers::Numbers;
use super::store::{OpenRun, RunInputs, Store};
use super::{DISCOVERY_PERIOD, Recorder, RecorderState};
use crate::bag_writer::BagAttachment;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use runtime::RosTime;
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// How long latched messages may take to arrive.
const MANIFESTS_WITHIN: Duration = Duration::from_secs(3);
/// How old the driver's journal report may be, with a margin for slow machines.
const JOURNAL_LAG: Duration = Duration::from_millis(60);
/// How often to check whether the write queue has room.
const ROOM_PERIOD: Duration = Duration::from_millis(5);
/// How long the disk may stall at the end of a run; messages written later may be lost.
const ROOM_WITHIN: Duration = Duration::from_secs(20);

/// Whether missing messages of this type are fetched.
pub(super) fn is_fetched(type_name: &str) -> bool {
    [
        wire::ProgramChunk::TYPE_NAME,
        wire::ContourChunk::TYPE_NAME,
        wire::PathChunk::TYPE_NAME,
        wire::ControllerTraffic::TYPE_NAME,
    ]
    .contains(&type_name)
}

impl Recorder {
    /// Fetches messages from before the bag was open: programs, paths, traffic.
    pub(super) async fn fetch_inputs(&self, run: u64, wanted: RunInputs) {
        let wanted = self.manifests(wanted).await;
        let at_ns = u64::try_from(RosTime::wall().as_nanos()).unwrap_or(0);
        let mut problems: Vec<String> = wanted.missing().collect();
        if let Some(manifest) = &wanted.program {
            match self.sources.program(manifest).await {
                Ok(chunks) => {
                    let text = chunks.iter().flat_map(|chunk| chunk.data.iter().copied());
                    let attachment = BagAttachment {
                        name: manifest.name.clone(),
                        media_type: "text/plain".into(),
                        log_time_ns: at_ns,
                        data: text.collect(),
                    };
                    self.when_room(run, |_, open| {
                        if let Err(error) = open.bag.attach(attachment) {
                            open.bag.note_incomplete(error.to_string());
                        }
                    })
                    .await;
                    self.feed(run, at_ns, &chunks).await;
                }
                Err(error) => problems.push(format!("the program's text: {error}")),
            }
        }
        if let Some(manifest) = &wanted.contour {
            match self.sources.contour(manifest).await {
                Ok(chunks) => self.feed(run, at_ns, &chunks).await,
                Err(error) => problems.push(format!("the programmed contour: {error}")),
            }
        }
        if let Some(manifest) = &wanted.path {
            match self.sources.path(manifest).await {
                Ok(chunks) => self.feed(run, at_ns, &chunks).await,
                Err(error) => problems.push(format!("the compensated path: {error}")),
            }
        }
        // The driver collects its journal for a moment before it serves it.
        sleep(JOURNAL_LAG).await;
        let FetchedTraffic { batches, problem } = self.sources.traffic(&Numbers::default()).await;
        for traffic in &batches {
            self.when_room(run, |store, open| open.add_traffic(store, traffic)).await;
        }
        self.when_room(run, |_, open| {
            open.has_inputs = true;
            open.has_beginning = problem.is_none() && !batches.is_empty();
            for problem in problems {
                open.bag.note_incomplete(problem);
            }
        })
        .await;
    }

    /// Waits for manifests that had not arrived when the run was noticed: a recorder that
    /// starts in mid-run sees the goal first.
    async fn manifests(&self, mut wanted: RunInputs) -> RunInputs {
        let end = Instant::now() + MANIFESTS_WITHIN;
        while wanted.missing().next().is_some() && Instant::now() < end {
            sleep(DISCOVERY_PERIOD).await;
            wanted = self.state().store.wanted();
        }
        wanted
    }

    async fn feed<M: Message>(&self, run: u64, at_ns: u64, messages: &[M]) {
        for message in messages {
            self.when_room(run, |store, open| open.write_ours(store, at_ns, message)).await;
        }
    }

    /// Calls `work` with the bag of a run when it has room, unless it is closed before.
    async fn when_room(&self, run: u64, write: impl FnOnce(&Store, &mut OpenRun)) {
        loop {
            {
                let mut state = self.state();
                let RecorderState { store, open, run: now, .. } = &mut *state;
                match open {
                    Some(open) if *now == run && open.has_room() => return write(store, open),
                    Some(_) if *now == run => {}
                    _ => return,
                }
            }
            sleep(ROOM_PERIOD).await;
        }
    }

    /// Fetches the traffic that is missing at the end; returns why it could not get more.
    pub(super) async fn fetch_rest(&self, open: &mut OpenRun) -> Option<String> {
        if !open.has_beginning {
            let beginning = self.sources.traffic(&Numbers::default()).await;
            open.has_beginning = beginning.problem.is_none() && !beginning.batches.is_empty();
            self.add_rest(open, &beginning.batches).await;
        }
        let FetchedTraffic { batches, problem } = self.sources.traffic(&open.numbers).await;
        self.add_rest(open, &batches).await;
        problem
    }

    async fn add_rest(&self, open: &mut OpenRun, batches: &[wire::ControllerTraffic]) {
        let end = Instant::now() + ROOM_WITHIN;
        for traffic in batches {
            while !open.has_room() && Instant::now() < end {
                sleep(ROOM_PERIOD).await;
            }
            open.add_traffic(&self.state().store, traffic);
        }
    }
}
