use std::collections::BTreeMap;

use ivd_core::op::by_class;
use ivd_core::{ClassLook, ParamError, TransferFunction, srgb};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// An opacity over a transfer function's reference length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(extend("x-unit" = "1"))]
pub struct Opacity(#[schemars(range(min = 0.0, max = 1.0))] pub f64);

/// A colour as `#rrggbb`, sRGB.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(extend("examples" = ["#ff8800"]))]
pub struct Colour(pub String);

impl Colour {
    /// Linear RGB; `None` for what isn't `#` with six hexadecimal digits.
    pub fn linear(&self) -> Option<[f32; 3]> {
        let digits = self.0.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii())?;
        let byte = |c: usize| u8::from_str_radix(&digits[2 * c..2 * c + 2], 16).ok();
        let rgb = [byte(0)?, byte(1)?, byte(2)?];
        // A sign is no digit, though a number may have one.
        let are_digits = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
        are_digits.then(|| rgb.map(|byte| srgb::linear(f32::from(byte) / 255.0)))
    }
}

/// How single classes are drawn, other than the transfer function says. Of the classes that it knows any can be named but transitions, which are
/// drawn as mixes of others.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ClassLooks {
    /// Opacity of single classes, over the transfer function's reference length; a class that was background is seen with it.
    #[serde(deserialize_with = "by_class")]
    pub opacity: BTreeMap<u16, Opacity>,
    /// Colour of single classes, `#rrggbb`.
    #[serde(deserialize_with = "by_class")]
    #[schemars(extend("x-alias" = ["color"]))]
    pub colour: BTreeMap<u16, Colour>,
    /// Classes that aren't drawn.
    #[schemars(extend("x-unit" = "1"))]
    pub hide: Vec<u16>,
    /// Classes that are drawn alone; all where none is named.
    #[schemars(extend("x-unit" = "1"))]
    pub show: Vec<u16>,
    /// Whether what labels leave out (label 0) is drawn as it is without labels; else it is clear.
    pub unlabelled: bool,
}

impl ClassLooks {
    /// Checks what the schema of a field can't say.
    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        if let Some((class, Colour(text))) = self.colour.iter().find(|(_, colour)| colour.linear().is_none())
        {
            let remedy = "give # and six hexadecimal digits, such as #ff8800";
            return Err(ParamError::new(format!("colour.{class}"), format!("`{text}`"), remedy));
        }
        if !self.hide.is_empty() && !self.show.is_empty() {
            return Err(ParamError::new("show", "beside hide".to_owned(), "keep one of them"));
        }
        let is_left_out = |class: &&u16| !self.show.is_empty() && !self.show.contains(class);
        if let Some(class) = self.opacity.keys().find(is_left_out) {
            let problem = format!("without class {class}, which has an opacity");
            return Err(ParamError::new("show", problem, "name it there, or drop its opacity"));
        }
        match self.hide.iter().find(|class| self.opacity.contains_key(class)) {
            Some(class) => {
                let problem = format!("class {class}, which has an opacity");
                Err(ParamError::new("hide", problem, "keep one of them"))
            }
            None => Ok(()),
        }
    }

    /// The same of one that may be there; `None` where there is none, or nothing changes it.
    pub(crate) fn changed(
        &self,
        transfer: Option<&TransferFunction>,
    ) -> Result<Option<TransferFunction>, Error> {
        transfer.filter(|_| !self.is_empty()).map(|transfer| self.of(transfer)).transpose()
    }

    /// The transfer function with these looks.
    ///
    /// # Errors
    /// [`ParamError`] names a class that the transfer function doesn't know, with those that it does; [`Error::Core`] for one by value and gradient.
    pub fn of(&self, transfer: &TransferFunction) -> Result<TransferFunction, Error> {
        let mut looks: BTreeMap<u16, ClassLook> = BTreeMap::new();
        for (class, Opacity(opacity)) in &self.opacity {
            looks.entry(*class).or_default().opacity = Some(*opacity as f32);
        }
        for class in self.hidden(transfer) {
            looks.entry(class).or_default().opacity = Some(0.0);
        }
        for (class, colour) in &self.colour {
            looks.entry(*class).or_default().rgb = colour.linear();
        }
        self.require_known(transfer)?;
        Ok(transfer.clone().with_class_looks(&looks)?)
    }

    /// Whether no class is drawn otherwise than a transfer function says.
    pub fn is_empty(&self) -> bool {
        self.opacity.is_empty() && self.colour.is_empty() && self.hide.is_empty() && self.show.is_empty()
    }

    /// Of a transfer function's classes, transitions among them, those that aren't drawn.
    pub fn hidden(&self, transfer: &TransferFunction) -> Vec<u16> {
        let all = transfer.entries().iter().map(|entry| entry.class);
        let left_out = all.filter(|class| !self.show.is_empty() && !self.show.contains(class));
        self.hide.iter().copied().chain(left_out).collect()
    }

    /// Refuses classes that a transfer function doesn't know.
    ///
    /// # Errors
    /// Names the key, with the classes that it does know.
    pub fn require_known(&self, transfer: &TransferFunction) -> Result<(), ParamError> {
        let named = self.opacity.keys().map(|class| (format!("opacity.{class}"), class));
        let named = named.chain(self.colour.keys().map(|class| (format!("colour.{class}"), class)));
        let named = named.chain(self.hide.iter().map(|class| ("hide".to_owned(), class)));
        let mut named = named.chain(self.show.iter().map(|class| ("show".to_owned(), class)));
        let known: Vec<u16> = transfer.classes_with_looks().collect();
        let Some((field, class)) = named.find(|(_, class)| !known.contains(class)) else { return Ok(()) };
        let is_transition = transfer.entries().iter().any(|entry| entry.class == *class);
        let problem = if is_transition {
            format!("class {class} is a transition, drawn as a mix of the classes on either side")
        } else {
            format!("the transfer function knows no class {class}")
        };
        let remedy = if known.is_empty() {
            "it knows no classes, as one from a file of another program; take one that `ivd atf` made of labels".to_owned()
        } else {
            let known: Vec<String> = known.iter().map(u16::to_string).collect();
            format!("give one of {}", known.join(", "))
        };
        Err(ParamError::new(field, problem, remedy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_six_digits_of_srgb() {
        let linear = |text: &str| Colour(text.to_owned()).linear();
        assert_eq!(linear("#ff0000"), Some([1.0, 0.0, 0.0]));
        assert_eq!(linear("#FF8800").unwrap()[1], srgb::linear(136.0 / 255.0));
        for bad in ["ff8800", "#ff880", "#ff88000", "#gg0000", "#+f8800", "#ää€", ""] {
            assert_eq!(linear(bad), None, "{bad}");
        }
    }

    #[test]
    fn what_does_not_go_together_is_named() {
        let looks =
            ClassLooks { opacity: [(3, Opacity(0.1))].into(), hide: vec![3], ..ClassLooks::default() };
        assert_eq!(looks.check_together().unwrap_err().field, "hide");
        let looks = ClassLooks { colour: [(4, Colour("red".to_owned()))].into(), ..ClassLooks::default() };
        assert_eq!(looks.check_together().unwrap_err().field, "colour.4");
    }
}
