//! `kerf plan --quiet` of files that are longer than a piece, so that they are not held.

use super::said;
use super::support::Folder;

/// The tool of 4 mm in a square of this size, after comments of more than 1 MB.
fn program(side_mm: f64, end: &str) -> String {
    let comments = format!("({})\n", "-".repeat(4000)).repeat(300);
    let half = side_mm / 2.0;
    format!(
        "{comments}G21 G17 G90 G40 F1000\nG0 X{half} Y{half}\nG41.1 D4 G1 X{half} Y0\nX{side_mm} Y0\n\
         X{side_mm} Y{side_mm}\nX0 Y{side_mm}\nX0 Y0\nX{half} Y0\nG40 G1 X{half} Y{half}\n{end}M2\n"
    )
}

#[test]
fn a_long_file_is_judged_as_a_short_one() {
    let folder = Folder::new();
    let file = |side_mm: f64, end: &str| {
        std::fs::write(folder.path().join("long.ngc"), program(side_mm, end)).expect("written");
        said(&folder, &["plan", "long.ngc", "--quiet"])
    };
    let loop_of_two = "o1 repeat [2]\nG0 X5\no1 endrepeat\n";
    for end in ["", loop_of_two] {
        let ran = file(30.0, end).expect(0);
        assert_eq!((ran.out.as_str(), ran.err.as_str()), ("", ""), "{end}");
    }
    file(3.5, "").expect(1).says(&["--> long.ngc:303:1", "303 | G41.1 D4 G1 X1.75 Y0"]);
    file(30.0, "G1 X\n").expect(1).says(&["--> long.ngc:310:4", "310 | G1 X"]);
    file(30.0, "o1 repeat [2]\n").expect(1).says(&["error[syntax]", "--> long.ngc:310:"]);
}
