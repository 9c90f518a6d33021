//! A bench: a controller, a fake clock, and what was sent and received.
#![allow(dead_code)]

use std::time::Duration;

use virtual_controller::{Build, Controller, Firmware, Settings};

pub(crate) struct Bench {
    pub(crate) controller: Controller,
    pub(crate) now: Duration,
}

/// Fast axes, and steps finer than any tolerance of the tests.
pub(crate) fn settings(lines: &[&str]) -> Settings {
    settings_of(Firmware::Grbl, lines)
}

/// The same for other firmware.
pub(crate) fn settings_of(firmware: Firmware, lines: &[&str]) -> Settings {
    let mut settings = Settings::of(firmware);
    for axis in 0..3 {
        settings.set(100 + axis, 250.0).unwrap();
        settings.set(110 + axis, 6000.0).unwrap();
        settings.set(120 + axis, 100.0).unwrap();
    }
    for line in lines {
        settings.set_line(line).unwrap_or_else(|code| panic!("{line}: {code}"));
    }
    settings
}

impl Bench {
    pub(crate) fn new(lines: &[&str]) -> Self {
        Self::with(Build::new(settings(lines)))
    }

    pub(crate) fn with(build: Build) -> Self {
        let mut bench = Self { controller: Controller::with_build(build), now: Duration::ZERO };
        bench.received();
        bench
    }

    /// What the controller has sent since the last call, lines joined by ` / `.
    pub(crate) fn received(&mut self) -> String {
        let mut bytes = Vec::new();
        let mut before = usize::MAX;
        while before != bytes.len() {
            before = bytes.len();
            self.controller.transmit(&mut bytes);
        }
        let text = String::from_utf8(bytes).unwrap();
        text.split("\r\n").filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" / ")
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) -> String {
        self.controller.receive(self.now, bytes);
        self.received()
    }

    /// Sends bytes so slowly that the main loop handles each by itself.
    pub(crate) fn send_spaced(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.send(&[*byte]);
            self.wait(0.01);
        }
    }

    /// Sends a line and returns what comes back at once.
    pub(crate) fn send_line(&mut self, line: &str) -> String {
        self.send(format!("{line}\n").as_bytes())
    }

    pub(crate) fn wait(&mut self, seconds: f64) -> String {
        self.now += Duration::from_secs_f64(seconds);
        self.controller.advance(self.now);
        self.received()
    }

    /// Advances from event to event until none is left; returns what was received.
    pub(crate) fn settle(&mut self) -> String {
        let mut received = vec![self.received()];
        while let Some(event) = self.controller.next_event(self.now) {
            self.now = event;
            self.controller.advance(event);
            received.push(self.received());
        }
        received.retain(|text| !text.is_empty());
        received.join(" / ")
    }

    /// The status report without its occasional fields.
    pub(crate) fn status(&mut self) -> String {
        let report = self.send(b"?");
        let end = report.find("|WCO").or(report.find("|Ov")).unwrap_or(report.len() - 1);
        report[..end].trim_start_matches('<').to_string()
    }
}
