//! Maps whose keys are all different.
//!
//! A map that is read from YAML keeps the last of two equal keys. In a tool
//! table that is not the tool that its owner sees first. So it is an error, at
//! the place of the second key.

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Unexpected, Visitor};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

/// What a map can be sorted by.
pub(crate) trait Key: FromStr + Ord + fmt::Display {
    /// What a reader expects, for error messages.
    const EXPECTED: &'static str;
}

impl Key for u32 {
    const EXPECTED: &'static str = "a whole number";
}

impl Key for String {
    const EXPECTED: &'static str = "a word";
}

/// Reads a map; for `#[serde(deserialize_with = "...")]`.
///
/// # Errors
/// A key is there twice, or a key or value has the wrong type.
pub(crate) fn map<'de, D, K, V>(deserializer: D) -> Result<BTreeMap<K, V>, D::Error>
where
    D: Deserializer<'de>,
    K: Key,
    V: Deserialize<'de>,
{
    deserializer.deserialize_map(Entries(PhantomData))
}

struct Entries<K, V>(PhantomData<(K, V)>);

impl<'de, K, V> Visitor<'de> for Entries<K, V>
where
    K: Key,
    V: Deserialize<'de>,
{
    type Value = BTreeMap<K, V>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map")
    }

    /// Nothing after the colon.
    fn visit_unit<E: Error>(self) -> Result<Self::Value, E> {
        Ok(BTreeMap::new())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Self::Value, A::Error> {
        let mut entries = BTreeMap::new();
        while let Some(key) = access.next_key_seed(NewKey(&entries))? {
            let value = access.next_value()?;
            entries.insert(key, value);
        }
        Ok(entries)
    }
}

/// A key that is not in the map yet. It is compared while it is read, so that
/// the error has its place and not that of the map.
struct NewKey<'a, K, V>(&'a BTreeMap<K, V>);

impl<'de, K: Key, V> DeserializeSeed<'de> for NewKey<'_, K, V> {
    type Value = K;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<K, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<K: Key, V> Visitor<'_> for NewKey<'_, K, V> {
    type Value = K;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(K::EXPECTED)
    }

    fn visit_u64<E: Error>(self, key: u64) -> Result<K, E> {
        self.visit_str(&key.to_string())
    }

    fn visit_i64<E: Error>(self, key: i64) -> Result<K, E> {
        self.visit_str(&key.to_string())
    }

    /// All keys of JSON are texts.
    fn visit_str<E: Error>(self, key: &str) -> Result<K, E> {
        let Ok(key) = key.parse::<K>() else {
            return Err(E::invalid_value(Unexpected::Str(key), &self));
        };
        if self.0.contains_key(&key) {
            return Err(E::custom(format_args!(
                "duplicate entry: {key} is written twice; delete one of them"
            )));
        }
        Ok(key)
    }
}
