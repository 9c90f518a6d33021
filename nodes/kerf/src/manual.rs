//! `kerf home`, `jog`, `probe`, `zero`, `override`: manual motion, work offsets and overrides.
//! Millimetres and percent. The driver decides; this command shows its answer.

use crate::ctrl_c::CtrlC;
use crate::exit::{CommandResult, Failure};
use crate::operate::{
    begin, canceled, no_result, reconnect, said, unless_dds_fails, with_lasting_node, with_node,
};
use crate::status::further_text;
use crate::words::percent;
use clap::{Args, ValueEnum};
use cnc_msgs::contour::work_system;
use cnc_msgs::convert::further_to_wire;
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position};
use cnc_msgs::interface::Action;
use cnc_msgs::units::{
    m_per_s_from_mm_per_min, point_from_position, position_from_point, rad_from_degrees,
};
use cnc_msgs::wire::cnc_msgs::action::{Home, HomeGoal, Jog, JogGoal, JogResult, Probe, ProbeGoal};
use cnc_msgs::wire::cnc_msgs::srv::{
    SetOverrides, SetOverridesRequest, SetWorkOffset, SetWorkOffsetRequest,
};
use cnc_msgs::wire::geometry_msgs::msg::Point;
use runtime::{Handle, Session};
use std::time::Duration;

/// No manual motion takes longer.
const MOVE_WITHIN: Duration = Duration::from_secs(24 * 3_600);

