use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// No place or length of a window is further from 0 (mm).
const FARTHEST: f64 = 1e12;
/// Most rulers.
const MOST_RULERS: usize = 64;
/// How far colours are shifted at most, in widths of their range, and widened, as a power of e.
const TURNED: [f64; 2] = [2.0, 3.0];

/// Along which slice the volume's picture is cut open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Inside {
    /// Along the axial slice.
    Axial,
    /// Along the coronal slice.
    Coronal,
    /// Along the sagittal slice.
    Sagittal,
    /// Square to the line of sight.
    Volume,
}

/// Which state of the body is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Body {
    /// As it is now.
    Now,
    /// At rest.
    Rest,
    /// At rest to the left of a line, as it is now to its right.
    Both,
}

/// What colours over slices tell of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Over {
    /// How far what is seen there has come.
    Motion,
    /// By how many times its volume has grown.
    Volume,
    /// Of which class it is.
    Classes,
}

/// A ruler: from one place to another; of three places the angle is at the second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RulerSection {
    /// Two or three places of the body at rest, RAS; they go with it.
    #[schemars(extend("x-unit" = "mm"), length(min = 2, max = 3))]
    pub places: Vec<[f64; 3]>,
}

/// `[window]`: what `ivd view` and `ivd serve` show, beside `[render]`'s camera and classes. `ivd pipeline` makes nothing of it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WindowSection {
    /// Where the slices meet, RAS; the middle of the volume where it isn't said.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub cross: Option<[f64; 3]>,
    /// Values that are black and white in slices; found in the volume where they aren't said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<[f64; 2]>,
    /// Reach of the next handle.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: Option<f64>,
    /// By how many widths of their range the volume's colours are shifted, −2 to 2, and by which power of e that is widened, −3 to 3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colours: Option<[f64; 2]>,
    /// Along which slice the volume's picture is cut open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inside: Option<Inside>,
    /// Which state of the body is shown; `now` where it isn't said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shows: Option<Body>,
    /// Where the line lies that divides pictures of both states, as a share of their width; the middle where it isn't said.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub line: Option<f64>,
    /// What colours over slices tell of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over: Option<Over>,
    /// Rulers, at most 64.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ruler: Vec<RulerSection>,
}

impl WindowSection {
    /// Refuses what no window shows.
    pub(crate) fn check(&self) -> Result<(), String> {
        let is_place = |place: &[f64; 3]| place.iter().all(|c| c.is_finite() && c.abs() <= FARTHEST);
        let wrong = |key: &str, value: String, remedy: &str| Err(format!("window.{key} = {value}: {remedy}"));
        let places = "use finite numbers up to 1e12 (mm)";
        if let Some(cross) = self.cross.filter(|cross| !is_place(cross)) {
            return wrong("cross", format!("{cross:?}"), places);
        }
        if let Some(radius) = self.radius.filter(|radius| !(*radius > 0.0 && *radius <= FARTHEST)) {
            return wrong("radius", radius.to_string(), "use a positive length up to 1e12 (mm)");
        }
        if let Some(values) = self.values.filter(|[low, high]| !((high - low).is_finite() && high > low)) {
            return wrong("values", format!("{values:?}"), "use two finite numbers, the darker first");
        }
        let is_turned = |[shift, widen]: &[f64; 2]| shift.abs() <= TURNED[0] && widen.abs() <= TURNED[1];
        if let Some(colours) = self.colours.filter(|colours| !is_turned(colours)) {
            return wrong(
                "colours",
                format!("{colours:?}"),
                "use a shift of −2 to 2 and a widening of −3 to 3",
            );
        }
        if let Some(line) = self.line.filter(|line| !(0.0..=1.0).contains(line)) {
            return wrong("line", line.to_string(), "use a share of the width, 0 to 1");
        }
        if self.ruler.len() > MOST_RULERS {
            let remedy = format!("use {MOST_RULERS} at most");
            return wrong("ruler", format!("{} of them", self.ruler.len()), &remedy);
        }
        for (i, RulerSection { places: ends }) in self.ruler.iter().enumerate() {
            let key = format!("ruler.{i}.places");
            if !ends.iter().all(is_place) {
                return wrong(&key, format!("{ends:?}"), places);
            }
            if !(2..=3).contains(&ends.len()) || ends.windows(2).any(|pair| pair[0] == pair[1]) {
                return wrong(
                    &key,
                    format!("{ends:?}"),
                    "give two or three places, each another than the one before",
                );
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{Override, parse};

    const SCENE: &str =
        "schema = 1\n[input]\nphantom = \"head\"\nsize = 32\n[output]\nreport = true\n[window]\n";

    #[test]
    fn what_no_window_shows_is_refused_by_its_key() {
        let error = |keys: &str| parse(&format!("{SCENE}{keys}\n"), &[]).unwrap_err();
        for (keys, told) in [
            ("cross = [0.0, nan, 0.0]", "window.cross"),
            ("cross = [0.0, 1e13, 0.0]", "window.cross"),
            ("line = 1.5", "window.line"),
            ("values = [3.0, 3.0]", "window.values"),
            ("values = [-1.7e308, 1.7e308]", "window.values"),
            ("radius = 0.0", "window.radius"),
            ("colours = [2.5, 0.0]", "window.colours"),
            ("colours = [nan, 0.0]", "window.colours"),
            ("[[window.ruler]]\nplaces = [[0.0, 0.0, 0.0]]", "window.ruler.0.places"),
            ("[[window.ruler]]\nplaces = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]", "window.ruler.0.places"),
            ("[[window.ruler]]\nplaces = [[1.0, 0.0, 0.0], [inf, 0.0, 0.0]]", "window.ruler.0.places"),
            ("insde = \"axial\"", "did you mean `inside`?"),
            ("over = \"classs\"", "line 8"),
        ] {
            assert!(error(keys).contains(told), "{keys}: {}", error(keys));
        }
    }

    #[test]
    fn what_is_said_of_windows_is_kept_and_can_be_set() {
        let set: Override = "window.radius=5.5".parse().unwrap();
        let scene = parse(&format!("{SCENE}inside = \"coronal\"\n"), &[set]).unwrap();
        let again = parse(&scene.to_text().unwrap(), &[]).unwrap();
        assert_eq!(again.window, scene.window);
        let said = again.window.clone().unwrap();
        assert_eq!((said.radius, said.inside), (Some(5.5), Some(super::Inside::Coronal)));
        let mut without = again.clone();
        without.set_window(super::WindowSection::default()).unwrap();
        assert!(!without.to_text().unwrap().contains("window"));
        assert_eq!(without.sections(), again.sections(), "no stage reads it");
    }
}
