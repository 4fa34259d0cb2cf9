use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

/// A class as a key: a number, or a number in words, as it is where a map lies in something flattened or told apart by a word.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Class(u16);

impl<'de> Deserialize<'de> for Class {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Key;
        impl Visitor<'_> for Key {
            type Value = Class;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the number of a class, 0 to 65535")
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Class, E> {
                u16::try_from(number).map(Class).map_err(E::custom)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Class, E> {
                text.parse().map(Class).map_err(|_| E::invalid_value(serde::de::Unexpected::Str(text), &self))
            }
        }
        deserializer.deserialize_any(Key)
    }
}

/// Reads a map by class, wherever it lies: `#[serde(deserialize_with = "ivd_core::op::by_class")]`.
///
/// # Errors
/// A key that is no class, a class that is there twice; what its value says.
pub fn by_class<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<BTreeMap<u16, T>, D::Error> {
    struct ByClass<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for ByClass<T> {
        type Value = BTreeMap<u16, T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a table by class")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Self::Value, A::Error> {
            let mut all = BTreeMap::new();
            while let Some((Class(class), value)) = entries.next_entry()? {
                if all.insert(class, value).is_some() {
                    return Err(A::Error::custom(format!("class {class} is there twice")));
                }
            }
            Ok(all)
        }
    }
    deserializer.deserialize_map(ByClass(PhantomData))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, serde::Deserialize)]
    struct Inner {
        #[serde(default, deserialize_with = "by_class")]
        material: BTreeMap<u16, f64>,
    }

    #[derive(Debug, PartialEq, serde::Deserialize)]
    #[serde(tag = "kind", rename_all = "lowercase")]
    enum Outer {
        Plain(Inner),
        Flat {
            #[serde(flatten)]
            inner: Inner,
        },
    }

    #[test]
    fn classes_are_read_wherever_the_map_lies_and_told_apart() {
        let read = |text: &str| serde_json::from_str::<Outer>(text);
        let inner = || Inner { material: [(4, 1.0), (7, 2.5)].into() };
        let map = r#""material": { "4": 1, "7": 2.5 } }"#;
        assert_eq!(read(&format!(r#"{{ "kind": "plain", {map}"#)).unwrap(), Outer::Plain(inner()));
        assert_eq!(read(&format!(r#"{{ "kind": "flat", {map}"#)).unwrap(), Outer::Flat { inner: inner() });
        assert_eq!(serde_json::from_str::<Inner>(&format!("{{ {map}")).unwrap(), inner());
        for bad in [r#"{ "bone": 1 }"#, r#"{ "-1": 1 }"#, r#"{ "65536": 1 }"#, r#"{ "4": 1, "04": 2 }"#] {
            assert!(serde_json::from_str::<Inner>(&format!(r#"{{ "material": {bad} }}"#)).is_err(), "{bad}");
        }
    }
}
