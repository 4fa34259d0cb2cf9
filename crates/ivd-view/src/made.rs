//! What the body is made of, and the same scan made otherwise.

use egui::{CollapsingHeader, ComboBox, Key, TextEdit, Ui};
use ivd_frames::{Figures, Made, Source};
use ivd_pipeline::scene::Override;

use crate::again::Making;
use crate::window::Window;

/// What a value of the surface does to what was found by itself.
const CLASSES_GO: &str =
    "With a value that is said no classes are looked for: their colours and stiffness go.";

/// What is wanted otherwise, as it is typed and chosen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wish {
    iso: String,
    part: Option<String>,
}

impl Wish {
    /// As it is.
    fn of(made: &Made) -> Self {
        Self { iso: made.iso.map_or_else(String::new, |iso| iso.to_string()), part: made.part.clone() }
    }

    /// The same source with what differs.
    fn source(&self, made: &Made, source: &Source) -> Result<Source, String> {
        let mut source = source.clone();
        let is = Self::of(made);
        for (key, now, was) in [
            ("lattice.iso", Some(&self.iso), Some(&is.iso)),
            ("boundary.class", self.part.as_ref(), is.part.as_ref()),
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
            let mut wish = self.wish.take().unwrap_or_else(|| Wish::of(made));
            let entered = ui.horizontal(|ui| {
                let field = TextEdit::singleline(&mut wish.iso).hint_text(found(made)).desired_width(110.0);
                let field = ui.add(field).accessible_name("Value of the surface");
                ui.label("value of the surface");
                field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter))
            });
            let loses_classes =
                made.iso.is_none() && !wish.iso.trim().is_empty() && !figures.classes.is_empty();
            part(ui, figures, &mut wish.part);
            let differs = wish != Wish::of(made);
            // How the session was opened that an older log goes on from isn't known.
            let is_last = self.work.as_ref().is_some_and(|work| work.is_last);
            let again = ui.add_enabled(differs && !is_last, egui::Button::new("Make again"));
            let why_not =
                "The log that this went on from doesn't say how it was opened: save the scene, and open that";
            let again = if is_last { again.on_disabled_hover_text(why_not) } else { again };
            let again =
                again.on_hover_text("Opens the same once more, made so, and does again what was done");
            if again.clicked() || entered.inner && again.enabled() {
                self.make_again(&wish, made);
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
            Ok(source) => {
                work.ask_for_log();
                self.making = Some(Making::of(source));
            }
            Err(problem) => self.complain(problem),
        }
    }
}

/// Where the surface was found.
fn found(made: &Made) -> String {
    match made.between {
        [Some(low), _] => format!("found: {low:.0}"),
        _ => "found by itself".to_owned(),
    }
}

/// The part: a class, one that is chosen by a rule, or all of the surface.
fn part(ui: &mut Ui, figures: &Figures, part: &mut Option<String>) {
    let made = &figures.made;
    let word = |part: Option<&str>| match (part, made.class) {
        (None, Some(class)) if made.part.is_none() => format!("found: class {class}"),
        (None, None) if made.is_body => "found: all but the background".to_owned(),
        (None, None) if made.is_above() => {
            format!("values of {} and more", made.between[0].unwrap_or_default() as f32)
        }
        (None, _) => "all of the surface".to_owned(),
        (Some(rule @ ("densest" | "largest")), _) => format!("the {rule} class"),
        (Some(class), _) => format!("class {class}"),
    };
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
        let said = |wish: &Wish| {
            let source = wish.source(&made, &source).unwrap();
            let said = source.overrides.iter().map(|one| format!("{}={}", one.path.join("."), one.value));
            said.collect::<Vec<_>>()
        };
        let is = Wish::of(&made);
        assert_eq!(said(&is), ["lattice.iso=40"]);
        assert_eq!(said(&Wish { iso: " 60.5 ".to_owned(), ..is.clone() }), ["lattice.iso=60.5"]);
        let part = Wish { iso: String::new(), part: Some("3".to_owned()) };
        assert_eq!(said(&part), ["boundary.class=3"]);
        let above = Made { between: [Some(61.5), None], ..Made::default() };
        let taken_out = part.source(&above, &Source::default()).unwrap().overrides;
        assert_eq!(
            taken_out.iter().map(|one| one.path.join(".")).collect::<Vec<_>>(),
            ["boundary.class", "boundary.above"]
        );
        let found = Made { is_body: true, ..above };
        assert_eq!(part.source(&found, &Source::default()).unwrap().overrides.len(), 1);
    }
}
