//! Which code a wrong line gets, row by row of the behaviour table of grbl 1.1h.

mod common;
use common::Bench;

/// Lines sent one after the other to one controller, each with its answer.
#[track_caller]
fn check(dialogue: &[(&str, &str)]) {
    let mut bench = Bench::new(&[]);
    for (line, expected) in dialogue {
        let answer = bench.send_line(line);
        assert_eq!(answer, *expected, "answer to `{line}`");
    }
}

#[test]
fn words_that_cannot_be_read_are_refused() {
    check(&[
        ("X", "error:2"),
        ("G", "error:2"),
        ("%", "error:1"),
        ("N1G1X1*12", "error:1"),
        ("*71", "error:1"),
        ("X99999999999999999999999999999999999999999999", "error:2"),
        ("G1X-F100", "error:2"),
        ("", "ok"),
        ("(comment)", "ok"),
        ("; comment", "ok"),
    ]);
}

#[test]
fn codes_the_firmware_does_not_have_are_refused() {
    for line in [
        "G41", "G42D1", "G64", "G95", "G96", "G41.1X1", "G43", "G43H1", "G90.1", "G61.1", "G38",
        "G38.6X1", "G92.2", "M6", "M7", "M48", "M98", "O100", "A1", "D1", "H1", "Q1", "U1", "G5X1",
        "G33", "G81X1", "G1X1E1F1",
    ] {
        check(&[(line, "error:20")]);
    }
}

#[test]
fn codes_the_firmware_has_are_taken() {
    for line in [
        "G40",
        "G49",
        "G80",
        "G61",
        "G17",
        "G18",
        "G19",
        "G20",
        "G21",
        "G90",
        "G91",
        "G91.1",
        "G93",
        "G94",
        "G54",
        "G59",
        "M3",
        "M4S100",
        "M5",
        "M8",
        "M9",
        "M1",
        "T255",
        "S1000",
        "N10000000",
        "F100",
        "G92.1",
        "G28.1",
        "G30.1",
        "G43.1Z1",
        "G92X1",
        "G10L2P1X1",
        "G10L20P0Z0",
        "G21G90G94G17G40G49G54",
        "/G1F1",
        "G4P0",
        "G1F1",
        "G0",
        "G28",
    ] {
        check(&[(line, "ok")]);
    }
}

#[test]
fn each_rule_of_a_block_has_its_code() {
    check(&[("G0G1X1", "error:24")]);
    check(&[
        ("G17G18", "error:21"),
        ("M3M4", "error:21"),
        ("M0M2", "error:21"),
        ("G20G21", "error:21"),
    ]);
    check(&[
        ("G1X1", "error:22"),
        ("G1X1F0", "error:22"),
        ("G93G1X1", "error:22"),
        ("G2X1I1", "error:22"),
    ]);
    check(&[
        ("G1.5X1F1", "error:23"),
        ("M3.1", "error:23"),
        ("G54.1", "error:23"),
        ("G40.1", "error:23"),
        ("G59.1", "error:23"),
    ]);
    check(&[("G28G1X1", "error:24"), ("G92G10L2P1X1", "error:24"), ("G43.1G1Z1", "error:24")]);
    check(&[("G1X1X2F1", "error:25"), ("F1F2", "error:25")]);
    check(&[
        ("G92", "error:26"),
        ("G10L2P1", "error:26"),
        ("G38.2F1", "error:26"),
        ("G2I5F100", "error:26"),
    ]);
    check(&[("N10000001", "error:27"), ("N-1", "error:4"), ("F-1", "error:4"), ("S-1", "error:4")]);
    check(&[("G4", "error:28"), ("G10X1P1", "error:28"), ("G10X1L2", "error:28")]);
    check(&[("G10L2P7X1", "error:29")]);
    check(&[("G53G2X1I1F1", "error:30"), ("G53G1X1F1", "ok")]);
    check(&[("G80X1", "error:31")]);
    check(&[("G2Z1I1F1", "error:32")]);
    check(&[("G38.2X0F1", "error:33"), ("G2X0Y0R5F1", "error:33")]);
    check(&[("G2X10R4.9F1", "error:34"), ("G2X10R5", "error:22")]);
    check(&[("G2X1F1", "error:35"), ("G2X1K1F1", "error:35")]);
    check(&[
        ("G0I1", "error:36"),
        ("X1P1", "error:36"),
        ("G1L1F1", "error:36"),
        ("G1", "error:22"),
        ("G4P0I1", "error:36"),
    ]);
    check(&[("G43.1X1", "error:37"), ("G43.1", "error:37")]);
    check(&[("T256", "error:38"), ("T300", "error:38")]);
    check(&[("G10L3P1X1", "error:20"), ("G10L2P1X1R5", "error:20")]);
}

