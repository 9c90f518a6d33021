//! Rules that a compiler does not check.

use compensation_planner::{Planning, judge};
use kerf_tests::layers::upward_imports;
use kerf_tests::{files, root};
use program_loader::render::render;
use program_loader::{LoadOptions, load};

/// Crates with folders in an order: each folder imports only those before it.
const LAYERS: [(&str, &[&str]); 3] = [
    (
        "nodes/runtime/src",
        &[
            "process",
            "parameters",
            "command_line",
            "samples",
            "rustdds",
            "zenoh",
            "endpoints",
            "managed",
        ],
    ),
    ("nodes/compensation_planner/src", &["geometry", "span", "check", "walk", "tools", "node"]),
    (
        "nodes/path_audit/src",
        &["geometry", "report", "blocks", "events", "offsets", "walls", "clearance"],
    ),
];

#[test]
fn every_file_says_first_what_it_knows() {
    let silent: Vec<_> = files(".rs")
        .into_iter()
        .filter(|path| {
            let text = std::fs::read_to_string(path).expect("sources are UTF-8");
            !text.lines().take(12).any(|line| line.starts_with("//!"))
        })
        .collect();
    assert!(silent.is_empty(), "no //! at the top of {silent:#?}");
}

#[test]
fn every_dependency_has_its_reason_above_it() {
    let mut bare = Vec::new();
    for path in files("Cargo.toml") {
        let text = std::fs::read_to_string(&path).expect("manifests are UTF-8");
        let mut section = "";
        let mut above = "";
        for line in text.lines() {
            if line.starts_with('[') {
                section = line;
            }
            let is_dependency = section.ends_with("dependencies]")
                && line.contains('=')
                && !line.starts_with('#')
                // Crates of this workspace need no reason; a comment counts for the group below it.
                && !line.contains("path = ");
            let is_ours = [
                "cnc_msgs",
                "runtime",
                "program_loader",
                "compensation_planner",
                "path_audit",
                "axis_driver",
                "run_recorder",
                "virtual_controller",
            ]
            .iter()
            .any(|name| line.starts_with(name));
            if is_dependency && !is_ours && above.is_empty() {
                bare.push(format!("{}: {line}", path.display()));
            }
            above = line;
        }
    }
    assert!(bare.is_empty(), "dependencies without a reason: {bare:#?}");
}

#[test]
fn continuous_integration_runs_the_two_commands_of_the_readme() {
    let readme = std::fs::read_to_string(root().join("README.md")).expect("README.md");
    let ci = std::fs::read_to_string(root().join(".ci/run")).expect(".ci/run");
    let test = "cargo test --workspace --locked";
    assert!(readme.contains(test) && ci.contains(test));
    assert!(readme.contains("cargo run --release --bin kerf -- demo"));
    assert!(ci.contains("--bin kerf -- demo"));
}

#[test]
fn the_first_pages_stay_short() {
    for (page, words_max) in [("README.md", 900), ("ARCHITECTURE.md", 2000)] {
        let text = std::fs::read_to_string(root().join(page)).expect("a page");
        let words = text.split_whitespace().count();
        assert!(words <= words_max, "{page} has {words} words, and {words_max} at most");
    }
}

