//! A run on good, slow, full and absent disks.

use super::*;
use crate::bag_reader::Bag;
use crate::files::{open_bag, recover_bag};
use crate::parts::PartFile;
use crate::qos::QosProfile;
use std::io::{Cursor, Write};
use std::time::Instant;

const LONG: Duration = Duration::from_secs(60);

fn spec(topic: &str) -> ChannelSpec {
    ChannelSpec {
        topic: topic.into(),
        type_name: "std_msgs/msg/UInt8".into(),
        schema_text: "uint8 data\n".into(),
        type_hash: String::new(),
        qos: vec![QosProfile::reliable(10)],
    }
}

/// A bag whose disk fails after `room` bytes, or blocks while `gate` is held.
fn bag_on(directory: &Path, room: usize, gate: Arc<Mutex<Vec<u8>>>, limits: QueueLimits) -> RunBag {
    struct Disk(usize, Arc<Mutex<Vec<u8>>>);
    impl Write for Disk {
        fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
            let mut content = lock(&self.1);
            let fits = buf.len().min(self.0);
            self.0 -= fits;
            if fits == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            content.extend(&buf[..fits]);
            Ok(fits)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let mut options = RunBagOptions::new(directory, "r");
    options.limits = limits;
    options.flush_interval = Duration::from_millis(1);
    let first = PartFile {
        name: "r_0.mcap".into(),
        sink: Box::new(Disk(room, gate)),
        sync: Box::new(|| Ok(())),
    };
    let next = Box::new(|_| Err(io::ErrorKind::Unsupported.into()));
    let outlet = Outlet { directory: directory.to_owned(), first, next };
    RunBag::start(options, outlet).unwrap()
}

#[test]
fn a_disk_that_hangs_blocks_nobody_and_late_results_are_removed() {
    assert_eq!(within(LONG, || Ok(5), |_| panic!("in time")).unwrap(), 5);
    let full = || Err::<(), _>(io::ErrorKind::StorageFull.into());
    assert_eq!(within(LONG, full, |()| ()).unwrap_err().kind(), io::ErrorKind::StorageFull);

    let parent = tempfile::tempdir().unwrap();
    let directory = parent.path().to_owned();
    let (answers, disk) = mpsc::channel();
    let hangs = move || {
        disk.recv().unwrap();
        outlet(&directory, "r")
    };
    let (undone, is_undone) = mpsc::channel();
    let undo = move |late: Outlet| {
        assert!(late.directory.is_dir());
        late.remove();
        undone.send(()).unwrap();
    };
    let error = within(Duration::from_millis(1), hangs, undo).map(|_| ()).unwrap_err();
    assert_eq!(error.to_string(), "the disk has not answered for 1ms");
    answers.send(()).unwrap();
    is_undone.recv_timeout(LONG).unwrap();
    assert_eq!(parent.path().read_dir().unwrap().count(), 0);
}

#[test]
fn a_bag_has_begun_when_the_disk_has_taken_what_it_begins_with() {
    let parent = tempfile::tempdir().unwrap();
    let begun = |name: &str, room: usize| {
        let directory = parent.path().join(name);
        // The disk fails only once everything is queued: a bag that has failed is closed.
        let gate = Arc::default();
        let closed = lock(&gate);
        let bag = bag_on(&directory, room, gate.clone(), QueueLimits::default());
        let channel = bag.add_channel(&spec("/a")).unwrap();
        assert!(bag.write(channel, 1, 1, vec![0, 1, 0, 0, 7]));
        assert!(!bag.status().has_begun);
        bag.begin().unwrap();
        drop(closed);
        let end = Instant::now() + LONG;
        while !bag.status().has_begun && bag.status().error.is_none() {
            assert!(Instant::now() < end, "neither begun nor failed");
            thread::sleep(Duration::from_millis(1));
        }
        bag.status()
    };
    let good = begun("good", usize::MAX);
    assert!(good.has_begun && good.complete && good.bytes_written > 0, "{good:?}");
    for room in [0, 100, 300] {
        let full = begun(&format!("full_{room}"), room);
        assert!(!full.has_begun && !full.complete, "{full:?}");
    }
}

#[test]
fn a_run_is_a_directory_with_a_finished_file_and_metadata() {
    let parent = tempfile::tempdir().unwrap();
    let mut options = RunBagOptions::new(parent.path().join("bags"), "run_1");
    options.run.insert("run_id".into(), "run_1".into());
    let bag = RunBag::create(options.clone()).unwrap();
    let a = bag.add_channel(&spec("/a")).unwrap();
    let b = bag.add_channel(&spec("/b")).unwrap();
    bag.attach(BagAttachment {
        name: "program.mpf".into(),
        media_type: "text/plain".into(),
        log_time_ns: 1,
        data: b"M30".to_vec(),
    })
    .unwrap();
    for i in 0..1000 {
        let channel = if i % 4 == 0 { a } else { b };
        if i == 500 {
            bag.note_missed(a, 3);
        }
        assert!(bag.write(channel, i, i, vec![0, 1, 0, 0, i as u8]));
    }
    let path = bag.path().to_owned();
    let status = bag.finish(LONG);
    assert_eq!((status.complete, status.is_finished), (true, true), "{status:?}");
    assert_eq!(status.messages_written, 1000);
    let size = std::fs::metadata(path.join("run_1_0.mcap")).unwrap().len();
    assert_eq!(status.bytes_written, size);
    assert!(!path.join("metadata.yaml.tmp").exists());

    let mut read = open_bag(&path).unwrap();
    assert_eq!(read.problems(), []);
    assert_eq!(read.messages().count(), 1000);
    assert_eq!(read.channels()[0].message_count, 250);
    assert_eq!(read.attachments()[0].name, "program.mpf");
    assert_eq!(read.metadata_named("cnc_run").unwrap()["run_id"], "run_1");
    let closing = read.closing().unwrap();
    let counts = |counts: &[(&str, u64)]| -> BTreeMap<String, u64> {
        counts.iter().map(|(topic, count)| ((*topic).to_owned(), *count)).collect()
    };
    assert!(closing.complete, "{closing:?}");
    assert_eq!(closing.written, counts(&[("/a", 250), ("/b", 750)]));
    assert_eq!(closing.missed, counts(&[("/a", 3)]));
    let of_a = read.messages().map(|it| it.unwrap()).filter(|it| it.channel_index == 0);
    let numbers: Vec<u32> = of_a.map(|it| it.sequence).collect();
    assert_eq!((numbers[124], numbers[125]), (124, 128), "what did not come leaves a gap");

    let error = RunBag::create(options).unwrap_err();
    assert!(matches!(error, RunBagError::Exists { .. }), "{error}");
}

#[test]
fn what_was_written_is_readable_while_the_run_goes_on() {
    let parent = tempfile::tempdir().unwrap();
    let mut options = RunBagOptions::new(parent.path(), "r");
    options.flush_interval = Duration::from_millis(5);
    let bag = RunBag::create(options).unwrap();
    let a = bag.add_channel(&spec("/a")).unwrap();
    assert!(bag.write(a, 1, 1, vec![0, 1, 0, 0, 7]));
    let given_up = Instant::now() + LONG;
    let mut read = 0;
    while read == 0 && Instant::now() < given_up {
        thread::sleep(Duration::from_millis(5));
        if let Ok(mut now) = open_bag(bag.path()) {
            assert!(!now.is_complete());
            read = now.messages().count();
        }
    }
    assert_eq!(read, 1);
    assert!(bag.finish(LONG).complete);
}

#[test]
fn a_slow_disk_loses_messages_but_never_holds_the_feeder() {
    let directory = tempfile::tempdir().unwrap();
    let gate: Arc<Mutex<Vec<u8>>> = Arc::default();
    let held = lock(&gate);
    let limits = QueueLimits { messages: 10, bytes: 1 << 20 };
    let bag = bag_on(directory.path(), usize::MAX, gate.clone(), limits);
    let a = bag.add_channel(&spec("/a")).unwrap();
    let taken = (0..100).filter(|i| bag.write(a, *i, 0, vec![0; 5])).count();
    assert_eq!(taken, 10);
    let status = bag.status();
    assert_eq!(status.messages_lost, 90);
    assert_eq!(status.lost_by_topic["/a"], 90);
    assert!(!status.complete);
    drop(held);
    let status = bag.finish(LONG);
    assert!(status.is_finished && !status.complete, "{status:?}");
    assert_eq!(status.messages_written, 10);
    assert!(status.reasons[0].contains("90 messages of /a"), "{status:?}");
}

#[test]
fn a_disk_that_hangs_is_reported_at_once() {
    let directory = tempfile::tempdir().unwrap();
    let gate: Arc<Mutex<Vec<u8>>> = Arc::default();
    let held = lock(&gate);
    let bag = bag_on(directory.path(), usize::MAX, gate.clone(), QueueLimits::default());
    let end = Instant::now() + LONG;
    while !bag.status().is_stalled {
        assert!(Instant::now() < end, "it is not reported");
        thread::sleep(Duration::from_millis(10));
    }
    let status = bag.status();
    assert!(!status.complete && status.reasons[0].starts_with("the disk has taken nothing for"));
    drop(held);
    let status = bag.finish(LONG);
    assert!(status.complete && !status.is_stalled, "{status:?}");
}

#[test]
fn a_bag_that_was_not_closed_in_time_never_says_that_it_is_complete() {
    let directory = tempfile::tempdir().unwrap();
    let gate: Arc<Mutex<Vec<u8>>> = Arc::default();
    let held = lock(&gate);
    let bag = bag_on(directory.path(), usize::MAX, gate.clone(), QueueLimits::default());
    let shared = bag.shared.clone();
    let status = bag.finish(Duration::from_millis(1));
    let reason = "the bag was not closed within 0.001 s";
    assert_eq!((status.complete, status.reasons), (false, vec![reason.to_owned()]));
    drop(held);
    let end = Instant::now() + LONG;
    while !lock(&shared.end).is_over {
        assert!(Instant::now() < end, "the thread goes on by itself");
        thread::sleep(Duration::from_millis(1));
    }
    assert!(shared.status().is_finished);
    let bytes = lock(&gate).clone();
    let read = Bag::open("r_0.mcap", Cursor::new(bytes)).unwrap();
    assert!(read.problems()[0].to_string().contains(reason), "{:?}", read.problems());
}

#[test]
fn the_queue_is_bounded_in_bytes_too() {
    let directory = tempfile::tempdir().unwrap();
    let gate: Arc<Mutex<Vec<u8>>> = Arc::default();
    let held = lock(&gate);
    let limits = QueueLimits { messages: 1000, bytes: 10_000 };
    let bag = bag_on(directory.path(), usize::MAX, gate.clone(), limits);
    let a = bag.add_channel(&spec("/a")).unwrap();
    let taken = (0..100).filter(|i| bag.write(a, *i, 0, vec![0; 1000])).count();
    assert_eq!(taken, 9);
    assert!(bag.status().bytes_waiting <= 10_000);
    drop(held);
    bag.finish(LONG);
}

#[test]
fn a_caller_that_waits_for_room_loses_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let gate = Arc::new(Mutex::new(Vec::new()));
    let limits = QueueLimits { messages: 1000, bytes: 10_000 };
    let bag = bag_on(directory.path(), usize::MAX, gate, limits);
    let channel = bag.add_channel(&spec("/n")).unwrap();
    let begin = Instant::now();
    for time in 0..200 {
        while !bag.has_room() {
            assert!(begin.elapsed() < LONG, "no room for message {time}");
            thread::sleep(Duration::from_millis(1));
        }
        assert!(bag.write(channel, time, time, vec![0; 1000]));
    }
    let status = bag.finish(LONG);
    assert_eq!((status.messages_written, status.messages_lost), (200, 0));
}

