//! What this package refuses in its own files although `rosidl` accepts it from others.
//!
//! Follows rosidl_adapter of Jazzy, so that what is accepted here is accepted by `colcon build`:
//! names, columns, and values within the bounds of their types. Also refuses what readers of
//! bags or generators of other languages treat differently.

use rosidl::InterfaceError;
use rosidl::interface_file::{InterfaceFile, Section};
use rosidl::name::{check_constant, check_field};
use rosidl::syntax::{self, LineItem, SourceLine};
use rosidl::types::{Arity, WrittenType};

use super::literal::{self, LiteralType};

/// Everything in a file that breaks the rules for our own files.
pub fn check(file: &InterfaceFile) -> Vec<InterfaceError> {
    file.sections().into_iter().flat_map(check_section).collect()
}

fn check_section(section: Section<'_>) -> Vec<InterfaceError> {
    let mut constants = Vec::new();
    let mut refusals = Vec::new();
    for line in syntax::lines(section.text) {
        if let Err(message) = check_line(&line, &mut constants) {
            let line = section.first_line + line.number - 1;
            refusals.push(InterfaceError { file: section.file.into(), line, message });
        }
    }
    refusals
}

/// `constants` are those of the lines above.
fn check_line<'a>(line: &SourceLine<'a>, constants: &mut Vec<&'a str>) -> Result<(), String> {
    let comment = line.comment.unwrap_or_default().trim();
    if comment.len() >= 3 && comment.chars().all(|c| c == '=') {
        return Err("a comment of = alone splits the schema".into());
    }
    // `rosidl` itself refuses a line that is not an item.
    let Some(Ok(item)) = line.item else { return Ok(()) };
    if line.code.starts_with(char::is_whitespace) {
        return Err("the line is indented; ROS wants the type in the first column".into());
    }
    if line.code.trim_end().contains(|c: char| c.is_whitespace() && c != ' ' && c != '\t') {
        return Err("a line has no white space but spaces and tabs".into());
    }
    match item {
        LineItem::Field { type_text, name, default } => {
            check_type(type_text)?;
            check_field(name)?;
            if let Some((before, _)) = default.split_once('=') {
                check_constant(format!("{name} {before}").trim_end())?;
            }
            check_default(type_text, default)
                .map_err(|reason| format!("default of {name}: {reason}"))
        }
        LineItem::Constant { type_text, name, value } => {
            check_type(type_text)?;
            check_constant(name)?;
            let of = LiteralType::parse(type_text).filter(|of| of.arity == Arity::One);
            let of = of.ok_or(format!("constant {name} must be a number, a bool or a string"))?;
            if constants.contains(&name) {
                return Err(format!("there is a constant {name} already"));
            }
            constants.push(name);
            literal::parse(value, of).map_err(|reason| format!("constant {name}: {reason}"))?;
            Ok(())
        }
    }
}

fn check_type(text: &str) -> Result<(), String> {
    // `rosidl` itself refuses text that is not a type.
    let Ok(WrittenType { base, bounds, .. }) = WrittenType::parse(text) else { return Ok(()) };
    match base {
        "wstring" | "wchar" => {
            return Err(format!("{base} is unknown to most readers of bags; take string"));
        }
        "time" | "duration" => {
            return Err(format!("{base} is of ROS 1; take a type of builtin_interfaces"));
        }
        _ => {}
    }
    if bounds.text == Some(0) || bounds.elements == Some(0) {
        return Err(format!("the size in {text} is not a whole number above 0"));
    }
    Ok(())
}

fn check_default(type_text: &str, default: &str) -> Result<(), String> {
    if default.is_empty() {
        return Ok(());
    }
    match (LiteralType::parse(type_text), WrittenType::parse(type_text)) {
        (Some(of), _) => literal::parse(default, of).map(|_| ()),
        (None, Ok(written)) => {
            Err(format!("{} is a message and cannot have a value here", written.base))
        }
        (None, Err(_)) => Ok(()),
    }
}