#[test]
fn an_arc_may_miss_its_circle_by_5_um_or_a_thousandth_but_never_by_half_a_millimetre() {
    // Full circles to a point `miss` outside, radius r.
    let cases = [
        (5.0, 0.004, "ok"),
        (5.0, 0.0045, "ok"),
        (5.0, 0.012, "error:33"),
        (5.0, 0.006, "error:33"),
        (100.0, 0.05, "ok"),
        (100.0, 0.12, "error:33"),
        (400.0, 0.39, "ok"),
        (600.0, 0.49, "ok"),
        (600.0, 0.51, "error:33"),
    ];
    for (radius, miss, expected) in cases {
        let line = format!("G2X{:.4}I{radius:.4}F6000", 2.0 * radius + miss);
        let mut bench = Bench::new(&["$12=1"]);
        let answer = bench.send_line(&line);
        let answer = if answer.is_empty() { bench.settle() } else { answer };
        assert_eq!(answer, expected, "{line}");
    }
}

#[test]
fn an_error_does_not_stick_and_later_lines_run() {
    let mut bench = Bench::new(&[]);
    assert_eq!(bench.send(b"G1X2F600\nG41\nG1X3\nG1X4\n"), "ok / error:20 / ok / ok");
    bench.wait(10.0);
    assert_eq!(bench.status(), "Idle|MPos:4.000,0.000,0.000|FS:0,0");
}

#[test]
fn carriage_return_and_line_feed_are_two_lines() {
    let mut bench = Bench::new(&[]);
    assert_eq!(bench.send(b"G0X1\r\n"), "ok / ok");
    assert_eq!(bench.send(b"G41\r\n"), "error:20 / ok");
}

#[test]
fn a_line_of_80_characters_is_refused_and_not_executed() {
    let mut bench = Bench::new(&[]);
    let line = |characters: usize| format!("G0X1.{}", "0".repeat(characters - 5));
    assert_eq!(bench.send_line(&line(80)), "error:11");
    assert_eq!(bench.status(), "Idle|MPos:0.000,0.000,0.000|FS:0,0");
    assert_eq!(bench.send_line(&line(79)), "ok");
}

#[test]
fn bytes_from_0x80_on_are_taken_out_of_the_line() {
    let mut bench = Bench::new(&[]);
    assert_eq!(bench.send(b"G0X\xb50.5\n"), "ok");
    bench.wait(5.0);
    assert_eq!(bench.status(), "Idle|MPos:0.500,0.000,0.000|FS:0,0");
}

#[test]
fn jogs_have_their_own_rules() {
    check(&[
        ("$J=X1", "error:22"),
        ("$J=F100", "error:26"),
        ("$J=X1F100M3", "error:16"),
        ("$J=X1F100S10", "error:36"),
        ("$J=G54X1F100", "error:16"),
        ("$JX1", "error:3"),
        ("$J=G91G20X1F100", "ok"),
        ("G0X1", "error:9"),
    ]);
}

#[test]
fn dollar_commands_have_their_codes() {
    check(&[
        ("$foo", "error:2"),
        ("$H", "error:5"),
        ("$GX", "error:3"),
        ("$RST=?", "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000> / error:3"),
        ("$0=2", "error:6"),
        ("$20=1", "error:10"),
        ("$110=-1", "error:4"),
        ("$77=1", "error:3"),
        ("$110=1x", "error:3"),
        ("$110=", "error:2"),
        ("$N2=G0", "error:3"),
        ("$N0=G41", "error:20"),
        ("$X", "ok"),
    ]);
}
