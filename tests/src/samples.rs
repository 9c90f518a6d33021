//! The programs of `tests/rs274_samples.txt`: one for each row of the page of the language.

use crate::root;

/// A program, and the word that it shows.
#[derive(Debug)]
pub struct Sample {
    /// As its row names it: `G5.1`, `M62 to M68`.
    pub word: String,
    /// With braces around what is left out in [`Self::without`].
    text: String,
}

impl Sample {
    /// The whole program.
    pub fn whole(&self) -> String {
        self.ended(self.text.replace(['{', '}'], ""))
    }

    /// The program without the word.
    pub fn without(&self) -> String {
        let (before, rest) = self.text.split_once('{').expect("a brace");
        let (_, after) = rest.split_once('}').expect("its end");
        self.ended(format!("{before}{after}"))
    }

    fn ended(&self, text: String) -> String {
        match self.text.contains("M2\n") || self.text.contains("M30") || self.text.contains("{M2}")
        {
            true => text,
            false => text + "M2\n",
        }
    }
}

/// All of the file.
///
/// # Panics
/// The file is not there.
pub fn samples() -> Vec<Sample> {
    let text = std::fs::read_to_string(root().join("tests/rs274_samples.txt")).expect("the file");
    let blocks = text.split("\n= ").skip(1).map(|block| {
        let (word, text) = block.split_once('\n').expect("a program");
        Sample { word: word.to_owned(), text: text.trim_end().to_owned() + "\n" }
    });
    blocks.collect()
}
