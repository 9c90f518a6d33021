//! Writes JSON for people and scripts, piece by piece: memory does not grow with the text.
//!
//! Indented by two spaces, as `serde_json` does it. Characters that control a terminal are escaped
//! as everywhere else, see [`intake::text`].

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::Formatter;
use std::io::{self, BufWriter, Write};

/// Bytes that are collected before they are written.
const BUFFER_BYTES: usize = 64 << 10;

/// Prints a value and a line feed on standard output.
///
/// # Errors
/// A full disk cuts the text off. A reader that has exited wants no more, which is none.
pub fn print(value: &impl Serialize) -> io::Result<()> {
    match write(io::stdout().lock(), value) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

fn write(to: impl Write, value: &impl Serialize) -> io::Result<()> {
    let mut to = BufWriter::with_capacity(BUFFER_BYTES, to);
    let written = value
        .serialize(&mut Serializer::with_formatter(&mut to, Indented::default()))
        .map_err(io::Error::from)
        .and_then(|()| to.write_all(b"\n"))
        .and_then(|()| to.flush());
    if written.is_err() {
        // Dropping the buffer would try again.
        drop(to.into_parts());
    }
    written
}

/// Puts each value of a list or an object on a line of its own, with one call of the writer.
#[derive(Debug, Default)]
struct Indented {
    depth: usize,
    /// Whether the innermost list or object has a value already.
    has_value: bool,
}

/// A comma, a line feed, and the indentation of the deepest level that is written with one call.
const SEPARATOR: &[u8] = b",\n                        ";

impl Indented {
    fn begin<W: Write + ?Sized>(&mut self, to: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth += 1;
        self.has_value = false;
        to.write_all(bracket)
    }

    fn end<W: Write + ?Sized>(&mut self, to: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth -= 1;
        if self.has_value {
            self.new_line(to, true)?;
        }
        to.write_all(bracket)
    }

    fn new_line<W: Write + ?Sized>(&self, to: &mut W, is_first: bool) -> io::Result<()> {
        let end = 2 + 2 * self.depth;
        to.write_all(&SEPARATOR[usize::from(is_first)..end.min(SEPARATOR.len())])?;
        (SEPARATOR.len()..end).try_for_each(|_| to.write_all(b" "))
    }
}

impl Formatter for Indented {
    fn begin_array<W: Write + ?Sized>(&mut self, to: &mut W) -> io::Result<()> {
        self.begin(to, b"[")
    }

    fn end_array<W: Write + ?Sized>(&mut self, to: &mut W) -> io::Result<()> {
        self.end(to, b"]")
    }

    fn begin_array_value<W: Write + ?Sized>(&mut self, to: &mut W, first: bool) -> io::Result<()> {
        self.new_line(to, first)
    }

    fn end_array_value<W: Write + ?Sized>(&mut self, _: &mut W) -> io::Result<()> {
        self.has_value = true;
        Ok(())
    }

    fn begin_object<W: Write + ?Sized>(&mut self, to: &mut W) -> io::Result<()> {
        self.begin(to, b"{")
    }

    fn end_object<W: Write + ?Sized>(&mut self, to: &mut W) -> io::Result<()> {
        self.end(to, b"}")
    }

    fn begin_object_key<W: Write + ?Sized>(&mut self, to: &mut W, first: bool) -> io::Result<()> {
        self.new_line(to, first)
    }

    fn begin_object_value<W: Write + ?Sized>(&mut self, to: &mut W) -> io::Result<()> {
        to.write_all(b": ")
    }

    fn end_object_value<W: Write + ?Sized>(&mut self, _: &mut W) -> io::Result<()> {
        self.has_value = true;
        Ok(())
    }

    fn write_string_fragment<W: Write + ?Sized>(
        &mut self,
        to: &mut W,
        part: &str,
    ) -> io::Result<()> {
        to.write_all(intake::text::one_line(part).as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// What arrives, and in how many calls.
    #[derive(Default)]
    struct Calls {
        text: Vec<u8>,
        count: usize,
    }

    impl Write for Calls {
        fn write(&mut self, part: &[u8]) -> io::Result<usize> {
            self.count += 1;
            self.text.extend(part);
            Ok(part.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn written(value: &impl Serialize) -> Calls {
        let mut calls = Calls::default();
        write(&mut calls, value).expect("memory takes everything");
        calls
    }

    #[test]
    fn it_is_indented_like_json_elsewhere() {
        let deep = (0..20).fold(json!(1), |value, _| json!([{ "a": value }, 2]));
        for value in [
            json!(null),
            json!([]),
            json!({}),
            json!({ "a": [], "b": {}, "c": [[], [1, -2.5e-9], {}], "d": { "e": null } }),
            json!(["\" \\ \n \t \u{1f} / é 部"]),
            deep,
        ] {
            let text = String::from_utf8(written(&value).text).expect("UTF-8");
            assert_eq!(text, format!("{value:#}\n"));
        }
    }

    #[test]
    fn what_steers_a_terminal_is_escaped() {
        let value = json!({ "a\u{9b}": "\u{7f}\u{202e}\r\n\t\u{1b}[2J" });
        let text = String::from_utf8(written(&value).text).expect("UTF-8");
        assert_eq!(text, intake::text::lines(&format!("{value:#}\n")));
        assert!(text.contains("\\u009b"), "{text}");
        assert_eq!(serde_json::from_str::<Value>(&text).expect("JSON"), value);
    }

    #[test]
    fn a_long_list_takes_few_calls() {
        let calls = written(&vec![[1, 20, 300]; 100_000]);
        let most = calls.text.len() / (BUFFER_BYTES - 256) + 2;
        assert!(calls.count <= most, "{} calls, at most {most} wanted", calls.count);
    }

    #[test]
    fn a_reader_that_exits_ends_it() {
        struct Closed(usize);
        impl Write for Closed {
            fn write(&mut self, part: &[u8]) -> io::Result<usize> {
                self.0 += 1;
                assert_eq!(self.0, 1, "nothing is written after the first refusal");
                let _ = part;
                Err(io::ErrorKind::BrokenPipe.into())
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let error = write(Closed(0), &vec![7; 1_000_000]).expect_err("nobody reads it");
        assert_eq!(error.kind(), io::ErrorKind::BrokenPipe);
    }
}
