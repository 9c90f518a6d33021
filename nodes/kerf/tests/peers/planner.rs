//! A planner that lies: what the driver takes for a path, and what not.
//!
//! The driver is alone, without a port; the planner is this process.

use super::machine::{domain, until};
use super::stranger::Stranger;
use super::support::{Folder, kerf};
use cnc_msgs::cdr;
use cnc_msgs::chunk::{PathChunks, sha256_hex};
use cnc_msgs::contour::Source;
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{GetPathChunks, GetPathChunksResponse};
use runtime::{Publisher, Qos};
use std::collections::BTreeMap;
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const ELEMENTS: usize = 1000;
/// Short ones: two fit an answer.
const CHUNKS: u32 = 10;

/// A path in ten chunks, and the manifest of it.
fn honest(revision: u64) -> Plan {
    let element = |index: usize| PathElement {
        shape: Shape::Line,
        end: [index as f64, 0.0, 0.0],
        feed_mm_per_min: Some(600.0),
        role: Role::None,
        side: None,
        axes: AxisSet::from_bits(1),
        source: Source::default(),
    };
    let elements = (1..=ELEMENTS).map(element).collect();
    let path = Arc::new(CompensatedPath { elements, ..CompensatedPath::default() });
    let program_id = format!("program_{revision}");
    let cut = PathChunks::new(program_id.clone(), revision, path);
    let whole = (0..cut.count()).filter_map(|index| cut.chunk(index));
    let elements: Vec<wire::PathElement> = whole.flat_map(|chunk| chunk.elements).collect();
    let manifest = wire::CompensatedPath {
        program_id: program_id.clone(),
        revision,
        element_count: ELEMENTS as u64,
        chunk_count: CHUNKS,
        ..wire::CompensatedPath::default()
    };
    let chunk = |(index, elements): (usize, &[wire::PathElement])| wire::PathChunk {
        program_id: program_id.clone(),
        revision,
        index: index as u32,
        chunk_count: CHUNKS,
        elements: elements.to_vec(),
        ..wire::PathChunk::default()
    };
    let chunks = elements.chunks(ELEMENTS / CHUNKS as usize).enumerate().map(chunk).collect();
    let mut plan = Plan { manifest, chunks, answer: Answer::Rest };
    seal(&mut plan);
    plan
}

/// What is announced, and what is given to who asks for it.
struct Plan {
    manifest: wire::CompensatedPath,
    chunks: Vec<wire::PathChunk>,
    answer: Answer,
}

/// What is answered to a request for the chunks from a number on.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    Rest,
    Refusal,
    Silence,
}

/// Makes the checksums right that a change has made wrong.
fn seal(plan: &mut Plan) {
    let mut bodies = Vec::new();
    for chunk in &mut plan.chunks {
        let body = cdr::record(&(&chunk.elements, &chunk.events));
        chunk.crc32 = cnc_msgs::chunk::crc32(&body);
        bodies.extend(body);
    }
    plan.manifest.sha256 = sha256_hex(&bodies);
}

