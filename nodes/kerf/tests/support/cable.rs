//! What lies between the driver and its controller in a test.

/// A serial line, or a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cable {
    Terminal,
    Tcp,
}

impl Cable {
    pub(crate) const BOTH: [Self; 2] = [Self::Terminal, Self::Tcp];

    /// The one that `KERF_TEST_CABLE` names: `tcp`; a pseudo-terminal where it is not set.
    pub(crate) fn wanted() -> Self {
        match std::env::var("KERF_TEST_CABLE").as_deref() {
            Ok("tcp") => Self::Tcp,
            Ok(other) => panic!("KERF_TEST_CABLE is {other}; it may be tcp, or not set"),
            Err(_) => Self::Terminal,
        }
    }
}
