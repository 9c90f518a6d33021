//! Values of expressions, and wrong expressions, in tables.

use super::*;
use crate::parameters::Parameters;

/// Parameters without a machine.
impl Lookup for Parameters {
    fn numbered(&self, number: u32) -> Option<Result<f64, Trouble>> {
        self.numbered(number).map(Ok)
    }

    fn named(&self, name: &str) -> Option<Result<f64, Trouble>> {
        self.named(name).map(Ok)
    }
}

fn parameters() -> Parameters {
    let mut parameters = Parameters::default();
    for (number, value) in [(1, 3.0), (2, 1.0), (3, 15.0), (101, -7.5), (102, f64::NAN)] {
        parameters.set(&Parameter::Numbered(number), value).expect("a parameter");
    }
    for (name, value) in [("depth", -2.5), ("_feed_rate", 400.0)] {
        parameters.set(&Parameter::Named(name.into()), value).expect("a parameter");
    }
    parameters
}

fn check(text: &str) -> Result<f64, Trouble> {
    match value(text.as_bytes(), 0, &parameters()) {
        Ok((value, end)) => {
            assert_eq!(end, text.len(), "{text}");
            Ok(value)
        }
        Err(error) => {
            assert!(error.start < error.end && error.start <= text.len(), "{text}: {error:?}");
            Err(error.trouble)
        }
    }
}

#[test]
fn expressions_have_the_values_that_rs274_gives_them() {
    for (text, wanted) in [
        ("12.5", 12.5),
        ("-.5", -0.5),
        ("+ 1 2.5", 12.5),
        ("[1+2*3]", 7.0),
        ("[2.0 / 3 * 1.5 - 5.5 / 11.0]", 0.5),
        ("[2**3**2]", 64.0),
        ("[-2 ** 2]", 4.0),
        ("[1 - 2 - 3]", -4.0),
        ("[10 MOD 4]", 2.0),
        ("[-1 MOD 4]", 3.0),
        ("[1 + 2 EQ 3]", 1.0),
        ("[1 EQ 1.0000001]", 1.0),
        ("[1 NE 1.0000001]", 0.0),
        ("[2 GE 2.0000001]", 1.0),
        ("[3 gt 2 and 2 lt 1]", 0.0),
        ("[1 or 0 xor 1]", 0.0),
        ("[5 LE 5]", 1.0),
        ("#1", 3.0),
        ("##2", 3.0),
        ("#[1+1]", 1.0),
        ("[#1+2]", 5.0),
        ("#100", 0.0),
        ("-#101", 7.5),
        ("#<depth>", -2.5),
        ("#<D e P th>", -2.5),
        ("[#<_feed_rate>/2]", 200.0),
        ("SIN[30]", 0.5),
        ("SIN[150]", 0.5),
        ("cos[60]", 0.5),
        ("TAN[45]", 1.0),
        ("ROUND[SIN[150]]", 1.0),
        ("SIN[0]", 0.0),
        ("ATAN[1]/[-1]", 135.0),
        ("[1 + acos[0] - [#3 ** [4.0/2]]]", 1.0 + 90.0 - 225.0),
        ("SQRT[9]", 3.0),
        ("ROUND[-2.5]", -3.0),
        ("FIX[-2.5]", -3.0),
        ("FUP[2.1]", 3.0),
        ("ABS[-4]", 4.0),
        ("LN[EXP[2]]", 2.0),
        ("EXISTS[#<depth>]", 1.0),
        ("EXISTS[#<width>]", 0.0),
        ("EXISTS[#6000]", 0.0),
        ("[- - 3]", 3.0),
        ("[2 m o d 2]", 0.0),
    ] {
        assert_eq!(check(text), Ok(wanted), "{text}");
    }
}

#[test]
fn wrong_expressions_say_what_is_wrong() {
    let deep = "[".repeat(10_000);
    for (text, wanted) in [
        ("[1/0]", Trouble::DivisionByZero),
        ("[1 MOD 0]", Trouble::DivisionByZero),
        ("[1+2", Trouble::NotClosed),
        ("[1 2 x]", Trouble::NoOperator),
        ("[1+]", Trouble::NoValue),
        ("[]", Trouble::NoValue),
        ("[1..2]", Trouble::Number { is_exponent: false }),
        ("[1e5]", Trouble::Number { is_exponent: true }),
        ("SQRT[-1]", Trouble::OutOfDomain { function: "SQRT", value: -1.0, allowed: "from 0 on" }),
        ("ACOS[2]", Trouble::OutOfDomain { function: "ACOS", value: 2.0, allowed: "from -1 to 1" }),
        ("LN[0]", Trouble::OutOfDomain { function: "LN", value: 0.0, allowed: "above 0" }),
        ("[-2**.5]", Trouble::NegativePower { base: -2.0, exponent: 0.5 }),
        ("EXP[1000]", Trouble::NotFinite),
        ("[[10**300]*[10**300]]", Trouble::NotFinite),
        ("SINH[1]", Trouble::NoArgument { function: "SIN" }),
        ("LOG[1]", Trouble::UnknownFunction),
        ("ATAN[1]", Trouble::NoSecondArgument),
        ("EXISTS[1]", Trouble::NoParameterInExists),
        ("#<width>", Trouble::Undefined { name: "width".into() }),
        ("#<_width>", Trouble::Undefined { name: "_width".into() }),
        ("#0", Trouble::NoSuchNumber { number: 0.0 }),
        ("#5603", Trouble::NoSuchNumber { number: 5603.0 }),
        ("#1.5", Trouble::NotWhole { value: 1.5 }),
        ("#<depth", Trouble::NoName),
        (&deep, Trouble::TooDeep { most: 100 }),
    ] {
        assert_eq!(check(text), Err(wanted), "{text}");
    }
}

#[test]
fn a_value_that_an_error_has_made_unknown_is_not_reported_again() {
    for text in ["#102", "[#102 + 1]", "SQRT[#102]", "##102", "[1/#102]"] {
        assert!(check(text).is_ok_and(f64::is_nan), "{text}");
    }
}

#[test]
fn the_page_of_rs274_names_each_operator_and_function() {
    let page = include_str!("../../../../docs/rs274.md");
    let operators = Operator::ALL.map(|(name, _)| name);
    let functions = Function::ALL.map(|(name, _)| name);
    for name in operators.into_iter().chain(functions) {
        let is_named = page.contains(&format!("`{name}`")) || page.contains(&format!("`{name}["));
        assert!(is_named, "{name}");
    }
}

#[test]
fn a_name_has_small_letters_and_no_blanks_however_it_is_written() {
    let table = [
        ("<depth>=", Some(("depth", 7))),
        ("<De pth>", Some(("depth", 8))),
        ("<a<b[1]@~>", Some(("a<b[1]@~", 10))),
        ("<gr\u{f6}\u{df}e>", Some(("gr\u{f6}\u{df}e", 9))),
        ("<\u{c4}>", Some(("\u{c4}", 4))),
        // LinuxCNC drops blanks and tabs alone.
        ("<d\u{a0}p>", Some(("d\u{a0}p", 6))),
        ("<\u{3000}>", Some(("\u{3000}", 5))),
        ("<>", None),
        ("< \t>", None),
        ("<depth", None),
    ];
    for (text, expected) in table {
        let found = name(text.as_bytes(), 0);
        assert_eq!(found.as_ref().map(|(name, end)| (&**name, *end)), expected, "{text}");
    }
    assert_eq!(name(b"<\xff>", 0), None, "it is no UTF-8");
}
