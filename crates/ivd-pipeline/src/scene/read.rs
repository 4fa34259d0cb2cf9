//! The keys of a scene: its own, and a section for every stage of the list.

use std::fmt;
use std::sync::LazyLock;

use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, MapAccess, Visitor};

use super::Scene;
use super::stage_sections::Written;
use crate::list::STAGES;

const OWN: [&str; 4] = ["schema", "input", "output", "window"];
static KEYS: LazyLock<Vec<&str>> =
    LazyLock::new(|| OWN.into_iter().chain(STAGES.iter().map(|stage| stage.name)).collect());

/// A key that a scene may have.
struct Key(&'static str);

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(keys: D) -> Result<Self, D::Error> {
        struct Known;
        impl Visitor<'_> for Known {
            type Value = Key;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a key of a scene")
            }

            fn visit_str<E: Error>(self, key: &str) -> Result<Key, E> {
                let known = KEYS.iter().find(|known| **known == key);
                known.map(|known| Key(known)).ok_or_else(|| E::unknown_field(key, &KEYS))
            }
        }
        keys.deserialize_identifier(Known)
    }
}

impl<'de> Deserialize<'de> for Scene {
    /// Reads what is no stage's; sections of stages are read by their declarations.
    fn deserialize<D: Deserializer<'de>>(scene: D) -> Result<Self, D::Error> {
        struct Own;
        impl<'de> Visitor<'de> for Own {
            type Value = Scene;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("struct Scene")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Scene, A::Error> {
                let (mut schema, mut input, mut output, mut window) = (None, None, None, None);
                while let Some(Key(key)) = map.next_key()? {
                    match key {
                        "schema" => schema = Some(map.next_value()?),
                        "input" => input = Some(map.next_value()?),
                        "output" => output = Some(map.next_value()?),
                        "window" => window = Some(map.next_value()?),
                        _ => {
                            map.next_value::<IgnoredAny>()?;
                        }
                    }
                }
                let missing = A::Error::missing_field;
                Ok(Scene {
                    schema: schema.ok_or_else(|| missing("schema"))?,
                    input: input.ok_or_else(|| missing("input"))?,
                    output: output.ok_or_else(|| missing("output"))?,
                    window,
                    written: Written::new(),
                    sections: Vec::new(),
                })
            }
        }
        scene.deserialize_map(Own)
    }
}
