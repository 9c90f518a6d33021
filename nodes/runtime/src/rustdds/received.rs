//! Takes samples out of RustDDS as bytes.
//!
//! RustDDS calls the decoder of a sample while it holds the lock of the topic's cache. A panic
//! there poisons the lock, and any peer may send any bytes. So its decoder only copies the bytes;
//! they become messages later (`endpoints`).
//! The report: docs/upstream/rustdds-decode-under-lock.md.

use crate::samples::sample::{ByteOrder, Received};
use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, SeqAccess, Visitor};

/// Takes the bytes of a sample as they are, in the decoder of ros2-client, which does not say
/// in which byte order it decodes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AsReceived;

impl AsReceived {
    /// The byte order of a deserializer of RustDDS; `None` for any other deserializer.
    fn order_of<D>() -> Option<ByteOrder> {
        let deserializer = typeid::of::<D>();
        if deserializer == typeid::of::<&mut CdrDeserializer<'_, LittleEndian>>() {
            Some(ByteOrder::Little)
        } else if deserializer == typeid::of::<&mut CdrDeserializer<'_, BigEndian>>() {
            Some(ByteOrder::Big)
        } else {
            None
        }
    }
}

impl<'de> DeserializeSeed<'de> for AsReceived {
    type Value = Received;

    fn deserialize<D: Deserializer<'de>>(self, sample: D) -> Result<Received, D::Error> {
        let order = Self::order_of::<D>()
            .ok_or_else(|| D::Error::custom("a deserializer of unknown byte order"))?;
        sample.deserialize_tuple(usize::MAX, Bytes { order })
    }
}

/// Reads the rest of a sample, whose length is not known, to its end.
struct Bytes {
    order: ByteOrder,
}

impl<'de> Visitor<'de> for Bytes {
    type Value = Received;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a message")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sample: A) -> Result<Received, A::Error> {
        let mut bytes = Vec::new();
        // CDR aligns by the position, so that words are read without gaps; the end is an error.
        while let Ok(Some(word)) = sample.next_element::<u64>() {
            bytes.extend_from_slice(&match self.order {
                ByteOrder::Little => word.to_le_bytes(),
                ByteOrder::Big => word.to_be_bytes(),
            });
        }
        while let Ok(Some(byte)) = sample.next_element::<u8>() {
            bytes.push(byte);
        }
        Ok(Received { bytes, order: self.order })
    }
}
