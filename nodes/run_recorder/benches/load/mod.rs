//! Messages like those of a run: many small ones, some larger, few near the size limit.

#![allow(dead_code)]

use run_recorder::bag_writer::ChannelSpec;
use run_recorder::qos::QosProfile;

/// Topic, bytes of a message, and how many of a thousand messages are of it.
pub(crate) const TOPICS: [(&str, usize, usize); 6] = [
    ("/joint_states", 180, 300),
    ("/tf", 150, 250),
    ("/machine_state", 320, 200),
    ("/controller_traffic", 1500, 200),
    ("/rosout", 400, 45),
    ("/compensated_path/chunks", 48_000, 5),
];

/// The types of the topics, by which the recorder sets how many samples may wait. The messages
/// are bytes and are never decoded.
pub(crate) const TYPES: [&str; 6] = [
    "sensor_msgs/msg/JointState",
    "tf2_msgs/msg/TFMessage",
    "diagnostic_msgs/msg/DiagnosticArray",
    "std_msgs/msg/String",
    "rcl_interfaces/msg/Log",
    "cnc_msgs/msg/PathChunk",
];

pub(crate) fn channels() -> Vec<ChannelSpec> {
    TOPICS
        .iter()
        .map(|(topic, ..)| ChannelSpec {
            topic: (*topic).to_owned(),
            type_name: "std_msgs/msg/ByteMultiArray".into(),
            schema_text: "byte[] data\n".into(),
            type_hash: String::new(),
            qos: vec![QosProfile::reliable(10)],
        })
        .collect()
}

/// Message after message, the same in every run of a bench.
pub(crate) struct Load {
    random: u64,
    /// Bytes that compress to about a half, as positions and texts do.
    noise: Vec<u8>,
}

impl Load {
    pub(crate) fn new() -> Self {
        let mut load = Self { random: 1, noise: Vec::new() };
        load.noise = (0..1 << 20)
            .flat_map(|_| {
                let random = load.next();
                // Two bytes of four are always the same.
                [random as u8, (random >> 8) as u8, 0x3f, 0]
            })
            .collect();
        load
    }

    fn next(&mut self) -> u64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        self.random >> 33
    }

    /// Place of the topic, and CDR with its encapsulation.
    pub(crate) fn message(&mut self) -> (usize, Vec<u8>) {
        let mut of_thousand = (self.next() % 1000) as usize;
        let topic = TOPICS.iter().position(|(_, _, share)| {
            let is_it = of_thousand < *share;
            of_thousand = of_thousand.saturating_sub(*share);
            is_it
        });
        let topic = topic.expect("the shares are a thousand");
        let size = TOPICS[topic].1;
        let start = self.next() as usize % (self.noise.len() - size);
        let mut data = Vec::with_capacity(size + 8);
        data.extend([0, 1, 0, 0]);
        data.extend((size as u32).to_le_bytes());
        data.extend(&self.noise[start..start + size]);
        (topic, data)
    }
}

/// The value of `--name` on the command line.
pub(crate) fn argument(name: &str) -> Option<u64> {
    let mut words = std::env::args().skip_while(|word| word != name).skip(1);
    words.next().map(|word| word.parse().unwrap_or_else(|_| panic!("{name} takes a number")))
}

/// Whether each bench only has to show that it works.
pub(crate) fn is_test() -> bool {
    std::env::args().any(|word| word == "--test")
}

/// Resident memory of a process, MB.
pub(crate) fn memory_mb(process: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).expect("Linux");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("a size");
    line.trim().trim_end_matches(" kB").parse::<f64>().expect("a number") / 1e3
}

/// The maxima of the first quarter, the last quarter, and all.
pub(crate) fn print_memory(name: &str, samples: &[f64]) {
    let most = |samples: &[f64]| samples.iter().copied().fold(0.0, f64::max);
    let quarter = samples.len().div_ceil(4);
    println!(
        "{name:<24} at most {:.0} MB; first quarter {:.0} MB, last {:.0} MB",
        most(samples),
        most(&samples[..quarter]),
        most(&samples[samples.len() - quarter..])
    );
}
