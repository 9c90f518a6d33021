//! The thread of a line: passes bytes from one end to the other, and spoils them.

use super::super::cable::Cable;
use super::near::NearEnd;
use super::{Line, Passed, Trouble, Wanted, Writer, push};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::io::Errno;
use std::net::SocketAddr;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long the boot loader of a board ignores its input.
const BOOT: Duration = Duration::from_millis(700);

/// Both ends, on the thread of the line.
pub(super) struct Ends {
    line: Arc<Mutex<Line>>,
    link: PathBuf,
    controller: OwnedFd,
    woken: OwnedFd,
    cable: Cable,
    /// In a network: it stays the same.
    address: Option<SocketAddr>,
    port: Option<NearEnd>,
    /// Another device, with another name.
    spare: Option<NearEnd>,
    /// Bytes that the system has not taken yet.
    to_driver: Vec<u8>,
    to_controller: Vec<u8>,
    /// The beginning of a line of the controller.
    unfinished: Vec<u8>,
    /// Bytes of the driver's line that have passed.
    at: usize,
    is_motion: bool,
    boots_until: Option<Instant>,
    is_first_opening: bool,
}

impl Ends {
    pub(super) fn new(
        line: &Arc<Mutex<Line>>,
        link: &Path,
        controller: OwnedFd,
        woken: OwnedFd,
        cable: Cable,
    ) -> Self {
        let spare = (cable == Cable::Terminal).then(|| NearEnd::new(cable, None));
        Self {
            line: Arc::clone(line),
            link: link.to_owned(),
            controller,
            woken,
            cable,
            address: None,
            port: None,
            spare,
            to_driver: Vec::new(),
            to_controller: Vec::new(),
            unfinished: Vec::new(),
            at: 0,
            is_motion: false,
            boots_until: None,
            is_first_opening: true,
        }
    }

    /// A port where the last one was.
    pub(super) fn plug_in(&mut self) {
        let port = NearEnd::new(self.cable, self.address);
        self.plug(port);
    }

    /// Puts the link to this port.
    fn plug(&mut self, port: NearEnd) {
        if self.cable == Cable::Terminal {
            // Never a moment in which the link leads nowhere.
            let new = self.link.with_extension("new");
            let _ = std::fs::remove_file(&new);
            std::os::unix::fs::symlink(port.path(), &new).expect("a link to the line");
            std::fs::rename(&new, &self.link).expect("a link to the line");
        }
        self.address = port.address();
        self.is_first_opening = true;
        self.boots_until = None;
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        (line.is_open, line.openings) = (false, 0);
        line.device = Some(port.path().to_owned());
        drop(line);
        self.port = Some(port);
    }

    fn pull(&mut self) {
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        // Before the driver can notice.
        (line.is_open, line.device) = (false, None);
        drop(line);
        // A device that is gone has no name.
        let _ = std::fs::remove_file(&self.link);
        self.port = None;
        self.to_driver.clear();
        self.at = 0;
    }

    /// Until the line is dropped.
    pub(super) fn run(mut self) {
        loop {
            let wanted = {
                let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
                if line.is_over {
                    return;
                }
                self.to_controller.append(&mut line.asides);
                line.wanted.take()
            };
            match wanted {
                Some(Wanted::PluggedIn) => self.plug_in(),
                Some(Wanted::MovedTo(controller)) => {
                    self.controller = controller;
                    self.to_controller.clear();
                    self.unfinished.clear();
                    match self.spare.take() {
                        Some(spare) => self.plug(spare),
                        None => {
                            // The address is free when nobody listens there.
                            self.pull();
                            self.plug_in();
                        }
                    }
                }
                Some(Wanted::Pulled) => self.pull(),
                None => {}
            }
            self.look_who_has_it_open();
            self.boot();
            self.write();
            self.wait();
            let mut drain = [0; 64];
            while rustix::io::read(&self.woken, &mut drain).is_ok_and(|count| count > 0) {}
            self.read_controller();
            self.read_driver();
        }
    }

    fn wait(&self) {
        let wish = |is_full: bool| match is_full {
            true => PollFlags::IN | PollFlags::OUT,
            false => PollFlags::IN,
        };
        let mut fds = vec![
            PollFd::from_borrowed_fd(self.woken.as_fd(), PollFlags::IN),
            PollFd::new(&self.controller, wish(!self.to_controller.is_empty())),
        ];
        if let Some(port) = &self.port {
            if let Some(bytes) = port.bytes() {
                fds.push(PollFd::from_borrowed_fd(bytes, wish(!self.to_driver.is_empty())));
            }
            fds.push(PollFd::from_borrowed_fd(port.watch(), PollFlags::IN));
        }
        let patience = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
        // What has failed shows where it is read.
        let _ = poll(&mut fds, Some(&patience));
    }

