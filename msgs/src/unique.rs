//! Maps whose keys are all different.
//!
//! A map that is read from YAML keeps the last of two equal keys. In a tool
//! table that is another tool than its owner sees first, so it is an error, at
//! the place of the second key.

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde::{Deserialize, de::IntoDeserializer as _};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

/// Reads a map; for `#[serde(deserialize_with = "...")]`.
///
/// # Errors
/// A key stands there twice, or a key or value is not of its kind.
pub(crate) fn map<'de, D, K, V>(deserializer: D) -> Result<BTreeMap<K, V>, D::Error>
where
    D: Deserializer<'de>,
    K: Deserialize<'de> + Ord + fmt::Display,
    V: Deserialize<'de>,
{
    deserializer.deserialize_map(Entries(PhantomData))
}

struct Entries<K, V>(PhantomData<(K, V)>);

impl<'de, K, V> Visitor<'de> for Entries<K, V>
where
    K: Deserialize<'de> + Ord + fmt::Display,
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

impl<'de, K, V> DeserializeSeed<'de> for NewKey<'_, K, V>
where
    K: Deserialize<'de> + Ord + fmt::Display,
{
    type Value = K;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<K, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<K: Ord + fmt::Display, V> NewKey<'_, K, V> {
    fn checked<E: Error>(&self, key: K) -> Result<K, E> {
        if self.0.contains_key(&key) {
            return Err(E::custom(format_args!(
                "duplicate entry: {key} is written twice; delete one of them"
            )));
        }
        Ok(key)
    }
}

impl<'de, K, V> Visitor<'de> for NewKey<'_, K, V>
where
    K: Deserialize<'de> + Ord + fmt::Display,
{
    type Value = K;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_u64<E: Error>(self, key: u64) -> Result<K, E> {
        self.checked(K::deserialize(key.into_deserializer())?)
    }

    fn visit_i64<E: Error>(self, key: i64) -> Result<K, E> {
        self.checked(K::deserialize(key.into_deserializer())?)
    }

    fn visit_str<E: Error>(self, key: &str) -> Result<K, E> {
        self.checked(K::deserialize(key.into_deserializer())?)
    }
}
