//! What the body is made of, and the same scan made otherwise.

use egui::{CollapsingHeader, ComboBox, Key, TextEdit, Ui};
use ivd_frames::{Figures, Made, Source, in_few_digits};
use ivd_pipeline::scene::Override;

use crate::again::Making;
use crate::received::Way;
use crate::window::Window;

/// What a value of the surface does to what was found by itself.
const CLASSES_GO: &str =
    "With a value that is said no classes are looked for: their colours and stiffness go.";

/// What the value of the surface is.
const VALUE: &str = "The surface lies where the scan's values pass this one, given or found";
/// What pieces are.
const PIECES: &str = "A surface that is found by values often has specks of noise beside the body: those that enclose less are left out of it";
/// What is made as before.
const AS_BEFORE: &str = "The surface that there was before this one, with all that was done since";

/// What is wanted otherwise, as it is typed and chosen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wish {
    iso: String,
    part: Option<String>,
    min_part: String,
}

impl Wish {
    /// As it is.
    fn of(made: &Made) -> Self {
        let above = made.between[0].filter(|_| made.is_above() && !made.is_body);
        let min_part = if made.min_part > 0.0 { made.min_part.to_string() } else { String::new() };
        // One that was found has more digits than a field has room for.
        let above = above.map(|above| in_few_digits(above).to_string());
        let iso = made.iso.map(|iso| iso.to_string()).or(above).unwrap_or_default();
        Self { iso, part: made.part.clone(), min_part }
    }

    /// The key of the surface's value: of what is all from a value on, that one, and classes stay.
    fn value_key(&self, made: &Made) -> &'static str {
        let is_above = made.is_above() && self.part == made.part;
        if is_above { "boundary.above" } else { "lattice.iso" }
    }

    /// The same source with what differs.
    fn source(&self, made: &Made, source: &Source) -> Result<Source, String> {
        let mut source = source.clone();
        let is = Self::of(made);
        for (key, now, was) in [
            (self.value_key(made), Some(&self.iso), Some(&is.iso)),
            ("boundary.class", self.part.as_ref(), is.part.as_ref()),
            ("lattice.min_part", Some(&self.min_part), Some(&is.min_part)),
        ] {
            if now == was {
                continue;
            }
            let is_part = key == "boundary.class";
            let path = |one: &Override| one.path.join(".");
            source.overrides.retain(|one| path(one) != key && !(is_part && path(one) == "boundary.above"));
            if let Some(value) = now.map(|value| value.trim()).filter(|value| !value.is_empty()) {
                source.overrides.push(format!("{key}={value}").parse()?);
                // A scene that says from which value on it is all isn't asked for a class as well.
                if is_part && made.is_above() && !made.is_body {
                    source.overrides.push("boundary.above=".parse()?);
                }
            }
        }
        Ok(source)
    }
}

impl Window {
    /// Shows what the body is made of.
    pub(crate) fn made_of(&mut self, ui: &mut Ui, figures: &Figures) {
        CollapsingHeader::new("Which surface was found").show(ui, |ui| {
            let made = &figures.made;
            let is = Wish::of(made);
            let mut wish = self.wish.take().unwrap_or_else(|| is.clone());
            let mut is_entered = false;
            let mut field = |ui: &mut Ui, text: &mut String, hint: &str, [name, label, about]: [&str; 3]| {
                ui.horizontal(|ui| {
                    let field = ui.add(TextEdit::singleline(text).hint_text(hint).desired_width(110.0));
                    let field = field.accessible_name(name).on_hover_text(about);
                    ui.label(label).on_hover_text(about);
                    is_entered |= field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
                });
            };
            field(ui, &mut wish.iso, &found(made), ["Value of the surface", "value of the surface", VALUE]);
            field(ui, &mut wish.min_part, "none", ["Smallest piece, mm³", "smallest piece (mm³)", PIECES]);
            let is_iso = made.iso.is_none() && wish.value_key(made) == "lattice.iso" && wish.iso != is.iso;
            let loses_classes = is_iso && !wish.iso.trim().is_empty() && !figures.classes.is_empty();
            part(ui, figures, &mut wish.part);
            let differs = wish != is;
            // How the session was opened that an older log goes on from isn't known.
            let is_last = self.work.as_ref().is_some_and(|work| work.is_last);
            let again = ui.add_enabled(differs && !is_last, egui::Button::new("Make again"));
            let why_not =
                "The log that this went on from doesn't say how it was opened: save the scene, and open that";
            let again = if is_last { again.on_disabled_hover_text(why_not) } else { again };
            let again =
                again.on_hover_text("Opens the same once more, made so, and does again what was done");
            if again.clicked() || is_entered && again.enabled() {
                self.make_again(&wish, made);
            }
            if let Some(previous) = self.previous.clone() {
                ui.horizontal_wrapped(|ui| {
                    let back = ui.add_enabled(!is_last, egui::Button::new("Make as before"));
                    let back = back.on_hover_text(AS_BEFORE).on_disabled_hover_text(why_not);
                    ui.weak(&previous.made);
                    if back.clicked() {
                        self.make_of(previous.source, Way::Forth);
                    }
                });
            }
            // Below what may be pressed, which stays where it is.
            if loses_classes {
                ui.weak(CLASSES_GO);
            }
            self.wish = differs.then_some(wish);
        });
    }

