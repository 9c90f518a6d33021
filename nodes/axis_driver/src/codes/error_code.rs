//! Why a command was refused or a run ended: the driver's hundred.

/// No port is open.
pub const NOT_CONNECTED: u16 = 301;
/// The controller is still being identified.
pub const CONNECTING: u16 = 302;
/// What the controller has still to answer is not known; a soft reset settles it.
pub const NEEDS_RESET: u16 = 303;
/// The controller is in alarm.
pub const ALARM: u16 = 304;
/// The machine does something else.
pub const BUSY: u16 = 305;
/// The tool is not where the path begins.
pub const START_POSITION: u16 = 306;
/// The path holds something that the controller cannot do.
pub const NOT_ENCODABLE: u16 = 307;
/// The run cannot begin at this line.
pub const START_LINE: u16 = 308;
/// The controller refused a line.
pub const CONTROLLER_ERROR: u16 = 309;
/// The controller restarted.
pub const RESTARTED: u16 = 310;
/// The controller does not answer, or the port is gone.
pub const LINK_LOST: u16 = 311;
/// Answers and lines do not match.
pub const PROTOCOL: u16 = 312;
/// Stopped by a cancel.
pub const CANCELED: u16 = 313;
/// Stopped because the driver shuts down.
pub const SHUTDOWN: u16 = 314;
/// Stopped by a soft reset.
pub const SOFT_RESET: u16 = 315;
/// There is nothing that this command could act on.
pub const NOTHING_TO_DO: u16 = 316;
/// Homing is switched off in the controller.
pub const NO_HOMING: u16 = 317;
/// No answer in time.
pub const NO_ANSWER: u16 = 318;
/// The probe touched, or let go, nowhere on its way.
pub const PROBE_FAILED: u16 = 319;
/// The tool is not in the table, or the path was made with another.
pub const TOOL: u16 = 321;
/// The loader or the planner refused a single block.
pub const BLOCK_REFUSED: u16 = 322;
/// A number or a name in the request is out of range.
pub const INVALID_REQUEST: u16 = 323;
/// Nothing records, and the parameters ask for it.
pub const NOT_RECORDING: u16 = 324;
/// The commander's sign of life stayed away.
pub const COMMANDER_LOST: u16 = 325;
/// A jog ended before its target: it was held, or cut short at the end of the travel.
pub const STOPPED_SHORT: u16 = 326;
/// The driver is not active, or was deactivated in the run.
pub const NOT_ACTIVE: u16 = 327;
/// A place of the machine frame was named, and the axes are not homed.
pub const NOT_HOMED: u16 = 328;
/// The tool is not where the lines that were sent have taken it.
pub const PATH_DEVIATION: u16 = 329;
/// The program leaves the travel of the machine.
pub const TRAVEL: u16 = 330;
/// The tool would touch a keep-out box.
pub const KEEP_OUT: u16 = 331;
/// A function of the user (M100 to M199) was not done, or nobody offers it.
pub const USER_FUNCTION: u16 = 332;