#[test]
fn a_full_disk_is_reported_and_every_message_accounted_for() {
    let directory = tempfile::tempdir().unwrap();
    let limits = QueueLimits::default();
    let disk: Arc<Mutex<Vec<u8>>> = Arc::default();
    let bag = bag_on(directory.path(), 5000, disk.clone(), limits);
    let a = bag.add_channel(&spec("/a")).unwrap();
    let given_up = Instant::now() + LONG;
    let mut fed = 0;
    while bag.status().error.is_none() && Instant::now() < given_up {
        bag.write(a, fed, 0, vec![0; 100]);
        fed += 1;
    }
    assert!(!bag.write(a, fed, 0, vec![0; 100]));
    fed += 1;
    assert!(matches!(bag.add_channel(&spec("/b")), Err(RunBagError::Closed)));
    let status = bag.finish(LONG);
    assert!(status.error.is_some() && !status.complete && !status.is_finished);
    assert_eq!(status.messages_written + status.messages_lost, fed);
    assert!(status.reasons.iter().any(|reason| reason.ends_with("messages of /a are lost")));
    let bytes = lock(&disk).clone();
    let mut read = Bag::open("r_0.mcap", Cursor::new(bytes)).unwrap();
    assert!(read.messages().count() as u64 >= status.messages_written);
}

