//! How much memory processes use while they run, sampled each second.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const PERIOD: Duration = Duration::from_secs(1);

/// The memory of one process.
#[derive(Debug)]
pub(crate) struct Held {
    pub(crate) name: String,
    id: u32,
    /// Seconds from the first sample, and megabytes.
    samples: Vec<(f64, f64)>,
}

impl Held {
    /// The mean over these eighths of the time, MB.
    pub(crate) fn mean_mb(&self, eighths: std::ops::Range<usize>) -> f64 {
        let part = self.part(eighths);
        part.iter().map(|(_, mb)| mb).sum::<f64>() / part.len() as f64
    }

    pub(crate) fn most_mb(&self) -> f64 {
        self.samples.iter().map(|(_, mb)| *mb).fold(0.0, f64::max)
    }

    /// The slope of the best line through these eighths, MB a minute.
    pub(crate) fn slope_mb_per_min(&self, eighths: std::ops::Range<usize>) -> f64 {
        let part = self.part(eighths.clone());
        let middle = part.iter().map(|(s, _)| s).sum::<f64>() / part.len() as f64;
        let mean = self.mean_mb(eighths);
        let sum =
            |of: &dyn Fn(f64, f64) -> f64| part.iter().map(|(s, mb)| of(*s, *mb)).sum::<f64>();
        let spread = sum(&|s, _| (s - middle) * (s - middle));
        // One sample has no slope.
        if spread > 0.0 { 60.0 * sum(&|s, mb| (s - middle) * (mb - mean)) / spread } else { 0.0 }
    }

    fn part(&self, eighths: std::ops::Range<usize>) -> &[(f64, f64)] {
        let at = |eighth: usize| self.samples.len() * eighth / 8;
        // In a short run one sample may be an eighth.
        let end = at(eighths.end).max(1);
        &self.samples[at(eighths.start).min(end - 1)..end]
    }
}

/// Samples until it is stopped.
#[derive(Debug)]
pub(crate) struct Sampler {
    stop: Sender<()>,
    thread: JoinHandle<Vec<Held>>,
}

impl Sampler {
    /// Starts sampling these processes.
    pub(crate) fn start(processes: Vec<(String, u32)>) -> Self {
        let (stop, stopped) = channel();
        let held = processes.into_iter().map(|(name, id)| Held { name, id, samples: Vec::new() });
        let mut held: Vec<Held> = held.collect();
        let thread = std::thread::spawn(move || {
            let begin = Instant::now();
            loop {
                let seconds = begin.elapsed().as_secs_f64();
                for process in &mut held {
                    if let Some(mb) = resident_mb(process.id) {
                        process.samples.push((seconds, mb));
                    }
                }
                if stopped.recv_timeout(PERIOD) != Err(RecvTimeoutError::Timeout) {
                    return held;
                }
            }
        });
        Self { stop, thread }
    }

    pub(crate) fn stop(self) -> Vec<Held> {
        drop(self.stop);
        self.thread.join().expect("it only samples")
    }
}

/// The anonymous memory of a process, without files; `None`: the process has ended.
pub(crate) fn resident_mb(id: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let kilobytes: f64 = line.trim().trim_end_matches(" kB").parse().ok()?;
    Some(kilobytes / 1024.0)
}
