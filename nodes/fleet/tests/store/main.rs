//! Stores, workers and reports, on bags of runs in virtual time.

mod joined;
mod mended;
#[path = "../support/mod.rs"]
mod support;

use fleet::core::key::{bag_object, key_of};
use fleet::push::{Done as Pushed, Order as Push, push};
use fleet::report::report;
use fleet::store::Store;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use support::{COUNT, Failing, bags, indexed, open, replay, root, said};
use tempfile::tempdir;

/// Pushes; returns what came of it and every sentence.
fn pushed(store: &Store, bags: Vec<PathBuf>) -> (Pushed, Vec<String>) {
    let sentences = RefCell::new(Vec::new());
    let order = Push { bags, ..Push::default() };
    let done = push(Ok(store), &order, &|text| sentences.borrow_mut().push(text.to_owned()));
    (done.expect("a push"), sentences.into_inner())
}

fn counted(sent: usize, known: usize, refused: usize) -> Pushed {
    Pushed { sent, known, refused, waiting: 0 }
}

const ALL: usize = COUNT as usize;

#[test]
fn each_bag_is_there_once_and_has_one_verdict_of_a_build() {
    let folder = tempdir().expect("a folder");
    let (store, journal) = (open(&folder.path().join("store")), folder.path().join("journal"));
    // One of them twice, under another name.
    let copy = folder.path().join("copy.mcap");
    fs::copy(&bags()[0], &copy).expect("copied");
    let with_copy = bags().into_iter().chain([copy]).collect();
    assert_eq!(pushed(&store, with_copy).0, counted(ALL, 1, 0));
    assert_eq!(pushed(&store, bags()).0, counted(0, ALL, 0));
    assert_eq!(indexed(&store).len(), ALL);
    let mut replayed = 0;
    for shard in ["0/3", "1/3", "2/3"] {
        replayed += replay(&store, shard, "today", &journal).expect("a shard").replayed;
    }
    assert_eq!(replayed, ALL);
    // Other shards know what is done, too.
    let again = replay(&store, "0/1", "today", &journal).expect("a shard");
    assert_eq!((again.replayed, again.known), (0, ALL));
    let said = said(&store, "today");
    assert_eq!(said.len(), ALL);
    for (bag, rows) in &said {
        assert_eq!(rows.len(), 1, "{bag}");
        assert_eq!(rows[0][1].as_text(), "reproduced", "{bag}: {}", rows[0][5]);
    }
    let report = report(&store, None, None).expect("a report");
    assert_eq!((report.counts.reproduced, report.to_do), (ALL, 0));
    assert!(report.text().contains("200 reproduced, 0 different, 0 cannot be compared, 0 to do"));
}

#[test]
fn bad_input_is_named_and_the_rest_is_done() {
    let folder = tempdir().expect("a folder");
    let (store, journal) = (open(&folder.path().join("store")), folder.path().join("journal"));
    let file = |name: &str, content: &[u8]| {
        let file = folder.path().join(name);
        fs::write(&file, content).expect("written");
        file
    };
    let whole = fs::read(&bags()[0]).expect("a bag");
    let truncated = file("truncated.mcap", &whole[..whole.len() / 2]);
    let text = file("text.mcap", b"G0 X0");
    let empty = file("empty.mcap", b"");
    let mut flipped = whole.clone();
    flipped[whole.len() / 3] ^= 0x40;
    let flipped = file("flipped.mcap", &flipped);
    let split = folder.path().join("split");
    fs::create_dir(&split).expect("a folder");
    for part in 0..2 {
        fs::copy(&bags()[part], split.join(format!("split_{part}.mcap"))).expect("copied");
    }
    let none = folder.path().join("none.mcap");
    let older = root("bags/rs274_older_definitions");
    let good = bags()[1].clone();
    let given = vec![truncated, text, empty, flipped, split, none, older, good];
    let (done, sentences) = pushed(&store, given);
    assert_eq!(done, counted(2, 0, 6));
    for (sentence, [name, why]) in sentences.iter().zip([
        ["truncated.mcap", "`kerf bag recover BAG NEW` copies what can be read"],
        ["text.mcap", "is not a bag (MCAP file)"],
        ["empty.mcap", "is empty"],
        ["flipped.mcap", "is damaged"],
        ["split", "its 2 files are not of one run; push each file by itself"],
        ["none.mcap", "No such file"],
    ]) {
        assert!(sentence.contains(&format!("{name}: not pushed: ")), "{sentence}");
        assert!(sentence.contains(why), "{sentence} does not say {why}");
    }
    // Behind the back of the index: a row without its bag, a bag without its row, one that is damaged.
    pushed(&store, bags()[2..6].to_vec());
    let keys: Vec<String> =
        bags().iter().map(|bag| key_of(&fs::read(bag).expect("a bag"))).take(6).collect();
    let object = |key: &str| folder.path().join("store").join(bag_object(key));
    fs::remove_file(object(&keys[2])).expect("removed");
    fs::write(object(&keys[3]), b"junk").expect("written");
    fs::copy(&bags()[6], object(&"ab".repeat(32))).expect("copied");
    fs::write(folder.path().join("store/bags/notes.txt"), b"not a bag").expect("written");
    let done = replay(&store, "0/1", "today", &journal).expect("done as far as it can be");
    assert_eq!((done.replayed, done.absent), (5, 1));
    let verdicts = said(&store, "today");
    assert_eq!(verdicts[&keys[3]][0][1].as_text(), "error");
    assert!(!verdicts.contains_key(&keys[2]));
    let report = report(&store, Some("today"), None).expect("a report");
    assert_eq!(report.rows_without_bag, [keys[2].clone()]);
    assert_eq!(report.bags_without_row, ["ab".repeat(32)]);
    // Pushing again mends both, and the next worker replays them.
    assert_eq!(pushed(&store, bags()[2..4].to_vec()).0, counted(2, 0, 0));
    let done = replay(&store, "0/1", "today", &journal).expect("a shard");
    assert_eq!((done.replayed, done.absent), (2, 0));
    let verdicts =
        fleet::dataset::verdicts(&store, "today", &["bag", "verdict"]).expect("verdicts");
    for key in &keys[2..4] {
        assert_eq!(verdicts.rows[key][1].as_text(), "reproduced");
    }
    assert_eq!(replay(&store, "0/1", "today", &journal).expect("a shard").replayed, 0);
}