#[test]
fn on_a_disk_of_any_size_what_was_flushed_is_recovered() {
    let limits = QueueLimits::default();
    let parent = tempfile::tempdir().unwrap();
    let mut recovered_some = 0;
    for room in (0..6000).step_by(97) {
        let directory = parent.path().join(room.to_string());
        std::fs::create_dir(&directory).unwrap();
        let disk: Arc<Mutex<Vec<u8>>> = Arc::default();
        let bag = bag_on(&directory, room, disk.clone(), limits);
        let Ok(channel) = bag.add_channel(&spec("/a")) else { continue };
        let mut fed = 0;
        for round in 0..40_u64 {
            bag.write(channel, round, 0, vec![round as u8; 50]);
            fed += 1;
            thread::sleep(Duration::from_micros(200));
        }
        let status = bag.finish(LONG);
        assert_eq!(status.messages_written + status.messages_lost, fed, "{room} bytes");
        if status.is_finished {
            continue;
        }
        assert!(!status.complete, "{status:?}");
        let file = directory.join("r_0.mcap");
        std::fs::write(&file, &*lock(&disk)).unwrap();
        let saved = parent.path().join(format!("saved_{room}"));
        match recover_bag(&directory, &saved) {
            Ok(recovered) => {
                // A chunk that was wholly written before its flush failed may be there too.
                assert!(recovered.summary.message_count >= status.messages_written, "{status:?}");
                recovered_some += usize::from(recovered.summary.message_count > 0);
                assert!(!open_bag(&saved).unwrap().is_complete());
            }
            // Not even the header had room.
            Err(error) => assert_eq!(status.messages_written, 0, "{room} bytes: {error}"),
        }
    }
    assert!(recovered_some > 5, "{recovered_some} disks had room for a message");
}

