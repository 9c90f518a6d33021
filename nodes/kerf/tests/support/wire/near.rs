//! The end of a line that the driver opens: a pseudo-terminal, or a TCP port.

use super::super::cable::Cable;
use super::super::port::Port;
use super::push;
use rustix::io::Errno;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::{Path, PathBuf};

/// What the driver opens.
#[derive(Debug)]
pub(super) enum NearEnd {
    Terminal(Port),
    Socket(Socket),
}

/// A board in a network, which takes one client.
#[derive(Debug)]
pub(super) struct Socket {
    listener: TcpListener,
    client: Option<TcpStream>,
    url: PathBuf,
    openings: usize,
}

impl NearEnd {
    /// One that nobody has open; `at` is the address of an earlier one, in a network.
    pub(super) fn new(cable: Cable, at: Option<SocketAddr>) -> Self {
        match cable {
            Cable::Terminal => Self::Terminal(Port::open().expect("a pseudo-terminal")),
            Cable::Tcp => {
                let at = at.unwrap_or_else(|| (Ipv4Addr::LOCALHOST, 0).into());
                let listener = TcpListener::bind(at).expect("an address");
                listener.set_nonblocking(true).expect("a socket");
                let at = listener.local_addr().expect("an address");
                let url = format!("tcp://{at}").into();
                Self::Socket(Socket { listener, client: None, url, openings: 0 })
            }
        }
    }

    /// Where it is: a device, or a URL.
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Terminal(port) => port.path(),
            Self::Socket(socket) => &socket.url,
        }
    }

    /// In a network.
    pub(super) fn address(&self) -> Option<SocketAddr> {
        match self {
            Self::Terminal(_) => None,
            Self::Socket(socket) => socket.listener.local_addr().ok(),
        }
    }

    /// Can be read when it was opened or closed.
    pub(super) fn watch(&self) -> BorrowedFd<'_> {
        match self {
            Self::Terminal(port) => port.watch().as_fd(),
            Self::Socket(socket) => socket.listener.as_fd(),
        }
    }

    /// Bytes written here arrive at the process that has it open; `None`: nobody has.
    pub(super) fn bytes(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Self::Terminal(port) => Some(port.master().as_fd()),
            Self::Socket(socket) => socket.client.as_ref().map(AsFd::as_fd),
        }
    }

    /// Takes note of who has opened and closed it.
    pub(super) fn look(&mut self) {
        match self {
            Self::Terminal(port) => port.look(),
            Self::Socket(socket) => {
                if let Ok((client, _)) = socket.listener.accept() {
                    client.set_nonblocking(true).expect("a socket");
                    client.set_nodelay(true).expect("a socket");
                    socket.client = Some(client);
                    socket.openings += 1;
                }
            }
        }
    }

    /// How often it was opened.
    pub(super) fn openings(&self) -> usize {
        match self {
            Self::Terminal(port) => port.openings(),
            Self::Socket(socket) => socket.openings,
        }
    }

    pub(super) fn is_open(&self) -> bool {
        match self {
            Self::Terminal(port) => port.is_open(),
            Self::Socket(socket) => socket.client.is_some(),
        }
    }

    /// Whether the last one to close it would let DTR fall.
    pub(super) fn hangs_up(&self) -> bool {
        match self {
            Self::Terminal(port) => port.hangs_up(),
            Self::Socket(_) => false,
        }
    }

    /// Writes what the system takes. Who is not there misses it.
    pub(super) fn write(&self, bytes: &mut Vec<u8>) {
        match self.bytes() {
            Some(to) => push(to, bytes),
            None => bytes.clear(),
        }
    }

    /// Reads what is there.
    pub(super) fn read(&mut self) -> Vec<u8> {
        let mut bytes = vec![0; 4096];
        let read = self.bytes().map(|from| rustix::io::read(from, &mut bytes));
        let count = match (read, &mut *self) {
            (None | Some(Err(Errno::AGAIN | Errno::INTR | Errno::IO)), _) => 0,
            (Some(Ok(0) | Err(_)), Self::Socket(socket)) => {
                socket.client = None;
                0
            }
            (Some(Ok(count)), _) => count,
            (Some(Err(error)), Self::Terminal(_)) => panic!("the wire cannot be read: {error}"),
        };
        bytes.truncate(count);
        bytes
    }
}
