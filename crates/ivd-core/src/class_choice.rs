use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Class, Error, Labels, ParamError, counted};

/// A class of labels: an id, or what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "Written", into = "Written")]
pub enum ClassChoice {
    /// The class of this id.
    Id(u16),
    /// The class of the highest mean.
    Densest,
    /// The class of the most voxels, the one of the lowest mean (air) apart.
    Largest,
}

/// How a choice is written: a number, or a word.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
enum Written {
    /// The id of a class.
    Id(u16),
    /// A class by what it is.
    Word(Word),
}

/// A class by what it is.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Word {
    /// The class of the highest mean.
    Densest,
    /// The class of the most voxels, the one of the lowest mean (air) apart.
    Largest,
}

impl From<Written> for ClassChoice {
    fn from(written: Written) -> Self {
        match written {
            Written::Id(id) => Self::Id(id),
            Written::Word(Word::Densest) => Self::Densest,
            Written::Word(Word::Largest) => Self::Largest,
        }
    }
}

impl From<ClassChoice> for Written {
    fn from(choice: ClassChoice) -> Self {
        match choice {
            ClassChoice::Id(id) => Self::Id(id),
            ClassChoice::Densest => Self::Word(Word::Densest),
            ClassChoice::Largest => Self::Word(Word::Largest),
        }
    }
}

impl Labels {
    /// The listed class that a choice means, the same one for whoever asks.
    ///
    /// Of two of the highest mean it is the one of the higher id, of two of the most voxels the one of the lower.
    ///
    /// # Errors
    /// [`Error::NoSuchClass`] for an id that isn't listed; a parameter error where no class holds a voxel.
    pub fn choose(&self, choice: ClassChoice) -> Result<&Class, Error> {
        match choice {
            ClassChoice::Id(id) => self.class(id).ok_or_else(|| self.no_such_class(id)),
            ClassChoice::Densest => self.densest(),
            ClassChoice::Largest => self.largest(),
        }
    }

    fn densest(&self) -> Result<&Class, Error> {
        let occupied = self.classes().iter().filter(|c| c.voxels > 0);
        occupied.max_by(|a, b| a.mean.total_cmp(&b.mean).then(a.id.cmp(&b.id))).ok_or_else(no_classes)
    }

    fn largest(&self) -> Result<&Class, Error> {
        let occupied = || self.classes().iter().filter(|c| c.voxels > 0);
        let air = occupied()
            .min_by(|a, b| a.mean.total_cmp(&b.mean).then(a.id.cmp(&b.id)))
            .ok_or_else(no_classes)?;
        let others = occupied().filter(|c| c.id != air.id);
        Ok(others.max_by_key(|c| (c.voxels, std::cmp::Reverse(c.id))).unwrap_or(air))
    }

    /// An id that no voxel has, with the classes that there are.
    pub fn no_such_class(&self, id: u16) -> Error {
        let each = self
            .classes()
            .iter()
            .map(|c| format!("{} (mean {:.4}, {})", c.id, c.mean, counted(c.voxels, "voxel", "voxels")));
        let list = each.collect::<Vec<_>>().join(", ");
        Error::NoSuchClass { id, known: if list.is_empty() { "no class".into() } else { list } }
    }
}

fn no_classes() -> Error {
    let remedy = "segment a volume that holds data, or give an id";
    ParamError::new("class", "the labels list no class with voxels", remedy).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_as_they_are_written() {
        for (choice, written) in [
            (ClassChoice::Id(7), "7"),
            (ClassChoice::Densest, "\"densest\""),
            (ClassChoice::Largest, "\"largest\""),
        ] {
            assert_eq!(serde_json::to_string(&choice).unwrap(), written);
            assert_eq!(serde_json::from_str::<ClassChoice>(written).unwrap(), choice);
        }
        assert!(serde_json::from_str::<ClassChoice>("\"heaviest\"").is_err());
    }
}
