//! Turns AeroScript calls such as `MoveLinear([X, Y], [100, 0])` into the equivalent words.
//!
//! Only calls with plain numbers and axis names: programs that compute are rejected by name.
//! Every word has the place of the text it comes from.

use super::Lexer;
use crate::block::Word;
use crate::number;
use cnc_msgs::finding::Code;

/// Words for calls that have no G code; the letter is `@`.
pub(crate) const SET_AXES: f64 = 1.0;
pub(crate) const HOME: f64 = 2.0;
pub(crate) const ROUNDING_AXES: f64 = 3.0;

/// No call has more items in an array, and no motion more axes.
const ITEMS_MAX: usize = 3;
const ARGUMENTS_MAX: usize = 4;

/// One axis or number, with its place.
#[derive(Debug, Clone, Copy)]
struct Item {
    what: ItemValue,
    start: usize,
    end: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum ItemValue {
    /// The letter of an axis.
    Axis(u8),
    Number(f64),
}

/// An argument: one item, or an array of them.
#[derive(Debug, Clone, Default)]
struct Argument {
    items: Vec<Item>,
    start: usize,
    end: usize,
}

/// What is wrong, and where.
struct Mistake {
    start: usize,
    end: usize,
    message: String,
    help: &'static str,
}

const FORM: &str = "write it like MoveLinear([X, Y], [100, 0]), with numbers only";

/// Statements of AeroScript, and words that begin or end some.
const STATEMENTS: [&str; 17] = [
    "program", "function", "var", "if", "else", "elseif", "for", "foreach", "while", "repeat",
    "switch", "break", "continue", "return", "goto", "end", "import",
];

impl Lexer<'_> {
    /// Reports `$distance = 5`, the `$` at `at`.
    #[cold]
    pub(super) fn variable(&mut self) {
        let help = "write the value of the variable where it is used";
        self.rest(Code::Unsupported, "variables are not supported", help);
    }

    /// Reads a name of several letters, from `start` on.
    #[cold]
    pub(super) fn name(&mut self, start: usize) {
        let text = self.line.text;
        let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
        let end = text[start..].iter().position(|byte| !is_part(byte));
        let end = end.map_or(text.len(), |length| start + length);
        let name = String::from_utf8_lossy(&text[start..end]).into_owned();
        if STATEMENTS.contains(&&*name) {
            let message = format!("statements of AeroScript, like `{name}`, are not supported");
            let help = "write the calls that it runs, one in each line, with numbers only";
            return self.rest(Code::Unsupported, &message, help);
        }
        let open = text[end..].iter().position(|byte| !matches!(byte, b' ' | b'\t'));
        self.at = end;
        self.covers(start);
        self.block.has_remark = true;
        if open.is_none_or(|blanks| text[end + blanks] != b'(') {
            let message = format!("`{name}` is neither a word nor a call");
            return self.unreadable(start, end, Code::UnknownWord, message, FORM);
        }
        match self.arguments(end + open.unwrap_or(0)) {
            Ok(arguments) => match self.call(&name, (start, end), &arguments) {
                Ok(()) => self.covers(start),
                Err(mistake) => {
                    self.unreadable(
                        mistake.start,
                        mistake.end,
                        Code::Syntax,
                        mistake.message,
                        mistake.help,
                    );
                }
            },
            Err(mistake) => {
                self.at = text.len();
                self.unreadable(
                    mistake.start,
                    mistake.end,
                    Code::Syntax,
                    mistake.message,
                    mistake.help,
                );
            }
        }
    }

    fn unreadable(&mut self, start: usize, end: usize, code: Code, message: String, help: &str) {
        let end_of_call = self.at;
        self.at = end.max(start + 1).min(self.line.text.len());
        self.report(code, start, message, help);
        self.at = end_of_call;
        // The position after the call is unknown.
        self.block.is_cut = true;
    }

