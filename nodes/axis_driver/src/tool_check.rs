//! Whether a path may be cut with the tool that was put in.
//!
//! A path is made for radii and lengths; a tool that has others since, or that the
//! table does not know, would cut something else than was planned and checked.

use cnc_msgs::tool_table::ToolTable;

/// Why the path must not go on with this tool; `None` when it may.
///
/// `planned` is the table that the path was made with, `now` the one in force; one that
/// was never heard is `None`. Tool 0 is an empty spindle and in no table.
pub fn objection(
    tool: u32,
    planned: Option<&ToolTable>,
    now: Option<&ToolTable>,
) -> Option<String> {
    if tool == 0 {
        return None;
    }
    let Some(now) = now else {
        return Some("no tool table was received: is the planner running?".into());
    };
    let Some(present) = now.tools.get(&tool) else {
        return Some(format!(
            "T{tool} is not in the tool table: enter it with set_tool and confirm again"
        ));
    };
    let Some(planned) = planned else {
        return Some("the tool table of this path was not received: cancel and run again".into());
    };
    // What the path did not know it does not use.
    let before = planned.tools.get(&tool)?;
    let mut differences = Vec::new();
    let mut compare = |name: &str, before: f64, now: f64| {
        if before != now {
            differences.push(format!("{name} {before:.4} mm, now {now:.4} mm"));
        }
    };
    let diameter = |tool: &cnc_msgs::tool_table::Tool| tool.diameter_mm + tool.wear_diameter_mm;
    compare("diameter", diameter(before), diameter(present));
    compare("length", before.length_mm, present.length_mm);
    compare("nose radius", before.nose_radius_mm, present.nose_radius_mm);
    if let (Some(before), Some(now)) = (planned.offsets.get(&tool), now.offsets.get(&tool)) {
        compare("offset radius", before.radius_mm + before.wear_mm, now.radius_mm + now.wear_mm);
        compare("offset length", before.length_mm, now.length_mm);
    }
    if before.tip_direction != present.tip_direction {
        differences
            .push(format!("tip direction {}, now {}", before.tip_direction, present.tip_direction));
    }
    if differences.is_empty() {
        return None;
    }
    Some(format!(
        "the path was made for another T{tool}: {}; cancel, and restart at the first block after the tool change",
        differences.join("; ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::tool_table::{Offset, Tool};

    fn table(tools: &[(u32, f64, f64)]) -> ToolTable {
        let tools = tools.iter().map(|&(number, diameter_mm, wear_diameter_mm)| {
            (number, Tool { diameter_mm, wear_diameter_mm, ..Tool::default() })
        });
        ToolTable { tools: tools.collect(), ..ToolTable::default() }
    }

    #[test]
    fn a_tool_as_planned_is_taken_and_any_other_is_reported_with_its_numbers() {
        let planned = table(&[(1, 10.0, 0.0), (2, 8.0, 0.0)]);
        let with_offset = |radius_mm| ToolTable {
            offsets: [(2, Offset { radius_mm, ..Offset::default() })].into(),
            ..planned.clone()
        };
        let worn = table(&[(1, 10.0, 0.0), (2, 8.0, -0.1)]);
        let other_worn = table(&[(1, 9.0, 0.0), (2, 8.0, 0.0)]);
        let entered = table(&[(1, 10.0, 0.0), (2, 8.0, 0.0), (3, 6.0, 0.0)]);
        for (tool, before, now, wanted) in [
            (2, Some(&planned), Some(&planned), None),
            (2, Some(&planned), Some(&other_worn), None),
            (0, None, None, None),
            (3, Some(&planned), Some(&entered), None),
            (3, Some(&planned), Some(&planned), Some("T3 is not in the tool table")),
            (2, Some(&planned), Some(&worn), Some("diameter 8.0000 mm, now 7.9000 mm")),
            (2, Some(&planned), None, Some("received")),
            (2, None, Some(&planned), Some("received")),
            (2, Some(&with_offset(4.0)), Some(&with_offset(4.0)), None),
            (
                2,
                Some(&with_offset(4.0)),
                Some(&with_offset(3.5)),
                Some("offset radius 4.0000 mm, now 3.5000 mm"),
            ),
        ] {
            let objected = objection(tool, before, now);
            match wanted {
                None => assert_eq!(objected, None),
                Some(part) => assert!(objected.clone().unwrap().contains(part), "{objected:?}"),
            }
        }
    }
}
