//! Draws findings under their source line, as compilers do.
//!
//! Serves the findings of every node: it knows only places and messages. A place outside of the
//! text is shown without its line.

use crate::subroutines::AppendedFiles;
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use cnc_msgs::calls::chain_text;
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::numbers::with_enough_digits;
use intake::text::one_line;

/// Characters of a line that are shown around a finding.
const LINE_SHOWN: usize = 120;
/// Characters that are shown before a finding in a longer line.
const LEAD_SHOWN: usize = 40;

/// Draws findings of the program `name`, one below the other.
///
/// `text` is the program as its places count characters: a lossy conversion if it is not UTF-8.
/// Without `color` the result is plain text.
pub fn render(name: &str, text: &str, findings: &[Finding], color: bool) -> String {
    draw_all(name, &shown_lines(text, 0, findings), &AppendedFiles::of(text), findings, color)
}

/// [`render`] where nothing but these lines is left of the text, in order.
pub fn render_lines(
    name: &str,
    lines: &[(u32, String)],
    findings: &[Finding],
    color: bool,
) -> String {
    let lines: Vec<_> = lines.iter().map(|(number, line)| (*number, line.as_str())).collect();
    draw_all(name, &lines, &AppendedFiles::default(), findings, color)
}

fn draw_all(
    name: &str,
    lines: &[(u32, &str)],
    files: &AppendedFiles<'_>,
    findings: &[Finding],
    color: bool,
) -> String {
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    let name = &printable(name);
    let mut drawn = String::new();
    for finding in findings {
        if !drawn.is_empty() {
            drawn.push_str("\n\n");
        }
        drawn.push_str(&draw(&renderer, name, lines, files, finding));
    }
    if !drawn.is_empty() {
        drawn.push('\n');
    }
    drawn
}

/// The lines that findings point at, by number, in a piece of a text after so many lines; found in one pass.
pub fn shown_lines<'t>(text: &'t str, before: u32, findings: &[Finding]) -> Vec<(u32, &'t str)> {
    let text = text.strip_prefix('\u{feff}').filter(|_| before == 0).unwrap_or(text);
    let mut wanted: Vec<u32> = findings.iter().map(|found| found.source.line).collect();
    wanted.sort_unstable();
    wanted.dedup();
    let mut wanted = wanted.into_iter().filter(|&line| line > before).peekable();
    let mut lines = Vec::new();
    for (number, line) in (before + 1..).zip(text.lines()) {
        match wanted.peek() {
            None => break,
            Some(&next) if next == number => {
                wanted.next();
                lines.push((number, line));
            }
            Some(_) => {}
        }
    }
    lines
}

fn draw(
    renderer: &Renderer,
    name: &str,
    lines: &[(u32, &str)],
    files: &AppendedFiles<'_>,
    finding: &Finding,
) -> String {
    let level = match finding.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let title = level.primary_title(printable(&finding.message)).id(finding.code.name());
    let source = finding.source;
    let found = lines.binary_search_by_key(&source.line, |&(number, _)| number);
    let mut group = match found {
        Ok(index) => {
            let shown = Shown::of(lines[index].1, source);
            let mut annotation = AnnotationKind::Primary.span(shown.start..shown.end);
            let label = label(finding);
            if !label.is_empty() {
                annotation = annotation.label(label);
            }
            let number = source.line as usize;
            let is_whole = shown.is_whole;
            let snippet = Snippet::source(shown.text).line_start(number).annotation(annotation);
            let group = Group::with_title(title);
            if is_whole {
                group.element(snippet.path(name.to_owned()))
            } else {
                // Written here: the library would count columns of the shown part.
                let column = usize::from(source.column.max(1));
                let origin = Origin::path(name.to_owned()).line(number).char_column(column);
                group.element(origin).element(snippet)
            }
        }
        Err(_) => {
            let origin = Origin::path(name.to_owned());
            let origin = match source.line {
                0 => origin,
                line => origin.line(line as usize).char_column(usize::from(source.column.max(1))),
            };
            Group::with_title(title).element(origin)
        }
    };
    for note in notes(files, finding) {
        group = group.element(Level::NOTE.message(printable(&note)));
    }
    if !finding.help.is_empty() {
        group = group.element(Level::HELP.message(printable(&finding.help)));
    }
    let drawn = renderer.render(&[group]);
    match found.is_ok_and(|_| drawn.contains(":::")) {
        true => drawn.lines().filter(|line| !is_empty_origin(line)).collect::<Vec<_>>().join("\n"),
        false => drawn,
    }
}

