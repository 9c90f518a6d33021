//! Machines and parts that the tests cut, and the numbers that they are drawn from.

use axis_driver::driver::{DriverConfig, OnPathDeviation};
use cnc_msgs::contour::{Action, Source, SpindleMode};
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position, Shape};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use kerf_tests::line::Line;
use virtual_controller::{Build, Firmware, Settings};

/// Where the axes stand when the board is switched on, machine frame.
pub(crate) const START: Position = [-300.0, -200.0, -50.0];

/// splitmix64; seeds are literals.
#[derive(Debug, Clone)]
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u64) as usize]
    }
}

/// A driver that holds at a deviation.
pub(crate) fn holding() -> DriverConfig {
    DriverConfig { on_path_deviation: OnPathDeviation::Hold, ..DriverConfig::default() }
}

/// A router with this firmware and these settings, idle, with its work zero where it stands.
pub(crate) fn router(firmware: Firmware, lines: &[&str], config: DriverConfig) -> Line {
    router_of(Settings::small_router_of(firmware), lines, config)
}

/// The same with an axis that turns.
pub(crate) fn turning_router(firmware: Firmware, lines: &[&str], config: DriverConfig) -> Line {
    let settings = Settings::small_router_of(firmware).with_axes("XYZA".parse().expect("axes"));
    router_of(settings, lines, config)
}

fn router_of(mut settings: Settings, lines: &[&str], config: DriverConfig) -> Line {
    for line in lines {
        settings.set_line(line).expect("a setting of this firmware");
    }
    built(Build::new(settings), config)
}

/// The same with a build of the firmware.
pub(crate) fn built(build: Build, config: DriverConfig) -> Line {
    let build = Build { start_in_machine: Some(START), ..build };
    let mut line = Line::new(config, build, &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.zero_here();
    line
}

/// A part under construction.
#[derive(Debug, Default)]
pub(crate) struct Part {
    pub(crate) path: CompensatedPath,
    at: Position,
    feed: f64,
}

impl Part {
    /// It begins with a rapid to its zero, from wherever the tool is.
    pub(crate) fn new() -> Self {
        let mut part = Self { feed: 1_500.0, ..Self::default() };
        part.push(Shape::Line, [0.0; 3], None, AxisSet::ALL);
        part
    }

    fn push(&mut self, shape: Shape, end: Position, feed: Option<f64>, axes: AxisSet) {
        let line = self.path.elements.len() as u32 + 1;
        self.path.elements.push(PathElement {
            side: None,
            shape,
            end,
            feed_mm_per_min: feed,
            role: Role::None,
            axes,
            source: Source { line, block: Some(10 * line), ..Source::default() },
        });
        self.at = end;
    }

    pub(crate) fn feed(&mut self, feed: f64) {
        self.feed = feed;
    }

    pub(crate) fn rapid(&mut self, end: Position) {
        self.push(Shape::Line, end, None, AxisSet::NONE);
    }

    pub(crate) fn line(&mut self, end: Position) {
        self.push(Shape::Line, end, Some(self.feed), AxisSet::NONE);
    }

    /// So many degrees about a centre that is this far away, rising.
    pub(crate) fn arc(&mut self, plane: Plane, from_center: [f64; 2], degrees: f64, rise: f64) {
        let [a, b, normal] = plane.axes();
        let mut center = self.at;
        (center[a], center[b]) = (self.at[a] - from_center[0], self.at[b] - from_center[1]);
        let radius = from_center[0].hypot(from_center[1]);
        let angle = from_center[1].atan2(from_center[0]) + degrees.to_radians();
        let mut end = self.at;
        end[normal] += rise;
        let turns = (degrees.abs() / 360.0).floor() as u16;
        if degrees.abs() % 360.0 > 0.0 {
            end[a] = center[a] + radius * angle.cos();
            end[b] = center[b] + radius * angle.sin();
        }
        let arc = Arc { center, plane, clockwise: degrees < 0.0, turns };
        self.push(Shape::Arc(arc), end, Some(self.feed), AxisSet::NONE);
    }

    /// At this point.
    pub(crate) fn event(&mut self, action: Action) {
        let at_element = self.path.elements.len();
        let line = at_element as u32;
        let source = Source { line, ..Source::default() };
        self.path.events.push(PathEvent { at_element, action, source });
    }
}

/// A part of so many elements: pockets, drilling, arcs in three planes, tiny segments, dwells,
/// a spindle. It stays within 60 mm of its zero.
pub(crate) fn random_part(random: &mut Random, elements: usize) -> CompensatedPath {
    let mut part = Part::new();
    part.event(Action::SpindleSpeed { rpm: random.between(1_000.0, 20_000.0).round() });
    part.event(Action::Spindle(SpindleMode::Clockwise));
    while part.path.elements.len() < elements {
        part.feed(random.between(200.0, 4_000.0).round());
        let place =
            [random.between(-40.0, 40.0), random.between(-40.0, 40.0), random.between(-15.0, 15.0)];
        match random.below(9) {
            0 => part.rapid(place),
            1 | 2 => part.line(place),
            3 => part.line([place[0], part.at[1], part.at[2]]),
            // A hole in pecks: up and down on one line.
            4 => {
                let at = part.at;
                for depth in [-1.0, -2.0, -3.0] {
                    part.line([at[0], at[1], at[2] + depth]);
                    part.rapid(at);
                }
            }
            // A surface of tiny segments.
            5 => {
                let (at, pitch) = (part.at, random.between(0.02, 0.6));
                for step in 1..=random.below(40) + 5 {
                    let way = pitch * step as f64;
                    part.line([at[0] + way, at[1] + (way / 3.0).sin(), at[2]]);
                }
            }
            6 => part.event(Action::Dwell { seconds: random.between(0.0, 1.5) }),
            7 => part.event(Action::SpindleSpeed { rpm: random.between(500.0, 24_000.0) }),
            _ => {
                let plane = random.of(&[Plane::Xy, Plane::Zx, Plane::Yz]);
                let center = [random.between(-12.0, 12.0), random.between(1.0, 12.0)];
                let sign = random.of(&[-1.0, 1.0]);
                part.arc(
                    plane,
                    center,
                    sign * random.between(5.0, 400.0),
                    random.between(-2.0, 2.0),
                );
            }
        }
        let is_far = part.at.iter().any(|value| value.abs() > 45.0);
        if is_far {
            part.rapid([0.0; 3]);
        }
    }
    part.path
}

/// A turns in some of the straight lines of a path, and between them; returns where it ends.
pub(crate) fn turn_along(path: &mut CompensatedPath, random: &mut Random) -> f64 {
    let mut angle = 0.0;
    let mut events = Vec::new();
    for (at_element, element) in path.elements.iter().enumerate() {
        if element.shape != Shape::Line || random.below(3) > 0 {
            continue;
        }
        angle = random.between(-120.0, 120.0).round();
        let mode = match random.below(4) {
            0 => FurtherMode::Rapid,
            1 => FurtherMode::Feed(random.between(2_000.0, 9_000.0).round()),
            _ => FurtherMode::Along,
        };
        let action = Action::Further(FurtherMove { axes: FurtherAxes::NONE.with(0, angle), mode });
        events.push(PathEvent { at_element, action, source: element.source });
    }
    // What waits for the line of its block comes last before it.
    path.events.extend(events);
    path.events.sort_by_key(|event| event.at_element);
    angle
}

/// How much of something is wanted: a number in the environment, or the usual one.
pub(crate) fn number(name: &str, usual: f64) -> f64 {
    std::env::var(name).map_or(usual, |text| text.parse().expect("a number"))
}