    fn look_who_has_it_open(&mut self) {
        let Some(port) = &mut self.port else { return };
        let was_open = port.is_open();
        port.look();
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        let risen = !was_open && port.openings() > line.openings;
        let resets = risen && (self.is_first_opening || line.hangs_up);
        (line.is_open, line.openings) = (port.is_open(), port.openings());
        if port.is_open() || was_open {
            line.hangs_up = port.hangs_up();
        }
        if risen {
            self.is_first_opening = false;
        }
        if resets && line.reset.is_some() {
            self.boots_until = Some(Instant::now() + BOOT);
        }
    }

    fn boot(&mut self) {
        if self.boots_until.is_some_and(|until| Instant::now() >= until) {
            self.boots_until = None;
            let line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(reset) = &line.reset {
                reset();
            }
        }
    }

    fn write(&mut self) {
        push(&self.controller, &mut self.to_controller);
        if let Some(port) = &self.port {
            port.write(&mut self.to_driver);
        }
    }

    fn read_controller(&mut self) {
        let bytes = pull(&self.controller);
        for byte in bytes {
            self.unfinished.push(byte);
            if byte == b'\n' {
                let said = std::mem::take(&mut self.unfinished);
                self.pass_to_driver(said);
            }
        }
    }

    fn pass_to_driver(&mut self, said: Vec<u8>) {
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        let (is_ok, is_report) = (said.starts_with(b"ok\r"), said.starts_with(b"<"));
        let fits = |trouble: &Trouble| match trouble {
            Trouble::LoseOk | Trouble::DoubleOk | Trouble::HalveOk => is_ok,
            Trouble::BeheadReport => is_report,
            Trouble::Say { after, .. } => said.starts_with(after.as_bytes()),
            _ => false,
        };
        let mut arrived = said.clone();
        // What was asked for first happens first.
        let first = line.troubles.iter().position(Trouble::is_to_driver);
        if let Some(index) = first.filter(|index| fits(&line.troubles[*index]))
            && let Some(trouble) = line.troubles.remove(index)
        {
            match trouble {
                Trouble::LoseOk => arrived.clear(),
                Trouble::DoubleOk => arrived.extend_from_slice(&said),
                Trouble::Say { bytes, .. } => arrived.extend(bytes),
                // A letter of an answer, the beginning of a report.
                _ => drop(arrived.remove(0)),
            }
        }
        if line.is_mute || self.boots_until.is_some() || self.port.is_none() {
            arrived.clear();
        }
        self.to_driver.extend_from_slice(&arrived);
        line.log.push(Passed { from: Writer::Controller, said, arrived });
    }

    fn read_driver(&mut self) {
        let Some(port) = &mut self.port else { return };
        let said = port.read();
        if said.is_empty() {
            return;
        }
        let mut arrived = Vec::new();
        let mut is_pulled = false;
        for &byte in &said {
            let is_lost = self.is_lost(byte, &mut is_pulled);
            if is_pulled {
                break;
            }
            if !is_lost && self.boots_until.is_none() {
                arrived.push(byte);
            }
        }
        self.to_controller.extend_from_slice(&arrived);
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        line.log.push(Passed { from: Writer::Driver, said, arrived });
        drop(line);
        if is_pulled {
            self.pull();
        }
    }

    /// Whether this byte of the driver is lost, and whether the cable is pulled before it.
    fn is_lost(&mut self, byte: u8, is_pulled: &mut bool) -> bool {
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        let is_at_once = b"?!~\x18".contains(&byte) || byte >= 0x80;
        if self.at == 0 && !is_at_once {
            self.is_motion = b"GXYZ".contains(&byte);
        }
        let first = line.troubles.iter().position(|trouble| !trouble.is_to_driver());
        let trouble = first.map(|index| (index, line.troubles[index].clone()));
        let is_of_motion = self.is_motion && !is_at_once;
        let is_hit = match &trouble {
            Some((_, Trouble::LoseByte(wanted))) => *wanted == byte,
            Some((_, Trouble::LoseLetter)) => is_of_motion && self.at == 0,
            Some((_, Trouble::LoseLineEnd)) => is_of_motion && byte == b'\n',
            Some((_, Trouble::Unplug { after })) => is_of_motion && self.at == *after,
            _ => false,
        };
        match byte {
            b'\n' => (self.at, self.is_motion) = (0, false),
            _ if is_at_once => {}
            _ => self.at += 1,
        }
        if let Some((index, trouble)) = trouble.filter(|_| is_hit) {
            line.troubles.remove(index);
            *is_pulled = matches!(trouble, Trouble::Unplug { .. });
        }
        is_hit
    }
}

/// Opens the port of a controller.
pub(super) fn open_controller(port: &Path) -> OwnedFd {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    open(port, flags, Mode::empty()).expect("the controller's port")
}

/// Reads what is there.
fn pull(from: impl AsFd) -> Vec<u8> {
    let mut bytes = vec![0; 4096];
    let count = match rustix::io::read(from, &mut bytes) {
        Ok(count) => count,
        Err(Errno::AGAIN | Errno::INTR | Errno::IO) => 0,
        Err(error) => panic!("the wire cannot be read: {error}"),
    };
    bytes.truncate(count);
    bytes
}