    /// Reads the arguments from the opening parenthesis on; `at` is then after the closing one.
    fn arguments(&mut self, open: usize) -> Result<Vec<Argument>, Mistake> {
        let mut arguments = Vec::new();
        self.at = open + 1;
        loop {
            arguments.push(self.argument()?);
            if arguments.len() > ARGUMENTS_MAX {
                return Err(self.mistake(self.at, "the call has too many arguments"));
            }
            match self.next_byte() {
                Some(b',') => self.at += 1,
                Some(b')') => {
                    self.at += 1;
                    return Ok(arguments);
                }
                Some(_) => return Err(self.mistake(self.at, "a `,` or `)` is missing before this")),
                None => {
                    return Err(self.mistake(open, "the parenthesis is not closed in this line"));
                }
            }
        }
    }

    fn argument(&mut self) -> Result<Argument, Mistake> {
        let first = self.next_byte();
        let start = self.at;
        let mut items = Vec::new();
        if first != Some(b'[') {
            items.push(self.item()?);
            return Ok(Argument { items, start, end: self.at });
        }
        self.at += 1;
        loop {
            items.push(self.item()?);
            if items.len() > ITEMS_MAX {
                let last = items.last().map_or(start, |item: &Item| item.start);
                return Err(self.mistake(last, "the array is longer than this machine has axes"));
            }
            match self.next_byte() {
                Some(b',') => self.at += 1,
                Some(b']') => {
                    self.at += 1;
                    return Ok(Argument { items, start, end: self.at });
                }
                _ => return Err(self.mistake(start, "the array is not closed with ]")),
            }
        }
    }

    fn item(&mut self) -> Result<Item, Mistake> {
        let text = self.line.text;
        let first = self.next_byte();
        let start = self.at;
        match first {
            Some(letter @ (b'A'..=b'Z' | b'a'..=b'z')) => {
                let is_longer = text.get(start + 1).is_some_and(u8::is_ascii_alphanumeric);
                if is_longer || !letter.is_ascii_uppercase() {
                    return Err(self.mistake(start, "this is not the name of an axis: X, Y or Z"));
                }
                self.at = start + 1;
                Ok(Item { what: ItemValue::Axis(letter), start, end: self.at })
            }
            Some(b'0'..=b'9' | b'+' | b'-' | b'.') => match number::read(text, start, false) {
                Ok(number) => {
                    self.at = number.end;
                    if matches!(self.next_byte(), Some(b'+' | b'-' | b'*' | b'/')) {
                        return Err(self.mistake(start, "calculations are not supported"));
                    }
                    Ok(Item { what: ItemValue::Number(number.value), start, end: number.end })
                }
                Err(_) => Err(self.mistake(start, "this is not a number")),
            },
            Some(b'$') => Err(self.mistake(start, "variables are not supported")),
            _ => Err(self.mistake(start, "an axis or a number is missing here")),
        }
    }

    fn next_byte(&mut self) -> Option<u8> {
        while matches!(self.line.text.get(self.at), Some(b' ' | b'\t')) {
            self.at += 1;
        }
        self.line.text.get(self.at).copied()
    }

    fn mistake(&self, at: usize, message: &str) -> Mistake {
        Mistake { start: at, end: at + 1, message: message.into(), help: FORM }
    }

    /// The words that a call means.
    fn call(
        &mut self,
        name: &str,
        place: (usize, usize),
        arguments: &[Argument],
    ) -> Result<(), Mistake> {
        let wrong = |message: String| Mistake { start: place.0, end: place.1, message, help: FORM };
        let count = |least: usize, most: usize| {
            if (least..=most).contains(&arguments.len()) {
                Ok(())
            } else {
                Err(wrong(match (least, most) {
                    (1, 1) => format!("{name} takes one argument"),
                    _ if least == most => format!("{name} takes {least} arguments"),
                    _ => format!("{name} takes {least} or {most} arguments"),
                }))
            }
        };
        match name {
            "MoveLinear" => {
                count(2, 3)?;
                self.push(b'G', 1.0, place);
                self.ends(&arguments[0], &arguments[1])?;
                arguments.get(2).map_or(Ok(()), |speed| self.number(b'F', speed))
            }
            "MoveRapid" => {
                count(2, 2)?;
                self.push(b'G', 0.0, place);
                self.ends(&arguments[0], &arguments[1])
            }
            "MoveCw" | "MoveCcw" => {
                count(3, 4)?;
                self.push(b'G', if name == "MoveCw" { 2.0 } else { 3.0 }, place);
                self.ends(&arguments[0], &arguments[1])?;
                self.center(&arguments[0], &arguments[2])?;
                arguments.get(3).map_or(Ok(()), |speed| self.number(b'F', speed))
            }
            "CutterCompensationSetAxes" => {
                count(1, 1)?;
                self.push(b'@', SET_AXES, place);
                self.axes(&arguments[0])
            }
            "CornerRoundingSetAxes" => {
                count(1, 1)?;
                self.push(b'@', ROUNDING_AXES, place);
                self.axes(&arguments[0])
            }
            "CutterCompensationSetRadius" => {
                count(1, 1)?;
                self.push(b'G', 43.0, place);
                self.number(b'P', &arguments[0])
            }
            "Home" => {
                count(1, 1)?;
                self.push(b'@', HOME, place);
                self.axes(&arguments[0])
            }
            "Dwell" => {
                count(1, 1)?;
                self.push(b'G', 4.0, place);
                self.number(b'P', &arguments[0])
            }
            _ => Err(wrong(format!(
                "{name} is not supported; the calls are MoveLinear, MoveRapid, MoveCw, MoveCcw, \
                 Home, Dwell, CutterCompensationSetAxes and CutterCompensationSetRadius"
            ))),
        }
    }

