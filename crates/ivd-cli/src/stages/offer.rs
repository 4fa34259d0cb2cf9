//! Which keys a command line of a stage may have flags for.

use std::ffi::OsString;

use ivd_core::op::{Method, Stage};
use ivd_pipeline::list::{self, Key};

use super::precursor;
use crate::parse::flag;

/// The keys of a stage's section that a command has flags for: those of all methods, or of the one that the words choose.
///
/// Flags are made from schemas, and most of what a short stage costs went into those of methods that nobody asked for.
#[derive(Debug, Clone)]
pub(crate) struct Offer {
    /// The stage.
    pub(crate) stage: &'static Stage,
    /// In the order of their names.
    pub(crate) keys: Vec<Key>,
    /// Whether they are those of all methods, as help needs them.
    pub(crate) is_whole: bool,
}

impl Offer {
    /// The keys of all methods.
    pub(crate) fn whole(stage: &'static Stage) -> Self {
        Self::of(stage, list::keys(stage).to_vec(), true)
    }

    /// The keys of the method that a command line of a stage chooses; `None` where it takes more than its words to know.
    pub(crate) fn chosen(words: &[OsString]) -> Option<Self> {
        let stage = named(words)?;
        Some(Self::of(stage, list::keys_of(method(stage, words)?), false))
    }

    fn of(stage: &'static Stage, mut keys: Vec<Key>, is_whole: bool) -> Self {
        keys.sort_by(|a, b| a.name.cmp(&b.name));
        Self { stage, keys, is_whole }
    }
}

/// The stage that a command line names.
pub(crate) fn named(words: &[OsString]) -> Option<&'static Stage> {
    words.iter().skip(1).find_map(|word| super::declared_as(word.to_str()?))
}

fn method(stage: &'static Stage, words: &[OsString]) -> Option<&'static Method> {
    if let [only] = stage.methods {
        return Some(only);
    }
    let selector = format!("--{}", flag(stage.selector));
    let mut chosen = words.iter().enumerate().filter_map(|(i, word)| {
        let rest = word.to_str()?.strip_prefix(&selector)?;
        if rest.is_empty() { words.get(i + 1)?.to_str() } else { rest.strip_prefix('=') }
    });
    match (chosen.next(), chosen.next()) {
        (Some(name), None) => stage.method(Some(name)),
        (Some(_), Some(_)) => None,
        (None, _) => {
            let by_file = words.iter().any(|word| word.to_string_lossy().starts_with("--params"));
            let by_slots = stage.methods.iter().any(|method| !method.without.is_empty());
            let with = |word: &OsString| {
                let given = word.to_string_lossy();
                let methods = stage.methods.iter().filter(|method| !method.with.is_empty());
                methods.into_iter().any(|method| given.starts_with(&format!("--{}", flag(method.with))))
            };
            let is_open = words.iter().any(with) || by_file || by_slots || precursor::of(stage).is_some();
            if is_open { None } else { stage.method(None) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offered(line: &str) -> Option<Vec<String>> {
        let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        Offer::chosen(&words).map(|offer| offer.keys.into_iter().map(|key| key.name).collect())
    }

    #[test]
    fn only_the_method_that_the_words_choose_is_offered() {
        let has = |line: &str, key: &str| offered(line).unwrap().iter().any(|own| own == key);
        let in_words =
            ["ivd deform l.ivd --solver projective", "ivd --json deform --solver=projective l.ivd"];
        for line in in_words {
            assert!(has(line, "inertia") && has(line, "handle"), "{line}");
        }
        assert!(!has("ivd deform l.ivd", "inertia") && has("ivd deform l.ivd", "handle"));
        let unclear = [
            "ivd deform l.ivd --params p.toml",
            "ivd deform --solver ring --solver xpbd l.ivd",
            "ivd deform --solver nothing l.ivd",
            "ivd segment v.ivd",
            "ivd demo",
        ];
        for line in unclear {
            assert_eq!(offered(line), None, "{line}");
        }
    }

    #[test]
    fn a_whole_offer_has_what_every_method_has() {
        for stage in super::super::declared() {
            let whole = Offer::whole(stage);
            for key in stage.methods.iter().flat_map(list::keys_of) {
                assert!(whole.keys.iter().any(|own| own.name == key.name), "{} {}", stage.name, key.name);
            }
        }
    }
}