/// A lie, and the word of it in the driver's log.
type Lie = (&'static str, fn(&mut Plan));

const LIES: [Lie; 14] = [
    ("1000000000 elements are announced; at most 50000000 are accepted", |plan| {
        plan.manifest.element_count = 1_000_000_000
    }),
    ("18446744073709551615 events are announced; at most 50000000", |plan| {
        plan.manifest.event_count = u64::MAX
    }),
    ("4294967295 chunks are announced", |plan| plan.manifest.chunk_count = u32::MAX),
    ("answered without chunk 1", |plan| drop(plan.chunks.remove(1))),
    ("revision 1, not of", |plan| plan.chunks[2].revision = 1),
    ("is of another revision", |plan| plan.chunks[2].program_id = "another".into()),
    ("chunk 99 of 10 does not exist", |plan| plan.chunks[3].index = 99),
    ("is damaged", |plan| plan.chunks[1].elements[7].end.x += 1e-6),
    ("together have checksum", |plan| plan.manifest.sha256 = sha256_hex(b"another path")),
    ("hold 1000 items so far; the manifest announced 999", |plan| {
        plan.manifest.element_count = 999
    }),
    ("NaN", |plan| {
        let last = plan.chunks.last_mut().expect("a chunk");
        last.elements.last_mut().expect("an element").end.x = f64::NAN;
        seal(plan);
    }),
    ("element 500 starts at", |plan| {
        let element = plan.chunks.iter_mut().flat_map(|it| &mut it.elements).nth(500);
        element.expect("an element").start.y = 1e-3;
        seal(plan);
    }),
    ("refused: no", |plan| plan.answer = Answer::Refusal),
    ("did not answer", |plan| plan.answer = Answer::Silence),
];

/// The driver; gone with this value.
struct Driver(Child);

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_path_that_is_not_whole_is_not_taken_and_the_next_one_is() {
    let (folder, domain) = (Folder::new(), domain());
    let namespace = format!("/alone_{}_{domain}", std::process::id());
    let log = std::fs::File::create(folder.path().join("driver.log")).expect("a log");
    let _driver = Driver(
        kerf()
            .env("ROS_DOMAIN_ID", &domain)
            .args(["node", "axis_driver", "--ros-args", "-r", &format!("__ns:={namespace}")])
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .expect("a driver"),
    );
    let said = || std::fs::read_to_string(folder.path().join("driver.log")).expect("a log");

    let planner = Stranger::join_as("planner", &domain, &namespace);
    let plans = Arc::<Mutex<BTreeMap<u64, Plan>>>::default();
    let shared = Arc::clone(&plans);
    planner.inside(|node| {
        node.concurrent_service::<GetPathChunks, _, _>(
            "compensated_path/get_chunks",
            move |request, _| {
                let plans = shared.lock().expect("no panic");
                let plan = &plans[&request.revision];
                // The one before as well: what comes twice does no harm.
                let before = request.first.saturating_sub(1) as usize;
                let rest = plan.chunks.iter().skip(before);
                let chunks = rest.take(1 + usize::from(request.first > 0)).cloned().collect();
                let (answer, success) = (plan.answer, plan.answer == Answer::Rest);
                async move {
                    if answer == Answer::Silence {
                        std::future::pending::<()>().await;
                    }
                    let message = "no".to_owned();
                    GetPathChunksResponse { success, message, chunks, ..Default::default() }
                }
            },
        )
        .expect("a service");
    });
    // A new planner for each, because the driver warns about each once.
    let announce = |plan: Plan| -> Publisher<wire::CompensatedPath> {
        let manifest = plan.manifest.clone();
        plans.lock().expect("no panic").insert(manifest.revision, plan);
        let publisher = planner.inside(|node| node.publisher("compensated_path", Qos::LATCHED));
        let publisher = publisher.expect("a publisher");
        assert!(publisher.publish(manifest));
        publisher
    };
    for (index, (words, lie)) in LIES.into_iter().enumerate() {
        let revision = 100 + 2 * index as u64;
        let mut plan = honest(revision);
        lie(&mut plan);
        let liar = announce(plan);
        let gid = liar.gid().to_string();
        let line = until(&format!("a word about {words:?}"), || {
            said().lines().find(|line| line.contains(&gid)).map(str::to_owned)
        });
        assert!(line.contains(words), "{words:?} is not in {line:?}");
        assert!(line.contains(&format!("revision {revision} ")), "{line}");
        // Published again and again: one line in the log is enough.
        let manifest = plans.lock().expect("no panic")[&revision].manifest.clone();
        if !words.contains("did not answer") {
            for _ in 0..20 {
                liar.publish(manifest.clone());
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        let _honest = announce(honest(revision + 1));
        let here = format!("(revision {}): {ELEMENTS} elements", revision + 1);
        until(&here, || said().contains(&here).then_some(()));
        assert_eq!(said().lines().filter(|line| line.contains(&gid)).count(), 1, "{}", said());
        assert!(
            !said().contains(&format!("(revision {revision}): {ELEMENTS} elements")),
            "{}",
            said()
        );
    }
    assert!(!said().contains("panicked"), "{}", said());
}
