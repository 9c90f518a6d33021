//! Writes generated bags into a folder: `make_bags FOLDER FROM COUNT`.

#[path = "generate/mod.rs"]
mod generate;

use std::path::Path;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [folder, from, count] = &words[..] else { panic!("make_bags FOLDER FROM COUNT") };
    let number = |text: &str| text.parse::<u64>().expect("a number");
    std::fs::create_dir_all(folder).expect("a folder");
    for number in number(from)..number(from) + number(count) {
        let file = Path::new(folder).join(format!("run_{number}.mcap"));
        std::fs::write(file, generate::bag(&generate::Spec::new(number))).expect("a bag");
    }
}
