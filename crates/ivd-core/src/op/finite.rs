//! Looks for numbers that aren't finite, which JSON can't hold.

use std::fmt;

use serde::ser::{self, Serialize, Serializer};
use serde_json::Value as Json;

/// The field that holds a number which isn't finite, where there is one; those inside it count as it.
pub(super) fn not_finite(params: &impl Serialize) -> Option<String> {
    params.serialize(Finite).err().map(|NotFinite(field)| field.unwrap_or_default())
}

/// Walks a value and keeps nothing of it.
#[derive(Clone, Copy)]
struct Finite;

/// A number isn't finite, in this field.
#[derive(Debug)]
struct NotFinite(Option<String>);

impl NotFinite {
    fn within(self, field: &str) -> Self {
        Self(Some(self.0.map_or_else(|| field.to_owned(), |inner| format!("{field}.{inner}"))))
    }
}

impl fmt::Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not a finite number")
    }
}

impl std::error::Error for NotFinite {}

impl ser::Error for NotFinite {
    fn custom<T: fmt::Display>(_: T) -> Self {
        Self(None)
    }
}

macro_rules! nothing_in {
    ($($method:ident: $type:ty),* $(,)?) => {$(
        fn $method(self, _: $type) -> Result<(), NotFinite> {
            Ok(())
        }
    )*};
}

macro_rules! variants {
    ($($method:ident),*) => {$(
        fn $method(self, _: &'static str, _: u32, _: &'static str, _: usize) -> Result<Self, NotFinite> {
            Ok(self)
        }
    )*};
}

impl Serializer for Finite {
    type Ok = ();
    type Error = NotFinite;
    type SerializeSeq = Self;
    type SerializeTuple = Self;
    type SerializeTupleStruct = Self;
    type SerializeTupleVariant = Self;
    type SerializeMap = Self;
    type SerializeStruct = Self;
    type SerializeStructVariant = Self;

    nothing_in! {
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64, serialize_u8: u8,
        serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_char: char, serialize_str: &str, serialize_bytes: &[u8],
        serialize_unit_struct: &'static str,
    }

    fn serialize_f32(self, number: f32) -> Result<(), NotFinite> {
        self.serialize_f64(number.into())
    }

    fn serialize_f64(self, number: f64) -> Result<(), NotFinite> {
        if number.is_finite() { Ok(()) } else { Err(NotFinite(None)) }
    }

    fn serialize_none(self) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        value: &T,
    ) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Self, NotFinite> {
        Ok(self)
    }

    fn serialize_tuple(self, _: usize) -> Result<Self, NotFinite> {
        Ok(self)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Self, NotFinite> {
        Ok(self)
    }

    variants!(serialize_tuple_variant, serialize_struct_variant);

    fn serialize_map(self, _: Option<usize>) -> Result<Self, NotFinite> {
        Ok(self)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self, NotFinite> {
        Ok(self)
    }
}

macro_rules! elements {
    ($($trait:ident: $method:ident),* $(,)?) => {$(
        impl ser::$trait for Finite {
            type Ok = ();
            type Error = NotFinite;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotFinite> {
                value.serialize(*self)
            }

            fn end(self) -> Result<(), NotFinite> {
                Ok(())
            }
        }
    )*};
}
elements! {
    SerializeSeq: serialize_element, SerializeTuple: serialize_element, SerializeTupleStruct: serialize_field,
    SerializeTupleVariant: serialize_field,
}

impl ser::SerializeMap for Finite {
    type Ok = ();
    type Error = NotFinite;

    // A struct with flattened fields is a map too: its keys are names of fields.
    fn serialize_entry<K: Serialize + ?Sized, V: Serialize + ?Sized>(
        &mut self,
        key: &K,
        value: &V,
    ) -> Result<(), NotFinite> {
        value.serialize(*self).map_err(|e| match serde_json::to_value(key) {
            Ok(Json::String(name)) => e.within(&name),
            Ok(name) => e.within(&name.to_string()),
            Err(_) => e,
        })
    }

    fn serialize_key<T: Serialize + ?Sized>(&mut self, _: &T) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotFinite> {
        value.serialize(*self)
    }

    fn end(self) -> Result<(), NotFinite> {
        Ok(())
    }
}

macro_rules! named {
    ($($trait:ident),* $(,)?) => {$(
        impl ser::$trait for Finite {
            type Ok = ();
            type Error = NotFinite;

            fn serialize_field<T: Serialize + ?Sized>(&mut self, name: &'static str, value: &T) -> Result<(), NotFinite> {
                value.serialize(*self).map_err(|e| e.within(name))
            }

            fn end(self) -> Result<(), NotFinite> {
                Ok(())
            }
        }
    )*};
}
named! { SerializeStruct, SerializeStructVariant }

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[derive(serde::Serialize)]
    struct Inner {
        b: Option<f64>,
    }

    #[derive(serde::Serialize)]
    struct Outer {
        a: [f64; 2],
        #[serde(flatten)]
        inner: Inner,
        c: BTreeMap<u16, f32>,
    }

    #[test]
    fn a_number_that_is_not_finite_is_found_wherever_it_hides() {
        let outer = |a, b, c| Outer { a: [0.0, a], inner: Inner { b }, c: BTreeMap::from([(3, c)]) };
        assert_eq!(not_finite(&outer(1.0, None, 2.0)), None);
        assert_eq!(not_finite(&outer(f64::NAN, None, 2.0)).as_deref(), Some("a"));
        assert_eq!(not_finite(&outer(1.0, Some(f64::INFINITY), 2.0)).as_deref(), Some("b"));
        assert_eq!(not_finite(&outer(1.0, Some(0.0), f32::NAN)).as_deref(), Some("c.3"));
        assert_eq!(not_finite(&Inner { b: Some(f64::NAN) }).as_deref(), Some("b"));
    }
}
