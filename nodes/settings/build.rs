//! Makes the list of the controls that come with the program: one for each file of `config/controls`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(&std::env::var("CARGO_MANIFEST_DIR")?).join("../../config/controls");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()?;
    files.retain(|file| file.extension().is_some_and(|extension| extension == "yaml"));
    files.sort();
    let (mut variants, mut names, mut texts) = (String::new(), String::new(), String::new());
    for file in &files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        let variant = variant(&name);
        write!(variants, "{variant}, ")?;
        writeln!(names, "            Self::{variant} => {name:?},")?;
        writeln!(
            texts,
            "            Self::{variant} => include_str!({:?}),",
            file.canonicalize()?
        )?;
    }
    let all: String =
        files.iter().zip(variants.split(", ")).map(|(_, it)| format!("Self::{it}, ")).collect();
    let count = files.len();
    let code = format!(
        "/// A control whose rules come with the program: one for each file of `config/controls`.
///
/// The one list of them. A `match` without a wildcard names what a new control lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Control {{ {variants} }}

impl Control {{
    /// All of them, in the order of their names.
    pub const ALL: [Self; {count}] = [{all}];

    /// As `--control` names it.
    pub const fn name(self) -> &'static str {{
        match self {{
{names}        }}
    }}

    /// Its file.
    const fn text(self) -> &'static str {{
        match self {{
{texts}        }}
    }}
}}
"
    );
    std::fs::write(Path::new(&std::env::var("OUT_DIR")?).join("controls.rs"), code)?;
    Ok(())
}

/// `OspLathe` of `osp_lathe`.
fn variant(name: &str) -> String {
    let capital = |word: &str| {
        let (first, rest) = word.split_at(word.len().min(1));
        first.to_uppercase() + rest
    };
    name.split('_').map(capital).collect()
}