#[test]
fn an_index_of_another_version_is_named_and_the_shard_is_not_called_done() {
    let folder = tempdir().expect("a folder");
    let (store, journal) = (open(&folder.path().join("store")), folder.path().join("journal"));
    pushed(&store, bags()[..3].to_vec());
    fs::write(folder.path().join("store/index/other.parquet"), b"PAR1 of others").expect("written");
    let error = replay(&store, "0/1", "today", &journal).expect_err("not done").to_string();
    assert!(
        error.contains("shard 0/1 is not done: 1 objects could not be read; 3 bags were replayed"),
        "{error}"
    );
    assert_eq!(said(&store, "today").len(), 3);
    let report = report(&store, None, None).expect("a report");
    let [problem] = &report.problems[..] else { panic!("{:?}", report.problems) };
    assert!(problem.starts_with("index/other.parquet: "), "{problem}");
    assert!(problem.contains("remove it and push its bags again"), "{problem}");
    // A push names it too, and does its work.
    let (done, sentences) = pushed(&store, bags()[3..4].to_vec());
    assert_eq!(done, counted(1, 0, 0));
    assert_eq!(&sentences, &report.problems);
    // The advice helps.
    fs::remove_file(folder.path().join("store/index/other.parquet")).expect("removed");
    assert_eq!(replay(&store, "0/1", "today", &journal).expect("done").replayed, 1);
}

#[test]
fn a_store_that_fails_one_request_in_ten_loses_and_doubles_nothing() {
    let folder = tempdir().expect("a folder");
    let at = folder.path().join("store");
    open(&at);
    let failing = Arc::new(Failing::new(&at, 10, u64::MAX));
    let store = Store::with(failing.clone(), "failing".into()).expect("a store");
    let some = bags()[..60].to_vec();
    assert_eq!(pushed(&store, some).0, counted(60, 0, 0));
    for shard in ["0/2", "1/2"] {
        replay(&store, shard, "today", &folder.path().join("journal")).expect("a shard");
    }
    let requests = failing.requests.load(Ordering::Relaxed);
    assert!(requests > 180, "{requests}");
    let whole = open(&at);
    assert_eq!(indexed(&whole).len(), 60);
    let said = said(&whole, "today");
    assert_eq!(said.len(), 60);
    assert!(said.values().all(|rows| rows.len() == 1));
}

#[test]
fn what_a_full_store_does_not_take_waits_in_the_spool() {
    let folder = tempdir().expect("a folder");
    let (at, spool) = (folder.path().join("store"), folder.path().join("spool"));
    open(&at);
    let size = |bag: &PathBuf| fs::metadata(bag).expect("a file").len();
    let room = bags()[..5].iter().map(size).sum::<u64>() + 1_000;
    let full =
        Store::with(Arc::new(Failing::new(&at, u64::MAX, room)), "full".into()).expect("a store");
    let some = bags()[..12].to_vec();
    // Without a spool it is an error, and nothing is lost: the bags are where they were.
    let order = Push { bags: some.clone(), ..Push::default() };
    let error = push(Ok(&full), &order, &|_| {}).expect_err("it is full").to_string();
    assert!(error.starts_with("full: ") && error.contains("no space left on device"), "{error}");
    let order = Push { bags: some, spool: Some(spool.clone()), ..Push::default() };
    let done = push(Ok(&full), &order, &|_| {}).expect("they wait");
    assert_eq!(done.waiting + done.sent, 12);
    assert!(done.waiting >= 7, "{done:?}");
    // Days later there is room: only the spool is pushed.
    let store = open(&at);
    let order = Push { spool: Some(spool.clone()), ..Push::default() };
    push(Ok(&store), &order, &|_| {}).expect("pushed");
    assert_eq!(indexed(&store).len(), 12);
    assert_eq!(store.list("bags").expect("a listing").len(), 12);
    assert_eq!(fs::read_dir(&spool).expect("a folder").count(), 0);
}