    fn push(&mut self, letter: u8, value: f64, (start, end): (usize, usize)) {
        self.block.words.push(Word { value, start: start as u16, end: end as u16, letter });
    }

    fn axes(&mut self, axes: &Argument) -> Result<(), Mistake> {
        for item in &axes.items {
            let ItemValue::Axis(letter) = item.what else { return Err(not_an_axis(item)) };
            self.push(letter, 0.0, (item.start, item.end));
        }
        Ok(())
    }

    fn ends(&mut self, axes: &Argument, values: &Argument) -> Result<(), Mistake> {
        for (axis, value) in pairs(axes, values)? {
            let ItemValue::Axis(letter) = axis.what else { return Err(not_an_axis(&axis)) };
            let ItemValue::Number(number) = value.what else { return Err(not_a_number(&value)) };
            self.push(letter, number, (value.start, value.end));
        }
        Ok(())
    }

    /// The centre relative to the start, or one radius.
    fn center(&mut self, axes: &Argument, center: &Argument) -> Result<(), Mistake> {
        if center.items.len() == 1 && axes.items.len() > 1 {
            return self.number(b'R', center);
        }
        for (axis, value) in pairs(axes, center)? {
            let letter = match axis.what {
                ItemValue::Axis(b'X') => b'I',
                ItemValue::Axis(b'Y') => b'J',
                ItemValue::Axis(b'Z') => b'K',
                _ => return Err(not_an_axis(&axis)),
            };
            let ItemValue::Number(number) = value.what else { return Err(not_a_number(&value)) };
            self.push(letter, number, (value.start, value.end));
        }
        Ok(())
    }

    fn number(&mut self, letter: u8, argument: &Argument) -> Result<(), Mistake> {
        match argument.items[..] {
            [Item { what: ItemValue::Number(number), start, end }] => {
                self.push(letter, number, (start, end));
                Ok(())
            }
            _ => Err(Mistake {
                start: argument.start,
                end: argument.end,
                message: "one number is needed here".into(),
                help: FORM,
            }),
        }
    }
}

fn pairs(
    axes: &Argument,
    values: &Argument,
) -> Result<impl Iterator<Item = (Item, Item)>, Mistake> {
    if axes.items.len() != values.items.len() {
        return Err(Mistake {
            start: values.start,
            end: values.end,
            message: format!(
                "{} for {} axes",
                match values.items.len() {
                    1 => "1 number".into(),
                    count => format!("{count} numbers"),
                },
                axes.items.len()
            ),
            help: FORM,
        });
    }
    Ok(axes.items.clone().into_iter().zip(values.items.clone()))
}

fn not_an_axis(item: &Item) -> Mistake {
    let message = "an axis is needed here: X, Y or Z".into();
    Mistake { start: item.start, end: item.end, message, help: FORM }
}

fn not_a_number(item: &Item) -> Mistake {
    let message = "a number is needed here".into();
    Mistake { start: item.start, end: item.end, message, help: FORM }
}