/// What `kerf jog` takes.
#[derive(Debug, Args)]
pub(crate) struct JogArgs {
    /// Target: X10 Y-2.5 in millimetres, or A90 in degrees
    #[arg(required = true, value_parser = any_word)]
    axes: Vec<Word>,
    /// Feed along the path in mm/min; of A, B and C in degrees/min
    #[arg(long, value_name = "FEED", default_value_t = 1_000.0)]
    feed: f64,
    /// What the numbers are relative to
    #[arg(long, value_enum, default_value_t = Frame::Relative)]
    from: Frame,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Frame {
    /// The current position
    Relative,
    /// The zero of the work frame
    Work,
    /// The zero of the machine
    Machine,
}

/// What `kerf probe` takes.
#[derive(Debug, Args)]
pub(crate) struct ProbeArgs {
    /// Longest move, in millimetres and degrees from the current position: Z-20, or A90
    #[arg(required = true, value_parser = any_word)]
    axes: Vec<Word>,
    /// Feed along the path in mm/min; of A, B and C in degrees/min
    #[arg(long, value_name = "FEED", default_value_t = 50.0)]
    feed: f64,
    /// Move until the probe opens, instead of until it touches
    #[arg(long)]
    away: bool,
    /// Do not raise an alarm when the probe finds nothing
    #[arg(long)]
    may_miss: bool,
}

/// What `kerf zero` takes.
#[derive(Debug, Args)]
pub(crate) struct ZeroArgs {
    /// Coordinates of the current tool position, in millimetres and degrees: X0 Y0 A0
    #[arg(required = true, value_parser = any_word)]
    axes: Vec<Word>,
    /// G54 to G59.3, or G92 for the shift on top of them
    #[arg(long, value_name = "SYSTEM", default_value = "G54", value_parser = system)]
    system: u8,
    /// Read the numbers as the origin of the work system in the machine frame
    #[arg(long)]
    origin: bool,
}

/// What `kerf override` takes; percent.
#[derive(Debug, Args)]
#[group(required = true, multiple = true)]
pub(crate) struct OverrideArgs {
    /// Feed, 10 to 200
    #[arg(long, value_name = "PERCENT", value_parser = percent::<10, 200>)]
    feed: Option<u8>,
    /// Rapids: 25, 50 or 100
    #[arg(long, value_name = "PERCENT", value_parser = rapid)]
    rapid: Option<u8>,
    /// Spindle speed, 10 to 200
    #[arg(long, value_name = "PERCENT", value_parser = percent::<10, 200>)]
    spindle: Option<u8>,
}

fn rapid(text: &str) -> Result<u8, String> {
    let percent = text.parse().ok().filter(|percent| [25, 50, 100].contains(percent));
    percent.ok_or_else(|| "write 25, 50 or 100".into())
}

/// An axis with its number.
#[derive(Debug, Clone, Copy)]
enum Word {
    /// X, Y or Z by its index, mm.
    Linear(usize, f64),
    /// A to W by its index in [`FurtherAxes`].
    Further(usize, f64),
}

fn any_word(text: &str) -> Result<Word, String> {
    let mut letters = text.chars();
    let letter = letters.next().map(|letter| letter.to_ascii_uppercase());
    let value = letters.as_str().parse::<f64>().ok().filter(|value| value.is_finite());
    let linear = AXIS_LETTERS.iter().position(|known| Some(*known) == letter);
    let word = match (linear, letter.and_then(FurtherAxes::index_of)) {
        (Some(axis), _) => value.map(|value| Word::Linear(axis, value)),
        (_, Some(axis)) => value.map(|value| Word::Further(axis, value)),
        _ => None,
    };
    word.ok_or_else(|| "write an axis and a number, such as X10, Y-2.5 or A90".into())
}

fn system(text: &str) -> Result<u8, String> {
    let word = text.to_ascii_uppercase();
    let is_meant = |system: &u8| word.trim_start_matches('G') == &work_system(*system)[1..];
    match (1..=9).find(is_meant) {
        Some(system) => Ok(system),
        None if word.trim_start_matches('G') == "92" => Ok(92),
        None => Err("write G54 to G59.3, or G92".into()),
    }
}

/// The named axes as bits, and their numbers.
fn axes_and_point(words: &[(usize, f64)]) -> Result<(u8, Point), Failure> {
    let (mut axes, mut position) = (AxisSet::NONE, Position::default());
    for &(axis, value) in words {
        if axes.contains(axis) {
            return Err(twice(AXIS_LETTERS[axis]));
        }
        (axes, position[axis]) = (axes.with(axis), value);
    }
    Ok((axes.bits(), point_from_position(position)))
}

/// The same of further axes too: X, Y and Z as bits with their numbers, and the others.
fn all_axes(words: &[Word]) -> Result<(u8, Point, FurtherAxes), Failure> {
    let (mut linear, mut further) = (Vec::new(), FurtherAxes::NONE);
    for word in words {
        match *word {
            Word::Linear(axis, value) => linear.push((axis, value)),
            Word::Further(axis, _) if further.get(axis).is_some() => {
                return Err(twice(FURTHER_LETTERS[axis]));
            }
            Word::Further(axis, value) => further = further.with(axis, value),
        }
    }
    let (axes, point) = axes_and_point(&linear)?;
    Ok((axes, point, further))
}

/// m/s of a feed in mm/min; where axes turn, rad/s of one in degrees/min.
fn feed_per_s(feed: f64, further: FurtherAxes) -> f64 {
    match further.only_turns() {
        true => rad_from_degrees(feed) / 60.0,
        false => m_per_s_from_mm_per_min(feed),
    }
}

fn twice(letter: char) -> Failure {
    Failure::usage(format_args!("{letter} occurs twice"))
}

fn show(point: &Point) -> String {
    let [x, y, z] = position_from_point(point);
    format!("X{x:.3} Y{y:.3} Z{z:.3}")
}

/// Sends a goal and waits for its end; Ctrl-C cancels it.
async fn follow<A: Action + 'static>(
    node: &Handle,
    name: &str,
    goal: A::Goal,
) -> Result<A::Result, Failure> {
    let mut ctrl_c = CtrlC::listen()?;
    let mut handle = unless_dds_fails(node, begin::<A>(node, name, goal)).await?;
    let (mut node, mut session) = (node.clone(), None::<Session>);
    let mut end = Box::pin(handle.result(MOVE_WITHIN));
    let result = loop {
        tokio::select! {
            ended = &mut end => {
                break ended.map_err(no_result)?.1;
            }
            reason = node.deaf() => {
                let again = reconnect(&node, &reason)?;
                node = again.handle().clone();
                handle = node.action_client::<A>(name)?.follow(handle.id());
                end = Box::pin(handle.result(MOVE_WITHIN));
                ctrl_c.reconnect(canceled(handle.cancel()));
                session = Some(again);
            }
            asked = ctrl_c.next() => {
                asked?;
                ctrl_c.cancel(canceled(handle.cancel()));
            }
        }
    };
    if let Some(session) = session {
        drop((handle, node));
        session.stop().await;
    }
    Ok(result)
}

