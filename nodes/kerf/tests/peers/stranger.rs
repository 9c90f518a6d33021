//! A node that does not belong to the machine, in its domain and namespace.

use super::machine::Machine;
use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use runtime::configuration::Configuration;
use runtime::{Handle, Session};
use std::collections::BTreeMap;

/// The stranger; it lives in this process.
pub(crate) struct Stranger {
    executor: tokio::runtime::Runtime,
    session: Option<Session>,
}

impl Stranger {
    pub(crate) fn join(machine: &Machine) -> Self {
        Self::join_as("stranger", &machine.domain, &machine.namespace)
    }

    pub(crate) fn join_as(name: &str, domain: &str, namespace: &str) -> Self {
        let executor = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .expect("threads");
        let inside = executor.enter();
        let words = ["--ros-args", "-r", &format!("__ns:={namespace}")].map(String::from);
        let variables = BTreeMap::from([("ROS_DOMAIN_ID".to_owned(), domain.to_owned())]);
        let configuration = Configuration::read(name, Vec::new(), &words, &variables);
        let session = Session::start(configuration.expect("valid")).expect("a node of our own");
        drop(inside);
        Self { executor, session: Some(session) }
    }

    pub(crate) fn node(&self) -> &Handle {
        self.session.as_ref().expect("it is taken at the end only").handle()
    }

    /// Makes endpoints, which need an executor around them.
    pub(crate) fn inside<T>(&self, work: impl FnOnce(&Handle) -> T) -> T {
        let _inside = self.executor.enter();
        work(self.node())
    }

    /// Runs what is written in async.
    pub(crate) fn wait<T>(&self, work: impl Future<Output = T>) -> T {
        self.executor.block_on(work)
    }
}

impl Drop for Stranger {
    fn drop(&mut self) {
        if let Some(session) = self.session.take() {
            self.executor.block_on(session.stop());
        }
    }
}

/// A message with its encoding in front.
pub(crate) fn encoded<M: Message>(message: &M) -> Vec<u8> {
    [&[0, 1, 0, 0], &cdr::body(message)[..]].concat()
}

/// What is in memory of a process, without what it has in files, MB.
pub(crate) fn resident_mb(process: rustix::process::Pid) -> f64 {
    let path = format!("/proc/{}/status", process.as_raw_nonzero());
    let status = std::fs::read_to_string(path).expect("the process is there");
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("RssAnon:"))
        .expect("RssAnon in the status");
    line.trim().trim_end_matches(" kB").parse::<f64>().expect("a number") / 1024.0
}
