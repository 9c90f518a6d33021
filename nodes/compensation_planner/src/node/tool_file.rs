//! The tool file on the disk: read once, replaced at once or not at all.
//!
//! [`tool_file`](crate::tools::tool_file) decides what is in it.

use crate::tools::set_tool::{Refusal, ToolTableChange};
use crate::tools::tool_file::{edited, whole};
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::srv::SetToolResponse;
use intake::replace::replace;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The file, and its text when this node last read or wrote it.
#[derive(Debug)]
pub(super) struct ToolFile {
    /// The real path: a link to it stays a link.
    path: PathBuf,
    text: String,
}

impl ToolFile {
    pub(super) fn open(path: &Path) -> Result<(Self, ToolTable), runtime::Error> {
        let text = settings::yaml::read_text(path)?;
        let tools = settings::tool_table_from_yaml(&text, &path.display().to_string())?;
        Ok((Self { path: fs::canonicalize(path)?, text }, tools))
    }

    /// Writes the row of a change into the file; returns where the change is kept.
    pub(super) fn write(&mut self, change: &ToolTableChange) -> Result<String, Refusal> {
        let name = self.path.display().to_string();
        let refuse = |why: String| {
            Refusal::new(SetToolResponse::TOOL_FILE, format!("{why}; nothing was changed"))
        };
        let cannot = |error: io::Error| refuse(format!("{name} cannot be written: {error}"));
        let now =
            settings::yaml::read_text(&self.path).map_err(|error| refuse(error.to_string()))?;
        if now != self.text {
            return Err(refuse(format!(
                "somebody has changed {name} since the planner read it: restart the planner to read it again"
            )));
        }
        if fs::metadata(&self.path).map_err(cannot)?.permissions().readonly() {
            // The file could still be replaced, but its owner does not want that.
            return Err(refuse(format!("{name} is read-only")));
        }
        let is_meant = |text: &String| {
            settings::tool_table_from_yaml(text, &name).is_ok_and(|tools| tools == change.tools)
        };
        let edited = edited(&self.text, change).filter(is_meant);
        let kept_comments = edited.is_some();
        let text = edited.unwrap_or_else(|| whole(&change.tools));
        replace(&self.path, text.as_bytes()).map_err(cannot)?;
        self.text = text;
        Ok(if kept_comments {
            format!("in {name}")
        } else {
            format!("in {name}, which was written anew: comments in it are lost")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::set_tool::change;
    use cnc_msgs::wire::cnc_msgs::srv::SetToolRequest as W;
    use std::os::unix::fs::PermissionsExt;

    const TEXT: &str = "tools:\n  1: {diameter_mm: 10.0} # HSS\n";

    fn worn(tools: &ToolTable, wear_diameter: f64) -> ToolTableChange {
        let (tool_number, mask) = (1, W::WEAR_DIAMETER);
        let request = W { tool_number, mask, wear_diameter, ..W::default() };
        change(tools, &request).expect("T1 is there")
    }

    #[test]
    fn a_file_is_replaced_at_once_and_its_owner_recognises_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, link) = (folder.path().join("tools.yaml"), folder.path().join("link.yaml"));
        fs::write(&path, TEXT).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("allowed");
        std::os::unix::fs::symlink(&path, &link).expect("a link");
        let (mut file, tools) = ToolFile::open(&link).expect("a tool file");
        let first = worn(&tools, -0.0005);
        file.write(&first).expect("written");
        file.write(&worn(&first.tools, -0.0006)).expect("its own change is no stranger's");
        let text = fs::read_to_string(&path).expect("there");
        assert_eq!(text, "tools:\n  1: {diameter_mm: 10.0, wear_diameter_mm: -0.6} # HSS\n");
        assert_eq!(fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o640);
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
        assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2, "no other file is left");
        // A row that is another one too needs a new file, and the answer says so.
        let alias = "tools:\n  2: &a {diameter_mm: 10.0}\n  1: *a # as T2\n";
        fs::write(&path, alias).expect("written");
        let (mut file, tools) = ToolFile::open(&path).expect("a tool file");
        let change = worn(&tools, -0.0005);
        let kept = file.write(&change).expect("written");
        assert!(kept.contains("comments in it are lost"), "{kept}");
        assert_eq!(ToolFile::open(&path).expect("a tool file").1, change.tools);
    }

    #[test]
    fn a_file_that_cannot_be_written_or_is_not_what_was_read_stays_as_it_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("tools.yaml");
        let lock = |mode| fs::set_permissions(&path, fs::Permissions::from_mode(mode));
        fs::write(&path, TEXT).expect("written");
        let (mut file, tools) = ToolFile::open(&path).expect("a tool file");
        let mut refused = |part: &str| {
            let before = fs::read(&path).ok();
            let Refusal { error_code, message, .. } =
                file.write(&worn(&tools, -0.0005)).expect_err("refused");
            assert_eq!(error_code, SetToolResponse::TOOL_FILE);
            assert!(
                message.contains(part) && message.ends_with("nothing was changed"),
                "{message}"
            );
            assert_eq!(fs::read(&path).ok(), before);
        };
        lock(0o440).expect("allowed");
        refused("is read-only");
        lock(0o640).expect("allowed");
        fs::write(&path, TEXT.replace("10.0", "12.0")).expect("written");
        refused("somebody has changed");
        fs::write(&path, b"tools: \xff").expect("written");
        refused("not UTF-8");
        fs::remove_file(&path).expect("removed");
        refused("No such file");
    }
}