/// Workers that are killed, of both shards.
const KILLS: u32 = 12;

#[test]
fn workers_that_are_killed_at_random_lose_and_double_nothing() {
    let folder = tempdir().expect("a folder");
    let (at, journal) = (folder.path().join("store"), folder.path().join("journal"));
    let store = open(&at);
    pushed(&store, bags());
    let worker = |shard: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kerf-fleet"));
        command.args(["replay", "--build", "today", "--shard", shard, "--store"]).arg(&at);
        command.arg("--journal").arg(&journal).stdout(Stdio::null());
        command.spawn().expect("a worker")
    };
    let mut shards = BTreeSet::from(["0/2", "1/2"]);
    let (mut kills, mut random) = (0, 20_261_124_u64);
    while !shards.is_empty() {
        for shard in shards.clone() {
            let mut worker = worker(shard);
            // A bag in which one is killed comes last again, and the third kill in it counts as its
            // fault. So the kills end before only such bags are left.
            if kills >= KILLS {
                let status = worker.wait().expect("a process");
                assert!(status.success(), "shard {shard}: {status}");
                shards.remove(shard);
                continue;
            }
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            std::thread::sleep(Duration::from_millis(20 + (random >> 33) % 900));
            let ended = worker.try_wait().expect("a process");
            worker.kill().expect("killed or ended");
            let status = worker.wait().expect("a process");
            if ended.is_some() {
                assert!(status.success(), "shard {shard}: {status}");
                shards.remove(shard);
            } else {
                kills += 1;
            }
        }
    }
    assert!(kills >= 5, "only {kills} workers were killed");
    let said = said(&store, "today");
    assert_eq!(said.keys().collect::<Vec<_>>(), indexed(&store).keys().collect::<Vec<_>>());
    for (bag, rows) in said {
        assert_eq!(rows.len(), 1, "{bag}");
        assert_eq!(rows[0][1].as_text(), "reproduced", "{bag}: {}", rows[0][5]);
    }
    assert_eq!(fs::read_dir(&journal).expect("a folder").count(), 0);
}

#[test]
fn the_command_says_what_it_did_and_refuses_what_is_no_shard() {
    let folder = tempdir().expect("a folder");
    let at = folder.path().join("store");
    pushed(&open(&at), bags()[..20].to_vec());
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kerf-fleet"));
        let output = command.args(words).arg("--store").arg(&at).output().expect("a process");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let (status, _, error) = run(&["replay", "--shard", "7/3"]);
    assert_eq!(status, Some(2));
    assert!(error.contains("shard 7/3 does not exist: the shards of 3 are 0/3 to 2/3"), "{error}");
    let (status, _, error) = run(&["replay", "--build", "a", "--where", "colour = 'red'"]);
    assert_eq!(status, Some(2));
    assert!(error.contains("there is no column `colour`"), "{error}");
    let (status, _, error) = run(&["replay", "--build", "a", "--bag-mb-max", "17592186044416"]);
    assert_eq!(status, Some(2));
    assert!(error.contains("the most is 17592186044415"), "{error}");
    let journal = folder.path().join("journal").display().to_string();
    let words = ["replay", "--build", "a", "--journal", &journal, "--where", "control = 'rs274'"];
    let (status, output, error) = run(&words);
    assert_eq!((status, error.as_str()), (Some(0), ""));
    assert!(output.starts_with("shard 0/1 of build a: "), "{output}");
    let page = folder.path().join("page.html").display().to_string();
    let (status, output, _) = run(&["report", "--json", "--html", &page]);
    assert_eq!(status, Some(0));
    let json: serde_json::Value = serde_json::from_str(&output).expect("JSON");
    let count = |key: &str| json["counts"][key].as_u64().expect("a count");
    assert!(count("reproduced") > 0 && json["to_do"].as_u64() == Some(20 - count("reproduced")));
    assert!(fs::read_to_string(&page).expect("a page").contains("<title>a: 0 different</title>"));
    let (status, _, error) = run(&["report", "--build", "b"]);
    assert_eq!(status, Some(2));
    assert!(error.contains("no verdict of build b is in"), "{error}");
}