/// The file that the line is of, and the calls and passes that led to it.
fn notes(files: &AppendedFiles<'_>, finding: &Finding) -> Vec<String> {
    let mut notes = Vec::new();
    let of_file = |line: u32| files.place(line).map(|(file, of)| format!("line {of} of {file}"));
    if let Some(place) = of_file(finding.source.line) {
        notes.push(format!("line {} is {place}", finding.source.line));
    }
    if !finding.calls.is_empty() {
        notes.push(chain_text(&finding.calls, |line| files.text(line)));
    }
    if let Some(other) = finding.other
        && !finding.other_calls.is_empty()
    {
        let chain = chain_text(&finding.other_calls, |line| files.text(line));
        notes.push(format!("{}: {chain}", files.text(other.line)));
    }
    notes
}

/// The `:::` of another file, which the library writes above a snippet whose place came first.
fn is_empty_origin(line: &str) -> bool {
    // Colours are of digits between these.
    let is_blank = |byte: u8| byte.is_ascii_digit() || b" \x1b[;m".contains(&byte);
    line.matches(":::").count() == 1 && line.replace(":::", "").bytes().all(is_blank)
}

/// The label after the carets: closest point, needed and available space, related block.
fn label(finding: &Finding) -> String {
    let mut label = String::new();
    if let Some([x, y, z]) = finding.position {
        label = format!("closest at X{x:.3} Y{y:.3} Z{z:.3}");
    }
    if let (Some(needed), Some(available)) = (finding.needed_mm, finding.available_mm)
        && finding.position.is_some()
    {
        let [needed, available] = with_enough_digits(needed, available);
        label += &format!("; {needed} mm needed, {available} mm there");
    }
    if let Some(other) = finding.other.filter(|other| other.line > 0) {
        if !label.is_empty() {
            label += "; ";
        }
        label += &match other.block {
            Some(block) => format!("see N{block} in line {}", other.line),
            None => format!("see line {}", other.line),
        };
    }
    label
}

/// The part of a line that is shown, and the marked bytes of it.
struct Shown {
    text: String,
    start: usize,
    end: usize,
    /// Whether the shown text has the columns of the line, and the place is in it.
    is_whole: bool,
}

impl Shown {
    fn of(line: &str, source: Source) -> Self {
        let column = usize::from(source.column.max(1)) - 1;
        let is_long = line.chars().nth(LINE_SHOWN).is_some();
        let skipped = if is_long { column.saturating_sub(LEAD_SHOWN) } else { 0 };
        let mut text = String::new();
        if skipped > 0 {
            text.push_str("...");
        }
        let (mut start, mut end) = (None, None);
        let mut shown = line.chars().enumerate().skip(skipped);
        for (index, letter) in shown.by_ref().take(LINE_SHOWN) {
            if index == column {
                start = Some(text.len());
            }
            // Tabs and invisible characters take one column, as in the place.
            text.push(if letter.is_control() { ' ' } else { letter });
            if index < column + usize::from(source.length.max(1)) {
                end = Some(text.len());
            }
        }
        let last = text.len();
        if shown.next().is_some() {
            text.push_str("...");
        }
        let is_whole = skipped == 0 && start.is_some();
        let start = start.unwrap_or(last);
        Self { text, start, end: end.unwrap_or(last).max(start), is_whole }
    }
}

/// A text as one line.
fn printable(text: &str) -> String {
    one_line(text).into_owned()
}

#[cfg(test)]
mod tests;
