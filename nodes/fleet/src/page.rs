//! The report as one HTML file: no script, no other file.

use crate::core::groups::{Counts, GROUPS_MAX, Grouping};
use crate::core::key::bag_object;
use crate::report::Report;
use std::fmt::Write;

/// Builds in the chart.
const BUILDS_MAX: usize = 40;
/// A bar of the chart, px.
const BAR_WIDTH: usize = 22;
const BAR_HEIGHT: f64 = 160.0;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:70em;padding:0 1em;\
    color:#222;background:#fff}table{border-collapse:collapse;width:100%;margin:.5em 0 1.5em}td,th{padding:.25em .6em;\
    border-bottom:1px solid #ddd;text-align:left;vertical-align:top}td.n{text-align:right}code{font-size:12px;\
    overflow-wrap:anywhere}text{font:11px system-ui,sans-serif;fill:#444}.r{fill:#3a7d44}.d{fill:#c2410c}.e{fill:#777}";

/// Draws a report.
pub fn html(report: &Report) -> String {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>kerf fleet: build {0}</title>\
         <style>{STYLE}</style></head><body>\n<h1>Build {0}</h1>\n<p>{1}</p>\n",
        escaped(&report.build),
        escaped(&report.store)
    );
    let Counts { reproduced, different, error } = report.counts;
    let _ = writeln!(
        page,
        "<p><b>{reproduced}</b> reproduced, <b>{different}</b> different, <b>{error}</b> cannot be compared, \
         <b>{}</b> to do.</p>",
        report.to_do
    );
    page += &chart(&report.builds);
    if let Some(against) = &report.against {
        let _ = writeln!(
            page,
            "<h2>Against build {}</h2>\n<p><b>{}</b> of {} bags have another verdict.</p>",
            escaped(&against.build),
            against.changed,
            against.compared
        );
        tables(&mut page, report, &against.groups);
    }
    let _ = writeln!(page, "<h2>Not reproduced</h2>");
    tables(&mut page, report, &report.groups);
    for (what, bags) in [
        ("Rows without a bag", &report.rows_without_bag),
        ("Bags without a row", &report.bags_without_row),
        ("Files that could not be read", &report.problems),
    ] {
        if !bags.is_empty() {
            let _ = writeln!(page, "<h2>{what}</h2>\n<p>{}</p>\n<ul>", bags.len());
            for bag in bags.iter().take(GROUPS_MAX) {
                let _ = writeln!(page, "<li><code>{}</code></li>", escaped(bag));
            }
            page += "</ul>\n";
        }
    }
    page + "</body></html>\n"
}

/// A bar for each build: what is reproduced at the bottom, then what differs, then errors.
fn chart(builds: &[(String, Counts)]) -> String {
    let builds = &builds[builds.len().saturating_sub(BUILDS_MAX)..];
    let most = builds.iter().map(|(_, counts)| counts.total()).max().unwrap_or(0).max(1);
    let (width, height) = (builds.len() * (BAR_WIDTH + 8) + 40, BAR_HEIGHT + 90.0);
    let mut svg = format!(
        "<h2>Builds</h2>\n<svg width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"verdicts of each build\">\n"
    );
    for (place, (build, counts)) in builds.iter().enumerate() {
        let x = place * (BAR_WIDTH + 8) + 10;
        let mut bottom = BAR_HEIGHT + 10.0;
        for (class, word, count) in [
            ("r", "reproduced", counts.reproduced),
            ("d", "different", counts.different),
            ("e", "cannot be compared", counts.error),
        ] {
            let height = count as f64 / most as f64 * BAR_HEIGHT;
            bottom -= height;
            let _ = writeln!(
                svg,
                "<rect class=\"{class}\" x=\"{x}\" y=\"{bottom:.1}\" width=\"{BAR_WIDTH}\" height=\"{height:.1}\">\
                 <title>{}: {count} {word}</title></rect>",
                escaped(build)
            );
        }
        let (x, y) = (x + BAR_WIDTH / 2, BAR_HEIGHT + 22.0);
        let short: String = build.chars().take(10).collect();
        let _ = writeln!(
            svg,
            "<text transform=\"translate({x},{y}) rotate(50)\">{}</text>",
            escaped(&short)
        );
    }
    svg + "</svg>\n<p>Green: reproduced. Orange: different. Grey: cannot be compared.</p>\n"
}

fn tables(page: &mut String, report: &Report, groupings: &[Grouping]) {
    for grouping in groupings.iter().filter(|it| !it.groups.is_empty()) {
        let Grouping { by, groups } = grouping;
        let _ = writeln!(
            page,
            "<h3>By {by}</h3>\n<table><tr><th>bags</th><th>{by}</th><th>first bag</th></tr>"
        );
        for group in grouping.shown() {
            let first = match report.pages.get(&group.first_bag) {
                Some(file) => format!(
                    "<a href=\"{}\">{}</a>",
                    escaped(&file.replace('%', "%25").replace('#', "%23").replace('?', "%3F")),
                    escaped(&bag_object(&group.first_bag))
                ),
                None => {
                    format!("<code>{}</code>", escaped(&report.page_command(&group.first_bag)))
                }
            };
            let _ = writeln!(
                page,
                "<tr><td class=\"n\">{}</td><td>{}</td><td>{}<br>{first}</td></tr>",
                group.bags,
                escaped(&group.value),
                escaped(&group.first_text),
            );
        }
        let _ = writeln!(page, "</table>");
        if groups.len() > GROUPS_MAX {
            let _ = writeln!(
                page,
                "<p>and {} more; <code>--json</code> lists all</p>",
                groups.len() - GROUPS_MAX
            );
        }
    }
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '&' => out += "&amp;",
            '"' => out += "&quot;",
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::groups::Group;

    #[test]
    fn a_page_has_its_numbers_and_no_markup_of_a_program_s_name() {
        let counts = Counts { reproduced: 3, different: 1, error: 0 };
        let group = Group {
            value: "<script>x</script>".into(),
            bags: 1,
            first_bag: "ab".repeat(32),
            first_text: "1 became \"2\"".into(),
        };
        let report = Report {
            store: "file:///srv/bags".into(),
            build: "abc".into(),
            counts,
            to_do: 2,
            groups: vec![Grouping { by: "program", groups: vec![group] }],
            against: None,
            rows_without_bag: vec![],
            bags_without_row: vec![],
            builds: vec![("abc".into(), counts)],
            problems: vec![],
            pages: Default::default(),
        };
        let page = html(&report);
        for expected in [
            "<b>3</b> reproduced, <b>1</b> different",
            "&lt;script&gt;x&lt;/script&gt;",
            "1 became &quot;2&quot;",
            "kerf replay /srv/bags/bags/abab",
            "<title>abc: 1 different</title>",
        ] {
            assert!(page.contains(expected), "{expected} is not in {page}");
        }
        assert!(!page.contains("<script"));
        // What was drawn is linked.
        let pages = [("ab".repeat(32), "of 100%.pages/abab.html".to_owned())].into();
        let page = html(&Report { pages, ..report });
        assert!(page.contains("<a href=\"of 100%25.pages/abab.html\">bags/abab"), "{page}");
    }
}
