use std::fmt;

use crate::hash::FieldHasher;
use crate::{ContentHash, Kind, KindCode, Provenance, canonical_json};

/// Name of a cache entry: BLAKE3 of everything that decides a stage's result.
///
/// Fields in their order: stage, its revision, output kind and the kind's version, canonical parameters, the number of
/// inputs, each input's name and content hash in the order of the names, backend class. A key is no [`std::hash::Hash`]:
/// it must be the same in every process and build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct CacheKey([u8; 32]);

impl CacheKey {
    /// The key of the output of `kind` with that provenance.
    pub fn new(kind: Kind, provenance: &Provenance) -> Self {
        let mut hasher = FieldHasher::new(*b"IVDK");
        hasher.text(&provenance.stage).number(provenance.revision.into());
        hasher.number(kind.code().into()).number(kind.version().into());
        hasher.text(&canonical_json(&provenance.params)).number(provenance.inputs.len() as u64);
        for (name, hash) in &provenance.inputs {
            hasher.text(name).raw(&hash.0);
        }
        hasher.text(&provenance.backend);
        Self(hasher.finish())
    }
}

impl fmt::Display for CacheKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        ContentHash(self.0).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn base() -> Provenance {
        Provenance::new("lattice", json!({"iso": 40.0, "close": true}))
            .with_input("volume", ContentHash([1; 32]))
            .with_input("labels", ContentHash([2; 32]))
    }

    #[test]
    fn every_ingredient_changes_the_key() {
        let key = CacheKey::new(Kind::Lattice, &base());
        let mut changed = vec![CacheKey::new(Kind::Mask, &base())];
        let mut other = |edit: &dyn Fn(&mut Provenance)| {
            let mut provenance = base();
            edit(&mut provenance);
            changed.push(CacheKey::new(Kind::Lattice, &provenance));
        };
        other(&|p| p.stage = "refine".into());
        other(&|p| p.revision = 2);
        other(&|p| p.params = json!({"iso": 41.0, "close": true}));
        other(&|p| p.params = json!({"iso": 40.0}));
        other(&|p| {
            p.inputs.insert("volume".into(), ContentHash([3; 32]));
        });
        other(&|p| {
            p.inputs.insert("mask".into(), ContentHash([1; 32]));
        });
        other(&|p| {
            // The same hashes under swapped names.
            p.inputs.insert("volume".into(), ContentHash([2; 32]));
            p.inputs.insert("labels".into(), ContentHash([1; 32]));
        });
        other(&|p| p.backend = "gpu".into());
        changed.push(key);
        changed.sort_unstable();
        changed.dedup();
        assert_eq!(changed.len(), 10);
    }

    #[test]
    fn order_of_insertion_does_not_change_the_key() {
        let swapped =
            Provenance::new("lattice", serde_json::from_str(r#"{"close":true,"iso":40.0}"#).unwrap())
                .with_input("labels", ContentHash([2; 32]))
                .with_input("volume", ContentHash([1; 32]));
        assert_eq!(CacheKey::new(Kind::Lattice, &base()), CacheKey::new(Kind::Lattice, &swapped));
    }
}
