//! `kerf controller dump`: what the driver knows of its controller, as a machine file.

use crate::exit::{CommandResult, Failure, Status};
use axis_driver::firmware::Firmware;
use cnc_msgs::convert::further_from_wire;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::units::position_from_point;
use cnc_msgs::wire::cnc_msgs::msg::{ControllerSettings, WorkOffset};
use runtime::{Handle, Qos, Subscription};
use std::time::Duration;
use tokio::time::timeout;

/// How long a latched message of a running node may take to arrive.
const LATCHED_WITHIN: Duration = Duration::from_secs(5);
/// A newer message comes within this time after an old one.
const SETTLES: Duration = Duration::from_millis(500);

/// Prints the newest settings that the driver publishes.
pub(super) async fn dump(node: &Handle) -> CommandResult {
    let mut reports: Subscription<ControllerSettings> =
        node.subscription("controller_settings", Qos::LATCHED)?;
    let (mut newest, _) = timeout(LATCHED_WITHIN, reports.next()).await.map_err(|_| {
        let text = format!(
            "nothing came from {} within {} s: is the driver running, and has it connected to a \
             controller?",
            reports.topic(),
            LATCHED_WITHIN.as_secs()
        );
        Failure::new(Status::NoAnswer, text)
    })?;
    let stamp = |it: &ControllerSettings| (it.stamp.sec, it.stamp.nanosec);
    let end = tokio::time::Instant::now() + SETTLES;
    while let Ok((newer, _)) = tokio::time::timeout_at(end, reports.next()).await {
        if stamp(&newer) >= stamp(&newest) {
            newest = newer;
        }
    }
    print!("{}", text(&newest));
    Ok(())
}

/// The machine file.
fn text(of: &ControllerSettings) -> String {
    let mut text = format!(
        "# Settings and stored positions of a controller: kerf plan --machine reads this file.\n\
         firmware: {}\nversion: {}\noptions: {}\n",
        quoted(&of.firmware),
        quoted(&of.version),
        quoted(&of.options)
    );
    // What the driver publishes then is a guess.
    let known = Firmware::ALL.into_iter().find(|it| it.traits().name == of.firmware);
    text += &match known.and_then(|it| it.traits().unreported_planner_blocks) {
        Some(usual) => format!("# not reported; the usual number: planner_blocks: {usual}\n"),
        None => format!("planner_blocks: {}\n", of.planner_blocks),
    };
    if !of.axes.is_empty() {
        text += &format!("axes: {}\n", quoted(&of.axes));
    }
    if known.is_some_and(|it| it.traits().may_have_ports) {
        text += "# whether the spindle has an encoder is not published: true if [NEWOPT:] of $I has SS\n\
                 # spindle_sync: true\n\
                 # outputs and inputs for programs (M62 to M68) are not published: the numbers of [AUX IO:] of $I\n\
                 # aux_io: [0, 0, 0, 0]\n";
    }
    text += "settings:\n";
    for row in &of.settings {
        let is_number = row.value.parse::<f64>().is_ok_and(f64::is_finite);
        let value = if is_number { row.value.clone() } else { quoted(&row.value) };
        let name = intake::text::one_line(&row.name);
        let comment = match (name.as_ref(), row.unit.as_str()) {
            ("", _) => String::new(),
            (name, "") => format!("  # {name}"),
            (name, unit) => format!("  # {name}, {}", intake::text::one_line(unit)),
        };
        text += &format!("  {}: {value}{comment}\n", row.number);
    }
    let offsets = match of.offsets.is_empty() {
        true => "offsets_mm: {}\n",
        false => "offsets_mm:\n",
    };
    text += offsets;
    for offset in &of.offsets {
        let values = position_from_point(&offset.position).into_iter();
        let further = further_in_order(&of.axes, offset).unwrap_or_default();
        let values: Vec<String> =
            values.chain(further).map(|value| rounded(value).to_string()).collect();
        text += &format!("  {}: [{}]\n", quoted(&offset.name), values.join(", "));
    }
    text
}

/// The values after X, Y and Z, in the order of the axes; `None` where one is not known.
fn further_in_order(axes: &str, offset: &WorkOffset) -> Option<Vec<f64>> {
    let WorkOffset { further_axes, further_position, .. } = offset;
    let values = further_from_wire("further_position", *further_axes, further_position).ok()?;
    axes.chars().skip(3).map(|letter| values.get(FurtherAxes::index_of(letter)?)).collect()
}

/// To the third decimal, as the controller reports it: metres have moved the last digits.
fn rounded(mm: f64) -> f64 {
    // No negative zero.
    (mm * 1e4).round() / 1e4 + 0.0
}

/// A JSON string is a YAML string.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axis_driver::machine_limits::{MachineLimits, settings_of_file};
    use cnc_msgs::convert::further_to_wire;
    use cnc_msgs::units::point_from_position;
    use cnc_msgs::wire::cnc_msgs::msg::ControllerSetting;
    use settings::MachineText;

    #[test]
    fn what_is_dumped_is_read_again() {
        let rows = [
            (11, "0.010"),
            (74, "shop: \"one\" # two"),
            (110, "5000.000"),
            (111, "5000.000"),
            (112, "2000.000"),
            (120, "500.000"),
            (121, "500.000"),
            (122, "200.000"),
            (130, "600.000"),
            (131, "400.000"),
            (132, "100.000"),
            (133, "360.000"),
            (134, "50.000"),
        ];
        let setting = |(number, value): (u32, &str)| ControllerSetting {
            number,
            value: value.into(),
            name: "a name\nof two lines".into(),
            unit: "mm".into(),
        };
        let offset = |name: &str, at| {
            let further = FurtherAxes::NONE.with(0, 12.5).with(3, -3.0);
            WorkOffset {
                name: name.into(),
                position: point_from_position(at),
                further_axes: further.bits(),
                further_position: further_to_wire(further),
            }
        };
        let report = ControllerSettings {
            firmware: "grblHAL".into(),
            version: "1.1f.20240510:".into(),
            planner_blocks: 100,
            axes: "XYZUA".into(),
            settings: rows.map(setting).to_vec(),
            offsets: vec![offset("G54", [-400.123, 0.0, -12.3]), offset("G28", [-1.0; 3])],
            ..ControllerSettings::default()
        };
        let read = MachineText::from_yaml(text(&report), "m.yaml").expect("a machine file");
        assert_eq!(read.machine.offsets_mm["G54"], [-400.123, 0.0, -12.3, -3.0, 12.5]);
        assert_eq!(read.machine.settings[&74].text(), "shop: \"one\" # two");
        let settings = settings_of_file(&read.machine).expect("a known firmware");
        let limits = MachineLimits::of(&settings).expect("a machine");
        assert_eq!(limits.travel_mm, [Some(600.0), Some(400.0), Some(100.0)]);
        assert_eq!(limits.planner_blocks, 100);
        let travel = limits.further.map(|it| it.and_then(|it| it.travel));
        assert_eq!(travel, [Some(50.0), None, None, Some(360.0), None, None]);
        assert_eq!(limits.offsets.further_systems[0].words(), " A12.5 U-3");
    }
}