fn ended(success: bool, error_code: u16, message: String) -> CommandResult {
    match success {
        true => said(true, message),
        false => said(false, format!("{message} (error {error_code})")),
    }
}

/// `kerf home`
pub(crate) fn home(ros_args: &[String]) -> CommandResult {
    with_lasting_node(ros_args, async |node| {
        let result = follow::<Home>(node, "home", HomeGoal::default()).await?;
        ended(result.success, result.error_code, result.message)
    })
}

/// `kerf jog`
pub(crate) fn jog(args: &JogArgs, ros_args: &[String]) -> CommandResult {
    let (axes, target, further) = all_axes(&args.axes)?;
    let frame = match args.from {
        Frame::Relative => JogGoal::FRAME_RELATIVE,
        Frame::Work => JogGoal::FRAME_WORK,
        Frame::Machine => JogGoal::FRAME_MACHINE,
    };
    let goal = JogGoal {
        frame,
        axes,
        target,
        feed_rate: feed_per_s(args.feed, further),
        further_axes: further.bits(),
        further_target: further_to_wire(further),
    };
    with_lasting_node(ros_args, async |node| {
        let result: JogResult = follow::<Jog>(node, "jog", goal).await?;
        let place = match result.machine_position.x.is_nan() {
            true => String::new(),
            false => {
                let further = further_text(result.further_axes, &result.further_machine_position);
                let place = show(&result.machine_position);
                format!("; the tool is at {place}{further} in the machine frame")
            }
        };
        ended(result.success, result.error_code, result.message + &place)
    })
}

/// `kerf probe`
pub(crate) fn probe(args: &ProbeArgs, ros_args: &[String]) -> CommandResult {
    let (axes, distance, further) = all_axes(&args.axes)?;
    let goal = ProbeGoal {
        axes,
        distance,
        feed_rate: feed_per_s(args.feed, further),
        away: args.away,
        may_miss: args.may_miss,
        further_axes: further.bits(),
        further_distance: further_to_wire(further),
    };
    with_lasting_node(ros_args, async |node| {
        let result = follow::<Probe>(node, "probe", goal).await?;
        let message = match result.found {
            true => format!(
                "found at {}{} in the machine frame, {} in the work frame",
                show(&result.machine_position),
                further_text(result.further_axes, &result.further_machine_position),
                show(&result.work_position)
            ),
            false => result.message,
        };
        ended(result.success, result.error_code, message)
    })
}

/// `kerf zero`
pub(crate) fn zero(args: &ZeroArgs, ros_args: &[String]) -> CommandResult {
    let (axes, position, further) = all_axes(&args.axes)?;
    let request = SetWorkOffsetRequest {
        system: args.system,
        axes,
        position,
        is_origin: args.origin,
        further_axes: further.bits(),
        further_position: further_to_wire(further),
    };
    with_node(ros_args, async |node| {
        let client = node.client::<SetWorkOffset>("set_work_offset")?;
        let answer = client.call_within(request, Duration::from_secs(15)).await?;
        said(answer.success, answer.message)
    })
}

/// `kerf override`
pub(crate) fn set_overrides(args: &OverrideArgs, ros_args: &[String]) -> CommandResult {
    let of = |percent: Option<u8>| f64::from(percent.unwrap_or(0)) / 100.0;
    let which = [args.feed, args.rapid, args.spindle].into_iter().zip([1, 2, 4]);
    let request = SetOverridesRequest {
        which: which.filter(|(percent, _)| percent.is_some()).map(|(_, bit)| bit).sum(),
        feed: of(args.feed),
        rapid: of(args.rapid),
        spindle: of(args.spindle),
    };
    with_node(ros_args, async |node| {
        let client = node.client::<SetOverrides>("set_overrides")?;
        let answer = client.call(request).await?;
        said(answer.success, answer.message)
    })
}