    /// Makes the same otherwise, as soon as it is known what was done to it.
    fn make_again(&mut self, wish: &Wish, made: &Made) {
        let Some(work) = &self.work else { return };
        let otherwise = wish.source(made, &work.source);
        // What can't even be read leaves all as it is.
        match otherwise
            .and_then(|otherwise| otherwise.read().map(|_| otherwise).map_err(|error| error.to_string()))
        {
            Ok(otherwise) if otherwise == work.source => {
                let problem =
                    "what is made of it is said by the scene itself: say another value, or change the scene";
                self.complain(problem.to_owned());
            }
            Ok(source) => self.make_of(source, Way::Forth),
            Err(problem) => self.complain(problem),
        }
    }

    /// Opens it by a source of the same, as soon as it is known what was done to it.
    pub(crate) fn make_of(&mut self, source: Source, way: Way) {
        let Some(work) = &self.work else { return };
        work.ask_for_log();
        self.making = Some(Making::of(source, way));
    }
}

/// What was open before the same was made otherwise.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AsBefore {
    pub(crate) source: Source,
    /// What it was made of, in words.
    pub(crate) made: String,
    /// The handles that there were.
    pub(crate) handles: Vec<u32>,
    /// Which way it was left, while that is the last step.
    pub(crate) step: Option<Way>,
}

/// What it is made of, in words.
pub(crate) fn told(made: &Made) -> String {
    let value = Wish::of(made).iso;
    let value = if value.is_empty() { found(made) } else { format!("value {value}") };
    let pieces = (made.min_part > 0.0).then(|| format!("pieces from {} mm³ on", made.min_part));
    // All from a value on is told by the value.
    let part =
        Some(part_in_words(made, made.part.as_deref())).filter(|_| made.part.is_some() || !made.is_above());
    [Some(value), part, pieces].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Where the surface was found.
fn found(made: &Made) -> String {
    match made.between {
        [Some(low), _] => format!("found: {low:.0}"),
        _ => "found by itself".to_owned(),
    }
}

/// A part: a class, one that is chosen by a rule, or all of the surface.
fn part_in_words(made: &Made, part: Option<&str>) -> String {
    match (part, made.class) {
        (None, Some(class)) if made.part.is_none() => format!("found: class {class}"),
        (None, None) if made.is_body => "found: all but the background".to_owned(),
        (None, None) if made.is_above() => {
            format!("values of {} and more", in_few_digits(made.between[0].unwrap_or_default()))
        }
        (None, _) => "all of the surface".to_owned(),
        (Some(rule @ ("densest" | "largest")), _) => format!("the {rule} class"),
        (Some(class), _) => format!("class {class}"),
    }
}

/// The part, to choose another.
fn part(ui: &mut Ui, figures: &Figures, part: &mut Option<String>) {
    let word = |part: Option<&str>| part_in_words(&figures.made, part);
    let classes = figures.classes.iter().map(|class| Some(class.id.to_string()));
    let rules = ["densest", "largest"].map(|rule| Some(rule.to_owned()));
    ComboBox::from_label("Part").selected_text(word(part.as_deref())).show_ui(ui, |ui| {
        for choice in [None].into_iter().chain(rules).chain(classes) {
            if ui.selectable_label(*part == choice, word(choice.as_deref())).clicked() {
                *part = choice;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_differs_is_said_and_what_is_taken_back_is_said_no_more() {
        let made = Made { iso: Some(40.0), ..Made::default() };
        let source = Source { overrides: vec!["lattice.iso=40".parse().unwrap()], ..Source::default() };
        let said = |source: &Source| {
            let said = source.overrides.iter().map(|one| format!("{}={}", one.path.join("."), one.value));
            said.collect::<Vec<_>>()
        };
        let is = Wish::of(&made);
        let made_so = |wish: &Wish| said(&wish.source(&made, &source).unwrap());
        assert_eq!(made_so(&is), ["lattice.iso=40"]);
        assert_eq!(made_so(&Wish { iso: " 60.5 ".to_owned(), ..is.clone() }), ["lattice.iso=60.5"]);
        let part = Wish { iso: String::new(), part: Some("3".to_owned()), ..Wish::of(&Made::default()) };
        assert_eq!(made_so(&part), ["boundary.class=3"]);
        let specks = Wish { min_part: "2.5".to_owned(), ..is.clone() };
        assert_eq!(made_so(&specks), ["lattice.iso=40", "lattice.min_part=2.5"]);
        let above = Made { between: [Some(61.5), None], ..Made::default() };
        let taken_out = part.source(&above, &Source::default()).unwrap().overrides;
        assert_eq!(
            taken_out.iter().map(|one| one.path.join(".")).collect::<Vec<_>>(),
            ["boundary.class", "boundary.above"]
        );
        // Its value is from which on it is all, as it was said or found.
        assert_eq!(Wish::of(&above).iso, "61.5");
        let shown = [100_012.0, -0.000_25, 898.746_748_594_379_4]
            .map(|value| Wish::of(&Made { between: [Some(value), None], ..Made::default() }).iso);
        assert_eq!(shown, ["100012", "-0.00025", "898.75"], "what was said in full, what was found in short");
        let found = Made { is_body: true, ..above };
        let denser = Wish { iso: "80".to_owned(), ..Wish::of(&found) };
        assert_eq!(said(&denser.source(&found, &Source::default()).unwrap()), ["boundary.above=80"]);
        assert_eq!(part.source(&found, &Source::default()).unwrap().overrides.len(), 1);
    }
}
