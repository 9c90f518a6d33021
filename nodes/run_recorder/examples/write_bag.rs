//! Writes a bag directory of known content, for other bag readers: see `tests/oracle.py`.
//!
//! `cargo run -p run_recorder --example write_bag -- DIR [COUNT]` makes
//! `DIR/oracle` with COUNT messages (default 1000) on two topics and a silent
//! third, and `DIR/oracle_split` with the same in several files; with COUNT, it
//! also prints how fast that was.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use run_recorder::bag_writer::{BagAttachment, ChannelSpec};
use run_recorder::qos::QosProfile;
use run_recorder::run_bag::{RunBag, RunBagError, RunBagOptions, SplitLimits};

/// A thousand messages are some files of this many bytes.
const SPLIT_SIZE: u64 = 30_000;
const POINT_TEXT: &str = "\
std_msgs/Header header
geometry_msgs/Point point
================================================================================
MSG: std_msgs/Header
# When and where.
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
";

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let Some(directory) = arguments.next() else {
        return fail("usage: write_bag DIR [COUNT]");
    };
    let count = match arguments.next().map(|text| text.parse()) {
        None => 1000,
        Some(Ok(count)) => count,
        Some(Err(_)) => return fail("COUNT is not a number"),
    };
    let split = SplitLimits { size: SPLIT_SIZE, ..SplitLimits::default() };
    let written = write(&directory, "oracle", SplitLimits::default(), count)
        .and_then(|first| Ok(first & write(&directory, "oracle_split", split, count)?));
    match written {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => fail(&error.to_string()),
    }
}

#[expect(clippy::print_stderr, reason = "an example talks to its user")]
fn fail(text: &str) -> ExitCode {
    eprintln!("{text}");
    ExitCode::FAILURE
}

#[expect(clippy::print_stdout, reason = "an example talks to its user")]
fn write(directory: &str, name: &str, split: SplitLimits, count: u64) -> Result<bool, RunBagError> {
    let mut options = RunBagOptions::new(directory, name);
    options.split = split;
    options.run.insert("run_id".into(), "oracle".into());
    let bag = RunBag::create(options)?;
    let channel = |topic: &str, type_name: &str, text: &str, qos| ChannelSpec {
        topic: topic.into(),
        type_name: type_name.into(),
        schema_text: text.into(),
        type_hash: String::new(),
        qos,
    };
    let string = "std_msgs/msg/String";
    let log = bag.add_channel(&channel(
        "/mill/log",
        string,
        "string data\n",
        vec![QosProfile::latched(1)],
    ))?;
    let point = "geometry_msgs/msg/PointStamped";
    let qos = vec![QosProfile::best_effort(5), QosProfile::reliable(10)];
    let tool = bag.add_channel(&channel("/mill/tool", point, POINT_TEXT, qos))?;
    bag.add_channel(&channel("/mill/silent", string, "string data\n", vec![]))?;
    bag.attach(BagAttachment {
        name: "program.mpf".into(),
        media_type: "text/plain".into(),
        log_time_ns: 1_000_000_000,
        data: b"N10 G1 X5 F100\nM30\n".to_vec(),
    })?;
    let start = Instant::now();
    for i in 0..count {
        let time = 1_700_000_000_000_000_000 + i * 1_000_000;
        let (channel, data) = if i % 4 == 0 {
            // 200 bytes with the encapsulation.
            (log, string_message(&format!("line {i:0>186}")))
        } else {
            (tool, point_message(i as i32, [i as f64, 0.5, -1.0]))
        };
        // Unlike a recorder, this program waits, so that nothing is lost on a slow disk.
        while i % 1000 == 0 && bag.status().bytes_waiting > 1 << 20 {
            std::thread::sleep(Duration::from_millis(1));
        }
        bag.write(channel, time, time - 1000, data);
    }
    let fed = start.elapsed();
    let status = bag.finish(Duration::from_secs(600));
    println!(
        "{} messages, {} bytes; fed in {:.3} s, finished in {:.3} s; complete: {}",
        status.messages_written,
        status.bytes_written,
        fed.as_secs_f64(),
        start.elapsed().as_secs_f64(),
        status.complete
    );
    Ok(status.is_finished)
}

fn string_message(text: &str) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend((text.len() as u32 + 1).to_le_bytes());
    data.extend(text.bytes());
    data.push(0);
    data
}

fn point_message(sec: i32, xyz: [f64; 3]) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend(sec.to_le_bytes());
    data.extend(0_u32.to_le_bytes());
    data.extend(5_u32.to_le_bytes());
    data.extend(b"work\0");
    data.resize(4 + 24, 0);
    xyz.iter().for_each(|value| data.extend(value.to_le_bytes()));
    data
}