#[test]
fn every_link_of_a_page_leads_to_a_file() {
    let mut broken = Vec::new();
    for path in files(".md") {
        let text = std::fs::read_to_string(&path).expect("pages are UTF-8");
        let folder = path.parent().expect("a folder");
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap_or_default();
            let is_local = !file.is_empty() && !file.contains("://") && !file.contains(' ');
            if is_local && !folder.join(file).exists() {
                broken.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "links to nothing: {broken:#?}");
}

#[test]
fn the_driver_asks_no_firmware_for_its_name() {
    for path in files(".rs") {
        let name = path.to_string_lossy().into_owned();
        let is_of_driver = name.contains("axis_driver/src") && !name.contains("/tests");
        if !is_of_driver || name.contains("/firmware") {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("sources are UTF-8");
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for firmware in ["Firmware::Grbl", "Firmware::FluidNc"] {
            assert!(
                !code.contains(firmware),
                "{name}: {firmware}; what differs is a field of Traits"
            );
        }
    }
}

#[test]
fn nothing_is_named_an_emergency_stop() {
    for ending in [".msg", ".srv", ".action"] {
        for path in files(ending) {
            let text = std::fs::read_to_string(&path).expect("interfaces are UTF-8").to_lowercase();
            let name = path.display().to_string().to_lowercase();
            for word in ["emergency_stop", "emergencystop", "estop", "e_stop"] {
                assert!(!text.contains(word) && !name.contains(word), "{word} in {name}");
            }
        }
    }
}

#[test]
fn a_folder_imports_only_the_folders_before_it() {
    for (src, order) in LAYERS {
        let wrong = upward_imports(&root().join(src), order);
        assert!(wrong.is_empty(), "{src}, in the order {order:?}: {wrong:#?}");
    }
}

/// The folders of the driver, and what of the driver each may import besides its own files.
const DRIVER: [(&str, &[&str]); 5] = [
    ("context", &["answer", "output"]),
    ("connect", &["answer", "output", "next", "context"]),
    ("manual", &["answer", "output", "next", "context"]),
    ("run", &["answer", "output", "next", "context"]),
    // A stop takes over what is left of a run.
    ("stop", &["answer", "output", "next", "context", "run"]),
];

#[test]
fn a_phase_of_the_driver_imports_no_other() {
    let driver = root().join("nodes/axis_driver/src/driver");
    let mut wrong = Vec::new();
    for path in files(".rs") {
        let Ok(inside) = path.strip_prefix(&driver) else { continue };
        let first = inside.components().next().expect("a file in the folder").as_os_str();
        let folder = first.to_string_lossy().trim_end_matches(".rs").to_owned();
        let Some((_, allowed)) = DRIVER.iter().find(|(name, _)| *name == folder) else { continue };
        let is_root_of_folder = inside.components().count() == 1;
        let text = std::fs::read_to_string(&path).expect("sources are UTF-8");
        for line in text.lines().filter(|line| line.starts_with("use ")) {
            let target = match is_root_of_folder {
                true => line.strip_prefix("use super::"),
                false => line.strip_prefix("use crate::driver::"),
            };
            let Some(target) = target.or_else(|| line.strip_prefix("use crate::driver::")) else {
                continue;
            };
            let end = target.find(|next: char| !next.is_alphanumeric() && next != '_');
            let target = &target[..end.unwrap_or(target.len())];
            if target != folder && !allowed.contains(&target) {
                wrong.push(format!("{}: {line}", inside.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "phases that import each other: {wrong:#?}");
}

#[test]
fn an_import_of_a_later_folder_is_found() {
    let seeds = [
        ("a/x.rs", "use crate::b::y::Y;", "crate::b"),
        ("a/mod.rs", "//! A.\nuse crate::{a::x, b::{y, z}};", "crate::b"),
        ("a.rs", "//! A.\nuse crate::b::y;", "crate::b"),
        ("a/x.rs", "fn f() {\n    crate::root::run();\n}", "crate::root"),
        ("a/x.rs", "use super::super::b::y;", "super::super::b"),
        ("a/x.rs", "mod tests {\n    use super::super::super::b::y;\n}", "super::super::super"),
        ("d/mod.rs", "//! D.", "d/ has no place"),
        ("b/mod.rs", "mod y;", "b/ does not say"),
        ("c.rs", "//! C.\nuse crate::root;", "c.rs: crate::root"),
    ];
    for (file, text, expected) in seeds {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |file: &str, text: &str| {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, text).expect("written");
        };
        write("a/mod.rs", "//! A.\nmod x;");
        write("a/x.rs", "//! Not [`crate::b`].\nmod tests {\n    use super::super::a;\n}");
        write("b/mod.rs", "//! B.\nmod y;");
        write("b/y.rs", "use crate::{a::x::X, b};\nuse super::super::a::x;");
        write("root.rs", "use crate::b;");
        write("c.rs", "//! C, one file.\nuse crate::b::y;");
        let order = ["a", "b", "c"];
        assert_eq!(upward_imports(folder.path(), &order), ["b/y.rs: use super::super::a::x;"]);
        write("b/y.rs", "use crate::{a::x::X, b};");
        assert!(upward_imports(folder.path(), &order).is_empty());
        write(file, text);
        let found = upward_imports(folder.path(), &order);
        assert!(found.iter().any(|it| it.contains(expected)), "{file}, {text}: {found:?}");
    }
}

/// A text file of the repository, by its path from the root.
fn page(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

#[test]
fn the_finding_in_the_readme_is_what_kerf_plan_prints() {
    let program = page("tests/readme/groove.ngc");
    let tools = settings::tool_table_from_yaml(&page("tests/readme/tools.yaml"), "tools.yaml")
        .expect("a tool table");
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let loaded = load(program.as_bytes(), &profile, &LoadOptions::default());
    assert!(loaded.findings.is_empty(), "{:?}", loaded.findings);
    let plan = judge(&loaded.contour, &profile, &tools, Planning::default()).plan;
    let drawn = render("groove.ngc", &program, &plan.findings, false);
    let block = format!("```text\n{drawn}```");
    // The page may break the line of the message.
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let is_there = words(&page("README.md")).contains(&words(&block));
    assert!(is_there, "README.md has another block than\n{block}");
}

#[test]
fn what_the_quality_declaration_names_exists() {
    let (declaration, ci) = (page("QUALITY_DECLARATION.md"), page(".ci/run"));
    let mut missing = Vec::new();
    // Every other piece between backticks is a name; code blocks have none of a path.
    for name in declaration.split('`').skip(1).step_by(2) {
        let is_path = name.contains('/') && !name.contains(' ') && !name.contains('\n');
        let is_file = [".md", ".toml", ".lock"].iter().any(|ending| name.ends_with(ending))
            || name.starts_with("LICENSE");
        if (is_path || is_file) && !root().join(name).exists() {
            missing.push(name);
        }
    }
    // Steps are the last column of the table of tests, and `Step "..."`.
    let rows = declaration.lines().filter(|line| line.starts_with("| ") && line.contains('`'));
    let cells = rows.filter_map(|row| row.trim_end_matches(" |").rsplit("| ").next());
    let quoted = declaration.split("tep \"").skip(1).filter_map(|rest| rest.split('"').next());
    for step in cells.skip(1).flat_map(|cell| cell.split(", ")).chain(quoted) {
        if step != "none" && !ci.contains(&format!("step \"{step}")) {
            missing.push(step);
        }
    }
    assert!(missing.is_empty(), "not there: {missing:#?}");
    for held in ["unsafe_code = \"deny\"", "license = \"MIT OR Apache-2.0\"", "version = \"0.1.0\""]
    {
        assert!(page("Cargo.toml").contains(held), "Cargo.toml has no {held}");
    }
}
