//! The form of values in CDR.
//!
//! A field is aligned to its size, counted from the beginning of the body; a text and a sequence
//! have their length before them. Each message has its form once, here in this crate: reading and
//! writing know the byte order at run time, so that no code is made twice for it.

use std::mem::size_of;

/// A sequence that announces many elements gets memory for so many bytes of them at first.
const MEMORY_AT_FIRST: usize = 1 << 16;

/// Why bytes are not a value of a type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Broken {
    #[error("unexpected end of input")]
    Ended,
    #[error("expected 0 or 1 as Boolean, got: {0}")]
    Bool(u8),
    #[error("UTF-8 error: {0}")]
    Text(std::str::Utf8Error),
}

/// A value with a form in CDR. [`cdr_struct`](crate::cdr_struct) implements it for structs.
pub trait Cdr: Sized {
    /// Appends the value.
    fn write(&self, out: &mut Writer);

    /// Takes a value.
    ///
    /// # Errors
    /// The bytes are not one.
    fn read(from: &mut Reader<'_>) -> Result<Self, Broken>;

    /// Appends each of these.
    fn write_each(values: &[Self], out: &mut Writer) {
        for value in values {
            value.write(out);
        }
    }

    /// Takes so many values.
    ///
    /// # Errors
    /// The bytes are not these.
    fn read_each(count: usize, from: &mut Reader<'_>) -> Result<Vec<Self>, Broken> {
        let at_first = MEMORY_AT_FIRST / size_of::<Self>().max(1);
        let mut values = Vec::with_capacity(count.min(at_first));
        for _ in 0..count {
            values.push(Self::read(from)?);
        }
        Ok(values)
    }
}

/// Makes a body, little-endian.
#[derive(Debug, Default)]
pub struct Writer {
    bytes: Vec<u8>,
    /// Where the body begins; before it is what alignment does not count.
    begin: usize,
}

impl Writer {
    /// A body that follows these bytes.
    pub fn after(bytes: Vec<u8>) -> Self {
        let begin = bytes.len();
        Self { bytes, begin }
    }

    /// What was written.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    #[inline]
    fn put<const BYTES: usize>(&mut self, number: [u8; BYTES]) {
        let padding = (self.bytes.len() - self.begin).wrapping_neg() % BYTES;
        self.bytes.extend_from_slice(&[0; 8][..padding]);
        self.bytes.extend_from_slice(&number);
    }

    fn put_length(&mut self, length: usize) {
        let length = u32::try_from(length).expect("no message has four thousand million elements");
        self.put(length.to_le_bytes());
    }
}

/// Takes a body apart, of either byte order.
#[derive(Debug)]
pub struct Reader<'a> {
    body: &'a [u8],
    at: usize,
    is_big_endian: bool,
}

impl<'a> Reader<'a> {
    pub fn new(body: &'a [u8], is_big_endian: bool) -> Self {
        Self { body, at: 0, is_big_endian }
    }

    /// The bytes after what was taken.
    pub fn left(&self) -> usize {
        self.body.len() - self.at
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Broken> {
        let taken = self.body[self.at..].get(..count).ok_or(Broken::Ended)?;
        self.at += count;
        Ok(taken)
    }

    /// The bytes of a number, little-endian.
    #[inline]
    fn number<const BYTES: usize>(&mut self) -> Result<[u8; BYTES], Broken> {
        let begin = self.at.next_multiple_of(BYTES);
        let rest = self.body.get(begin..).ok_or(Broken::Ended)?;
        let mut number = *rest.first_chunk::<BYTES>().ok_or(Broken::Ended)?;
        self.at = begin + BYTES;
        if self.is_big_endian {
            number.reverse();
        }
        Ok(number)
    }

    fn length(&mut self) -> Result<usize, Broken> {
        let length = u32::from_le_bytes(self.number()?);
        usize::try_from(length).map_err(|_| Broken::Ended)
    }
}

macro_rules! numbers {
    ($($number:ty),*) => { $(
        impl Cdr for $number {
            #[inline]
            fn write(&self, out: &mut Writer) {
                out.put(self.to_le_bytes());
            }

            #[inline]
            fn read(from: &mut Reader<'_>) -> Result<Self, Broken> {
                from.number().map(Self::from_le_bytes)
            }
        }
    )* };
}

numbers!(i8, i16, u16, i32, u32, i64, u64, f32, f64);

impl Cdr for u8 {
    #[inline]
    fn write(&self, out: &mut Writer) {
        out.bytes.push(*self);
    }

    #[inline]
    fn read(from: &mut Reader<'_>) -> Result<Self, Broken> {
        from.number().map(|[byte]| byte)
    }

    fn write_each(bytes: &[Self], out: &mut Writer) {
        out.bytes.extend_from_slice(bytes);
    }

    fn read_each(count: usize, from: &mut Reader<'_>) -> Result<Vec<Self>, Broken> {
        from.take(count).map(<[u8]>::to_vec)
    }
}

impl Cdr for bool {
    fn write(&self, out: &mut Writer) {
        u8::from(*self).write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, Broken> {
        match u8::read(from)? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(Broken::Bool(other)),
        }
    }
}

impl Cdr for String {
    fn write(&self, out: &mut Writer) {
        out.put_length(self.len() + 1);
        out.bytes.extend_from_slice(self.as_bytes());
        out.bytes.push(0);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, Broken> {
        let length = from.length()?;
        // Some writers send an empty text without the zero that ends it.
        let text = from.take(length)?.split_last().map_or(&[][..], |(_zero, text)| text);
        std::str::from_utf8(text).map(str::to_owned).map_err(Broken::Text)
    }
}

impl<T: Cdr> Cdr for Vec<T> {
    fn write(&self, out: &mut Writer) {
        out.put_length(self.len());
        T::write_each(self, out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, Broken> {
        let count = from.length()?;
        T::read_each(count, from)
    }
}

impl<T: Cdr + Default, const COUNT: usize> Cdr for [T; COUNT] {
    fn write(&self, out: &mut Writer) {
        T::write_each(self, out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, Broken> {
        let mut values = std::array::from_fn(|_| T::default());
        for value in &mut values {
            *value = T::read(from)?;
        }
        Ok(values)
    }
}

/// Implements [`Cdr`](crate::cdr::Cdr) for a struct: its fields, in the order in which they are
/// named here.
#[macro_export]
macro_rules! cdr_struct {
    ($name:ident $(<$of:ident>)? { $($field:ident),* $(,)? }) => {
        impl $(<$of: $crate::cdr::Cdr>)? $crate::cdr::Cdr for $name $(<$of>)? {
            fn write(&self, out: &mut $crate::cdr::Writer) {
                $( $crate::cdr::Cdr::write(&self.$field, out); )*
            }

            fn read(from: &mut $crate::cdr::Reader<'_>) -> Result<Self, $crate::cdr::Broken> {
                Ok(Self { $( $field: $crate::cdr::Cdr::read(from)?, )* })
            }
        }
    };
}
