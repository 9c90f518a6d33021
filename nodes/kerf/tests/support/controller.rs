//! A virtual controller as a process, in whose hands something goes wrong on demand.

use super::support::kerf;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

/// A controller. It goes when this is dropped.
#[derive(Debug)]
pub(crate) struct Controller {
    process: Child,
    orders: Orders,
    port: PathBuf,
}

/// Its standard input, for fault actions.
#[derive(Debug, Clone)]
pub(crate) struct Orders(Arc<Mutex<ChildStdin>>);

impl Orders {
    /// Lets this happen now, in the words of `--fault` before the `@`.
    pub(crate) fn inject(&self, what: &str) {
        let mut stdin = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // One that has ended says so elsewhere.
        let _ = writeln!(stdin, "{what}").and_then(|()| stdin.flush());
    }
}

impl Controller {
    /// One with these arguments, so many times faster than a real one.
    pub(crate) fn start(time_factor: u32, args: &[&str]) -> Self {
        let mut command = kerf();
        command
            .args(["node", "virtual_controller", "--stdin"])
            .args(["--time-factor", &time_factor.to_string()])
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let mut process = command.spawn().expect("a virtual controller");
        let orders = Orders(Arc::new(Mutex::new(process.stdin.take().expect("piped"))));
        let mut said = BufReader::new(process.stdout.take().expect("piped"));
        let mut first = String::new();
        said.read_line(&mut first).expect("it reports its port");
        let port = PathBuf::from(first.trim());
        assert!(port.exists(), "no virtual controller: {first:?}");
        Self { process, orders, port }
    }

    pub(crate) fn port(&self) -> &Path {
        &self.port
    }

    pub(crate) fn orders(&self) -> Orders {
        self.orders.clone()
    }

    /// See [`Orders::inject`].
    pub(crate) fn inject(&self, what: &str) {
        self.orders.inject(what);
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
