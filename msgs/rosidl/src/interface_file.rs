//! Interface files, and the sections that `---` cuts them into.

use crate::name::TypeName;

/// A file with its place in its package.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InterfaceFile {
    /// The package, the folder and the file name without extension.
    pub name: TypeName,
    /// Path from the package folder, for messages.
    pub path: String,
    pub text: String,
}

/// A piece of a file.
#[derive(Debug, Clone, Copy)]
pub struct Section<'a> {
    /// Path of the file from the package folder.
    pub file: &'a str,
    /// Line of the file that `text` starts on, from 1; 0 for text that is in no file.
    pub first_line: usize,
    pub text: &'a str,
}

impl InterfaceFile {
    /// Cuts the file at its `---` lines.
    pub fn sections(&self) -> Vec<Section<'_>> {
        let (file, text) = (self.path.as_str(), self.text.as_str());
        let mut sections = Vec::new();
        let (mut start, mut first_line, mut at) = (0, 1, 0);
        for (index, line) in text.split_inclusive('\n').enumerate() {
            if line.trim_end() == "---" {
                sections.push(Section { file, first_line, text: &text[start..at] });
                start = at + line.len();
                first_line = index + 2;
            }
            at += line.len();
        }
        sections.push(Section { file, first_line, text: &text[start..] });
        sections
    }
}