#[test]
fn a_disk_that_takes_no_second_file_keeps_the_first_whole() {
    let directory = tempfile::tempdir().unwrap();
    let mut options = RunBagOptions::new(directory.path(), "r");
    options.split.size = 1;
    let bag = RunBag::create(options).unwrap();
    // Something else has the name of the second file.
    std::fs::create_dir(bag.path().join("r_1.mcap")).unwrap();
    let channel = bag.add_channel(&spec("/a")).unwrap();
    for time in 0..10 {
        bag.write(channel, time, time, vec![0; 5]);
    }
    let path = bag.path().to_owned();
    let status = bag.finish(LONG);
    assert!(status.error.is_some() && !status.complete && !status.is_finished, "{status:?}");
    assert_eq!((status.messages_written, status.messages_lost), (1, 9));
    std::fs::remove_dir(path.join("r_1.mcap")).unwrap();
    assert_eq!(open_bag(&path).unwrap().messages().count(), 1);
}

#[test]
fn a_gap_that_the_caller_knows_of_makes_the_bag_incomplete() {
    let parent = tempfile::tempdir().unwrap();
    let bag = RunBag::create(RunBagOptions::new(parent.path(), "r")).unwrap();
    bag.note_incomplete("controller_traffic 17 to 20 could not be fetched");
    let path = bag.path().to_owned();
    assert!(!bag.finish(LONG).complete);
    let read = open_bag(&path).unwrap();
    assert!(!read.is_complete());
    let problem = read.problems()[0].to_string();
    assert!(problem.contains("controller_traffic 17 to 20"), "{problem}");
}
