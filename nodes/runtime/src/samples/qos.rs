//! QoS profiles, by the purpose of a topic.
//!
//! Knows the ROS 2 defaults. The code that makes a topic chooses its profile; the middleware says
//! what it means there.

/// How a topic is carried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Qos {
    /// Lost samples are sent again.
    pub reliable: bool,
    /// Late joiners get the last `depth` samples.
    pub transient_local: bool,
    /// Samples kept, on the sender for repair and late joiners, on the
    /// receiver until they are taken.
    pub depth: usize,
}

impl Qos {
    /// The ROS 2 default: reliable, volatile, the last ten.
    pub const DEFAULT: Self = Self { reliable: true, transient_local: false, depth: 10 };
    /// A value that stays true until the next one: reliable, transient local, one.
    ///
    /// A publisher that had no reader yet hands all its earlier samples to the
    /// first one, so the receiver takes the newest by stamp or sequence number.
    pub const LATCHED: Self = Self { reliable: true, transient_local: true, depth: 1 };
    /// Cyclic state that is soon replaced: best effort, volatile, five.
    pub const SENSOR: Self = Self { reliable: false, transient_local: false, depth: 5 };
    /// `/clock`: only the newest counts.
    pub const CLOCK: Self = Self { reliable: false, transient_local: false, depth: 1 };
    /// Requests and replies of services: reliable, volatile, a hundred waiting.
    pub const SERVICES: Self = Self { reliable: true, transient_local: false, depth: 100 };
    /// `/parameter_events` and other streams that must not lose samples.
    pub const EVENTS: Self = Self { reliable: true, transient_local: false, depth: 1000 };
    /// `/rosout`: reliable, transient local, a thousand.
    pub const ROSOUT: Self = Self { reliable: true, transient_local: true, depth: 1000 };

    /// The same with another depth; at least one.
    pub const fn with_depth(mut self, depth: usize) -> Self {
        self.depth = if depth == 0 { 1 } else { depth };
        self
    }
}

impl Default for Qos {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_depth_of_zero_becomes_one() {
        assert_eq!(Qos::DEFAULT.with_depth(0).depth, 1);
    }
}
