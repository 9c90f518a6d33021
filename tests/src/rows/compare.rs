//! Whether what was observed is what a row expects.
//!
//! Objects are compared by the keys that are expected, lists whole, numbers
//! within a tolerance, texts exactly but for `says` and `helps`, which are parts.

use serde_json::Value;

/// What an expected number is moved by to see whether it is looked at.
const PERTURBATION: f64 = 1e-3;

/// The first difference, with its place.
pub fn matches(expected: &Value, observed: &Value, tolerance: f64) -> Result<(), String> {
    at("", expected, observed, tolerance)
}

/// Places of numbers that could be others without a difference.
pub fn lax_numbers(expected: &Value, observed: &Value, tolerance: f64) -> Vec<String> {
    let mut places = Vec::new();
    numbers(expected, &mut String::new(), &mut places);
    places.retain(|place| {
        let mut perturbed = expected.clone();
        let number = perturbed.pointer_mut(place).expect("the place was found there");
        *number = (number.as_f64().expect("it is a number") + PERTURBATION).into();
        matches(&perturbed, observed, tolerance).is_ok()
    });
    places
}

/// How many numbers a row expects.
pub fn count_numbers(expected: &Value) -> usize {
    let mut places = Vec::new();
    numbers(expected, &mut String::new(), &mut places);
    places.len()
}

fn numbers(value: &Value, place: &mut String, found: &mut Vec<String>) {
    let length = place.len();
    match value {
        Value::Number(_) => found.push(place.clone()),
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                *place += &format!("/{index}");
                numbers(item, place, found);
                place.truncate(length);
            }
        }
        Value::Object(keys) => {
            for (key, item) in keys {
                *place += &format!("/{key}");
                numbers(item, place, found);
                place.truncate(length);
            }
        }
        _ => {}
    }
}

fn at(place: &str, expected: &Value, observed: &Value, tolerance: f64) -> Result<(), String> {
    let differs = || Err(format!("{place}: {expected} is expected, and it is {observed}"));
    match (expected, observed) {
        (Value::Object(keys), Value::Object(have)) => {
            keys.iter().try_for_each(|(key, value)| match have.get(key) {
                Some(other) => at(&format!("{place}/{key}"), value, other, tolerance),
                None if key == "says" || key == "helps" => {
                    let whole = if key == "says" { "message" } else { "help" };
                    contains(place, value, have.get(whole).unwrap_or(&Value::Null))
                }
                None => Err(format!("{place}: there is no {key} in {observed}")),
            })
        }
        (Value::Array(items), Value::Array(have)) => {
            if items.len() != have.len() {
                let have: Vec<String> = have.iter().map(brief).collect();
                return Err(format!(
                    "{place}: {} are expected, and there are {}:\n  {}",
                    items.len(),
                    have.len(),
                    have.join("\n  ")
                ));
            }
            (items.iter().zip(have).enumerate()).try_for_each(|(index, (item, other))| {
                at(&format!("{place}/{index}"), item, other, tolerance)
                    .map_err(|error| format!("{error}\n  in {}", brief(other)))
            })
        }
        (Value::Number(number), Value::Number(other)) => {
            let pair = number.as_f64().zip(other.as_f64());
            match pair {
                // NaN is equal to nothing.
                Some((a, b)) if (a - b).abs() <= tolerance => Ok(()),
                _ => differs(),
            }
        }
        _ if expected == observed => Ok(()),
        _ => differs(),
    }
}

fn contains(place: &str, part: &Value, whole: &Value) -> Result<(), String> {
    match (part.as_str(), whole.as_str()) {
        (Some(part), Some(whole)) if !part.is_empty() && whole.contains(part) => Ok(()),
        _ => Err(format!("{place}: {part} is not in {whole}")),
    }
}

fn brief(value: &Value) -> String {
    let text = value.to_string();
    if text.len() > 400 {
        format!("{}...", text.chars().take(400).collect::<String>())
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_not_compared_is_reported() {
        let expected = json!({"a": [1.0, {"b": 2.0}], "says": "five"});
        let observed = json!({"a": [1.0, {"b": 2.0, "c": 3.0}], "message": "it is five"});
        assert_eq!(matches(&expected, &observed, 1e-6), Ok(()));
        assert_eq!(lax_numbers(&expected, &observed, 1e-6), Vec::<String>::new());
        assert_eq!(lax_numbers(&expected, &observed, 1e-2), ["/a/0", "/a/1/b"]);
        assert_eq!(count_numbers(&expected), 2);
    }

    #[test]
    fn differences_say_where() {
        let observed = json!({"a": [{"b": 2.5}], "message": "six"});
        for (expected, place) in [
            (json!({"a": [{"b": 2.0}]}), "/a/0/b: 2.0"),
            (json!({"a": []}), "/a: 0 are expected, and there are 1"),
            (json!({"c": 1}), "there is no c"),
            (json!({"says": "five"}), "\"five\" is not in \"six\""),
        ] {
            let error = matches(&expected, &observed, 1e-6).unwrap_err();
            assert!(error.contains(place), "{error}");
        }
    }
}
