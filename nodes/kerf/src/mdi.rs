//! Operator functions other than running programs: set a tool, run a single block, single-block
//! mode. The nodes decide; these commands show their answers.

use crate::ctrl_c::CtrlC;
use crate::exit::{CommandResult, Failure, Status};
use crate::operate::{said, with_node};
use clap::{Args, ValueEnum};
use cnc_msgs::units::m_from_mm;
use cnc_msgs::wire::cnc_msgs::srv::{ExecuteMdi, ExecuteMdiRequest, SetTool, SetToolRequest};
use cnc_msgs::wire::std_srvs::srv::{SetBool, SetBoolRequest, Trigger, TriggerRequest};
use runtime::CallError;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

/// No single block takes longer.
const BLOCK_WITHIN: Duration = Duration::from_secs(3600);
/// How long planning a long program twice may take.
const PLAN_WITHIN: Duration = Duration::from_secs(120);

/// What `kerf mdi` takes.
#[derive(Debug, Args)]
pub(crate) struct MdiArgs {
    /// The block: "G1 X10 F200"
    block: String,
    /// Control profile [default: the loader's parameter]
    #[arg(long, value_name = "NAME|FILE", default_value = "", hide_default_value = true)]
    control: String,
}

/// What `kerf single-block` takes.
#[derive(Debug, Args)]
pub(crate) struct SingleBlockArgs {
    switch: Switch,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Switch {
    On,
    Off,
}

/// What `kerf tool` takes; millimetres.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub(crate) struct ToolArgs {
    /// The tool or the offset register: T1, D1
    #[arg(value_parser = row)]
    row: (char, u32),
    /// Nominal diameter; for an offset register twice its radius
    #[arg(long, value_name = "MM")]
    diameter: Option<f64>,
    /// Added to the diameter: negative for a worn tool
    #[arg(long, value_name = "MM")]
    wear: Option<f64>,
    /// Length of the tool
    #[arg(long, value_name = "MM")]
    length: Option<f64>,
    /// For a turning tool: radius of its nose
    #[arg(long, value_name = "MM")]
    nose_radius: Option<f64>,
    /// For a turning tool: orientation of its nose, 0 to 9
    #[arg(long, value_name = "0..9")]
    tip_direction: Option<u8>,
}

fn row(text: &str) -> Result<(char, u32), String> {
    let mut letters = text.chars();
    let letter = letters.next().map(|letter| letter.to_ascii_uppercase());
    match (letter, letters.as_str().parse()) {
        (Some(letter @ ('T' | 'D')), Ok(number)) => Ok((letter, number)),
        _ => {
            Err("write T and the number of a tool (T1), or D and the number of an offset register \
                  (D1)"
                .into())
        }
    }
}

/// `kerf mdi`
pub(crate) fn mdi(args: &MdiArgs, ros_args: &[String]) -> CommandResult {
    with_node(ros_args, async |node| {
        let client = node.client::<ExecuteMdi>("execute_mdi")?;
        let request = ExecuteMdiRequest { text: args.block.clone(), control: args.control.clone() };
        let cancel = Arc::new(node.client::<Trigger>("cancel")?);
        let mut ctrl_c = CtrlC::listen()?;
        let mut answer = pin!(client.call_within(request, BLOCK_WITHIN));
        let answer = loop {
            tokio::select! {
                answer = &mut answer => break answer.map_err(may_still_run)?,
                asked = ctrl_c.next() => {
                    asked?;
                    let cancel = Arc::clone(&cancel);
                    ctrl_c.cancel(async move {
                        let answer = cancel.call(TriggerRequest::default()).await?;
                        said(answer.success, answer.message)
                    });
                }
            }
        };
        said(answer.success, answer.message)
    })
}

/// A block goes on in the driver, whatever happens to this command.
fn may_still_run(error: CallError) -> Failure {
    match error {
        CallError::Lost { .. } | CallError::NoAnswer { .. } => Failure::new(
            Status::NoAnswer,
            format!(
                "{error}; the block may still be running: see `kerf status`, stop it with `kerf hold` or `kerf abort`"
            ),
        ),
        error => error.into(),
    }
}

/// `kerf single-block`
pub(crate) fn single_block(args: &SingleBlockArgs, ros_args: &[String]) -> CommandResult {
    with_node(ros_args, async |node| {
        let client = node.client::<SetBool>("single_block")?;
        let request = SetBoolRequest { data: matches!(args.switch, Switch::On) };
        let answer = client.call(request).await?;
        said(answer.success, answer.message)
    })
}

/// `kerf tool`
pub(crate) fn tool(args: &ToolArgs, ros_args: &[String]) -> CommandResult {
    let request = request(args);
    if request.mask == 0 {
        return Err(Failure::usage(
            "name what changes: --diameter, --wear, --length, --nose-radius or --tip-direction",
        ));
    }
    with_node(ros_args, async |node| {
        let client = node.client::<SetTool>("set_tool")?;
        let answer = client.call_within(request, PLAN_WITHIN).await?;
        said(answer.success, answer.message)
    })
}

fn request(args: &ToolArgs) -> SetToolRequest {
    type W = SetToolRequest;
    let metres = |mm: Option<f64>| mm.map_or(0.0, m_from_mm);
    let masks = [
        (W::DIAMETER, args.diameter.is_some()),
        (W::WEAR_DIAMETER, args.wear.is_some()),
        (W::LENGTH, args.length.is_some()),
        (W::NOSE_RADIUS, args.nose_radius.is_some()),
        (W::TIP_DIRECTION, args.tip_direction.is_some()),
    ];
    let (letter, number) = args.row;
    W {
        tool_number: if letter == 'T' { number } else { 0 },
        offset_number: if letter == 'D' { number } else { 0 },
        mask: masks.iter().filter(|(_, is_set)| *is_set).map(|(bit, _)| bit).sum(),
        diameter: metres(args.diameter),
        wear_diameter: metres(args.wear),
        length: metres(args.length),
        nose_radius: metres(args.nose_radius),
        tip_direction: args.tip_direction.unwrap_or_default(),
    }
}
