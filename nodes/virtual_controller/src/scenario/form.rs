//! How the values of a scenario are written, and their limits.

use std::fmt;
use std::str::FromStr;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use crate::axes::Vector;
use crate::fault::Fault;

/// Allowed sizes of the receive buffer, bytes.
pub(crate) const RECEIVE_BUFFER_BYTES: std::ops::RangeInclusive<usize> = 16..=65_536;
/// Allowed time factors.
pub(crate) const TIME_FACTORS: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;
/// Largest coordinate, mm.
pub(crate) const COORDINATE_MM_MAX: f64 = 1e5;

/// The text or number of one value.
enum Scalar<'a> {
    Text(&'a str),
    Number(f64),
}

/// Reads one value; an error names its place.
struct Reader<'a, T> {
    expecting: &'a str,
    read: &'a dyn Fn(Scalar<'_>) -> Result<T, String>,
}

impl<T> Reader<'_, T> {
    fn take<E: Error>(&self, scalar: Scalar<'_>) -> Result<T, E> {
        (self.read)(scalar).map_err(E::custom)
    }
}

impl<T> Visitor<'_> for Reader<'_, T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expecting)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        self.take(Scalar::Text(text))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<T, E> {
        self.take(Scalar::Number(number as f64))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<T, E> {
        self.take(Scalar::Number(number as f64))
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<T, E> {
        self.take(Scalar::Number(number))
    }
}

/// Reads a number for which `is_usable` holds.
fn number<'de, D: Deserializer<'de>>(
    from: D,
    expecting: &str,
    is_usable: &dyn Fn(f64) -> bool,
) -> Result<f64, D::Error> {
    let read = |scalar: Scalar<'_>| match scalar {
        Scalar::Number(value) if is_usable(value) => Ok(value),
        Scalar::Number(value) => Err(format!("{value} is not {expecting}")),
        Scalar::Text(text) => Err(format!("`{text}` is not {expecting}")),
    };
    from.deserialize_any(Reader { expecting, read: &read })
}

pub(super) fn by_name<'de, D, T>(from: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr<Err: fmt::Display>,
{
    let read = |scalar: Scalar<'_>| {
        let text = match scalar {
            Scalar::Text(text) => text.to_string(),
            Scalar::Number(number) => number.to_string(),
        };
        text.parse::<T>().map(Some).map_err(|error| error.to_string())
    };
    from.deserialize_any(Reader { expecting: "a name", read: &read })
}

pub(super) fn receive_buffer_bytes<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<usize>, D::Error> {
    let (least, most) = (RECEIVE_BUFFER_BYTES.start(), RECEIVE_BUFFER_BYTES.end());
    let expecting = format!("a number of bytes from {least} to {most}");
    let bytes = number(from, &expecting, &|bytes| {
        bytes.fract() == 0.0 && (*least as f64..=*most as f64).contains(&bytes)
    })?;
    Ok(Some(bytes as usize))
}

pub(super) fn time_factor<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    let expecting = format!("a factor from {} to {}", TIME_FACTORS.start(), TIME_FACTORS.end());
    number(from, &expecting, &|factor| TIME_FACTORS.contains(&factor)).map(Some)
}

/// A machine coordinate, mm.
struct Coordinate(f64);

impl<'de> Deserialize<'de> for Coordinate {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let expecting = format!("a number of millimetres within {COORDINATE_MM_MAX}");
        number(from, &expecting, &|mm| mm.abs() <= COORDINATE_MM_MAX).map(Self)
    }
}

pub(super) fn probe_z_mm<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    Coordinate::deserialize(from).map(|Coordinate(mm)| Some(mm))
}

pub(super) fn start_mm<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Vector>, D::Error> {
    <[Coordinate; 3]>::deserialize(from).map(|at| Some(at.map(|Coordinate(mm)| mm)))
}

/// The n of a setting: `110` or `$110`.
struct Number(u16);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let read = |scalar: Scalar<'_>| {
            let text = match scalar {
                Scalar::Text(text) => text.to_string(),
                Scalar::Number(number) => number.to_string(),
            };
            let number = text.strip_prefix('$').unwrap_or(&text).parse().ok();
            number
                .map(Number)
                .ok_or_else(|| format!("`{text}` is not a setting; write $110 or 110"))
        };
        let expecting = "the number of a setting, such as 110 or $110";
        from.deserialize_any(Reader { expecting, read: &read })
    }
}

/// A mapping, read in its order: `$22` must be set before `$20`.
pub(super) fn settings<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<(u16, f64)>, D::Error> {
    struct InOrder;
    impl<'de> Visitor<'de> for InOrder {
        type Value = Vec<(u16, f64)>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("settings and their values, such as $110: 5000")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut settings = Vec::new();
            while let Some((Number(number), value)) = map.next_entry()? {
                settings.push((number, value));
            }
            Ok(settings)
        }
    }
    from.deserialize_map(InOrder)
}

/// A fault written as a mapping.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mapping {
    action: String,
    seconds: Option<f64>,
    axis: Option<String>,
    number: Option<u8>,
    text: Option<String>,
    line: Option<u64>,
    byte: Option<u64>,
    time: Option<f64>,
    rate: Option<f64>,
}

/// The fault as a line of the grammar.
fn written(mapping: &Mapping) -> Result<String, String> {
    let shown = |value: Option<&dyn fmt::Display>| value.map(ToString::to_string);
    let arguments = [
        shown(mapping.seconds.as_ref().map(|value| value as _)),
        shown(mapping.axis.as_ref().map(|value| value as _)),
        shown(mapping.number.as_ref().map(|value| value as _)),
        shown(mapping.text.as_ref().map(|value| value as _)),
    ];
    let triggers = [
        ("line", shown(mapping.line.as_ref().map(|value| value as _))),
        ("byte", shown(mapping.byte.as_ref().map(|value| value as _))),
        ("time", shown(mapping.time.as_ref().map(|value| value as _))),
        ("rate", shown(mapping.rate.as_ref().map(|value| value as _))),
    ];
    let action = &mapping.action;
    let mut arguments = arguments.into_iter().flatten();
    let argument = arguments.next().map(|argument| format!(":{argument}")).unwrap_or_default();
    if arguments.next().is_some() {
        return Err(format!("`{action}` takes one of seconds, axis, number and text"));
    }
    let mut triggers = triggers.into_iter().filter_map(|(name, value)| Some((name, value?)));
    match (triggers.next(), triggers.next()) {
        (Some((name, value)), None) => Ok(format!("{action}{argument}@{name}={value}")),
        _ => Err(format!("`{action}` needs one trigger of line, byte, time and rate")),
    }
}

impl<'de> Deserialize<'de> for Fault {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct TextOrMapping;
        impl<'de> Visitor<'de> for TextOrMapping {
            type Value = Fault;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a fault: a text such as lose-ok@line=20, or a mapping")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Fault, E> {
                text.parse().map_err(E::custom)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Fault, A::Error> {
                let mapping = Mapping::deserialize(MapAccessDeserializer::new(map))?;
                let text = written(&mapping).map_err(A::Error::custom)?;
                text.parse().map_err(A::Error::custom)
            }
        }
        from.deserialize_any(TextOrMapping)
    }
}

pub(super) fn faults<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Fault>, D::Error> {
    Vec::deserialize(from)
}
