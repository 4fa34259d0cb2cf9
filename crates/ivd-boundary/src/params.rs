use std::fmt;
use std::str::FromStr;

use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// Which class a part is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Id(u16),
    Word(Word),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    Densest,
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

impl FromStr for ClassChoice {
    type Err = ParamError;
    fn from_str(text: &str) -> Result<Self, ParamError> {
        match text {
            "densest" => Ok(Self::Densest),
            "largest" => Ok(Self::Largest),
            _ => text.parse().map(Self::Id).map_err(|_| {
                ParamError::new("class", format!("`{text}` is no class"), "use an id, `densest` or `largest`")
            }),
        }
    }
}

impl fmt::Display for ClassChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Id(id) => write!(f, "{id}"),
            Self::Densest => f.write_str("densest"),
            Self::Largest => f.write_str("largest"),
        }
    }
}

/// Which part is isolated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// The class, where labels are given; `None`: the class at the seed, or without a seed the largest.
    pub class: Option<ClassChoice>,
    /// A point [mm, world RAS] in the piece to keep; `None`: the piece of the most voxels.
    pub seed: Option<[f64; 3]>,
    /// Whether background that the piece encloses becomes part of it (voxels without data stay out).
    pub fill_holes: bool,
    /// Isolate what is at or above this value [real units] instead of a class.
    pub above: Option<f64>,
}

impl Default for Params {
    fn default() -> Self {
        Self { class: None, seed: None, fill_holes: true, above: None }
    }
}

impl Params {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        if let Some(seed) = self.seed
            && !seed.iter().all(|c| c.is_finite())
        {
            return Err(ParamError::new(
                "seed",
                format!("{seed:?} is not finite"),
                "give three numbers in mm",
            ));
        }
        match self.above {
            Some(above) if !above.is_finite() => {
                Err(ParamError::new("above", format!("{above} is not finite"), "give a value of the volume"))
            }
            Some(_) if self.class.is_some() => {
                Err(ParamError::new("above", "given together with a class", "give one of the two"))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_as_they_are_written() {
        for choice in [ClassChoice::Id(7), ClassChoice::Densest, ClassChoice::Largest] {
            assert_eq!(choice.to_string().parse::<ClassChoice>().unwrap(), choice);
        }
        assert!("heaviest".parse::<ClassChoice>().unwrap_err().to_string().contains("`heaviest`"));
    }

    #[test]
    fn params_out_of_their_domain_name_the_field() {
        let field = |params: Params| params.check().unwrap_err().field;
        assert_eq!(field(Params { seed: Some([0.0, f64::NAN, 0.0]), ..Params::default() }), "seed");
        assert_eq!(field(Params { above: Some(f64::INFINITY), ..Params::default() }), "above");
        let both = Params { above: Some(1.0), class: Some(ClassChoice::Densest), ..Params::default() };
        assert_eq!(field(both), "above");
    }
}
