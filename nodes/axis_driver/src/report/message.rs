//! Lines in square brackets: what the controller reports of itself and of what it did.
//!
//! All of them are pushed or belong to a question; none of them is an answer.

use super::ReportUnits;
use super::number::{parse_count, parse_further, parse_number, parse_position};
use cnc_msgs::geometry::Position;

/// A line in brackets.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// `[VER:1.1h.20190830:]`
    Version(String),
    /// `[OPT:VNML+,100,1024,3,0]`: build letters, planner blocks, receive buffer in bytes,
    /// axes and tools. grbl reports the first three, FluidNC the letters alone.
    Options {
        letters: String,
        planner_blocks: Option<u16>,
        receive_bytes: Option<u16>,
        axes: Option<u16>,
        tools: Option<u16>,
    },
    /// `[NEWOPT:ENUMS,RT+,TC,SED]`: what else the build can do.
    NewOptions(Vec<String>),
    /// `[AUX IO:2,4,0,1]`: digital inputs and outputs, then analog ones, that programs can use.
    AuxIo([u8; 4]),
    /// `[AXS:3:XYZ]`: the letters of the axes, in the order of reports.
    Axes(String),
    /// `[SIGNALS:D]`: the inputs that the board has, lettered as in reports.
    Signals(String),
    /// `[FIRMWARE:grblHAL]`
    Firmware(String),
    /// `[DRIVER:Simulator]`, `[BOARD:...]`, `[NVS STORAGE:*EEPROM]` and the like.
    Build { key: String, value: String },
    /// `[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]`: the words in force, for
    /// [`super::ModalWords`].
    ParserState(String),
    /// `[PRB:5.000,0.000,-3.988:1]`, machine frame, mm.
    Probe { position: Position, further: Vec<f64>, has_touched: bool },
    /// `[G54:0.000,0.000,0.000]`, also G28, G30 and G92; mm.
    Offset {
        name: String,
        position: Position,
        /// The values after X, Y and Z, as they are printed.
        further: Vec<f64>,
    },
    /// `[TLO:0.000]`, mm. Where it is reported for each axis, the one farthest from zero.
    ToolLength(f64),
    /// `[SETTING:110|10|X-axis maximum rate|mm/min|6|...]`: what the controller calls a
    /// setting; the unit is empty where it has none.
    SettingDetail { number: u16, name: String, unit: String },
    /// `[MSG:Reset to continue]`, `[MSG:INFO: Caution: Unlocked]`; see [`Severity`].
    Text(String),
    /// `[echo: G1X1]`: a line that the controller has read.
    Echo(String),
    /// `[JSON:{...}]`: for the web interface of FluidNC.
    Json(String),
    /// Any other bracket, as it stands.
    Other(String),
}

/// How serious FluidNC calls a text; grbl and grblHAL do not say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    Debug,
    Info,
    Warning,
    Error,
}

impl Severity {
    /// Takes `INFO: ` and the like off a text; a text without it is information.
    pub fn of(text: &str) -> (Self, &str) {
        const PREFIXES: [(&str, Severity); 5] = [
            ("INFO:", Severity::Info),
            ("DBG:", Severity::Debug),
            ("VERB:", Severity::Debug),
            ("WARN:", Severity::Warning),
            ("ERR:", Severity::Error),
        ];
        let text = text.trim_start();
        let found = PREFIXES.into_iter().find_map(|(prefix, severity)| {
            text.strip_prefix(prefix).map(|rest| (severity, rest.trim_start()))
        });
        found.unwrap_or((Self::Info, text))
    }
}

impl Message {
    /// Reads what stands between the brackets.
    pub(super) fn read(text: &str, units: ReportUnits) -> Self {
        Self::read_known(text, units).unwrap_or_else(|| Self::Other(text.to_owned()))
    }

    fn read_known(text: &str, units: ReportUnits) -> Option<Self> {
        let (key, value) = text.split_once(':')?;
        Some(match key {
            "VER" => Self::Version(value.to_owned()),
            "OPT" => {
                let mut fields = value.split(',');
                let letters = fields.next().unwrap_or_default().to_owned();
                let mut number = || fields.next().and_then(parse_count);
                Self::Options {
                    letters,
                    planner_blocks: number(),
                    receive_bytes: number(),
                    axes: number(),
                    tools: number(),
                }
            }
            "AUX IO" => Self::AuxIo(four_counts(value)?),
            "NEWOPT" => Self::NewOptions(value.split(',').map(str::to_owned).collect()),
            "AXS" => Self::Axes(axis_letters(value)?),
            "SIGNALS" => Self::Signals(value.to_owned()),
            "FIRMWARE" => Self::Firmware(value.to_owned()),
            "DRIVER"
            | "DRIVER VERSION"
            | "DRIVER OPTIONS"
            | "BOARD"
            | "NVS STORAGE"
            | "FREE MEMORY"
            | "PLUGIN"
            | "SPINDLE"
            | "MAX STEP RATE"
            | "KINEMATICS"
            | "COMPATIBILITY LEVEL" => Self::Build { key: key.to_owned(), value: value.to_owned() },
            "GC" => Self::ParserState(value.to_owned()),
            "PRB" => {
                let (place, hit) = value.split_once(':')?;
                let has_touched = [("0", false), ("1", true)]
                    .into_iter()
                    .find_map(|(name, touched)| (name == hit).then_some(touched))?;
                let position = parse_position(place, units)?;
                Self::Probe { position, further: parse_further(place), has_touched }
            }
            "TLO" => Self::ToolLength(tool_length(value)? * units.millimetres()),
            "SETTING" => {
                let mut fields = value.split('|');
                let number = parse_count(fields.next()?)?;
                // The group comes first.
                let name = fields.nth(1)?.to_owned();
                let unit = fields.next().unwrap_or_default().to_owned();
                Self::SettingDetail { number, name, unit }
            }
            "MSG" => Self::Text(value.trim_start().to_owned()),
            "echo" => Self::Echo(value.trim_start().to_owned()),
            "JSON" => Self::Json(value.to_owned()),
            _ if is_place(key) => {
                let position = parse_position(value, units)?;
                Self::Offset { name: key.to_owned(), position, further: parse_further(value) }
            }
            _ => return None,
        })
    }
}

/// `2,4,0,1`
fn four_counts(value: &str) -> Option<[u8; 4]> {
    let counts: Option<Vec<u8>> = value.split(',').map(|count| count.parse().ok()).collect();
    counts?.try_into().ok()
}

/// `3:XYZ`
fn axis_letters(value: &str) -> Option<String> {
    let (count, letters) = value.split_once(':')?;
    let count = usize::from(parse_count(count)?);
    let is_whole = letters.len() == count && letters.bytes().all(|b| b.is_ascii_uppercase());
    is_whole.then(|| letters.to_owned())
}

fn tool_length(value: &str) -> Option<f64> {
    let lengths: Option<Vec<f64>> = value.split(',').map(parse_number).collect();
    lengths?.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// Whether an offset or a stored place is called so.
fn is_place(key: &str) -> bool {
    super::number::parse_work_system(key).is_some() || matches!(key, "G28" | "G30" | "G92")
}
